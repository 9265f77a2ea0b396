/* SPDX-License-Identifier: MIT */
/* Frames of attributes, byte by byte. They are sent after their points, cut with them, and refused where they are
 * wrong. */
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
static uint8_t echo[MOST];

static uint64_t wire(const uint8_t *p, int bytes)
{
    uint64_t v = 0;
    for (int i = bytes - 1; i >= 0; i--)
        v = v << 8 | p[i];
    return v;
}

/* Each pulse has `echoes` echoes. Amplitudes and widths count up, and so name the entry. */
static struct line_block make_block(uint32_t n_points, uint32_t echoes)
{
    for (uint32_t i = 0; i < n_points; i++) {
        a[i] = i;
        dt[i] = i / echoes * 500;
        echo[i] = (uint8_t)((i % echoes + 1) | echoes << 4);
        amplitude[i] = (int16_t)(i - 3000);
        width[i] = (uint16_t)(65535 - i);
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
                               .amplitude_cdb = amplitude,
                               .width_cns = width};
}

/* POINTS.md, 9. */
static void test_bytes(void **state)
{
    (void)state;
    struct line_block block = make_block(3, 1);
    amplitude[0] = -32768;
    width[0] = 0;
    amplitude[1] = 1234; /* 12.34 dB */
    width[1] = 400;      /* 4 ns */
    amplitude[2] = 32767;
    width[2] = 65535;
    size_t len = native_encode_points(out, sizeof out, &block, 5000), points_len = 28 + 40 + 3 * 20;
    const uint8_t *f = out + points_len, *p = f + 28;
    assert_int_equal(len, points_len + 28 + 16 + 3 * 4);
    assert_int_equal(out[1], 3);
    assert_int_equal(f[0], 0xd5);
    assert_int_equal(f[1], 9);
    assert_int_equal(f[3], 0);
    assert_int_equal(wire(f + 4, 4), 28);
    assert_int_equal(wire(f + 16, 8), wire(out + 16, 8)); /* the device time of its points */
    assert_int_equal(wire(p, 8), 0x123456789a);
    assert_int_equal(wire(p + 8, 4), 77);
    assert_int_equal(wire(p + 12, 4), 3);
    assert_int_equal(wire(p + 16, 2), 0x8000);
    assert_int_equal(wire(p + 18, 2), 0);
    assert_int_equal(wire(p + 20, 2), 1234);
    assert_int_equal(wire(p + 22, 2), 400);
    assert_int_equal(wire(p + 24, 2), 32767);
    assert_int_equal(wire(p + 26, 2), 65535);
    struct native_attributes head;
    struct native_attribute one;
    assert_int_equal(native_decode_attributes(p, 28, &head), 0);
    assert_int_equal(head.pulse0, 0x123456789a);
    assert_int_equal(head.line, 77);
    assert_int_equal(head.n_points, 3);
    native_decode_attribute(p, 0, &one);
    assert_int_equal(one.amplitude_cdb, NATIVE_AMPLITUDE_NONE);
    assert_int_equal(one.width_cns, NATIVE_WIDTH_NONE);
    native_decode_attribute(p, 1, &one);
    assert_int_equal(one.amplitude_cdb, 1234);
    assert_int_equal(one.width_cns, 400);
}

/* A payload is cut anywhere, and has counts that it can't hold. */
static void test_refused(void **state)
{
    (void)state;
    struct line_block block = make_block(3, 1);
    struct native_attributes head;
    size_t len = native_encode_points(out, sizeof out, &block, 0);
    uint8_t *p = out + len - 28;
    for (size_t cut = 0; cut < 28; cut++)
        assert_int_equal(native_decode_attributes(p, cut, &head), SH_EFORMAT);
    assert_int_equal(native_decode_attributes(p, 28, &head), 0);
    assert_int_equal(native_decode_attributes(p, 40, &head), 0); /* later versions grow at the end */
    p[12] = 4;
    assert_int_equal(native_decode_attributes(p, 28, &head), SH_EFORMAT);
    p[15] = 0xff;
    assert_int_equal(native_decode_attributes(p, 28, &head), SH_EFORMAT);
    /* Without room for them there is no room for the block. */
    assert_int_equal(native_encode_points(out, len - 1, &block, 0), 0);
    assert_int_equal(native_encode_points(out, 28 + 40 + 3 * 20, &block, 0), 0);
}

/* There are as many frames as for the points, each with its own. */
static void check_cut(uint32_t n_points, uint32_t echoes)
{
    struct line_block block = make_block(n_points, echoes);
    size_t room = native_points_bound(n_points) + native_attributes_bound(n_points), at = 0;
    size_t len = native_encode_points(out, room, &block, 0);
    uint32_t seen = 0;
    assert_true(len > 0);
    while (at < len) {
        struct native_points points;
        struct native_attributes head;
        assert_int_equal(out[at + 1], NATIVE_POINTS);
        assert_int_equal(native_decode_points(out + at + 28, (size_t)wire(out + at + 4, 4), &points), 0);
        at += 28 + (size_t)wire(out + at + 4, 4);
        assert_int_equal(out[at + 1], NATIVE_ATTRIBUTES);
        assert_int_equal(native_decode_attributes(out + at + 28, (size_t)wire(out + at + 4, 4), &head), 0);
        assert_int_equal(head.pulse0, points.pulse0);
        assert_int_equal(head.line, points.line);
        assert_int_equal(head.n_points, points.n_points);
        for (uint32_t i = 0; i < head.n_points; i++, seen++) {
            struct native_attribute one;
            native_decode_attribute(out + at + 28, i, &one);
            assert_int_equal(one.amplitude_cdb, (int16_t)(seen - 3000));
            assert_int_equal(one.width_cns, 65535 - seen);
        }
        at += 28 + (size_t)wire(out + at + 4, 4);
    }
    assert_int_equal(at, len);
    assert_int_equal(seen, n_points);
}

static void test_cut_with_their_points(void **state)
{
    (void)state;
    check_cut(15, 15);
    check_cut(NATIVE_MAX_POINTS, 1);
    check_cut(NATIVE_MAX_POINTS + 6, 4);
    check_cut(2 * NATIVE_MAX_POINTS + 2, 15 * 2 / 3);
}

/* The descriptor announces them, and does not change where there are none. */
static void test_descriptor(void **state)
{
    (void)state;
    struct native_descriptor d = {.idn = "a,b,c,d", .layout = NATIVE_GEO, .seed = 5}, back;
    assert_int_equal(native_encode_descriptor(out, sizeof out, &d, 0, 0), 28 + 272);
    d.content = NATIVE_HAS_ATTRIBUTES;
    assert_int_equal(native_encode_descriptor(out, 28 + 279, &d, 0, 0), 0);
    assert_int_equal(native_encode_descriptor(out, sizeof out, &d, 0, 0), 28 + 280);
    assert_int_equal(wire(out + 28 + 264, 8), 5);
    assert_int_equal(wire(out + 28 + 272, 4), 1);
    assert_int_equal(wire(out + 28 + 276, 4), 0);
    assert_int_equal(native_decode_descriptor(out + 28, 280, &back), 0);
    assert_int_equal(back.content, NATIVE_HAS_ATTRIBUTES);
    assert_int_equal(native_decode_descriptor(out + 28, 272, &back), 0);
    assert_int_equal(back.content, 0);
}

/* A frame of a type that the parser does not know, as this one was before, is like any other: it counts, it is in the
 * sequence, and nothing is broken. */
static void test_parser_passes_unknown_types(void **state)
{
    (void)state;
    static struct native_parser parser;
    struct line_block block = make_block(3, 1);
    size_t len = native_encode_points(out, sizeof out, &block, 0), points_len = 28 + 40 + 3 * 20, room;
    native_finish_frame(out, 8);
    out[points_len + 1] = 200;
    native_finish_frame(out + points_len, 9);
    native_parser_init(&parser);
    memcpy(native_parser_room(&parser, &room), out, len);
    native_parser_added(&parser, len);
    assert_int_equal(native_parser_next(&parser), NATIVE_FRAME);
    assert_int_equal(parser.header.type, NATIVE_POINTS);
    assert_int_equal(native_parser_next(&parser), NATIVE_FRAME);
    assert_int_equal(parser.header.type, 200);
    assert_int_equal(native_parser_next(&parser), NATIVE_MORE);
    assert_int_equal(parser.stats.frames, 2);
    assert_int_equal(parser.stats.bad_bytes + parser.stats.bad_payload + parser.stats.seq_gaps, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bytes),
        cmocka_unit_test(test_refused),
        cmocka_unit_test(test_cut_with_their_points),
        cmocka_unit_test(test_descriptor),
        cmocka_unit_test(test_parser_passes_unknown_types),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
