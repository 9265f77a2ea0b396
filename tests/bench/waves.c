/* SPDX-License-Identifier: MIT */
/* This measures the cost of waveforms on the wire. 300 pulses of one window each are a block; it is encoded with its
 * checksums, and parsed and decoded again. Figures are medians of the rounds, in processor time of the thread.
 *
 *   build/tests/bench/waves */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/line.h"
#include "drivers/protocol/native_encode.h"
#include "drivers/protocol/native_waves.h"
#include "tests/bench/bench.h"
#include "tests/bench/pin.h"

enum { PULSES = 300, BLOCKS = 400, ROUNDS = 21, LONGEST = 256 };

static int make_block(struct line_block *b, uint32_t samples)
{
    if (line_block_alloc(b, PULSES, NULL) != 0 || line_block_alloc_waves(b, PULSES, PULSES * LONGEST, NULL) != 0)
        return -1;
    b->n_points = b->n_pulses = PULSES;
    b->waves->sample_ps = 1000;
    b->waves->bits = 12;
    b->waves->count_signal = 0.25F;
    for (uint32_t i = 0; i < PULSES; i++) {
        b->dt_ns[i] = 3333 * i;
        b->echo[i] = 0x11;
        if (samples == 0) continue;
        b->waves->wave[i] = (struct line_wave){.pulse = i,
                                               .dt_ns = b->dt_ns[i],
                                               .first = 7 * i,
                                               .n = samples,
                                               .at = b->waves->n_samples,
                                               .b = i,
                                               .c = 9 * i};
        for (uint32_t k = 0; k < samples; k++)
            b->waves->sample[b->waves->n_samples++] = (uint16_t)((i * 31 + k * 7) & 0xfff);
        b->waves->n++;
    }
    return 0;
}

/* Sums the samples, as a reader of all of them does. */
static uint64_t read_waves(const uint8_t *payload, size_t len)
{
    struct native_waves head;
    uint64_t sum = 0;
    size_t at = NATIVE_WAVES_HEAD_LEN;
    if (native_decode_waves(payload, len, &head) != 0) return 0;
    for (uint32_t i = 0; i < head.n_windows; i++) {
        struct native_wave w;
        at = native_decode_wave(payload, at, &w);
        for (uint32_t k = 0; k < w.n; k++)
            sum += le_get16(w.sample + NATIVE_SAMPLE_LEN * (size_t)k);
    }
    return sum;
}

static uint64_t read_all(struct native_parser *parser, uint8_t *bytes, size_t len, uint32_t *seq)
{
    uint64_t sum = 0;
    size_t room;
    for (size_t at = 0, frame_len; at < len; at += frame_len) {
        frame_len = native_finish_frame(bytes + at, (*seq)++);
        uint8_t *to = native_parser_room(parser, &room);
        memcpy(to, bytes + at, frame_len);
        native_parser_added(parser, frame_len);
        while (native_parser_next(parser) == NATIVE_FRAME)
            if (parser->header.type == NATIVE_WAVES) sum += read_waves(parser->payload, parser->header.length);
    }
    return sum;
}

struct cost {
    double encode_ns, read_ns;
    size_t bytes;
    uint64_t sum;
};

/* Returns 0, or -1: there is no memory, or frames did not come back. */
static int measure(uint32_t samples, struct cost *cost)
{
    static struct native_parser parser;
    struct line_block b;
    double encode_ns[ROUNDS], read_ns[ROUNDS];
    uint32_t seq = 0;
    const size_t cap = native_points_bound(PULSES) + native_waves_bound(PULSES, PULSES, PULSES * LONGEST);
    uint8_t *bytes = malloc(cap);
    *cost = (struct cost){.sum = 0};
    if (bytes == NULL || make_block(&b, samples) != 0) return -1;
    native_parser_init(&parser);
    for (int round = 0; round < ROUNDS; round++) {
        double start_s = bench_thread_s();
        for (int i = 0; i < BLOCKS; i++)
            cost->bytes = native_encode_points(bytes, cap, &b, 0);
        encode_ns[round] = 1e9 * (bench_thread_s() - start_s) / ((double)BLOCKS * PULSES);
        start_s = bench_thread_s();
        for (int i = 0; i < BLOCKS; i++)
            cost->sum += read_all(&parser, bytes, cost->bytes, &seq);
        read_ns[round] = 1e9 * (bench_thread_s() - start_s) / ((double)BLOCKS * PULSES);
    }
    cost->encode_ns = bench_median(encode_ns, ROUNDS);
    cost->read_ns = bench_median(read_ns, ROUNDS);
    line_block_free(&b);
    free(bytes);
    return samples == 0 || cost->sum != 0 ? 0 : -1;
}

int main(void)
{
    static const uint32_t samples[] = {16, 32, 64, 128, LONGEST};
    struct cost none, with;
    pin(NULL);
    if (measure(0, &none) != 0) return 1;
    printf("points alone: %.1f ns a pulse to encode, %.1f to read\n", none.encode_ns, none.read_ns);
    for (size_t i = 0; i < sizeof samples / sizeof samples[0]; i++) {
        if (measure(samples[i], &with) != 0) return 1;
        printf("%4u samples: %6.1f ns a window to encode, %6.1f to read; %.1f bytes\n", samples[i],
               with.encode_ns - none.encode_ns, with.read_ns - none.read_ns,
               (double)(with.bytes - none.bytes) / PULSES);
    }
    return 0;
}
