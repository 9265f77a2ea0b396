/* SPDX-License-Identifier: MIT */
/* The sequence numbers of frames: missing, repeated, late ones, and restarts. */
#include "tests/unit/native_rig.h"

static struct native_sequence sequence;
static uint32_t first, n;

/* Frames of one number are the same frame, unless they differ in `life`. */
static struct native_header frame_of(uint32_t seq, uint32_t life)
{
    return (struct native_header){.type = NATIVE_POINTS,
                                  .version = 1,
                                  .length = 60,
                                  .seq = seq,
                                  .payload_crc = seq * 2654435761u + life,
                                  .t_ns = 1000 * (int64_t)seq};
}

static enum native_notice_kind take(uint32_t seq, uint32_t life)
{
    const struct native_header header = frame_of(seq, life);
    return native_sequence_take(&sequence, &header, &first, &n);
}

static void expect(uint32_t seq, enum native_notice_kind kind, uint32_t want_first, uint32_t want_n)
{
    assert_int_equal(take(seq, 0), kind);
    assert_int_equal(first, want_first);
    assert_int_equal(n, want_n);
}

/* The same story is told from several first numbers; with some of them it runs over 2^32. */
static void tell_story(uint32_t s)
{
    memset(&sequence, 0, sizeof sequence);
    expect(s, NATIVE_NO_NOTICE, s, 1);
    expect(s + 1, NATIVE_NO_NOTICE, s + 1, 1);
    expect(s + 1, NATIVE_REPEATED, s + 1, 1);
    expect(s, NATIVE_REPEATED, s, 1);
    expect(s + 2, NATIVE_NO_NOTICE, s + 2, 1);
    expect(s + 10, NATIVE_GAP, s + 3, 7);
    expect(s + 6, NATIVE_LATE, s + 6, 1);
    expect(s + 6, NATIVE_REPEATED, s + 6, 1);
    expect(s + 11, NATIVE_NO_NOTICE, s + 11, 1);
    expect(s + 3, NATIVE_LATE, s + 3, 1);
    expect(s + 9, NATIVE_LATE, s + 9, 1);
    expect(s + 12, NATIVE_NO_NOTICE, s + 12, 1);
    expect(s + 12, NATIVE_REPEATED, s + 12, 1);
    expect(s + 14, NATIVE_GAP, s + 13, 1);
    expect(s + 13, NATIVE_LATE, s + 13, 1);
    /* Number s + 2 has come, but not this frame. */
    assert_int_equal(take(s + 2, 1), NATIVE_RESTARTED);
    assert_int_equal(first, s + 2);
    /* Earlier losses belong to another sequence. */
    expect(s + 3, NATIVE_NO_NOTICE, s + 3, 1);
    expect(s + 14, NATIVE_GAP, s + 4, 10);
    expect(s + 4, NATIVE_LATE, s + 4, 1);
}

static void test_story(void **state)
{
    (void)state;
    static const uint32_t from[] = {0, 1, 1000, 0x7ffffff8u, 0x80000000u, UINT32_MAX};
    for (size_t i = 0; i < sizeof from / sizeof from[0]; i++)
        tell_story(from[i]);
    for (uint32_t back = 0; back < 20; back++)
        tell_story(0 - back);
}

/* All knowledge of a sequence ends with it. */
static void test_forgets(void **state)
{
    (void)state;
    for (int again = 0; again < 2; again++) {
        memset(&sequence, 0, sizeof sequence);
        expect(10, NATIVE_NO_NOTICE, 10, 1);
        expect(15, NATIVE_GAP, 11, 4);
        for (uint32_t seq = 16; seq < 40; seq++)
            expect(seq, NATIVE_NO_NOTICE, seq, 1);
        assert_int_equal(take(20, 1), NATIVE_RESTARTED);
        expect(again ? 15 : 12, NATIVE_RESTARTED, again ? 15 : 12, 1); /* before the restart 15 came, 12 didn't */
    }
    /* A late frame fills its place. Another one with its number is of another sequence. */
    memset(&sequence, 0, sizeof sequence);
    expect(10, NATIVE_NO_NOTICE, 10, 1);
    expect(15, NATIVE_GAP, 11, 4);
    expect(12, NATIVE_LATE, 12, 1);
    assert_int_equal(take(12, 1), NATIVE_RESTARTED);
}

static void test_memory(void **state)
{
    (void)state;
    memset(&sequence, 0, sizeof sequence);
    for (uint32_t seq = 0; seq < 1000; seq++)
        assert_int_equal(take(seq, 0), NATIVE_NO_NOTICE);
    expect(1000 - NATIVE_SEEN, NATIVE_REPEATED, 1000 - NATIVE_SEEN, 1);
    /* further back nothing is known: another sequence */
    expect(1000 - NATIVE_SEEN - 1, NATIVE_RESTARTED, 1000 - NATIVE_SEEN - 1, 1);
    /* Every third frame is missing. The gaps of the last 3 NATIVE_GAPS numbers are remembered. */
    memset(&sequence, 0, sizeof sequence);
    for (uint32_t seq = 1; seq < 900; seq++)
        if (seq % 3 != 0) assert_int_equal(take(seq, 0), seq % 3 == 1 && seq > 1 ? NATIVE_GAP : NATIVE_NO_NOTICE);
    for (uint32_t i = 1; i <= NATIVE_GAPS; i++)
        expect(900 - 3 * i, NATIVE_LATE, 900 - 3 * i, 1);
    expect(900 - 3 * (NATIVE_GAPS + 1), NATIVE_RESTARTED, 900 - 3 * (NATIVE_GAPS + 1), 1);
    /* The oldest gap that is remembered is cut in two by a late frame. Both parts stay. */
    memset(&sequence, 0, sizeof sequence);
    expect(0, NATIVE_NO_NOTICE, 0, 1);
    for (uint32_t i = 0; i < NATIVE_GAPS; i++)
        expect(4 + 2 * i, NATIVE_GAP, i == 0 ? 1 : 3 + 2 * i, i == 0 ? 3 : 1);
    expect(2, NATIVE_LATE, 2, 1);
    expect(1, NATIVE_LATE, 1, 1);
    expect(3, NATIVE_LATE, 3, 1);
}

static void test_long_gaps(void **state)
{
    (void)state;
    memset(&sequence, 0, sizeof sequence);
    expect(0, NATIVE_NO_NOTICE, 0, 1);
    expect(NATIVE_GAP_MOST + 1, NATIVE_GAP, 1, NATIVE_GAP_MOST);
    expect(1, NATIVE_LATE, 1, 1);
    /* The gap is too long to wait for. A number within it begins another sequence, and none of its frames is
     * dropped. */
    expect(2 * NATIVE_GAP_MOST + 3, NATIVE_GAP, NATIVE_GAP_MOST + 2, NATIVE_GAP_MOST + 1);
    for (uint32_t seq = NATIVE_GAP_MOST + 5; seq < NATIVE_GAP_MOST + 400; seq++)
        expect(seq, seq == NATIVE_GAP_MOST + 5 ? NATIVE_RESTARTED : NATIVE_NO_NOTICE, seq, 1);
    /* A jump by half of all numbers or more is a jump back. */
    memset(&sequence, 0, sizeof sequence);
    expect(0, NATIVE_NO_NOTICE, 0, 1);
    expect(0x80000000u, NATIVE_GAP, 1, 0x7fffffffu);
    expect(1, NATIVE_RESTARTED, 1, 1);
}

/* A head started again, with numbers that all count as missing. Its frames are dropped as late only for a while. */
static void test_late_run(void **state)
{
    (void)state;
    memset(&sequence, 0, sizeof sequence);
    expect(0u - 10u, NATIVE_NO_NOTICE, 0u - 10u, 1);
    expect(5000, NATIVE_GAP, 0u - 9u, 5009);
    for (uint32_t i = 1; i < NATIVE_LATE_RUN; i++)
        expect(i - 3, NATIVE_LATE, i - 3, 1);
    expect(NATIVE_LATE_RUN - 3, NATIVE_RESTARTED, NATIVE_LATE_RUN - 3, 1);
    expect(NATIVE_LATE_RUN - 2, NATIVE_NO_NOTICE, NATIVE_LATE_RUN - 2, 1);
    /* Late ones come with another frame between, or with a hole. */
    memset(&sequence, 0, sizeof sequence);
    expect(0, NATIVE_NO_NOTICE, 0, 1);
    expect(5000, NATIVE_GAP, 1, 4999);
    for (uint32_t i = 1; i < 2000; i++) {
        expect(i < 1000 ? i : i + 1, NATIVE_LATE, i < 1000 ? i : i + 1, 1);
        if (i % 200 == 0 && i != 1000)
            expect(5000 + i / 200 - (i > 1000), NATIVE_NO_NOTICE, 5000 + i / 200 - (i > 1000), 1);
    }
}

static void test_resumed(void **state)
{
    (void)state;
    /* The head is the same as before. Missed frames are a gap, and a frame of an older gap may still come. */
    memset(&sequence, 0, sizeof sequence);
    expect(5, NATIVE_NO_NOTICE, 5, 1);
    expect(8, NATIVE_GAP, 6, 2);
    native_sequence_resume(&sequence);
    expect(12, NATIVE_GAP, 9, 3);
    expect(6, NATIVE_LATE, 6, 1);
    expect(13, NATIVE_NO_NOTICE, 13, 1);
    /* The last frame comes again. */
    native_sequence_resume(&sequence);
    expect(13, NATIVE_REPEATED, 13, 1);
    expect(14, NATIVE_NO_NOTICE, 14, 1);
    /* A head that started again sends its first frames anew: they are neither repeated nor late. */
    native_sequence_resume(&sequence);
    expect(5, NATIVE_RESTARTED, 5, 1);
    for (uint32_t seq = 6; seq < 20; seq++)
        expect(seq, NATIVE_NO_NOTICE, seq, 1);
    native_sequence_resume(&sequence);
    expect(7, NATIVE_RESTARTED, 7, 1);
    /* A restarted head's first frame is not late either, though its number was missing. */
    expect(9, NATIVE_GAP, 8, 1);
    native_sequence_resume(&sequence);
    expect(8, NATIVE_RESTARTED, 8, 1);
}

static void test_local(void **state)
{
    (void)state;
    struct native_header local = frame_of(0, 7);
    local.flags = NATIVE_LOCAL;
    memset(&sequence, 0, sizeof sequence);
    assert_int_equal(native_sequence_take(&sequence, &local, &first, &n), NATIVE_NO_NOTICE);
    expect(100, NATIVE_NO_NOTICE, 100, 1);
    /* Equal ones are allowed, but not twice in a row. */
    assert_int_equal(native_sequence_take(&sequence, &local, &first, &n), NATIVE_NO_NOTICE);
    assert_int_equal(native_sequence_take(&sequence, &local, &first, &n), NATIVE_REPEATED);
    local.t_ns++;
    assert_int_equal(native_sequence_take(&sequence, &local, &first, &n), NATIVE_NO_NOTICE);
    native_sequence_resume(&sequence);
    assert_int_equal(native_sequence_take(&sequence, &local, &first, &n), NATIVE_NO_NOTICE);
    expect(101, NATIVE_NO_NOTICE, 101, 1); /* their number, 0, does not count */
}

/* With the same number, a frame that differs in one of these fields is another frame. */
static void test_same_number(void **state)
{
    (void)state;
    for (int field = 0; field < 5; field++) {
        memset(&sequence, 0, sizeof sequence);
        expect(7, NATIVE_NO_NOTICE, 7, 1);
        expect(8, NATIVE_NO_NOTICE, 8, 1);
        struct native_header other = frame_of(7, 0);
        if (field == 0) other.type++;
        if (field == 1) other.length++;
        if (field == 2) other.payload_crc++;
        if (field == 3) other.t_ns++;
        if (field == 4) other.flags = NATIVE_REPEAT;
        assert_int_equal(native_sequence_take(&sequence, &other, &first, &n), NATIVE_RESTARTED);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_late_run), cmocka_unit_test(test_forgets),     cmocka_unit_test(test_story),
        cmocka_unit_test(test_memory),   cmocka_unit_test(test_long_gaps),   cmocka_unit_test(test_resumed),
        cmocka_unit_test(test_local),    cmocka_unit_test(test_same_number),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
