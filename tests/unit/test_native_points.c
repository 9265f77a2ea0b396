/* SPDX-License-Identifier: MIT */
/* Points encoded and decoded, and cut into frames. */
#include "tests/unit/native_rig.h"

static uint8_t out[1 << 20];

static void test_point_extremes(void **state)
{
    (void)state;
    static const struct native_point want[4] = {
        {0, UINT32_MAX, 0x80000000u, INT16_MIN, 0xffff, 0, 0, 0},
        {UINT32_MAX, 0, 1, INT16_MAX, 0, 0xffffff, 1, 15},
        {0x01020304, 0x05060708, 0x090a0b0c, -1, 0x0d0e, 0x112233, 15, 15},
        {1, 2, 3, 0, 1, 1, 1, 1},
    };
    struct line_block block = make_block(4);
    block.n_pulses = 4;
    for (int i = 0; i < 4; i++) {
        block_a[i] = want[i].a;
        block_b[i] = want[i].b;
        block_c[i] = want[i].c;
        block_refl[i] = want[i].refl_cdb;
        block_label[i] = want[i].label;
        block_dt[i] = want[i].dt_ns;
        block_echo[i] = (uint8_t)(want[i].echo | want[i].echo_count << 4);
    }
    size_t len = native_encode_points(out, sizeof out, &block, 1000);
    check_frame(out, len, 3, 0, 40 + 80, 1000 + block.t0_ns);
    assert_memory_equal(out + 28 + 40 + 40,
                        "\x04\x03\x02\x01\x08\x07\x06\x05\x0c\x0b\x0a\x09\xff\xff\x0e\x0d\x33\x22\x11\xff", 20);
    struct native_points head;
    assert_int_equal(native_decode_points(out + 28, 120, &head), 0);
    assert_int_equal(head.frame, 3);
    assert_int_equal(wire(out + 28, 4, 4), 0xfffffffe);
    assert_int_equal(wire(out + 28, 8, 8), block.pulse0);
    assert_int_equal(wire(out + 28, 16, 8), block.t0_ns);
    assert_int_equal(wire(out + 28, 24, 8), block.line_t0_ns);
    assert_int_equal(wire(out + 28, 32, 4), 4);
    assert_int_equal(wire(out + 28, 36, 4), 4);
    for (uint32_t i = 0; i < 4; i++) {
        struct native_point p;
        memset(&p, 0, sizeof p);
        native_decode_point(out + 28, i, &p);
        assert_memory_equal(&p, &want[i], sizeof p);
    }
    assert_int_equal(native_decode_points(out + 28, 119, &head), SH_EFORMAT);
    assert_int_equal(native_decode_points(out + 28, 39, &head), SH_EFORMAT);
    assert_int_equal(native_encode_points(out, len - 1, &block, 0), 0);
    block_dt[2] = 1 << 24; /* has no room beside the echo: refused, not cut */
    assert_int_equal(native_encode_points(out, sizeof out, &block, 0), 0);
}

/* The counts are those of points decoded one by one. All other bytes are random. */
static void test_points_counted(void **state)
{
    (void)state;
    enum { N = 500 };
    uint32_t x = 7, empty = 0, reflectances = 0, n_empty, n_reflectances;
    for (size_t i = 0; i < 40 + 20 * N; i++)
        out[i] = (uint8_t)((x = x * 1664525u + 1013904223u) >> 24);
    for (uint32_t i = 0; i < N; i++) {
        uint8_t *point = out + 40 + 20 * (size_t)i;
        struct native_point p;
        if (i % 3 == 0) memcpy(point + 12, "\x00\x80", 2); /* not modelled */
        if (i % 5 == 0) point[19] &= 15;                   /* no echo */
        native_decode_point(out, i, &p);
        empty += p.echo_count == 0;
        reflectances += p.echo_count != 0 && p.refl_cdb != LINE_REFL_NONE;
    }
    assert_true(empty > N / 6 && reflectances > N / 3);
    native_count_points(out, N, &n_empty, &n_reflectances);
    assert_int_equal(n_empty, empty);
    assert_int_equal(n_reflectances, reflectances);
    native_count_points(out, 0, &n_empty, &n_reflectances);
    assert_int_equal(n_empty + n_reflectances, 0);
}

static void test_empty_block(void **state)
{
    (void)state;
    struct line_block block = make_block(0);
    struct native_points head;
    assert_int_equal(native_encode_points(out, sizeof out, &block, 0), 68);
    assert_int_equal(native_decode_points(out + 28, 40, &head), 0);
    assert_int_equal(head.n_points, 0);
}

/* Pulses of 1..15 echoes come in blocks of all sizes around the cut. Nothing is lost, no pulse is torn, and times and
 * numbers are right. */
static void check_cut(uint32_t n_points, uint32_t echoes)
{
    const struct line_block block = make_pulses(n_points, echoes);
    size_t len = native_encode_points(out, native_points_bound(n_points), &block, 0), at = 0;
    assert_true(len > 0 && len <= native_points_bound(n_points));
    uint32_t seen = 0, pulses = 0;
    while (at < len) {
        struct native_points head;
        size_t payload_len = (size_t)wire(out, at + 4, 4);
        assert_int_equal(native_decode_points(out + at + 28, payload_len, &head), 0);
        assert_int_equal(seen % echoes, 0);
        assert_int_equal(head.pulse0, block.pulse0 + pulses);
        assert_int_equal(head.t0_ns, block.t0_ns + (int64_t)pulses * 500);
        assert_int_equal(wire(out, at + 16, 8), (uint64_t)head.t0_ns);
        for (uint32_t i = 0; i < head.n_points; i++, seen++) {
            struct native_point p;
            native_decode_point(out + at + 28, i, &p);
            assert_int_equal(p.a, seen);
            assert_int_equal(head.t0_ns + p.dt_ns, block.t0_ns + (int64_t)(seen / echoes) * 500);
        }
        pulses += head.n_pulses;
        at += 28 + payload_len;
    }
    assert_int_equal(at, len);
    assert_int_equal(seen, n_points);
    assert_int_equal(pulses, block.n_pulses);
}

static void test_points_cut(void **state)
{
    (void)state;
    static const uint32_t sizes[] = {NATIVE_MAX_POINTS - 1, NATIVE_MAX_POINTS, NATIVE_MAX_POINTS + 1,
                                     2 * NATIVE_MAX_POINTS - 27, 2 * NATIVE_MAX_POINTS + 1};
    for (uint32_t echoes = 1; echoes <= 15; echoes++)
        for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++)
            check_cut(sizes[i], echoes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_point_extremes),
        cmocka_unit_test(test_empty_block),
        cmocka_unit_test(test_points_cut),
        cmocka_unit_test(test_points_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
