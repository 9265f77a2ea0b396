/* SPDX-License-Identifier: MIT */
/* .shs: the stream as it came, frame after frame, without the reply lines. scanhead_open reads it as a
 * source. */
#include <stdlib.h>

#include "drivers/record/recorder.h"
#include "drivers/record/scan_count.h"

static int shs_frame(void *rec, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct recorder *shs = rec;
    (void)sh;
    return outfile_write(&shs->file, frame->raw, frame->raw_len, err);
}

struct frames {
    struct native_parser parser;
    struct scan_count scans;
    uint64_t n, end; /* frames; where the last whole item ends */
};

static void take_frames(struct frames *f)
{
    enum native_item item;
    while ((item = native_parser_next(&f->parser)) != NATIVE_MORE) {
        f->end = f->parser.stats.bytes - (f->parser.end - f->parser.start);
        if (item != NATIVE_FRAME) continue;
        f->n++;
        scan_count_frame(&f->scans, f->parser.frame);
    }
}

static int read_frames(const struct repair *r, struct frames *f, struct sh_err *err)
{
    int rc = SH_OK;
    size_t room;
    for (uint64_t at = 0; at < r->len && rc == SH_OK; at += room) {
        uint8_t *to = native_parser_room(&f->parser, &room);
        if (room > r->len - at) room = (size_t)(r->len - at);
        rc = repair_read(r, at, to, room, err);
        native_parser_added(&f->parser, room);
        if (rc == SH_OK) rc = sh_check_stop(r->report, err);
        take_frames(f);
    }
    native_parser_finish(&f->parser);
    take_frames(f);
    return rc;
}

/* Cuts the file after the last whole frame. Damage before that stays: readers skip it. */
static int shs_repair(struct repair *r, struct sh_err *err)
{
    struct frames *f = calloc(1, sizeof *f);
    if (f == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory to read it", r->path);
    native_parser_init(&f->parser);
    int rc = read_frames(r, f, err);
    if (rc == SH_OK && f->n == 0) rc = repair_fail_none(r, "stream of frames", err);
    if (rc == SH_OK) rc = repair_check_rest(r, f->end, NATIVE_MAX_FRAME, err);
    if (rc == SH_OK) {
        const uint64_t within = f->parser.stats.bad_bytes - (r->len - f->end);
        if (within != 0)
            sh_warn(r->report, "%s: %llu bytes between frames belong to no frame; they stay, and readers skip them",
                    r->path, (unsigned long long)within);
        repair_say_kept(r, "frames", f->n, f->scans.n_scans);
        r->was_whole = f->end == r->len;
        rc = repair_cut(r, f->end, err);
    }
    free(f);
    return rc;
}

const struct recorder_ops recorder_shs = {
    .ending = ".shs",
    .size = sizeof(struct recorder),
    .frame = shs_frame,
    .repair = shs_repair,
};
