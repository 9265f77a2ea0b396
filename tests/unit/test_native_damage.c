/* SPDX-License-Identifier: MIT */
/* These tests give the parser single damages: at every byte with THOROUGH=1, else some only at every third. */
#include "tests/common/thorough.h"
#include "tests/unit/native_stream.h"

enum { SIZES_EACH = SANITIZED ? 1 : 4 }; /* of the pieces in which each damage is fed */

/* Checks how many counted frames a damaged range costs, by the layout of the stream. A gap shows only between good
 * frames. */
static void check_seq(size_t hurt_from, size_t hurt_to)
{
    uint64_t lost = 0, gaps = 0, pending = 0;
    int seen = 0;
    for (int i = 0; i < n_pieces; i++) {
        if (piece[i].is_text || (stream[piece[i].at + 3] & NATIVE_LOCAL) != 0) continue;
        if (piece[i].at < hurt_to && hurt_from < piece[i].at + piece[i].len) {
            pending++;
            continue;
        }
        if (seen && pending > 0) {
            lost += pending;
            gaps++;
        }
        pending = 0;
        seen = 1;
    }
    assert_int_equal(parser.stats.seq_lost, lost);
    assert_int_equal(parser.stats.seq_gaps, gaps);
}

static void run_hurt(const uint8_t *bytes, size_t len, size_t from, size_t to)
{
    static const size_t chunks[] = {1, 7, 64, STREAM_MAX};
    for (size_t i = 0; i < SIZES_EACH; i++) {
        begin();
        feed(bytes, len, chunks[(from + i) % 4]);
        finish();
        check_got(from, to);
        check_seq(from, to);
        /* every byte is accounted for */
        size_t frames = 0;
        for (int k = 0; k < n_got; k++)
            frames += got[k].len;
        assert_true(parser.start == parser.end);
        assert_true(parser.stats.bytes == len && frames + parser.stats.bad_bytes <= len);
    }
}

/* Returns the distance from one damaged byte of the stream to the next. */
static size_t step(void)
{
    return (size_t)thorough(1, 3);
}

static void test_parser_every_byte_deleted(void **state)
{
    (void)state;
    static uint8_t hurt[STREAM_MAX];
    make_stream();
    for (size_t at = 0; at < stream_len; at += step()) {
        memcpy(hurt, stream, at);
        memcpy(hurt + at, stream + at + 1, stream_len - at - 1);
        run_hurt(hurt, stream_len - 1, at, at + 1);
    }
}

static void test_parser_every_byte_flipped(void **state)
{
    (void)state;
    static uint8_t hurt[STREAM_MAX];
    make_stream();
    memcpy(hurt, stream, stream_len);
    for (size_t at = 0; at < stream_len; at++) {
        hurt[at] ^= (uint8_t)(1 + at % 255);
        run_hurt(hurt, stream_len, at, at + 1);
        hurt[at] = stream[at];
    }
}

static void test_parser_every_byte_added(void **state)
{
    (void)state;
    static const uint8_t added[] = {NATIVE_SYNC, 'O', 0};
    static uint8_t hurt[STREAM_MAX + 1];
    make_stream();
    for (size_t at = 0; at <= stream_len; at += at < stream_len - 3 ? step() : 1) {
        memcpy(hurt, stream, at);
        hurt[at] = added[at % 3];
        /* An added byte that equals its neighbour could as well lie on its other side, outside the frame. */
        while (at < stream_len && (hurt[at] == stream[at] || (at > 0 && hurt[at] == stream[at - 1])))
            hurt[at]++;
        memcpy(hurt + at + 1, stream + at, stream_len - at);
        /* A byte before the first byte of a frame damages nothing. */
        size_t inside = at;
        for (int i = 0; i < n_pieces; i++)
            if (piece[i].at == at) inside = at + 1;
        if (at == stream_len)
            run_hurt(hurt, stream_len + 1, 0, 0);
        else if (inside == at)
            run_hurt(hurt, stream_len + 1, at, at + 1);
        else
            run_hurt(hurt, stream_len + 1, 0, 0);
    }
}

static void test_parser_every_late_start(void **state)
{
    (void)state;
    make_stream();
    for (size_t at = 0; at < stream_len; at += step())
        run_hurt(stream + at, stream_len - at, 0, at);
}

static void test_parser_every_cut(void **state)
{
    (void)state;
    make_stream();
    for (size_t at = 0; at < stream_len; at++)
        run_hurt(stream, at, at, stream_len);
}

static int is_boundary(size_t at)
{
    for (int i = 0; i < n_pieces; i++)
        if (piece[i].at == at) return 1;
    return at == stream_len;
}

/* Headers begin alike and payloads end in zeros. So losing a range some bytes later or earlier than [from, to) may
 * leave the same bytes. If a later range begins at a border of pieces, the piece before it is whole after all. If an
 * earlier range ends at a border, the piece after it is whole. Takes such a range, if possible a later one. */
static void slide_to_piece(size_t *from, size_t *to)
{
    for (size_t n = 0;; n++) {
        if (is_boundary(*from + n)) {
            *from += n;
            *to += n;
            return;
        }
        if (*to + n >= stream_len || stream[*from + n] != stream[*to + n]) break;
    }
    for (size_t n = 0; n <= *from; n++) {
        if (is_boundary(*to - n)) {
            *from -= n;
            *to -= n;
            return;
        }
        if (n == *from || stream[*from - n - 1] != stream[*to - n - 1]) return;
    }
}

static void test_parser_lost_stretches(void **state)
{
    (void)state;
    static uint8_t hurt[STREAM_MAX];
    make_stream();
    uint32_t x = 99;
    for (int run = 0; run < thorough(3000, 1000); run++) {
        x = x * 1664525u + 1013904223u;
        size_t from = (x >> 4) % stream_len;
        x = x * 1664525u + 1013904223u;
        size_t to = from + 1 + (x >> 4) % (stream_len - from);
        memcpy(hurt, stream, from);
        memcpy(hurt + from, stream + to, stream_len - to);
        slide_to_piece(&from, &to);
        run_hurt(hurt, stream_len - (to - from), from, to);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_parser_every_byte_deleted), cmocka_unit_test(test_parser_every_byte_flipped),
        cmocka_unit_test(test_parser_every_byte_added),   cmocka_unit_test(test_parser_every_late_start),
        cmocka_unit_test(test_parser_every_cut),          cmocka_unit_test(test_parser_lost_stretches),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
