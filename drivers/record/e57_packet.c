/* SPDX-License-Identifier: MIT */
#include "drivers/record/e57_packet.h"

#include <string.h>

#include "core/bytes.h"
#include "drivers/protocol/crc32c.h"

static const unsigned stream_bits[E57_N_STREAMS] = {32, 32, 32, 2, 16, 1, 8, 8, 8, 64, 4, 4, 32, 32, 16};

static int has_stream(const struct e57_facts *facts, int s)
{
    if (s == E57_INVALID) return facts->empty_shots;
    return s < E57_RED || s > E57_BLUE || facts->has_colours;
}

static uint16_t count_streams(const struct e57_facts *facts)
{
    int n = 0;
    for (int s = 0; s < E57_N_STREAMS; s++)
        n += has_stream(facts, s);
    return (uint16_t)n;
}

static size_t stream_len(int s, unsigned n)
{
    return ((size_t)n * stream_bits[s] + 7) / 8;
}

void e57_put_bits(uint8_t *stream, unsigned bits, unsigned i, unsigned v)
{
    unsigned at = i * bits;
    if (at % 8 == 0) stream[at / 8] = 0;
    stream[at / 8] |= (uint8_t)(v << at % 8);
}

static unsigned get_bits(const uint8_t *stream, unsigned bits, unsigned i)
{
    const unsigned at = i * bits;
    return (unsigned)stream[at / 8] >> at % 8 & ((1u << bits) - 1);
}

size_t e57_packet_make(struct e57_packet *packet, const struct e57_facts *facts, unsigned n,
                       uint8_t out[E57_PACKET_MAX])
{
    const uint16_t n_streams = count_streams(facts);
    uint8_t *len_at = out + E57_PACKET_HEADER_LEN, *at = len_at + 2 * n_streams;
    for (int s = 0; s < E57_N_STREAMS; s++) {
        if (!has_stream(facts, s)) continue;
        const size_t len = stream_len(s, n);
        le_put16(len_at, (uint16_t)len);
        len_at += 2;
        memcpy(at, packet->stream[s], len);
        at += len;
        if (n < packet->n) memmove(packet->stream[s], packet->stream[s] + len, stream_len(s, packet->n - n));
    }
    while ((at - out) % 4 != 0)
        *at++ = 0;
    const size_t len = (size_t)(at - out);
    out[0] = 1; /* a data packet */
    out[1] = 0;
    le_put16(out + 2, (uint16_t)(len - 1));
    le_put16(out + 4, n_streams);
    packet->n -= n;
    return len;
}

/* ---- what is in a packet */

/* Finds the streams in a packet, and returns the number of records in them, or -1. */
static int find_streams(const uint8_t *packet, size_t len, const struct e57_facts *facts,
                        const uint8_t *stream[E57_N_STREAMS])
{
    const uint16_t n_streams = count_streams(facts);
    const uint8_t *len_at = packet + E57_PACKET_HEADER_LEN;
    size_t at = E57_PACKET_HEADER_LEN + 2 * (size_t)n_streams;
    if (len < at || packet[0] != 1 || le_get16(packet + 2) + 1u != len || le_get16(packet + 4) != n_streams) return -1;
    const unsigned n = le_get16(len_at) / 4; /* the first stream has 32 bits a record */
    if (n > E57_PACKET_RECORDS) return -1;
    for (int s = 0; s < E57_N_STREAMS; s++) {
        if (!has_stream(facts, s)) continue;
        if (le_get16(len_at) != stream_len(s, n) || len - at < stream_len(s, n)) return -1;
        stream[s] = packet + at;
        at += stream_len(s, n);
        len_at += 2;
    }
    return len - at < 4 ? (int)n : -1;
}

static void count_point(struct e57_scan *scan, const uint8_t *const stream[E57_N_STREAMS], unsigned i)
{
    for (int k = 0; k < 3; k++) {
        const int32_t v = (int32_t)(le_get32(stream[E57_X + k] + 4 * (size_t)i) ^ 0x80000000u);
        if (scan->n_points == 0 || v < scan->min[k]) scan->min[k] = v;
        if (scan->n_points == 0 || v > scan->max[k]) scan->max[k] = v;
    }
    scan->n_points++;
}

static void count_intensity(struct e57_scan *scan, const uint8_t *const stream[E57_N_STREAMS], unsigned i)
{
    if (get_bits(stream[E57_NO_INTENSITY], 1, i) != 0) return;
    const int16_t cdb = (int16_t)(le_get16(stream[E57_INTENSITY] + 2 * (size_t)i) - 32768);
    if (!scan->have_intensity || cdb < scan->intensity_min_cdb) scan->intensity_min_cdb = cdb;
    if (!scan->have_intensity || cdb > scan->intensity_max_cdb) scan->intensity_max_cdb = cdb;
    scan->have_intensity = 1;
}

static void count_index(struct e57_scan *scan, const uint8_t *const stream[E57_N_STREAMS], unsigned i)
{
    const uint32_t row = le_get32(stream[E57_ROW] + 4 * (size_t)i),
                   column = le_get32(stream[E57_COLUMN] + 4 * (size_t)i);
    const unsigned number = get_bits(stream[E57_RETURN], 4, i);
    const int first = scan->n_records == 0;
    if (first || row < scan->row_min) scan->row_min = row;
    if (first || row > scan->row_max) scan->row_max = row;
    if (first || column < scan->column_min) scan->column_min = column;
    if (first || column > scan->column_max) scan->column_max = column;
    if (number > scan->return_max) scan->return_max = number;
    scan->n_records++;
}

int e57_packet_count(const uint8_t *packet, size_t len, const struct e57_facts *facts, struct e57_scan *scan)
{
    const uint8_t *stream[E57_N_STREAMS] = {0};
    const int n = find_streams(packet, len, facts, stream);
    if (n < 0) return -1;
    for (unsigned i = 0; i < (unsigned)n; i++) {
        if (!facts->empty_shots || get_bits(stream[E57_INVALID], 2, i) == 0) count_point(scan, stream, i);
        count_intensity(scan, stream, i);
        count_index(scan, stream, i);
    }
    scan->crc = crc32c(scan->crc, packet, len);
    return 0;
}
