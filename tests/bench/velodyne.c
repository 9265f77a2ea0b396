/* SPDX-License-Identifier: MIT */
/* This measures the cost of a VLP-16's data packets. It runs the protocol alone: points frames of a turn at 600 rpm
 * go in, and 76 packets (152 if dual) come out and go nowhere. Figures are medians of the rounds, in processor time of
 * the thread.
 *
 *   build/tests/bench/velodyne */
#include <stdio.h>
#include <stdlib.h>

#include "core/line.h"
#include "drivers/protocol/native.h"
#include "drivers/protocol/native_encode.h"
#include "drivers/protocol/protocol.h"
#include "tests/bench/bench.h"
#include "tests/bench/pin.h"

enum { SEQUENCES = 1824, FIRINGS = 16 * SEQUENCES, FRAME_FIRINGS = 304, TURNS = 40, ROUNDS = 21 };
static const double TURN_NS = 1e8;

struct stream {
    uint8_t *frames;
    size_t len;
    uint64_t units;
};

static int take_unit(void *ctx, const void *unit, size_t len)
{
    (void)unit;
    (void)len;
    ((struct stream *)ctx)->units++;
    return 0;
}

static void count(void *ctx, enum protocol_count what, uint64_t n)
{
    (void)ctx;
    (void)what;
    (void)n;
}

/* Walls stand at 2 to 12 m. Every fifth firing has two returns if dual. */
static void add_firing(struct line_block *b, uint64_t pulse, int dual)
{
    const uint32_t returns = dual && pulse % 5 == 0 ? 2 : 1;
    const int64_t t_ns = (int64_t)(pulse / 16) * 55296 + (int64_t)(pulse % 16) * 2304;
    for (uint32_t k = 0; k < returns; k++) {
        const uint32_t i = b->n_points++;
        b->dt_ns[i] = (uint32_t)(t_ns - b->t0_ns);
        b->a[i] = 2000000 + (uint32_t)(pulse * 7919 % 10000000) + k * 1500000;
        b->c[i] = (uint32_t)((double)t_ns / TURN_NS * 4294967296.0);
        b->refl_cdb[i] = (int16_t)(-(int)(pulse * 31 % 2000));
        b->echo[i] = (uint8_t)((k + 1) | returns << 4);
    }
}

static int make_turn(struct stream *s, int dual)
{
    struct line_block b;
    const size_t cap = 2 * (native_points_bound(2 * FRAME_FIRINGS) * (FIRINGS / FRAME_FIRINGS + 1));
    s->frames = malloc(cap);
    if (s->frames == NULL) return -1;
    for (uint32_t at = 0; at < FIRINGS; at += FRAME_FIRINGS) {
        if (line_block_alloc(&b, 2 * FRAME_FIRINGS, NULL) != 0) return -1;
        b.layout = LINE_POLAR;
        b.pulse0 = at;
        b.n_pulses = at + FRAME_FIRINGS <= FIRINGS ? FRAME_FIRINGS : FIRINGS - at;
        b.t0_ns = (int64_t)(at / 16) * 55296;
        for (uint32_t i = 0; i < b.n_pulses; i++)
            add_firing(&b, at + i, dual);
        s->len += native_encode_points(s->frames + s->len, cap - s->len, &b, 0);
        line_block_free(&b);
    }
    return 0;
}

static void describe(const struct protocol_ops *ops, void *protocol, int dual)
{
    static const int elevation_deg[16] = {-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15};
    const struct native_descriptor d = {.pan_counts_per_turn = 4294967296.0, .range_scale_m = 1e-6, .scan = 1};
    const struct native_emitter e = {.kind = NATIVE_EMIT_BEAMS,
                                     .n_beams = 16,
                                     .turn = 1,
                                     .sequence_ns_num = 55296,
                                     .sequence_ns_den = 1,
                                     .echoes = dual ? NATIVE_ECHOES_ALL : NATIVE_ECHOES_STRONGEST};
    struct native_beam beam[16];
    uint8_t frame[1024];
    for (uint32_t i = 0; i < 16; i++)
        beam[i] = (struct native_beam){elevation_deg[i] * 1000000, 0, 2304 * i};
    ops->frame(protocol, frame, native_encode_descriptor(frame, sizeof frame, &d, 0, 0));
    ops->frame(protocol, frame, native_encode_emitter(frame, sizeof frame, &e, beam, 0, 0));
}

/* Returns 0, or -1 if it could not be set up or packets are missing. */
static int measure(int dual)
{
    const struct protocol_ops *ops = protocol_ops_get(PROTOCOL_VELODYNE);
    struct stream s = {0};
    const struct protocol_identity identity = {.model = "VLP-16"};
    const struct protocol_spec spec = {.identity = &identity, .host = {.ctx = &s, .send = take_unit, .count = count}};
    void *protocol;
    double ns[ROUNDS];
    if (make_turn(&s, dual) != 0 || protocol_create(ops, &spec, &protocol, NULL) != 0) return -1;
    describe(ops, protocol, dual);
    for (int round = 0; round < ROUNDS; round++) {
        const double start_s = bench_thread_s();
        for (int turn = 0; turn < TURNS; turn++)
            for (size_t at = 0; at < s.len; at += native_frame_len(s.frames + at))
                ops->frame(protocol, s.frames + at, native_frame_len(s.frames + at));
        ns[round] = 1e9 * (bench_thread_s() - start_s) / ((double)TURNS * FIRINGS);
    }
    printf("%-7s %5.1f ns a firing, %zu bytes of frames a turn, %.1f packets a turn\n", dual ? "dual" : "single",
           bench_median(ns, ROUNDS), s.len, (double)s.units / (double)(TURNS * ROUNDS));
    protocol_destroy(ops, protocol);
    free(s.frames);
    return s.units == (uint64_t)ROUNDS * TURNS * FIRINGS / (dual ? 192 : 384) ? 0 : -1;
}

int main(void)
{
    pin(NULL);
    return measure(0) != 0 || measure(1) != 0;
}
