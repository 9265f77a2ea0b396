/* SPDX-License-Identifier: MIT */
/* This makes a stream in memory, as a head of 20 million points a second sends it, for programs that measure readers.
 *
 * A tick of 1 ms is a block of 20,000 points; a line is five of them. As in a scene, no range, label or reflectance
 * follows from another. Every 50th shot has no echo. */
#ifndef TESTS_BENCH_MADE_STREAM_H
#define TESTS_BENCH_MADE_STREAM_H

#include <stddef.h>
#include <stdint.h>

#include "drivers/host/scanhead.h"

enum { MADE_TICK_POINTS = 20000, MADE_BATCH = 256 };
enum made_layout { MADE_POLAR, MADE_UTM, MADE_GEODETIC };

struct made_stream {
    uint8_t *bytes;
    size_t len;
    uint64_t n_points;
};

/* Returns 0, or -1 without memory. The caller frees out->bytes. */
int made_stream_create(enum made_layout layout, uint32_t ticks, struct made_stream *out);
/* Writes the stream into a file in memory, and sets `source` to its name (fd:N) for scanhead_open. Returns 0, or -1. */
int made_stream_source(const struct made_stream *stream, char *source, size_t len);

/* This has room for MADE_BATCH points, with all columns. */
extern const struct scanhead_columns made_columns;

#endif
