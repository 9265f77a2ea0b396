/* SPDX-License-Identifier: MIT */
#include "drivers/host/exchange.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/native_waves.h"

_Static_assert(SCANHEAD_EINPUT == (int)SH_EINPUT && SCANHEAD_EIO == (int)SH_EIO && SCANHEAD_ENOMEM == (int)SH_ENOMEM &&
                   SCANHEAD_EPERM == (int)SH_EPERM && SCANHEAD_ETIMEOUT == (int)SH_ETIMEOUT &&
                   SCANHEAD_ECLOSED == (int)SH_ECLOSED && SCANHEAD_EFORMAT == (int)SH_EFORMAT &&
                   SCANHEAD_ESTATE == (int)SH_ESTATE && SCANHEAD_ELOST == (int)SH_ELOST &&
                   SCANHEAD_ERESET == (int)SH_ERESET,
               "the library's errors are those of core/err.h");
_Static_assert(SCANHEAD_POINTS == (int)NATIVE_POINTS && SCANHEAD_POSES == (int)NATIVE_POSES &&
                   SCANHEAD_ATTRIBUTES == (int)NATIVE_ATTRIBUTES && SCANHEAD_EMITTER == (int)NATIVE_EMITTER &&
                   SCANHEAD_COLOURS == (int)NATIVE_COLOURS && SCANHEAD_WAVES == (int)NATIVE_WAVES &&
                   SCANHEAD_EMIT_DIRECTIONS == (int)NATIVE_EMIT_DIRECTIONS &&
                   SCANHEAD_MAX_BEAMS == (int)NATIVE_MAX_BEAMS && SCANHEAD_EV_PPS == (int)NATIVE_EV_PPS &&
                   SCANHEAD_POSE_NONE == (int)NATIVE_POSE_NONE && SCANHEAD_LOCAL == (int)NATIVE_LOCAL,
               "types, events and flags are those on the wire");

const char *scanhead_version(void)
{
    return SCANHEAD_VERSION;
}

/* Tries to open a source until the deadline, as long as it isn't there. wrong_too: also as long as its name seems
 * wrong, for a source that was open before. */
static int open_in_time(const char *source, int wrong_too, int64_t deadline_ns, struct host_source *out,
                        struct sh_err *err)
{
    struct host_usb_watch *watch = deadline_ns > host_deadline_ns(0) ? host_usb_watch_open(source) : NULL;
    wrong_too |= strncmp(source, "tty:", 4) == 0; /* until it is plugged in, its node may be missing, or no terminal */
    for (;;) {
        int rc = host_source_open(source, out, err);
        if (rc == SH_OK || rc == SH_ENOMEM || (rc == SH_EINPUT && !wrong_too) || host_deadline_ns(0) >= deadline_ns ||
            host_usb_watch_wait(watch, rc, deadline_ns) != 0) {
            host_usb_watch_close(watch);
            return rc;
        }
    }
}

struct scanhead *host_open(const struct host_source *source)
{
    struct scanhead *sh = calloc(1, sizeof *sh);
    if (sh == NULL) return NULL;
    sh->source = *source;
    native_parser_init(&sh->parser);
    host_listen(sh);
    host_turn_table(sh);
    return sh;
}

int scanhead_open_within(const char *source, int timeout_ms, struct scanhead **out, char *err, size_t err_len)
{
    struct sh_err why = {0};
    struct host_source opened;
    *out = NULL;
    int rc = open_in_time(source, 0, host_deadline_ns(timeout_ms), &opened, &why);
    if (rc == SH_OK && (*out = host_open(&opened)) == NULL) {
        opened.ops->close(&opened);
        rc = sh_fail(&why, SH_ENOMEM, "no memory for a scan head handle");
    }
    if (err != NULL && err_len > 0) snprintf(err, err_len, "%s", rc == SH_OK ? "" : why.text);
    return rc;
}

int scanhead_open(const char *source, struct scanhead **out, char *err, size_t err_len)
{
    return scanhead_open_within(source, 0, out, err, err_len);
}

int scanhead_reattach(struct scanhead *sh, int timeout_ms)
{
    char name[sizeof sh->source.name];
    if (sh->source.is_file || sh->source.ctx != NULL || strncmp(sh->source.name, "fd:", 3) == 0)
        return sh_fail(&sh->err, SCANHEAD_ESTATE,
                       "%s: this source can't be reattached; allowed are usb, tty:PATH and tcp:HOST:PORT",
                       sh->source.name);
    if (sh->source.ops != NULL) sh->source.ops->close(&sh->source);
    sh->source.ops = NULL;
    sh->ended = 1;
    int rc = host_keep_rest(sh);
    if (rc != SH_OK) return rc;
    host_note_closed(sh);
    snprintf(name, sizeof name, "%s", sh->source.name);
    rc = open_in_time(name, 1, host_deadline_ns(timeout_ms), &sh->source, &sh->err);
    if (rc != SH_OK) return rc;
    sh->ended = sh->lost = sh->reset = sh->stuck = 0;
    native_parser_resume(&sh->parser);
    host_count_reader_lost(sh, 0);
    host_note_reattached(sh);
    return SCANHEAD_OK;
}

void host_hang_up(struct scanhead *sh)
{
    if (sh->source.ops != NULL) sh->source.ops->close(&sh->source);
    sh->source.ops = NULL;
    sh->payload = NULL;
    sh->ended = 1;
    native_parser_lend(&sh->parser, NULL, 0);
}

static struct host_node *pop(struct scanhead *sh)
{
    struct host_node *node = sh->kept.first;
    sh->kept.first = node->next;
    if (sh->kept.first == NULL) sh->kept.last = NULL;
    sh->kept.bytes -= sizeof *node + node->len;
    return node;
}

void scanhead_close(struct scanhead *sh)
{
    if (sh == NULL) return;
    if (sh->source.ops != NULL) sh->source.ops->close(&sh->source);
    while (sh->kept.first != NULL)
        free(pop(sh));
    free(sh->kept.current);
    for (uint32_t i = 0; i < sh->n_surfaces; i++) {
        free(sh->surface[i].object);
        free(sh->surface[i].material);
    }
    free(sh->surface);
    free(sh->poses);
    free(sh);
}

const char *scanhead_error(const struct scanhead *sh)
{
    return sh->err.text;
}

/* Takes a frame into the state. Returns 0, or 1 for a frame that is to be left out. A stream that begins with another
 * version is not ours, so this is an error. */
static int take(struct scanhead *sh, const struct native_header *header, const uint8_t *raw, uint64_t at_byte)
{
    const int rc = host_absorb(sh, header, raw + NATIVE_HEADER_LEN);
    if (rc != SH_EFORMAT) {
        sh->has_taken = 1;
        return rc;
    }
    host_note_refused(sh, header, at_byte);
    return header->version != NATIVE_VERSION && !sh->has_taken ? rc : 1;
}

/* Drops the oldest frame. The frame's facts about the stream are taken in first, and the frame stays in the hash. */
static int drop_oldest(struct scanhead *sh)
{
    struct host_node *node = pop(sh);
    struct native_header header;
    native_read_header(node->raw, &header);
    const int rc = take(sh, &header, node->raw, node->at_byte);
    sh->dropped += (uint64_t)(rc == 0);
    free(node);
    return rc < 0 ? rc : 0;
}

/* Where the parser's present frame begins, in all bytes. */
static uint64_t at_byte_of_frame(const struct native_parser *p)
{
    return p->stats.bytes - (p->end - p->start) - native_frame_len(p->frame);
}

int host_keep(struct scanhead *sh)
{
    size_t len = native_frame_len(sh->parser.frame);
    struct host_node *node = malloc(sizeof *node + len);
    if (node == NULL) return sh_fail(&sh->err, SH_ENOMEM, "no memory to keep a frame of %zu bytes", len);
    node->next = NULL;
    node->len = len;
    node->at_byte = at_byte_of_frame(&sh->parser);
    memcpy(node->raw, sh->parser.frame, len);
    if (sh->kept.last != NULL)
        sh->kept.last->next = node;
    else
        sh->kept.first = node;
    sh->kept.last = node;
    sh->kept.bytes += sizeof *node + len;
    int rc = 0;
    while (sh->kept.bytes > HOST_QUEUE_BYTES && rc == 0)
        rc = drop_oldest(sh);
    return rc;
}

static void fill_points(struct scanhead *sh, struct scanhead_frame *frame)
{
    struct native_points points;
    if (native_decode_points(frame->payload, frame->payload_len, &points) != 0) return;
    frame->scan_frame = points.frame;
    frame->scan_line = points.line;
    frame->n_points = points.n_points;
    frame->n_pulses = points.n_pulses;
    frame->pulse0 = points.pulse0;
    frame->scan_t0_ns = points.t0_ns;
    frame->line_t0_ns = points.line_t0_ns;
    sh->have_points = 1;
    sh->points_seq = frame->seq;
    sh->points_t_ns = frame->t_ns;
    sh->points_t0_ns = points.t0_ns;
    sh->of_points =
        (struct native_attributes){.pulse0 = points.pulse0, .line = points.line, .n_points = points.n_points};
}

/* Fills a frame of attributes or colours. */
static void fill_attributes(struct scanhead_frame *frame)
{
    struct native_attributes head;
    const int rc = frame->type == SCANHEAD_COLOURS
                       ? native_decode_colours(frame->payload, frame->payload_len, &head)
                       : native_decode_attributes(frame->payload, frame->payload_len, &head);
    if (rc != 0) return;
    frame->scan_line = head.line;
    frame->n_points = head.n_points;
    frame->pulse0 = head.pulse0;
}

static void fill_waves(struct scanhead_frame *frame)
{
    struct native_waves head;
    if (native_decode_waves(frame->payload, frame->payload_len, &head) != 0) return;
    frame->scan_line = head.line;
    frame->n_points = head.n_windows;
    frame->pulse0 = head.pulse0;
}

static void fill_event(struct scanhead_frame *frame)
{
    struct native_event event;
    if (native_decode_event(frame->payload, frame->payload_len, &event) != 0) return;
    frame->event = event.code;
    frame->event_value[0] = event.a;
    frame->event_value[1] = event.b;
    frame->event_value[2] = event.c;
    memcpy(frame->event_text, event.text, sizeof frame->event_text);
}

/* Returns as `take` does. */
static int hand_out(struct scanhead *sh, const uint8_t *raw, uint64_t at_byte, struct scanhead_frame *frame)
{
    struct native_header header;
    native_read_header(raw, &header);
    const int rc = take(sh, &header, raw, at_byte);
    if (rc != 0) return rc;
    *frame = (struct scanhead_frame){
        .type = header.type,
        .flags = header.flags,
        .seq = header.seq,
        .t_ns = header.t_ns,
        .payload = raw + NATIVE_HEADER_LEN,
        .payload_len = header.length,
        .raw = raw,
        .raw_len = native_frame_len(raw),
    };
    if (header.type == NATIVE_POINTS) fill_points(sh, frame);
    if (header.type == NATIVE_ATTRIBUTES || header.type == NATIVE_COLOURS) fill_attributes(frame);
    if (header.type == NATIVE_WAVES) fill_waves(frame);
    if (header.type == NATIVE_EVENT) fill_event(frame);
    sh->payload = frame->payload;
    sh->err.text[0] = '\0'; /* it may be of a frame that was left out */
    return SCANHEAD_OK;
}

int host_check_last(struct scanhead *sh, const struct scanhead_frame *frame, enum scanhead_frame_type type)
{
    static const char *const name[] = {
        [SCANHEAD_POINTS] = "points",   [SCANHEAD_POSES] = "poses",     [SCANHEAD_ATTRIBUTES] = "attributes",
        [SCANHEAD_COLOURS] = "colours", [SCANHEAD_WAVES] = "waveforms",
    };
    if (frame->type == (int)type && frame->payload != NULL && frame->payload == sh->payload) return 0;
    return sh_fail(&sh->err, SCANHEAD_EINPUT, "this is not the %s frame that scanhead_next returned last", name[type]);
}

int host_gone(struct scanhead *sh)
{
    if (sh->reset)
        return sh_fail(&sh->err, SCANHEAD_ERESET,
                       "%s: the USB bus was reset: the head is still plugged in, and its session is over",
                       sh->source.name);
    if (sh->lost)
        return sh_fail(&sh->err, SCANHEAD_ELOST, "%s: the head was unplugged, or no longer answers", sh->source.name);
    return sh_fail(&sh->err, SCANHEAD_ECLOSED, sh->source.is_file ? "%s: end of the recording" : "%s: the head is gone",
                   sh->source.name);
}

int host_over(struct scanhead *sh)
{
    host_note_closed(sh);
    return host_gone(sh);
}

static int closed(struct scanhead *sh)
{
    const struct native_stats *s = &sh->parser.stats;
    host_note_closed(sh);
    if (s->bytes > 0 && s->frames == 0 && s->texts == 0)
        return sh_fail(&sh->err, SCANHEAD_EFORMAT, "%s: no frame in %llu bytes: this is not a scan head's stream",
                       sh->source.name, (unsigned long long)s->bytes);
    return host_gone(sh);
}

/* Hands out the first kept frame that is not to be left out. Returns 1 where there is none. */
static int hand_out_kept(struct scanhead *sh, struct scanhead_frame *frame)
{
    int rc = 1;
    do {
        free(sh->kept.current);
        sh->kept.current = sh->kept.first != NULL ? pop(sh) : NULL;
        if (sh->kept.current != NULL) rc = hand_out(sh, sh->kept.current->raw, sh->kept.current->at_byte, frame);
    } while (rc == 1 && sh->kept.current != NULL);
    return rc;
}

int scanhead_next(struct scanhead *sh, struct scanhead_frame *frame, int timeout_ms)
{
    memset(frame, 0, sizeof *frame);
    sh->payload = NULL;
    sh->has_no_limit = timeout_ms < 0;
    int rc = hand_out_kept(sh, frame);
    if (rc <= 0) return rc;
    int64_t deadline_ns = 0; /* asked for only when there is something to wait for */
    for (;;) {
        enum native_item item;
        while ((item = native_parser_next(&sh->parser)) == NATIVE_TEXT)
            host_stray_line(sh);
        if (item == NATIVE_FRAME) {
            rc = hand_out(sh, sh->parser.frame, at_byte_of_frame(&sh->parser), frame);
            if (rc <= 0) return rc;
            continue;
        }
        if (sh->ended) return closed(sh);
        if (deadline_ns == 0)
            deadline_ns = host_deadline_ns(timeout_ms);
        else if (deadline_ns < host_deadline_ns(0) && timeout_ms != 0)
            return sh_fail(&sh->err, SCANHEAD_ETIMEOUT, "%s: no frame came within the time limit", sh->source.name);
        rc = host_fill(sh, deadline_ns);
        if (rc != 0) return rc;
    }
}
