/* SPDX-License-Identifier: MIT */
/* Frames of colours, byte by byte. They are sent after their points and these points' attributes, cut with them, and
 * refused where they are wrong. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "core/err.h"
#include "drivers/protocol/native_encode.h"

enum { MOST = 2 * NATIVE_MAX_POINTS + 100 };

static uint8_t out[1 << 19];
static uint32_t dt[MOST], a[MOST];
static int16_t refl[MOST], amplitude[MOST];
static uint16_t label[MOST], width[MOST];
static uint8_t echo[MOST], rgb[MOST][3];

static uint64_t wire(const uint8_t *p, int bytes)
{
    uint64_t v = 0;
    for (int i = bytes - 1; i >= 0; i--)
        v = v << 8 | p[i];
    return v;
}

/* Each pulse has `echoes` echoes. Colours count up, and so name the entry. */
static struct line_block make_block(uint32_t n_points, uint32_t echoes, int attributes)
{
    for (uint32_t i = 0; i < n_points; i++) {
        dt[i] = i / echoes * 500;
        echo[i] = (uint8_t)((i % echoes + 1) | echoes << 4);
        for (int c = 0; c < 3; c++)
            rgb[i][c] = (uint8_t)(i >> 8 * c);
    }
    return (struct line_block){.line = 77,
                               .pulse0 = UINT64_C(0x123456789a),
                               .n_pulses = n_points / echoes,
                               .t0_ns = 1000,
                               .n_points = n_points,
                               .dt_ns = dt,
                               .a = a,
                               .b = a,
                               .c = a,
                               .refl_cdb = refl,
                               .echo = echo,
                               .label = label,
                               .amplitude_cdb = attributes ? amplitude : NULL,
                               .width_cns = attributes ? width : NULL,
                               .rgb = rgb};
}

/* POINTS.md, 11. */
static void test_bytes(void **state)
{
    (void)state;
    for (int attributes = 0; attributes < 2; attributes++) {
        const struct line_block block = make_block(3, 1, attributes);
        memcpy(rgb, "\x01\x02\x03\xff\xfe\xfd\x80\x80\x80", 9);
        const size_t before = 28 + 40 + 3 * 20 + (attributes ? 28 + 16 + 3 * 4 : 0);
        const size_t len = native_encode_points(out, sizeof out, &block, 5000);
        const uint8_t *f = out + before, *p = f + 28;
        assert_int_equal(len, before + 28 + 16 + 9);
        assert_int_equal(f[0], 0xd5);
        assert_int_equal(f[1], 11);
        assert_int_equal(f[2], 1);
        assert_int_equal(f[3], 0);
        assert_int_equal(wire(f + 4, 4), 25);
        assert_int_equal(wire(f + 16, 8), wire(out + 16, 8)); /* the device time of its points */
        assert_int_equal(wire(p, 8), 0x123456789a);
        assert_int_equal(wire(p + 8, 4), 77);
        assert_int_equal(wire(p + 12, 4), 3);
        assert_memory_equal(p + 16, "\x01\x02\x03\xff\xfe\xfd\x80\x80\x80", 9);
        struct native_attributes head;
        uint8_t one[3];
        assert_int_equal(native_decode_colours(p, 25, &head), 0);
        assert_int_equal(head.pulse0, 0x123456789a);
        assert_int_equal(head.n_points, 3);
        native_decode_colour(p, 1, one);
        assert_memory_equal(one, "\xff\xfe\xfd", 3);
    }
}

/* A payload is cut anywhere, and has counts that it can't hold. Without room for it there is no room for the block. */
static void test_refused(void **state)
{
    (void)state;
    const struct line_block block = make_block(3, 1, 1);
    struct native_attributes head;
    const size_t len = native_encode_points(out, sizeof out, &block, 0);
    uint8_t *p = out + len - 25;
    for (size_t cut = 0; cut < 25; cut++)
        assert_int_equal(native_decode_colours(p, cut, &head), SH_EFORMAT);
    assert_int_equal(native_decode_colours(p, 25, &head), 0);
    assert_int_equal(native_decode_colours(p, 40, &head), 0); /* later versions grow at the end */
    p[12] = 4;
    assert_int_equal(native_decode_colours(p, 25, &head), SH_EFORMAT);
    p[15] = 0xff;
    assert_int_equal(native_decode_colours(p, 25, &head), SH_EFORMAT);
    assert_int_equal(native_encode_points(out, len - 1, &block, 0), 0);
    assert_int_equal(native_encode_points(out, len - 25 - 28, &block, 0), 0);
}

/* There are as many frames as for the points, each with its own, in the room that is promised to be enough. */
static void test_cut_with_their_points(void **state)
{
    (void)state;
    static const uint32_t cases[][2] = {{15, 15}, {NATIVE_MAX_POINTS, 1}, {2 * NATIVE_MAX_POINTS + 2, 10}};
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        const uint32_t n = cases[k][0];
        const struct line_block block = make_block(n, cases[k][1], 0);
        const size_t room = native_points_bound(n) + native_colours_bound(n);
        const size_t len = native_encode_points(out, room, &block, 0);
        uint32_t seen = 0;
        assert_true(len > 0);
        for (size_t at = 0; at < len;) {
            struct native_points points;
            struct native_attributes head;
            assert_int_equal(out[at + 1], NATIVE_POINTS);
            assert_int_equal(native_decode_points(out + at + 28, (size_t)wire(out + at + 4, 4), &points), 0);
            at += native_frame_len(out + at);
            assert_int_equal(out[at + 1], NATIVE_COLOURS);
            assert_int_equal(native_decode_colours(out + at + 28, (size_t)wire(out + at + 4, 4), &head), 0);
            assert_true(head.pulse0 == points.pulse0 && head.line == points.line && head.n_points == points.n_points);
            for (uint32_t i = 0; i < head.n_points; i++, seen++)
                assert_int_equal(wire(out + at + 28 + 16 + 3 * (size_t)i, 3), seen);
            at += native_frame_len(out + at);
        }
        assert_int_equal(seen, n);
    }
}

/* The descriptor announces them in its second bit. */
static void test_descriptor(void **state)
{
    (void)state;
    const struct native_descriptor d = {.idn = "a,b,c,d", .content = NATIVE_HAS_COLOURS};
    struct native_descriptor back;
    assert_int_equal(native_encode_descriptor(out, sizeof out, &d, 0, 0), 28 + 280);
    assert_int_equal(wire(out + 28 + 272, 4), 2);
    assert_int_equal(native_decode_descriptor(out + 28, 280, &back), 0);
    assert_int_equal(back.content, NATIVE_HAS_COLOURS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bytes),
        cmocka_unit_test(test_refused),
        cmocka_unit_test(test_cut_with_their_points),
        cmocka_unit_test(test_descriptor),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
