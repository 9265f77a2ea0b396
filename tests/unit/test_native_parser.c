/* SPDX-License-Identifier: MIT */
/* The parser: bytes in pieces of any size, its limits, and garbage. */
#include "tests/unit/native_stream.h"

static uint8_t out[1 << 20];

static void test_parser_whole(void **state)
{
    (void)state;
    make_stream();
    for (size_t chunk = 1; chunk <= stream_len; chunk = chunk < 80 ? chunk + 1 : chunk * 2 + 1) {
        begin();
        feed(stream, stream_len, chunk);
        check_got(0, 0);
        assert_int_equal(n_texts, 5);
        assert_int_equal(parser.stats.frames, 13);
        assert_int_equal(parser.stats.texts, 5);
        assert_int_equal(parser.stats.bytes, stream_len);
        assert_int_equal(parser.stats.bad_bytes, 0);
        assert_int_equal(parser.stats.bad_payload, 0);
        assert_int_equal(parser.stats.seq_gaps, 0);
        assert_int_equal(parser.stats.seq_lost, 0);
    }
}

static void test_parser_length_refused(void **state)
{
    (void)state;
    make_stream();
    begin();
    uint8_t bad[28] = {NATIVE_SYNC, NATIVE_POINTS, 1, 0, 1, 0, 1, 0}; /* 65537 bytes */
    native_finish_frame(bad, 0);
    feed(bad, 28, 28);
    assert_int_equal(parser.stats.bad_bytes, 28); /* at once, without waiting for a payload */
    feed(stream, stream_len, 100);
    check_got(0, 0);
    assert_int_equal(n_texts, 4); /* out of step until the first frame */
}

static void test_parser_biggest_frame(void **state)
{
    (void)state;
    struct line_block block = make_block(NATIVE_MAX_POINTS);
    memset(block_echo, 0, sizeof block_echo);
    memset(block_dt, 0, sizeof block_dt);
    size_t len = native_encode_points(out, sizeof out, &block, 0);
    assert_int_equal(len, 28 + 40 + 20 * 3274);
    static const size_t chunks[] = {1000, 4096, 65535, 200000};
    for (size_t c = 0; c < 4; c++) {
        native_parser_init(&parser);
        int n = 0;
        for (int repeat = 0; repeat < 20; repeat++) {
            size_t at = 0;
            native_finish_frame(out, (uint32_t)repeat);
            while (at < len) {
                size_t room;
                uint8_t *to = native_parser_room(&parser, &room);
                size_t part = len - at < chunks[c] ? len - at : chunks[c];
                if (part > room) part = room;
                assert_true(part > 0);
                memcpy(to, out + at, part);
                native_parser_added(&parser, part);
                at += part;
                while (native_parser_next(&parser) == NATIVE_FRAME) {
                    assert_memory_equal(parser.frame, out, len);
                    n++;
                }
            }
        }
        assert_int_equal(n, 20);
        assert_int_equal(parser.stats.bad_bytes, 0);
    }
}

static void test_parser_text_limits(void **state)
{
    (void)state;
    char line[600];
    memset(line, 'x', sizeof line);
    memcpy(line + 510, "\r\n", 2);
    begin();
    feed((const uint8_t *)line, 512, 100);
    assert_int_equal(n_texts, 1);
    assert_int_equal(strlen(parser.text), 510);
    memset(line, 'x', sizeof line);
    memcpy(line + 511, "\r\n", 2);
    begin();
    feed((const uint8_t *)line, 513, 100);
    assert_int_equal(n_texts, 0);
    assert_int_equal(parser.stats.bad_bytes, 513);
    /* Printable characters are 0x20 to 0x7e. */
    begin();
    feed((const uint8_t *)" ~\r\n", 4, 4);
    assert_int_equal(n_texts, 1);
    assert_string_equal(parser.text, " ~");
    for (int i = 0; i < 2; i++) {
        begin();
        feed((const uint8_t *)(i == 0 ? "\x1f\r\n" : "\x7f\r\n"), 3, 3);
        assert_int_equal(n_texts, 0);
        assert_int_equal(parser.stats.bad_bytes, 3);
    }
    /* Out of step, a line does not count as a reply. */
    feed((const uint8_t *)"OK\r\n", 4, 4);
    assert_int_equal(n_texts, 0);
}

/* Items come out where they lie. A header that was changed is found there, too. */
static void test_parser_lent(void **state)
{
    (void)state;
    make_stream();
    for (int at_once = 1; at_once <= n_pieces; at_once++) {
        enum native_item item;
        int k = 0;
        begin();
        for (int from = 0; from < n_pieces; from += at_once) {
            const struct piece *last = &piece[from + at_once < n_pieces ? from + at_once - 1 : n_pieces - 1];
            native_parser_lend(&parser, stream + piece[from].at, last->at + last->len - piece[from].at);
            for (; (item = native_parser_next(&parser)) != NATIVE_MORE; k++) {
                assert_int_equal(item, piece[k].is_text ? NATIVE_TEXT : NATIVE_FRAME);
                if (item == NATIVE_FRAME) assert_ptr_equal(parser.frame, stream + piece[k].at);
                if (item == NATIVE_TEXT) assert_memory_equal(parser.text, stream + piece[k].at, piece[k].len - 2);
            }
        }
        assert_int_equal(k, n_pieces);
        assert_int_equal(parser.stats.bytes, stream_len);
        assert_int_equal(parser.stats.bad_bytes, 0);
    }
    begin();
    stream[piece[1].at + 4] ^= 1;
    native_parser_lend(&parser, stream, stream_len);
    for (enum native_item item; (item = native_parser_next(&parser)) != NATIVE_MORE;)
        n_got += item == NATIVE_FRAME;
    assert_int_equal(n_got, 12);
    assert_int_equal(parser.stats.bad_bytes, piece[1].len);
}

/* Garbage made to be slow: only sync bytes, and headers without payload whose length hides the following bytes. The
 * work is counted in CRC checks. The parser reads a good header at most once per frame start, so the number is
 * bounded. */
static void test_parser_resync_cost(void **state)
{
    (void)state;
    native_parser_init(&parser);
    memset(out, NATIVE_SYNC, sizeof out);
    size_t at = 0;
    while (at < sizeof out) {
        size_t room;
        uint8_t *to = native_parser_room(&parser, &room);
        size_t n = sizeof out - at < room ? sizeof out - at : room;
        memcpy(to, out + at, n);
        native_parser_added(&parser, n);
        at += n;
        assert_int_equal(native_parser_next(&parser), NATIVE_MORE);
        assert_true(parser.end - parser.start < NATIVE_HEADER_LEN);
    }
    assert_true(parser.stats.bad_bytes > sizeof out - NATIVE_HEADER_LEN);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_parser_whole),         cmocka_unit_test(test_parser_length_refused),
        cmocka_unit_test(test_parser_biggest_frame), cmocka_unit_test(test_parser_text_limits),
        cmocka_unit_test(test_parser_resync_cost),   cmocka_unit_test(test_parser_lent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
