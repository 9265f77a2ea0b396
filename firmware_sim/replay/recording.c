/* SPDX-License-Identifier: MIT */
#include "firmware_sim/replay/recording.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/of_file.h"

static struct recording_item *item_of(struct recording *r, uint32_t i)
{
    return &r->item[(r->first + i) % RECORDING_QUEUE];
}

static void note(void *ctx, const struct scanhead_notice *notice)
{
    struct recording *r = ctx;
    if (notice->kind == SCANHEAD_NOTICE_RESTARTED) r->restarted = 1;
}

int recording_open_file(const char *path, struct scanhead **stream, struct sh_err *err)
{
    char name[4096 + 3], why[512];
    snprintf(name, sizeof name, "%s%s", strchr(path, ':') != NULL && path[0] != '/' ? "./" : "", path);
    const int rc = scanhead_open(name, stream, why, sizeof why);
    return rc == SCANHEAD_OK ? SH_OK : sh_of_file(sh_fail(err, rc, "%s", why), err);
}

static int open_stream(struct recording *r, struct sh_err *err)
{
    const int rc = recording_open_file(r->path, &r->stream, err);
    if (rc == SH_OK) scanhead_on_notice(r->stream, note, r);
    return rc;
}

int recording_open(struct recording *r, const char *path, struct sh_err *err)
{
    if (strlen(path) >= sizeof r->path)
        return sh_fail(err, SH_EINPUT, "%.100s...: path too long; allowed up to %zu bytes", path, sizeof r->path - 1);
    snprintf(r->path, sizeof r->path, "%s", path);
    return open_stream(r, err);
}

/* Reads all items in the parser. *t_ns becomes the time of the last frame that is not LOCAL. 0: there is none. */
static int take_times(struct native_parser *parser, int64_t *t_ns)
{
    int found = 0;
    for (enum native_item item; (item = native_parser_next(parser)) != NATIVE_MORE;) {
        if (item != NATIVE_FRAME || (parser->header.flags & NATIVE_LOCAL) != 0) continue;
        *t_ns = parser->header.t_ns;
        found = 1;
    }
    return found;
}

int recording_last_ns(const char *path, int64_t *t_ns)
{
    enum { TAIL_BYTES = 4 << 20 }; /* it has many of the longest frames */
    int found = 0;
    struct native_parser *parser = calloc(1, sizeof *parser);
    FILE *f = parser != NULL ? fopen(path, "rb") : NULL;
    if (f != NULL) {
        size_t n = 1;
        native_parser_init(parser);
        if (fseek(f, -(long)TAIL_BYTES, SEEK_END) != 0) rewind(f);
        while (n > 0) {
            size_t room;
            uint8_t *at = native_parser_room(parser, &room);
            n = fread(at, 1, room, f);
            native_parser_added(parser, n);
            found |= take_times(parser, t_ns);
        }
        native_parser_finish(parser);
        found |= take_times(parser, t_ns);
        fclose(f);
    }
    free(parser);
    return found;
}

int recording_rewind(struct recording *r, struct sh_err *err)
{
    scanhead_close(r->stream);
    r->stream = NULL;
    r->timing = (struct timing){0};
    r->first = r->n = 0;
    r->at_end = r->restarted = 0;
    r->last_t_ns = r->first_t_ns;
    return open_stream(r, err);
}

void recording_close(struct recording *r)
{
    scanhead_close(r->stream);
    for (int i = 0; i < RECORDING_QUEUE; i++)
        free(r->item[i].bytes);
    memset(r, 0, sizeof *r);
}

void recording_stats(const struct recording *r, struct scanhead_stats *stats)
{
    scanhead_get_stats(r->stream, stats);
}

/* A frame whose time is known bounds the times of all frames before it: they did not go out later. A frame that waits
 * for its own time does not: several frames may be of the packet that a line's end cuts short. The last line of a
 * stopped scan went out together with the next event or telemetry, so it gets the time of that. */
static void recording_settle(struct recording *r, const struct timing_moment *by, int is_event)
{
    for (uint32_t i = 0; i < r->n; i++) {
        struct recording_item *item = item_of(r, i);
        if (item->is_known) continue;
        if (item->kind == TIMING_STOPS ? is_event : by->t_ns < item->t_ns) item->t_ns = by->t_ns;
        item->is_known = 1;
    }
}

static int replay_recording_put(struct recording *r, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct native_header header;
    native_read_header(frame->raw, &header);
    const struct timing_moment moment = timing_take(&r->timing, &header, frame->payload);
    if (moment.kind == TIMING_KNOWN)
        recording_settle(r, &moment, header.type == NATIVE_EVENT || header.type == NATIVE_TELEMETRY);
    struct recording_item *item = item_of(r, r->n);
    if (item->room < frame->raw_len) {
        uint8_t *bytes = realloc(item->bytes, frame->raw_len);
        if (bytes == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory for a frame", r->path);
        item->bytes = bytes;
        item->room = frame->raw_len;
    }
    memcpy(item->bytes, frame->raw, frame->raw_len);
    item->len = (uint32_t)frame->raw_len;
    item->kind = moment.kind;
    item->t_ns = moment.t_ns;
    item->is_known = moment.kind != TIMING_AT_MOST && moment.kind != TIMING_STOPS;
    item->restarted = r->restarted;
    r->restarted = 0;
    r->n++;
    return SH_OK;
}

static int read_one(struct recording *r, struct sh_err *err)
{
    struct scanhead_frame frame;
    const int rc = scanhead_next(r->stream, &frame, -1);
    if (rc == SCANHEAD_OK) return replay_recording_put(r, &frame, err);
    if (rc != SCANHEAD_ECLOSED) return sh_of_file(sh_fail(err, rc, "%s", scanhead_error(r->stream)), err);
    r->at_end = 1;
    return SH_OK;
}

int recording_next(struct recording *r, struct recording_frame *frame, struct sh_err *err)
{
    while (!r->at_end && (r->n == 0 || (!item_of(r, 0)->is_known && r->n < RECORDING_QUEUE))) {
        const int rc = read_one(r, err);
        if (rc != SH_OK) return rc;
    }
    if (r->n == 0) return 0;
    const struct recording_item *item = item_of(r, 0);
    if (item->kind != TIMING_FOLLOWS) {
        r->last_t_ns = item->t_ns;
        if (!r->has_first) r->first_t_ns = item->t_ns;
        r->has_first = 1;
    }
    *frame = (struct recording_frame){item->bytes, item->len, r->last_t_ns, item->restarted};
    r->first = (r->first + 1) % RECORDING_QUEUE;
    r->n--;
    return 1;
}
