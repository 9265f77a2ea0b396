/* SPDX-License-Identifier: MIT */
/* Frames of attributes and of colours, byte by byte. The frames are sent after their points, cut with them, and refused
 * where they are wrong. */
#include "tests/unit/native_rig.h"

enum { MOST = 2 * NATIVE_MAX_POINTS + 100 };

static uint8_t out[1 << 20];
static int16_t amplitude[MOST];
static uint16_t width[MOST];
static uint8_t rgb[MOST][3];

/* Amplitudes count up and widths count down, so that both name the entry. */
static struct line_block with_attributes(uint32_t n_points, uint32_t echoes)
{
    struct line_block block = make_pulses(n_points, echoes);
    for (uint32_t i = 0; i < n_points; i++) {
        amplitude[i] = (int16_t)(i - 3000);
        width[i] = (uint16_t)(65535 - i);
    }
    block.amplitude_cdb = amplitude;
    block.width_cns = width;
    return block;
}

static struct line_block with_colours(uint32_t n_points, uint32_t echoes)
{
    struct line_block block = make_pulses(n_points, echoes);
    for (uint32_t i = 0; i < n_points; i++)
        for (int c = 0; c < 3; c++)
            rgb[i][c] = (uint8_t)(i >> 8 * c);
    block.rgb = rgb;
    return block;
}

/* Frames of type 9 or 11 (POINTS.md). `see` gets entry i of a frame, which is entry n of the block. */
struct beside {
    uint8_t type;
    size_t entry_len;
    struct line_block (*make)(uint32_t n_points, uint32_t echoes);
    int (*decode)(const uint8_t *payload, size_t len, struct native_attributes *head);
    void (*see)(const uint8_t *payload, uint32_t i, uint32_t n);
};

static void see_attribute(const uint8_t *payload, uint32_t i, uint32_t n)
{
    struct native_attribute one;
    native_decode_attribute(payload, i, &one);
    assert_int_equal(one.amplitude_cdb, (int16_t)(n - 3000));
    assert_int_equal(one.width_cns, 65535 - n);
}

static void see_colour(const uint8_t *payload, uint32_t i, uint32_t n)
{
    assert_int_equal(wire(payload, 16 + 3 * (size_t)i, 3), n);
}

static const struct beside attributes = {9, 4, with_attributes, native_decode_attributes, see_attribute},
                           colours = {11, 3, with_colours, native_decode_colours, see_colour};

enum { POINTS_LEN = 28 + 40 + 3 * 20 };

/* Encodes three points. The frame begins at byte `at`, and is the last one. Returns its payload. */
static uint8_t *check_three(const struct beside *b, const struct line_block *block, size_t at)
{
    const size_t payload_len = 16 + 3 * b->entry_len;
    uint8_t *f = out + at, *p = f + 28;
    struct native_attributes head;
    assert_int_equal(native_encode_points(out, sizeof out, block, 5000), at + 28 + payload_len);
    assert_int_equal(out[1], 3);
    assert_int_equal(f[0], 0xd5);
    assert_int_equal(f[1], b->type);
    assert_int_equal(f[2], 1);
    assert_int_equal(f[3], 0);
    assert_int_equal(wire(f, 4, 4), payload_len);
    assert_int_equal(wire(f, 16, 8), wire(out, 16, 8)); /* the device time of its points */
    assert_int_equal(wire(p, 0, 8), 0x123456789a);
    assert_int_equal(wire(p, 8, 4), 77);
    assert_int_equal(wire(p, 12, 4), 3);
    assert_int_equal(b->decode(p, payload_len, &head), 0);
    assert_int_equal(head.pulse0, 0x123456789a);
    assert_int_equal(head.line, 77);
    assert_int_equal(head.n_points, 3);
    return p;
}

/* The payload is cut anywhere, and has counts that it can't hold. Without room for the frame, or for its payload, there
 * is no room for the block. */
static void check_refused(const struct beside *b, const struct line_block *block, size_t at)
{
    uint8_t *p = check_three(b, block, at);
    const size_t len = 16 + 3 * b->entry_len;
    struct native_attributes head;
    for (size_t cut = 0; cut < len; cut++)
        assert_int_equal(b->decode(p, cut, &head), SH_EFORMAT);
    assert_int_equal(b->decode(p, len + 12, &head), 0); /* later versions grow at the end */
    p[12] = 4;
    assert_int_equal(b->decode(p, len, &head), SH_EFORMAT);
    p[15] = 0xff;
    assert_int_equal(b->decode(p, len, &head), SH_EFORMAT);
    assert_int_equal(native_encode_points(out, at + 28 + len - 1, block, 0), 0);
    assert_int_equal(native_encode_points(out, at, block, 0), 0);
}

static void test_attributes(void **state)
{
    (void)state;
    struct line_block block = with_attributes(3, 1);
    struct native_attribute one;
    amplitude[0] = -32768;
    width[0] = 0;
    amplitude[1] = 1234; /* 12.34 dB */
    width[1] = 400;      /* 4 ns */
    amplitude[2] = 32767;
    width[2] = 65535;
    const uint8_t *p = check_three(&attributes, &block, POINTS_LEN);
    assert_int_equal(wire(p, 16, 2), 0x8000);
    assert_int_equal(wire(p, 18, 2), 0);
    assert_int_equal(wire(p, 20, 2), 1234);
    assert_int_equal(wire(p, 22, 2), 400);
    assert_int_equal(wire(p, 24, 2), 32767);
    assert_int_equal(wire(p, 26, 2), 65535);
    native_decode_attribute(p, 0, &one);
    assert_int_equal(one.amplitude_cdb, NATIVE_AMPLITUDE_NONE);
    assert_int_equal(one.width_cns, NATIVE_WIDTH_NONE);
    native_decode_attribute(p, 1, &one);
    assert_int_equal(one.amplitude_cdb, 1234);
    assert_int_equal(one.width_cns, 400);
    check_refused(&attributes, &block, POINTS_LEN);
}

/* Colours come after their points' attributes. */
static void test_colours(void **state)
{
    (void)state;
    struct line_block block = with_colours(3, 1);
    memcpy(rgb, "\x01\x02\x03\xff\xfe\xfd\x80\x80\x80", 9);
    assert_memory_equal(check_three(&colours, &block, POINTS_LEN) + 16, rgb, 9);
    block.amplitude_cdb = amplitude;
    block.width_cns = width;
    assert_memory_equal(check_three(&colours, &block, POINTS_LEN + 28 + 16 + 3 * 4) + 16, rgb, 9);
    check_refused(&colours, &block, POINTS_LEN + 28 + 16 + 3 * 4);
}

/* Each frame of points is followed by one of their attributes or colours. The promised room is enough for all. */
static void check_cut(const struct beside *b, uint32_t n_points, uint32_t echoes)
{
    const struct line_block block = b->make(n_points, echoes);
    const size_t beside_bound = b == &colours ? native_colours_bound(n_points) : native_attributes_bound(n_points),
                 len = native_encode_points(out, native_points_bound(n_points) + beside_bound, &block, 0);
    uint32_t seen = 0;
    assert_true(len > 0);
    for (size_t at = 0; at < len; at += native_frame_len(out + at)) {
        struct native_points points;
        struct native_attributes head;
        assert_int_equal(out[at + 1], NATIVE_POINTS);
        assert_int_equal(native_decode_points(out + at + 28, (size_t)wire(out, at + 4, 4), &points), 0);
        at += native_frame_len(out + at);
        assert_int_equal(out[at + 1], b->type);
        assert_int_equal(b->decode(out + at + 28, (size_t)wire(out, at + 4, 4), &head), 0);
        assert_true(head.pulse0 == points.pulse0 && head.line == points.line && head.n_points == points.n_points);
        for (uint32_t i = 0; i < head.n_points; i++)
            b->see(out + at + 28, i, seen++);
    }
    assert_int_equal(seen, n_points);
}

static void test_cut_with_their_points(void **state)
{
    (void)state;
    static const uint32_t cases[][2] = {
        {15, 15}, {NATIVE_MAX_POINTS, 1}, {NATIVE_MAX_POINTS + 6, 4}, {2 * NATIVE_MAX_POINTS + 2, 10}};
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        check_cut(&attributes, cases[k][0], cases[k][1]);
        check_cut(&colours, cases[k][0], cases[k][1]);
    }
}

/* A descriptor announces attributes in eight bytes at its end. Without attributes it lacks these bytes. */
static void test_descriptor(void **state)
{
    (void)state;
    struct native_descriptor d = {.idn = "a,b,c,d", .layout = NATIVE_GEO, .seed = 5}, back;
    assert_int_equal(native_encode_descriptor(out, sizeof out, &d, 0, 0), 28 + 272);
    d.content = NATIVE_HAS_ATTRIBUTES;
    assert_int_equal(native_encode_descriptor(out, 28 + 279, &d, 0, 0), 0);
    assert_int_equal(native_encode_descriptor(out, sizeof out, &d, 0, 0), 28 + 280);
    assert_int_equal(wire(out, 28 + 264, 8), 5);
    assert_int_equal(wire(out, 28 + 272, 4), 1);
    assert_int_equal(wire(out, 28 + 276, 4), 0);
    assert_int_equal(native_decode_descriptor(out + 28, 280, &back), 0);
    assert_int_equal(back.content, NATIVE_HAS_ATTRIBUTES);
    assert_int_equal(native_decode_descriptor(out + 28, 272, &back), 0);
    assert_int_equal(back.content, 0);
}

/* To the parser a frame of an unknown type is like any other: it counts, it is in the sequence, and nothing is broken.
 * Attributes once were of an unknown type. */
static void test_parser_passes_unknown_types(void **state)
{
    (void)state;
    static struct native_parser parser;
    struct line_block block = with_attributes(3, 1);
    size_t len = native_encode_points(out, sizeof out, &block, 0), room;
    native_finish_frame(out, 8);
    out[POINTS_LEN + 1] = 200;
    native_finish_frame(out + POINTS_LEN, 9);
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
        cmocka_unit_test(test_attributes),
        cmocka_unit_test(test_colours),
        cmocka_unit_test(test_cut_with_their_points),
        cmocka_unit_test(test_descriptor),
        cmocka_unit_test(test_parser_passes_unknown_types),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
