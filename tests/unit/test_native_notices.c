/* SPDX-License-Identifier: MIT */
/* The parser's notices of a damaged stream: each fault once, at its byte, however the bytes are cut. */
#include "tests/unit/native_stream.h"

enum { NOTICES_MAX = 400 };

static struct native_notice noticed[NOTICES_MAX];
static int n_noticed;

static void on_notice(void *ctx, const struct native_notice *notice)
{
    assert_ptr_equal(ctx, &parser);
    assert_true(n_noticed < NOTICES_MAX);
    if (n_noticed > 0) assert_true(notice->at_byte >= noticed[n_noticed - 1].at_byte);
    noticed[n_noticed++] = *notice;
}

static void listen_again(void)
{
    begin();
    n_noticed = 0;
    parser.notice = on_notice;
    parser.notice_ctx = &parser;
}

static void expect(int i, enum native_notice_kind kind, uint64_t at_byte, uint32_t seq, uint64_t n)
{
    assert_true(i < n_noticed);
    assert_int_equal(noticed[i].kind, kind);
    assert_int_equal(noticed[i].at_byte, at_byte);
    assert_int_equal(noticed[i].seq, seq);
    assert_int_equal(noticed[i].n, n);
}

/* ---- frames of an event each */

static uint8_t bytes[1 << 14];
static size_t n_bytes;

enum { FRAME = 156 }; /* header and event */

static size_t put(uint32_t seq, int flags)
{
    struct native_event e = {.code = NATIVE_EV_ERROR, .a = seq};
    const size_t at = n_bytes,
                 len = native_encode_event(bytes + at, sizeof bytes - at, &e, 10 * (int64_t)(int32_t)seq, flags);
    assert_int_equal(len, FRAME);
    native_finish_frame(bytes + at, (flags & NATIVE_LOCAL) != 0 ? 0 : seq);
    n_bytes += len;
    return at;
}

static size_t put_text(const char *text)
{
    const size_t at = n_bytes, len = strlen(text);
    memcpy(bytes + at, text, len);
    n_bytes += len;
    return at;
}

/* Runs `check` on the whole bytes, in pieces of every size up to 2 frames, and split once at each byte. */
static void in_all_pieces(void (*check)(void))
{
    for (size_t chunk = 1; chunk <= n_bytes; chunk = chunk < 2 * FRAME ? chunk + 1 : n_bytes) {
        listen_again();
        feed(bytes, n_bytes, chunk);
        finish();
        check();
        if (chunk == n_bytes) break;
    }
    for (size_t at = 1; at < n_bytes; at++) {
        listen_again();
        feed(bytes, at, at);
        feed(bytes + at, n_bytes - at, n_bytes);
        finish();
        check();
    }
}

static size_t at[10];

static void check_sequence(void)
{
    assert_int_equal(n_noticed, 5);
    expect(0, NATIVE_GAP, at[2], UINT32_MAX, 3);
    assert_int_equal(noticed[0].t_ns, 20);
    expect(1, NATIVE_REPEATED, at[3], 2, 1);
    expect(2, NATIVE_LATE, at[4], 0, 1);
    assert_int_equal(noticed[2].t_ns, 0);
    expect(3, NATIVE_RESTARTED, at[6], 0x90000000u, 1);
    expect(4, NATIVE_REPEATED, at[8], 0, 1);
    assert_int_equal(n_got, 6);
    assert_int_equal(parser.stats.frames, 6);
    assert_int_equal(parser.stats.seq_lost, 3);
    assert_int_equal(parser.stats.seq_gaps, 2);
    assert_int_equal(parser.stats.restarts, 1);
    assert_int_equal(parser.stats.repeated, 2);
    assert_int_equal(parser.stats.late, 1);
    assert_int_equal(parser.stats.bad_bytes, 0);
}

static void test_sequence(void **state)
{
    (void)state;
    n_bytes = 0;
    at[0] = put(UINT32_MAX - 2, 0);
    at[1] = put(UINT32_MAX - 1, 0);
    at[2] = put(2, 0);
    at[3] = put(2, 0);
    at[4] = put(0, 0);
    at[5] = put(3, 0);
    at[6] = put(0x90000000u, 0);
    at[7] = put(9, NATIVE_LOCAL);
    at[8] = put(9, NATIVE_LOCAL);
    in_all_pieces(check_sequence);
}

static void check_bytes(void)
{
    int i = 0;
    expect(i++, NATIVE_BAD_BYTES, 0, 0, 7);
    assert_int_equal(noticed[0].t_ns, NATIVE_NO_TIME);
    expect(i++, NATIVE_BAD_PAYLOAD, at[1], 11, FRAME); /* flipped */
    assert_int_equal(noticed[1].t_ns, 110);
    expect(i++, NATIVE_GAP, at[2], 11, 1);
    expect(i++, NATIVE_BAD_BYTES, at[3], 0, FRAME + 9); /* a broken header, and garbage after it */
    assert_int_equal(noticed[3].t_ns, 120);
    expect(i++, NATIVE_GAP, at[4], 13, 1);
    expect(i++, NATIVE_BAD_PAYLOAD, at[5], 15, FRAME); /* flipped, then garbage that is not its own */
    expect(i++, NATIVE_BAD_BYTES, at[5] + FRAME, 0, 5);
    expect(i++, NATIVE_BAD_PAYLOAD, at[6], 16, 60);         /* its end is lost; */
    expect(i++, NATIVE_BAD_PAYLOAD, at[6] + 60, 17, FRAME); /* the next begins within its length, and is flipped */
    expect(i++, NATIVE_GAP, at[8], 15, 3);
    expect(i++, NATIVE_BAD_BYTES, at[9], 0, 20); /* a header that is not whole */
    expect(i++, NATIVE_GAP, at[9] + 20, 19, 1);
    assert_int_equal(n_noticed, i);
    assert_int_equal(n_texts, 1);
    assert_int_equal(n_got, 5);
    assert_int_equal(parser.stats.bad_payload, 4);
    assert_int_equal(parser.stats.bad_bytes, n_bytes - 5 * FRAME - 4);
    assert_int_equal(parser.stats.seq_lost, 6);
    assert_int_equal(parser.stats.cuts, 0);
}

static void test_bytes(void **state)
{
    (void)state;
    n_bytes = 0;
    put_text("\xd5garbag");
    at[0] = put(10, 0);
    at[1] = put(11, 0);
    bytes[at[1] + 40] ^= 1;
    at[2] = put(12, 0);
    put_text("OK\r\n");
    at[3] = put(13, 0);
    bytes[at[3] + 5] ^= 0x10; /* the length */
    put_text("\x02OK\r\nOK\r\n");
    at[4] = put(14, 0);
    at[5] = put(15, 0);
    bytes[at[5] + 155] ^= 0x80;
    put_text("\xd5\xd5\xd5\xd5\xd5");
    at[6] = put(16, 0);
    n_bytes = at[6] + 60;
    at[7] = put(17, 0);
    bytes[at[7] + 155] ^= 0x80;
    at[8] = put(18, 0);
    at[9] = put(19, 0);
    n_bytes = at[9] + 20;
    put(20, 0);
    in_all_pieces(check_bytes);
}

/* ---- the end of a connection */

static size_t cut_at;

static void check_cut(void)
{
    assert_int_equal(n_noticed, 1);
    expect(0, NATIVE_CUT, at[1], n_bytes - at[1] < NATIVE_HEADER_LEN ? 0 : 6, n_bytes - at[1]);
    assert_int_equal(noticed[0].t_ns, n_bytes - at[1] < NATIVE_HEADER_LEN ? 50 : 60);
    assert_int_equal(parser.stats.cuts, 1);
    assert_int_equal(parser.stats.bad_payload, 0);
    assert_int_equal(parser.stats.bad_bytes, n_bytes - at[1]);
}

static void check_cut_text(void)
{
    assert_int_equal(n_noticed, 1);
    expect(0, NATIVE_CUT, at[1], 0, n_bytes - at[1]);
}

static void check_cut_later(void)
{
    assert_int_equal(n_noticed, 4);
    expect(0, NATIVE_BAD_PAYLOAD, at[1], 6, 28); /* frames follow within its length: it lost bytes before the end */
    expect(1, NATIVE_GAP, at[2], 6, 1);
    expect(2, NATIVE_BAD_PAYLOAD, at[3], 8, FRAME);
    expect(3, NATIVE_CUT, at[4], 0, 10);
    assert_int_equal(n_got, 2);
    assert_int_equal(parser.stats.bad_payload, 2);
}

static void check_hidden(void)
{
    assert_int_equal(n_noticed, 2);
    expect(0, NATIVE_BAD_PAYLOAD, at[1], 6, 40);
    expect(1, NATIVE_GAP, at[2], 6, 1);
    assert_int_equal(n_got, 2);
    assert_int_equal(parser.stats.bad_payload, 1);
    assert_int_equal(parser.stats.cuts, 0);
}

static void check_garbage_at_end(void)
{
    assert_int_equal(n_noticed, 1);
    expect(0, NATIVE_BAD_BYTES, at[1], 0, 4); /* its sync byte does not begin a frame */
}

static void test_end(void **state)
{
    (void)state;
    for (cut_at = 1; cut_at < FRAME; cut_at++) {
        n_bytes = 0;
        put(5, 0);
        at[1] = put(6, 0);
        n_bytes = at[1] + cut_at;
        in_all_pieces(check_cut);
    }
    n_bytes = 0;
    put(5, 0);
    at[1] = put_text("OK\r");
    in_all_pieces(check_cut_text);
    n_bytes = 0;
    put(5, 0);
    at[1] = put(6, 0);
    n_bytes = at[1] + 28;
    at[2] = put(7, 0);
    n_bytes = at[2] + FRAME;
    at[3] = put(8, 0);
    bytes[at[3] + 100] ^= 4;
    at[4] = put(9, 0);
    n_bytes = at[4] + 10;
    in_all_pieces(check_cut_later);
    /* A frame's length reaches beyond the end, and a whole one is within it. */
    n_bytes = 0;
    put(5, 0);
    at[1] = put(6, 0);
    at[2] = n_bytes = at[1] + 40;
    memset(bytes + at[2], 0, NATIVE_HEADER_LEN);
    memcpy(bytes + at[2], (uint8_t[]){NATIVE_SYNC, 200, NATIVE_VERSION}, 3);
    n_bytes += native_finish_frame(bytes + at[2], 7);
    in_all_pieces(check_hidden);
    n_bytes = 0;
    put(5, 0);
    at[1] = put_text("\x01\x02\xd5\x01");
    in_all_pieces(check_garbage_at_end);
}

/* Broken frames that no gap shows: at both ends, and before a restart. */
static void test_bad_unseen(void **state)
{
    (void)state;
    static const struct {
        uint32_t seq;
        int flags, hurt;
        uint64_t unseen;
    } frames[] = {
        {4, 0, 1, 1},
        {5, 0, 0, 1},
        {6, 0, 1, 2},
        {6, 0, 0, 1},
        {7, 0, 1, 2},
        {7, NATIVE_LOCAL, 0, 2},
        {8, 0, 0, 1},
        {9, 0, 1, 2},
        {8, 0, 0, 2},
        {0x90000000u, 0, 0, 2},
        {0, NATIVE_LOCAL, 1, 2},
        {0x90000001u, 0, 1, 3},
    };
    listen_again();
    for (size_t i = 0; i < sizeof frames / sizeof frames[0]; i++) {
        n_bytes = 0;
        put(frames[i].seq, frames[i].flags);
        if (frames[i].hurt) bytes[100] ^= 1;
        feed(bytes, n_bytes, n_bytes);
        assert_int_equal(parser.stats.bad_unseen, frames[i].unseen);
    }
    assert_int_equal(parser.stats.seq_lost, 1);
    assert_int_equal(parser.stats.bad_payload, 6);
}

static void test_resume(void **state)
{
    (void)state;
    n_bytes = 0;
    put(5, 0);
    put(6, 0);
    listen_again();
    feed(bytes, FRAME + 50, FRAME);
    finish();
    native_parser_resume(&parser);
    assert_int_equal(n_noticed, 1);
    expect(0, NATIVE_CUT, FRAME, 6, 50);
    n_bytes = 0;
    put(6, 0);
    put(2, 0);
    feed(bytes, n_bytes, n_bytes);
    assert_int_equal(n_noticed, 2);
    expect(1, NATIVE_RESTARTED, FRAME + 50 + FRAME, 2, 1);
    /* items that were not taken */
    size_t room;
    memcpy(native_parser_room(&parser, &room), bytes, n_bytes);
    native_parser_added(&parser, n_bytes);
    native_parser_resume(&parser);
    assert_int_equal(n_noticed, 3);
    expect(2, NATIVE_CUT, 3 * FRAME + 50, 0, 2 * FRAME);
    assert_int_equal(parser.stats.bytes, 5 * FRAME + 50);
}

/* A head that was started again meanwhile sends the same frames, but they are not the earlier ones. */
static void test_resume_with_old_numbers(void **state)
{
    (void)state;
    n_bytes = 0;
    put(4, 0);
    put(5, 0);
    listen_again();
    feed(bytes, n_bytes, n_bytes);
    finish();
    native_parser_resume(&parser);
    feed(bytes, n_bytes, n_bytes);
    assert_int_equal(n_noticed, 1);
    expect(0, NATIVE_RESTARTED, 2 * FRAME, 4, 1);
    assert_int_equal(parser.stats.frames, 4);
}

/* The client attaches again in the middle of a frame, at any byte. The next frame or reply is whole. The first part of
 * the frame before is lost, and reported. */
static void test_resume_in_a_frame(void **state)
{
    (void)state;
    /* A reply or a frame follows. The end of the bytes is reported, or the client itself cuts them off. */
    for (int i = 0; i < 4; i++)
        for (size_t had = 1; had < FRAME; had++) {
            n_bytes = 0;
            put(5, 0);
            put(6, 0);
            listen_again();
            feed(bytes, FRAME + had, FRAME + had);
            if (i % 2 != 0) finish();
            native_parser_resume(&parser);
            n_bytes = 0;
            if (i < 2)
                put_text("OK\r\n");
            else
                put(7, 0);
            feed(bytes, n_bytes, n_bytes);
            assert_int_equal(parser.stats.texts, i < 2);
            assert_int_equal(parser.stats.frames, i < 2 ? 1 : 2);
            assert_int_equal(parser.stats.bad_bytes, had);
            assert_int_equal(n_noticed, i < 2 ? 1 : 2);
            expect(0, NATIVE_CUT, FRAME, noticed[0].seq, had);
            if (i >= 2) expect(1, NATIVE_GAP, FRAME + had, 6, 1);
        }
}

/* Without a listener the counts are the same. */
static void test_nobody_listens(void **state)
{
    (void)state;
    n_bytes = 0;
    put(5, 0);
    put(5, 0);
    put_text("\x01");
    put(9, 0);
    begin();
    feed(bytes, n_bytes, 100);
    assert_int_equal(parser.stats.repeated, 1);
    assert_int_equal(parser.stats.seq_lost, 3);
    assert_int_equal(parser.stats.bad_bytes, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sequence),
        cmocka_unit_test(test_bytes),
        cmocka_unit_test(test_end),
        cmocka_unit_test(test_bad_unseen),
        cmocka_unit_test(test_resume),
        cmocka_unit_test(test_nobody_listens),
        cmocka_unit_test(test_resume_in_a_frame),
        cmocka_unit_test(test_resume_with_old_numbers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
