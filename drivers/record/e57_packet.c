/* SPDX-License-Identifier: MIT */
#include "drivers/record/e57_packet.h"

#include <string.h>

#include "core/bytes.h"
#include "core/vecmath.h"
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

static unsigned get_bits(const uint8_t *stream, unsigned bits, unsigned i)
{
    const unsigned at = i * bits;
    return (unsigned)stream[at / 8] >> at % 8 & ((1u << bits) - 1);
}

void e57_packet_begin(struct e57_packet *packet, const struct e57_facts *facts)
{
    uint8_t *at = packet->full + E57_PACKET_HEADER_LEN + 2 * count_streams(facts);
    int n_bits = 0;
    packet->n = 0;
    packet->most = facts->has_colours ? E57_PACKET_COLOURED : E57_PACKET_RECORDS;
    for (int s = 0; s < E57_N_STREAMS; s++) {
        packet->stream[s] = stream_bits[s] < 8 ? packet->bits[n_bits++] : at;
        if (has_stream(facts, s)) at += stream_len(s, packet->most);
    }
}

/* Packs eight records of `bits` bits. In v each has a byte; in the result they lie side by side, the first one lowest.
 * Fields of 8 bits become fields of 16 with two records each, then of 32 with four. */
VEC_INLINE uint64_t pack_eight(uint64_t v, unsigned bits)
{
    const uint64_t two = ((uint64_t)1 << 2 * bits) - 1, four = ((uint64_t)1 << 4 * bits) - 1;
    v = (v | v >> (8 - bits)) & (two | two << 16 | two << 32 | two << 48);
    v = (v | v >> (16 - 2 * bits)) & (four | four << 32);
    return v | v >> (32 - 4 * bits);
}

/* Packs groups of eight records; those beyond the last record are 0. */
VEC_CLONES static void pack(const uint8_t *restrict v, unsigned bits, size_t n_eights, uint8_t *restrict out)
{
    if (bits == 1)
        for (size_t i = 0; i < n_eights; i++)
            out[i] = (uint8_t)pack_eight(le_get64(v + 8 * i), 1);
    else if (bits == 2)
        for (size_t i = 0; i < n_eights; i++)
            le_put16(out + 2 * i, (uint16_t)pack_eight(le_get64(v + 8 * i), 2));
    else
        for (size_t i = 0; i < n_eights; i++)
            le_put32(out + 4 * i, (uint32_t)pack_eight(le_get64(v + 8 * i), 4));
}

/* Puts the records of a stream into the packet at `at`. */
static void put_stream(struct e57_packet *packet, int s, uint8_t *at)
{
    const unsigned n = packet->n;
    uint8_t *stream = packet->stream[s];
    if (stream_bits[s] >= 8) {
        if (at != stream) memcpy(at, stream, stream_len(s, n));
        return;
    }
    memset(stream + n, 0, 8);
    pack(stream, stream_bits[s], (n + 7) / 8, at);
}

const uint8_t *e57_packet_make(struct e57_packet *packet, const struct e57_facts *facts, size_t *len)
{
    const unsigned n = packet->n;
    const uint16_t n_streams = count_streams(facts);
    uint8_t *out = n == packet->most ? packet->full : packet->part;
    uint8_t *len_at = out + E57_PACKET_HEADER_LEN, *at = len_at + 2 * n_streams;
    for (int s = 0; s < E57_N_STREAMS; s++) {
        if (!has_stream(facts, s)) continue;
        put_stream(packet, s, at);
        le_put16(len_at, (uint16_t)stream_len(s, n));
        len_at += 2;
        at += stream_len(s, n);
    }
    while ((at - out) % 4 != 0)
        *at++ = 0;
    *len = (size_t)(at - out);
    out[0] = 1; /* a data packet */
    out[1] = 0;
    le_put16(out + 2, (uint16_t)(*len - 1));
    le_put16(out + 4, n_streams);
    packet->n = 0;
    return out;
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

/* NAME widens the limits so that they include n records of TYPE, which GET reads. */
#define FIND_LIMITS(NAME, TYPE, GET)                                                  \
    VEC_CLONES static void NAME(const uint8_t *restrict v, unsigned n, TYPE limit[2]) \
    {                                                                                 \
        TYPE low = limit[0], high = limit[1];                                         \
        for (size_t i = 0; i < n; i++) {                                              \
            const TYPE x = GET(v + sizeof x * i);                                     \
            low = x < low ? x : low;                                                  \
            high = x > high ? x : high;                                               \
        }                                                                             \
        limit[0] = low;                                                               \
        limit[1] = high;                                                              \
    }
FIND_LIMITS(find_limits32, uint32_t, le_get32)
FIND_LIMITS(find_limits16, uint16_t, le_get16)

/* A byte has two records; the last byte may have one and a 0. */
VEC_CLONES static unsigned find_most4(const uint8_t *restrict v, size_t n_bytes)
{
    uint8_t most = 0;
    for (size_t i = 0; i < n_bytes; i++) {
        const uint8_t low = v[i] & 15, high = v[i] >> 4, x = low > high ? low : high;
        most = x > most ? x : most;
    }
    return most;
}

typedef void count_run(struct e57_scan *scan, const uint8_t *const stream[E57_N_STREAMS], unsigned first, unsigned n);

/* Calls `count` for each run of records whose field in stream s is 0. A byte that holds only such records is taken in
 * one step, and so is a byte without any. */
static void count_zeros(struct e57_scan *scan, const uint8_t *const stream[E57_N_STREAMS], int s, unsigned n,
                        count_run *count)
{
    const unsigned bits = stream_bits[s], a_byte = 8 / bits;
    const uint8_t none = bits == 1 ? 0xff : 0xaa; /* a field of two bits is 2 or 0 */
    for (unsigned i = 0; i < n;) {
        const unsigned first = i;
        while (i < n && get_bits(stream[s], bits, i) == 0)
            i += i % a_byte == 0 && stream[s][i / a_byte] == 0 ? a_byte : 1;
        if (i > first) count(scan, stream, first, (i < n ? i : n) - first);
        while (i < n && get_bits(stream[s], bits, i) != 0)
            i += i % a_byte == 0 && stream[s][i / a_byte] == none ? a_byte : 1;
    }
}

/* Counts the points of the records from `first` on. Since coordinates count from INT32_MIN on, they are compared as
 * unsigned numbers. */
static void count_points(struct e57_scan *scan, const uint8_t *const stream[E57_N_STREAMS], unsigned first, unsigned n)
{
    const uint32_t least = 0x80000000u;
    for (int k = 0; k < 3; k++) {
        uint32_t limit[2] = {UINT32_MAX, 0};
        if (scan->n_points > 0) limit[0] = (uint32_t)scan->min[k] ^ least;
        if (scan->n_points > 0) limit[1] = (uint32_t)scan->max[k] ^ least;
        find_limits32(stream[E57_X + k] + 4 * (size_t)first, n, limit);
        scan->min[k] = (int32_t)(limit[0] ^ least);
        scan->max[k] = (int32_t)(limit[1] ^ least);
    }
    scan->n_points += n;
}

/* Widens the scan's limits of intensity by the n records from `first` on. The caller has left out records without
 * intensity. */
static void count_intensities(struct e57_scan *scan, const uint8_t *const stream[E57_N_STREAMS], unsigned first,
                              unsigned n)
{
    uint16_t limit[2] = {UINT16_MAX, 0};
    if (scan->have_intensity) limit[0] = (uint16_t)(scan->intensity_min_cdb + 32768);
    if (scan->have_intensity) limit[1] = (uint16_t)(scan->intensity_max_cdb + 32768);
    find_limits16(stream[E57_INTENSITY] + 2 * (size_t)first, n, limit);
    scan->intensity_min_cdb = (int16_t)(limit[0] - 32768);
    scan->intensity_max_cdb = (int16_t)(limit[1] - 32768);
    scan->have_intensity = 1;
}

static void count_indices(struct e57_scan *scan, const uint8_t *const stream[E57_N_STREAMS], unsigned n)
{
    const int first = scan->n_records == 0;
    uint32_t row[2] = {first ? UINT32_MAX : scan->row_min, first ? 0 : scan->row_max},
             column[2] = {first ? UINT32_MAX : scan->column_min, first ? 0 : scan->column_max};
    find_limits32(stream[E57_ROW], n, row);
    find_limits32(stream[E57_COLUMN], n, column);
    scan->row_min = row[0];
    scan->row_max = row[1];
    scan->column_min = column[0];
    scan->column_max = column[1];
    const unsigned most = find_most4(stream[E57_RETURN], stream_len(E57_RETURN, n));
    if (most > scan->return_max) scan->return_max = most;
    scan->n_records += n;
}

int e57_packet_count(const uint8_t *packet, size_t len, const struct e57_facts *facts, struct e57_scan *scan)
{
    const uint8_t *stream[E57_N_STREAMS] = {0};
    const int found = find_streams(packet, len, facts, stream);
    const unsigned n = found > 0 ? (unsigned)found : 0;
    if (found < 0) return -1;
    if (n > 0) {
        if (facts->empty_shots)
            count_zeros(scan, stream, E57_INVALID, n, count_points);
        else
            count_points(scan, stream, 0, n);
        count_zeros(scan, stream, E57_NO_INTENSITY, n, count_intensities);
        count_indices(scan, stream, n);
    }
    scan->crc = crc32c(scan->crc, packet, len);
    return 0;
}
