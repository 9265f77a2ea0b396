/* SPDX-License-Identifier: MIT */
#include "tests/bench/made_stream.h"

#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "core/line.h"
#include "drivers/protocol/native_encode.h"

enum { LINE_TICKS = 5, LINE_PULSES = LINE_TICKS * MADE_TICK_POINTS, PULSE_NS = 50, TICK_NS = 1000000 };
enum { TURN_COUNTS = 1 << 20, HEAD_ROOM = 4096 };

static struct {
    double figure[7][MADE_BATCH];
    int64_t t_ns[MADE_BATCH];
    uint16_t label[MADE_BATCH];
    uint8_t echo[MADE_BATCH], echo_count[MADE_BATCH];
} room;

const struct scanhead_columns made_columns = {room.figure[0], room.figure[1], room.figure[2], room.figure[3],
                                              room.figure[4], room.figure[5], room.figure[6], room.t_ns,
                                              room.label,     room.echo,      room.echo_count};

struct maker {
    struct made_stream *out;
    size_t cap;
    uint32_t seq, random;
};

/* Adds the len bytes of frames that were written after the stream's end, and numbers them. */
static void add_frames(struct maker *m, size_t len)
{
    uint8_t *at = m->out->bytes + m->out->len, *end = at + len;
    m->out->len += len;
    while (at < end)
        at += native_finish_frame(at, m->seq++);
}

static void add_begin(struct maker *m, enum made_layout layout)
{
    const struct native_descriptor d = {.idn = "scanhead,made,1,1.0",
                                        .profile = "made",
                                        .layout = layout == MADE_POLAR ? NATIVE_POLAR : NATIVE_GEO,
                                        .prr_uhz = 20000000000000,
                                        .lines_uhz = 200000000,
                                        .pan_udeg_s = 36000000,
                                        .line_start_udeg = -40000000,
                                        .line_stop_udeg = 60000000,
                                        .pan_stop_udeg = 360000000,
                                        .mirror_counts_per_turn = TURN_COUNTS,
                                        .pan_counts_per_turn = TURN_COUNTS,
                                        .range_scale_m = 1e-4,
                                        .range_max_m = 1000,
                                        .max_echoes = 1,
                                        .scan = 1};
    struct native_anchor a = {
        .crs = NATIVE_CRS_LOCAL, .station = 1, .scale_m = 1e-4, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    const double utm[3] = {391779, 5820072, 110}, geodetic[3] = {52.5, 13.4, 110}, fine[3] = {1e-9, 1e-9, 1e-4};
    for (int i = 0; i < 3; i++) {
        a.scale[i] = layout == MADE_GEODETIC ? fine[i] : a.scale_m;
        a.anchor[i] = layout == MADE_GEODETIC ? geodetic[i] : layout == MADE_UTM ? utm[i] : 0;
    }
    if (layout != MADE_POLAR) a.crs = layout == MADE_UTM ? NATIVE_CRS_UTM : NATIVE_CRS_GEODETIC;
    add_frames(m, native_encode_descriptor(m->out->bytes + m->out->len, m->cap - m->out->len, &d, 0, 0));
    add_frames(m, native_encode_anchor(m->out->bytes + m->out->len, m->cap - m->out->len, &a, 0, 0));
}

static uint32_t next_random(struct maker *m)
{
    m->random = m->random * 1664525u + 1013904223u;
    return m->random >> 8;
}

static void fill_tick(struct maker *m, struct line_block *b, enum made_layout layout, uint32_t tick)
{
    b->layout = layout == MADE_POLAR ? LINE_POLAR : LINE_GEO;
    b->line = tick / LINE_TICKS;
    b->pulse0 = (uint64_t)tick * MADE_TICK_POINTS;
    b->n_pulses = b->n_points = MADE_TICK_POINTS;
    b->t0_ns = (int64_t)tick * TICK_NS;
    b->line_t0_ns = (int64_t)b->line * LINE_TICKS * TICK_NS;
    for (uint32_t i = 0; i < MADE_TICK_POINTS; i++) {
        const uint32_t of_line = tick % LINE_TICKS * MADE_TICK_POINTS + i, x = next_random(m);
        const uint32_t mirror = of_line * (TURN_COUNTS / 36 * 10 / 1000) / (LINE_PULSES / 1000);
        b->dt_ns[i] = i * PULSE_NS;
        b->a[i] = 20000 + x % 1000000;
        b->b[i] = layout == MADE_POLAR ? (mirror - TURN_COUNTS / 9) % TURN_COUNTS : next_random(m) % 2000000 - 1000000;
        b->c[i] = layout == MADE_POLAR ? (tick * 100 + i / 200) % TURN_COUNTS : next_random(m) % 200000 - 100000;
        b->refl_cdb[i] = (int16_t) - (int)(x / 7 % 3000);
        b->label[i] = (uint16_t)(x / 11 % 40);
        b->echo[i] = i % 50 == 49 ? 0 : 0x11;
    }
}

static void add_line_end(struct maker *m, const struct line_block *b)
{
    const struct line_end end = {.line = b->line,
                                 .pulse0 = (uint64_t)b->line * LINE_PULSES,
                                 .n_fired = LINE_PULSES,
                                 .n_cast = LINE_PULSES,
                                 .t0_ns = b->line_t0_ns,
                                 .t1_ns = b->line_t0_ns + LINE_TICKS * TICK_NS};
    add_frames(m, native_encode_line_end(m->out->bytes + m->out->len, m->cap - m->out->len, &end, 0));
}

int made_stream_create(enum made_layout layout, uint32_t ticks, struct made_stream *out)
{
    struct line_block b;
    struct maker m = {.out = out, .cap = HEAD_ROOM + ticks * (native_points_bound(MADE_TICK_POINTS) + HEAD_ROOM)};
    *out = (struct made_stream){.bytes = malloc(m.cap)};
    if (out->bytes == NULL || line_block_alloc(&b, MADE_TICK_POINTS, NULL) != 0) return -1;
    add_begin(&m, layout);
    for (uint32_t tick = 0; tick < ticks; tick++) {
        fill_tick(&m, &b, layout, tick);
        add_frames(&m, native_encode_points(out->bytes + out->len, m.cap - out->len, &b, 0));
        if (tick % LINE_TICKS == LINE_TICKS - 1) add_line_end(&m, &b);
        out->n_points += b.n_points;
    }
    line_block_free(&b);
    return 0;
}

int made_stream_source(const struct made_stream *stream, char *source, size_t len)
{
    const int fd = memfd_create("stream", 0);
    for (size_t at = 0; fd >= 0 && at < stream->len;) {
        const ssize_t n = pwrite(fd, stream->bytes + at, stream->len - at, (off_t)at);
        if (n <= 0) return -1;
        at += (size_t)n;
    }
    snprintf(source, len, "fd:%d", fd);
    return fd >= 0 ? 0 : -1;
}
