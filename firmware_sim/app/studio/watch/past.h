/* SPDX-License-Identifier: MIT */
/* The past of the scans, for a page that is opened late, or again: the last points of the stream, as frames.
 *
 * In: frames of the stream, in their order. Out: these frames in pieces, as the body of `/past` (README.md has its
 * format). A piece begins with the descriptor, the emitter and the anchor that its points need, so that a reader of the
 * protocol can begin with any piece.
 *
 * The past keeps points with their attributes and colours, poses, the frames that place them, ends of scans, and
 * reports of frames that the head left out for the taker (READER_LOST). The past keeps no waveforms: those of one
 * second may take as much memory as everything else. When there are more than `points` or `bytes`, the oldest piece
 * goes, and its points are counted as gone.
 *
 * Memory: pieces with room for PAST_PIECE bytes and four more frames, allocated as points come. All pieces together
 * hold up to `bytes` of frames. No piece is allocated before the first points or poses.
 * Threads: one takes frames; any number of others read. */
#ifndef FIRMWARE_SIM_APP_STUDIO_WATCH_PAST_H
#define FIRMWARE_SIM_APP_STUDIO_WATCH_PAST_H

#include <stddef.h>
#include <stdint.h>

#include "drivers/host/scanhead.h"
#include "drivers/link/web.h"

struct past;

struct past_limits {
    uint64_t points; /* shots without echo among them */
    size_t bytes;    /* at least two pieces */
};
/* 10 million points of 20 bytes with their attributes, colours and headers take up to 320 MiB. */
#define PAST_MOST_POINTS   10000000ULL
#define PAST_MOST_POSITION 1e15 /* of a query; a double holds it exactly */
enum { PAST_PIECE = 1 << 20, PAST_MOST_BYTES = 320 << 20, PAST_HEAD_LEN = 56 };

/* NULL: no memory. */
struct past *past_create(const struct past_limits *limits);
/* Takes a frame as it came to the taker. The frames that the taker lost are those that READER_LOST reports. Points for
 * which there is no memory count as gone. */
void past_take(struct past *past, const struct scanhead_frame *frame);
/* Gives the frames from a position on, up to its piece's end. A position whose piece has gone gives the oldest piece;
 * one beyond the end gives no frames. query: "from=POSITION", or "" for 0; else SH_EINPUT. SH_ENOMEM. */
int past_get(struct past *past, const char *query, struct web_body *out, struct sh_err *err);
/* A number that another run of a head does not have. */
uint64_t past_run(const struct past *past);
void past_free(struct past *past);

#endif
