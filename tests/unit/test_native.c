/* Encode, decode and parse: every field at its place with extreme values, and the parser against every single
 * damage. */
#include <float.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/protocol/bytes.h"
#include "drivers/protocol/crc32c.h"
#include "drivers/protocol/native_encode.h"

enum { STREAM_MAX = 8192, ITEMS_MAX = 40, BLOCK_MAX = 7000 };

static uint8_t out[1 << 20];

/* The wire by shifts, apart from the code under test. */
static uint64_t wire(const uint8_t *p, size_t at, int bytes)
{
    uint64_t v = 0;
    for (int i = bytes - 1; i >= 0; i--)
        v = v << 8 | p[at + (size_t)i];
    return v;
}

static double wire_double(const uint8_t *p, size_t at)
{
    uint64_t v = wire(p, at, 8);
    double d;
    memcpy(&d, &v, sizeof d);
    return d;
}

static void check_frame(const uint8_t *frame, size_t len, int type, int flags, size_t payload_len, int64_t t_ns)
{
    assert_int_equal(len, NATIVE_HEADER_LEN + payload_len);
    assert_int_equal(frame[0], 0xd5);
    assert_int_equal(frame[1], type);
    assert_int_equal(frame[2], 1);
    assert_int_equal(frame[3], flags);
    assert_int_equal(wire(frame, 4, 4), payload_len);
    assert_int_equal(wire(frame, 8, 4), 0);
    assert_int_equal(wire(frame, 12, 4), crc32c_table(0, frame + 28, payload_len));
    assert_int_equal(wire(frame, 16, 8), (uint64_t)t_ns);
    assert_int_equal(wire(frame, 24, 4), crc32c_table(0, frame, 24));
}

static struct native_descriptor make_descriptor(void)
{
    struct native_descriptor d;
    memset(&d, 0xee, sizeof d); /* what stands behind a NUL must not reach the wire */
    strcpy(d.idn, "Maker,Model,SN1,1.0");
    memset(d.profile, 'p', 31);
    d.profile[31] = 0;
    d.layout = NATIVE_GEO;
    d.isa = 16;
    d.prr_uhz = UINT64_MAX;
    d.lines_uhz = 1;
    d.pan_udeg_s = 18000000;
    d.fov_min_udeg = INT64_MIN;
    d.sweep_udeg = 360000000;
    d.line_start_udeg = -40000000;
    d.line_stop_udeg = 60000000;
    d.pan_start_udeg = -1;
    d.pan_stop_udeg = INT64_MAX;
    d.mirror_counts_per_turn = 4294967296.0;
    d.pan_counts_per_turn = DBL_MAX;
    d.range_scale_m = DBL_MIN;
    d.range_min_m = -0.0;
    d.range_max_m = 0.1;
    d.max_echoes = 15;
    d.n_surfaces = 65534;
    d.frames = UINT32_MAX;
    d.scan = 7;
    d.seed = 0x0123456789abcdefu;
    d.content = d.reserved = 0; /* not sent then; test_native_attributes */
    return d;
}

static void test_descriptor(void **state)
{
    (void)state;
    struct native_descriptor d = make_descriptor(), back;
    size_t len = native_encode_descriptor(out, sizeof out, &d, INT64_MIN, NATIVE_REPEAT);
    check_frame(out, len, 1, 1, 272, INT64_MIN);
    const uint8_t *p = out + 28;
    assert_string_equal((const char *)p, d.idn);
    for (size_t i = strlen(d.idn); i < 96; i++)
        assert_int_equal(p[i], 0);
    assert_string_equal((const char *)p + 96, d.profile);
    assert_int_equal(wire(p, 128, 4), 1);
    assert_int_equal(wire(p, 132, 4), 16);
    assert_int_equal(wire(p, 136, 8), UINT64_MAX);
    assert_int_equal(wire(p, 144, 8), 1);
    assert_int_equal(wire(p, 152, 8), 18000000);
    assert_int_equal(wire(p, 160, 8), (uint64_t)INT64_MIN);
    assert_int_equal(wire(p, 168, 8), 360000000);
    assert_int_equal(wire(p, 176, 8), (uint64_t)-40000000);
    assert_int_equal(wire(p, 184, 8), 60000000);
    assert_int_equal(wire(p, 192, 8), (uint64_t)-1);
    assert_int_equal(wire(p, 200, 8), INT64_MAX);
    assert_true(wire_double(p, 208) == 4294967296.0);
    assert_true(wire_double(p, 216) == DBL_MAX);
    assert_true(wire_double(p, 224) == DBL_MIN);
    assert_int_equal(wire(p, 232, 8), UINT64_C(1) << 63);
    assert_true(wire_double(p, 240) == 0.1);
    assert_int_equal(wire(p, 248, 4), 15);
    assert_int_equal(wire(p, 252, 4), 65534);
    assert_int_equal(wire(p, 256, 4), UINT32_MAX);
    assert_int_equal(wire(p, 260, 4), 7);
    assert_int_equal(wire(p, 264, 8), 0x0123456789abcdefu);
    assert_int_equal(native_decode_descriptor(p, 272, &back), 0);
    memset(d.idn + strlen(d.idn), 0, sizeof d.idn - strlen(d.idn));
    assert_memory_equal(&d, &back, sizeof d);
}

static void test_descriptor_refused(void **state)
{
    (void)state;
    struct native_descriptor d = make_descriptor(), back;
    uint8_t *p = out + 28;
    size_t len = native_encode_descriptor(out, sizeof out, &d, 0, 0);
    assert_int_equal(native_encode_descriptor(out, len - 1, &d, 0, 0), 0);
    assert_int_equal(native_decode_descriptor(p, 271, &back), SH_EFORMAT);
    assert_int_equal(native_decode_descriptor(p, 300, &back), 0); /* later versions grow at the end */
    p[128] = 2;
    assert_int_equal(native_decode_descriptor(p, 272, &back), SH_EFORMAT);
    p[128] = 0;
    memset(p + 96, 'x', 32); /* no NUL */
    assert_int_equal(native_decode_descriptor(p, 272, &back), SH_EFORMAT);
    p[127] = 0;
    assert_int_equal(native_decode_descriptor(p, 272, &back), 0);
    memset(p + 208, 0xff, 8); /* NaN */
    assert_int_equal(native_decode_descriptor(p, 272, &back), SH_EFORMAT);
}

static struct native_anchor make_anchor(void)
{
    struct native_anchor a = {
        .crs = NATIVE_CRS_UTM,
        .epsg = 32632,
        .station = UINT32_MAX,
        .anchor = {500000.125, 6e6, -11000.5},
        .scale_m = 1e-5,
        .lat_deg = -90,
        .lon_deg = 180,
        .height_m = 8848.86,
        .station_m = {1.5, -2.5, 3.5},
    };
    for (int i = 0; i < 9; i++)
        a.rotation[i] = i - 4.25;
    for (int i = 0; i < 3; i++)
        a.scale[i] = 0.25 * (i + 1);
    a.heights = NATIVE_HEIGHTS_GEOID;
    for (int i = 0; i < 9; i++)
        a.axes[i] = 0.5 * i - 1.75;
    a.moving = NATIVE_STOP;
    a.frame = 1207.25;
    return a;
}

static void test_anchor(void **state)
{
    (void)state;
    struct native_anchor a = make_anchor(), back;
    size_t len = native_encode_anchor(out, sizeof out, &a, 5, NATIVE_LOCAL);
    check_frame(out, len, 2, 2, 280, 5);
    const uint8_t *p = out + 28;
    assert_int_equal(wire(p, 0, 4), 2);
    assert_int_equal(wire(p, 4, 4), 32632);
    assert_int_equal(wire(p, 8, 4), UINT32_MAX);
    assert_int_equal(wire(p, 12, 4), 2);
    assert_true(wire_double(p, 16) == 500000.125 && wire_double(p, 24) == 6e6 && wire_double(p, 32) == -11000.5);
    assert_true(wire_double(p, 40) == 1e-5);
    assert_true(wire_double(p, 48) == -90 && wire_double(p, 56) == 180 && wire_double(p, 64) == 8848.86);
    assert_true(wire_double(p, 72) == 1.5 && wire_double(p, 80) == -2.5 && wire_double(p, 88) == 3.5);
    for (size_t i = 0; i < 9; i++)
        assert_true(wire_double(p, 96 + 8 * i) == (double)i - 4.25);
    assert_true(wire_double(p, 168) == 0.25 && wire_double(p, 176) == 0.5 && wire_double(p, 184) == 0.75);
    assert_true(wire(p, 192, 4) == 1 && wire(p, 196, 4) == 0);
    for (size_t i = 0; i < 9; i++)
        assert_true(wire_double(p, 200 + 8 * i) == 0.5 * (double)i - 1.75);
    assert_true(wire_double(p, 272) == 1207.25);
    assert_int_equal(native_decode_anchor(p, 280, &back), 0);
    assert_memory_equal(&a, &back, sizeof a);
    for (size_t n = 272; n < 280; n++) { /* of an older head */
        assert_int_equal(native_decode_anchor(p, n, &back), 0);
        assert_true(back.frame == 0 && back.axes[8] == 2.25 && back.scale[2] == 0.75);
    }
    assert_int_equal(native_decode_anchor(p, 168, &back), 0); /* of the first ones */
    assert_true(back.scale[0] == 1e-5 && back.scale[1] == 1e-5 && back.scale[2] == 1e-5 && back.heights == 0);
    assert_true(back.rotation[8] == 3.75);
    for (int i = 0; i < 9; i++)
        assert_true(back.axes[i] == (i % 4 == 0));
    assert_int_equal(native_decode_anchor(p, 167, &back), SH_EFORMAT);
    out[28] = 3;
    assert_int_equal(native_decode_anchor(p, 280, &back), 0);
    assert_int_equal(back.crs, NATIVE_CRS_GEODETIC);
    out[28] = 4;
    assert_int_equal(native_decode_anchor(p, 280, &back), SH_EFORMAT);
    out[28] = 2;
    out[28 + 192] = 2;
    assert_int_equal(native_decode_anchor(p, 280, &back), SH_EFORMAT);
}

static void test_line_end(void **state)
{
    (void)state;
    struct line_end e = {1,  UINT32_MAX, UINT64_MAX - 1, 3, 4, 5, -6, 7000, UINT32_MAX - 2, 9, LINE_PARTIAL,
                         10, 11,         UINT32_MAX - 3};
    size_t len = native_encode_line_end(out, sizeof out, &e, 1000);
    check_frame(out, len, 4, 0, 68, 1000 + e.t1_ns);
    const uint8_t *p = out + 28;
    struct native_line_end back;
    /* the first heads' line ends had no counts; what is between them and these is none either */
    assert_int_equal(native_decode_line_end(p, 55, &back), SH_EFORMAT);
    for (size_t n = 56; n < 68; n++) {
        assert_int_equal(native_decode_line_end(p, n, &back), 0);
        assert_int_equal(back.status, e.status);
        assert_int_equal(back.n_crowded | back.n_faint | back.n_unfit, 0);
    }
    assert_int_equal(native_decode_line_end(p, 68, &back), 0);
    assert_int_equal(wire(p, 56, 4), e.n_crowded);
    assert_int_equal(wire(p, 60, 4), e.n_faint);
    assert_int_equal(wire(p, 64, 4), e.n_unfit);
    assert_int_equal(back.n_crowded, e.n_crowded);
    assert_int_equal(back.n_unfit, e.n_unfit);
    assert_int_equal(wire(p, 0, 4), e.frame);
    assert_int_equal(wire(p, 4, 4), e.line);
    assert_int_equal(wire(p, 8, 8), e.pulse0);
    assert_int_equal(wire(p, 16, 8), (uint64_t)e.t0_ns);
    assert_int_equal(wire(p, 24, 8), (uint64_t)e.t1_ns);
    assert_int_equal(wire(p, 32, 4), e.n_fired);
    assert_int_equal(wire(p, 36, 4), e.n_cast);
    assert_int_equal(wire(p, 40, 4), e.n_echoes);
    assert_int_equal(wire(p, 44, 4), e.mirror_count);
    assert_int_equal(wire(p, 48, 4), e.pan_count);
    assert_int_equal(wire(p, 52, 4), e.status);
    assert_int_equal(back.frame, e.frame);
    assert_int_equal(back.pulse0, e.pulse0);
    assert_int_equal(back.t1_ns, e.t1_ns);
    assert_int_equal(back.status, e.status);
}

static void test_telemetry(void **state)
{
    (void)state;
    struct native_telemetry t = {4, 2, UINT64_MAX, 1, 2, 3, 4, 5, 6, 7, INT64_MIN}, back;
    size_t len = native_encode_telemetry(out, sizeof out, &t, -1, 0);
    check_frame(out, len, 5, 0, 72, -1);
    const uint8_t *p = out + 28;
    assert_int_equal(wire(p, 0, 4), 4);
    assert_int_equal(wire(p, 4, 4), 2);
    assert_int_equal(wire(p, 8, 8), UINT64_MAX);
    for (size_t i = 0; i < 4; i++)
        assert_int_equal(wire(p, 16 + 8 * i, 8), i + 1);
    assert_int_equal(wire(p, 48, 4), 5);
    assert_int_equal(wire(p, 52, 4), 6);
    assert_int_equal(wire(p, 56, 8), 7);
    assert_int_equal(wire(p, 64, 8), (uint64_t)INT64_MIN);
    assert_int_equal(native_decode_telemetry(p, 72, &back), 0);
    assert_memory_equal(&t, &back, sizeof t);
    assert_int_equal(native_decode_telemetry(p, 71, &back), SH_EFORMAT);
}

static void test_event(void **state)
{
    (void)state;
    struct native_event e = {.code = NATIVE_EV_OVERRUN, .a = UINT64_MAX, .b = 2, .c = 3, .text = "100 pulses"}, back;
    size_t len = native_encode_event(out, sizeof out, &e, 9, 0);
    check_frame(out, len, 6, 0, 128, 9);
    const uint8_t *p = out + 28;
    assert_int_equal(wire(p, 0, 4), 4);
    assert_int_equal(wire(p, 8, 8), UINT64_MAX);
    assert_int_equal(wire(p, 16, 8), 2);
    assert_int_equal(wire(p, 24, 8), 3);
    assert_string_equal((const char *)p + 32, "100 pulses");
    assert_int_equal(native_decode_event(p, 128, &back), 0);
    assert_memory_equal(&e, &back, sizeof e);
    assert_int_equal(native_decode_event(p, 127, &back), SH_EFORMAT);
}

/* ---- surfaces */

static char names[3][300];

static void name_of(void *ctx, uint32_t label, const char **object, const char **material)
{
    (void)ctx;
    *object = names[label % 3];
    *material = "m";
}

struct seen {
    uint32_t n, first;
    char last[600];
};

static void see(void *ctx, uint32_t label, const char *object, const char *material)
{
    struct seen *seen = ctx;
    if (seen->n++ == 0) seen->first = label;
    snprintf(seen->last, sizeof seen->last, "%s|%s", object, material);
}

static void test_surfaces(void **state)
{
    (void)state;
    struct seen seen = {0};
    uint32_t done;
    strcpy(names[0], "wall");
    strcpy(names[1], "");
    memset(names[2], 'n', 255);
    names[2][255] = 0;
    size_t len = native_encode_surfaces(out, sizeof out, 3, 3, 4096, name_of, NULL, 1, 0, &done);
    const size_t payload = 8 + (5 + 2) + (1 + 2) + (256 + 2);
    check_frame(out, len, 7, 0, payload, 1);
    assert_int_equal(done, 3);
    assert_memory_equal(out + 28, "\x03\0\0\0\x03\0\0\0\x04wall\x01m\0\x01m\xff", 19);
    assert_int_equal(native_decode_surfaces(out + 28, payload, see, &seen), 0);
    assert_int_equal(seen.n, 3);
    assert_int_equal(seen.first, 3);
    assert_int_equal(strlen(seen.last), 257);
    /* nothing is called for a payload that is wrong at its end */
    seen.n = 0;
    assert_int_equal(native_decode_surfaces(out + 28, payload - 1, see, &seen), SH_EFORMAT);
    out[28 + 2] = 1; /* first label beyond 65534 */
    assert_int_equal(native_decode_surfaces(out + 28, payload, see, &seen), SH_EFORMAT);
    assert_int_equal(seen.n, 0);
}

static void test_surfaces_split(void **state)
{
    (void)state;
    struct seen seen = {0};
    uint32_t done;
    strcpy(names[0], "wall");
    strcpy(names[1], "door");
    strcpy(names[2], "roof"); /* 7 bytes each with their material */
    size_t len = native_encode_surfaces(out, sizeof out, 0, 100, 8 + 7 * 10 + 6, name_of, NULL, 1, 0, &done);
    assert_int_equal(done, 10);
    assert_int_equal(len, 28 + 8 + 70);
    assert_int_equal(native_decode_surfaces(out + 28, 78, see, &seen), 0);
    assert_string_equal(seen.last, "wall|m");
    assert_int_equal(native_encode_surfaces(out, sizeof out, 0, 1, 14, name_of, NULL, 1, 0, &done), 0);
    assert_int_equal(done, 0);
    assert_int_equal(native_encode_surfaces(out, 28 + 8, 0, 0, 4096, name_of, NULL, 1, 0, &done), 36);
    memset(names[0], 'n', 256);
    names[0][256] = 0; /* a length that has no byte */
    assert_int_equal(native_encode_surfaces(out, sizeof out, 0, 1, 4096, name_of, NULL, 1, 0, &done), 0);
}

/* ---- points */

static uint32_t block_a[BLOCK_MAX], block_b[BLOCK_MAX], block_c[BLOCK_MAX], block_dt[BLOCK_MAX];
static int16_t block_refl[BLOCK_MAX];
static uint16_t block_label[BLOCK_MAX];
static uint8_t block_echo[BLOCK_MAX];

static struct line_block make_block(uint32_t n_points)
{
    struct line_block block = {.frame = 3,
                               .line = 0xfffffffe,
                               .pulse0 = UINT64_C(1) << 40,
                               .n_pulses = 0,
                               .t0_ns = INT64_C(1) << 50,
                               .line_t0_ns = (INT64_C(1) << 50) - 77,
                               .layout = LINE_GEO,
                               .n_points = n_points,
                               .capacity = BLOCK_MAX,
                               .dt_ns = block_dt,
                               .a = block_a,
                               .b = block_b,
                               .c = block_c,
                               .refl_cdb = block_refl,
                               .echo = block_echo,
                               .label = block_label};
    return block;
}

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

static void test_empty_block(void **state)
{
    (void)state;
    struct line_block block = make_block(0);
    struct native_points head;
    assert_int_equal(native_encode_points(out, sizeof out, &block, 0), 68);
    assert_int_equal(native_decode_points(out + 28, 40, &head), 0);
    assert_int_equal(head.n_points, 0);
}

/* Pulses of 1..15 echoes, in blocks of all sizes around the cut: nothing lost, no pulse torn, times and
 * numbers right. */
static void check_cut(uint32_t n_points, uint32_t echoes)
{
    struct line_block block = make_block(n_points);
    for (uint32_t i = 0; i < n_points; i++) {
        block_a[i] = i;
        block_echo[i] = (uint8_t)((i % echoes + 1) | echoes << 4);
        block_dt[i] = i / echoes * 500;
    }
    block.n_pulses = (n_points + echoes - 1) / echoes;
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

/* ---- the parser */

struct piece {
    size_t at, len;
    int is_text;
};

static uint8_t stream[STREAM_MAX];
static size_t stream_len;
static struct piece piece[ITEMS_MAX];
static int n_pieces;
static uint32_t next_seq;

static void add_frame(size_t len)
{
    next_seq = (stream[stream_len + 3] & NATIVE_LOCAL) != 0 ? next_seq : next_seq + 1;
    native_seal(stream + stream_len, (stream[stream_len + 3] & NATIVE_LOCAL) != 0 ? 0 : next_seq - 1);
    /* a frame that ends like the next begins can't be told from one that lost its first byte */
    assert_int_not_equal(stream[stream_len + len - 1], NATIVE_SYNC);
    piece[n_pieces++] = (struct piece){stream_len, len, 0};
    stream_len += len;
}

static void add_text(const char *text)
{
    size_t len = strlen(text);
    memcpy(stream + stream_len, text, len);
    piece[n_pieces++] = (struct piece){stream_len, len, 1};
    stream_len += len;
}

static void add_points(uint32_t n, uint32_t salt)
{
    struct line_block block = make_block(n);
    block.n_pulses = n;
    for (uint32_t i = 0; i < n; i++) {
        /* payloads full of sync bytes and of text */
        block_a[i] = 0xd5d5d5d5u;
        block_b[i] = 0x0a0d4b4fu;
        block_c[i] = salt * 2654435761u + i;
        block_refl[i] = (int16_t)salt;
        block_label[i] = 0x03d5;
        block_dt[i] = i;
        block_echo[i] = 0x11;
    }
    add_frame(native_encode_points(stream + stream_len, STREAM_MAX - stream_len, &block, (int64_t)salt));
}

/* 13 frames of all types, some LOCAL, with reply lines between, and seq running over 2^32. */
static void make_stream(void)
{
    stream_len = 0;
    n_pieces = 0;
    next_seq = UINT32_MAX - 4;
    struct native_descriptor d = make_descriptor();
    struct native_anchor a = make_anchor();
    struct native_telemetry t = {.state = 4, .pulses = 0xd5d5};
    struct native_event e = {.code = NATIVE_EV_SCAN_START, .a = 1, .text = "OK\r\n\xd5"};
    struct line_end end = {.line = 0xd5, .n_cast = 5};
    uint32_t done;
    strcpy(names[0], "wall");
#define AT stream + stream_len, STREAM_MAX - stream_len
    add_text("Maker,Model,SN1,1.0\r\n");
    add_frame(native_encode_surfaces(AT, 0, 1, 4096, name_of, NULL, 1, 0, &done));
    add_frame(native_encode_descriptor(AT, &d, 1, 0));
    add_frame(native_encode_anchor(AT, &a, 1, 0));
    add_text("OK\r\n");
    add_frame(native_encode_event(AT, &e, 2, 0));
    add_points(3, 1);
    add_points(0, 2);
    add_text("ERR -222,\"Data out of range\"\r\n");
    add_text("1\r\n");
    add_points(5, 3);
    add_frame(native_encode_line_end(AT, &end, 5));
    add_frame(native_encode_event(AT, &e, 6, NATIVE_LOCAL));
    add_frame(native_encode_descriptor(AT, &d, 7, NATIVE_REPEAT));
    add_text("0\r\n");
    add_frame(native_encode_anchor(AT, &a, 7, NATIVE_REPEAT));
    add_points(2, 4);
    add_frame(native_encode_telemetry(AT, &t, 8, 0));
}

static struct native_parser parser;
static struct {
    size_t len;
    uint8_t bytes[512];
} got[ITEMS_MAX];
static int n_got, n_texts;

static void collect(void)
{
    enum native_item item;
    while ((item = native_parser_next(&parser)) != NATIVE_MORE) {
        assert_true(n_got < ITEMS_MAX);
        if (item == NATIVE_TEXT) {
            n_texts++;
            continue;
        }
        got[n_got].len = NATIVE_HEADER_LEN + (size_t)parser.header.length;
        assert_true(got[n_got].len <= sizeof got[0].bytes);
        assert_ptr_equal(parser.payload, parser.frame + NATIVE_HEADER_LEN);
        memcpy(got[n_got++].bytes, parser.frame, NATIVE_HEADER_LEN + (size_t)parser.header.length);
    }
}

static void feed(const uint8_t *data, size_t len, size_t chunk)
{
    while (len > 0) {
        size_t room, n = chunk < len ? chunk : len;
        uint8_t *to = native_parser_room(&parser, &room);
        assert_true(room > 0);
        if (n > room) n = room;
        memcpy(to, data, n);
        native_parser_added(&parser, n);
        collect();
        data += n;
        len -= n;
    }
}

static void begin(void)
{
    native_parser_init(&parser);
    n_got = n_texts = 0;
}

static void finish(void)
{
    native_parser_finish(&parser);
    collect();
}

/* Exactly the frames that [hurt_from, hurt_to) of the stream does not touch, byte by byte, in order. */
static void check_got(size_t hurt_from, size_t hurt_to)
{
    int k = 0;
    for (int i = 0; i < n_pieces; i++) {
        if (piece[i].is_text || (piece[i].at < hurt_to && hurt_from < piece[i].at + piece[i].len)) continue;
        assert_true(k < n_got);
        assert_int_equal(got[k].len, piece[i].len);
        assert_memory_equal(got[k].bytes, stream + piece[i].at, piece[i].len);
        k++;
    }
    assert_int_equal(n_got, k);
}

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

static void test_parser_random_chunks(void **state)
{
    (void)state;
    make_stream();
    uint32_t x = 1;
    for (int run = 0; run < 300; run++) {
        size_t at = 0;
        begin();
        while (at < stream_len) {
            x = x * 1664525u + 1013904223u;
            size_t n = 1 + (x >> 8) % (1u + (uint32_t)run * 4);
            if (n > stream_len - at) n = stream_len - at;
            feed(stream + at, n, n);
            at += n;
        }
        check_got(0, 0);
        assert_int_equal(n_texts, 5);
    }
}

/* How many counted frames a hurt range costs, from the layout of the stream: a jump is only seen between good
 * ones. */
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
    for (size_t i = 0; i < sizeof chunks / sizeof chunks[0]; i++) {
        begin();
        feed(bytes, len, chunks[i]);
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

static void test_parser_every_byte_deleted(void **state)
{
    (void)state;
    static uint8_t hurt[STREAM_MAX];
    make_stream();
    for (size_t at = 0; at < stream_len; at++) {
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
    for (size_t at = 0; at <= stream_len; at++) {
        memcpy(hurt, stream, at);
        hurt[at] = added[at % 3];
        /* a byte like a neighbour could as well stand on that neighbour's other side, outside the frame */
        while (at < stream_len && (hurt[at] == stream[at] || (at > 0 && hurt[at] == stream[at - 1])))
            hurt[at]++;
        memcpy(hurt + at + 1, stream + at, stream_len - at);
        /* a byte before the first byte of a frame hurts nothing */
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
    for (size_t at = 0; at < stream_len; at++)
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

/* Losing [from, to) leaves the same bytes as losing that stretch some bytes later, where the bytes after both
 * ends are equal, or earlier, where those before are (headers begin alike, payloads end in zeros). If such a
 * shift makes the loss begin where a piece ends, or end where one begins, that piece is whole after all; the
 * first of two takes the bytes. */
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
    for (int run = 0; run < 3000; run++) {
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

static void test_parser_length_refused(void **state)
{
    (void)state;
    make_stream();
    begin();
    uint8_t bad[28] = {NATIVE_SYNC, NATIVE_POINTS, 1, 0, 1, 0, 1, 0}; /* 65537 bytes */
    native_seal(bad, 0);
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
    /* out of step: a line is not taken for a reply */
    feed((const uint8_t *)"OK\r\n", 4, 4);
    assert_int_equal(n_texts, 0);
}

static void test_seq_jumps_back(void **state)
{
    (void)state;
    struct native_telemetry t = {0};
    size_t len = native_encode_telemetry(out, sizeof out, &t, 0, 0);
    static const uint32_t seq[] = {10, 11, 15, 0, 1, 1};
    begin();
    for (size_t i = 0; i < 6; i++) {
        assert_int_equal(native_seal(out, seq[i]), len);
        feed(out, len, len);
    }
    /* 15 after 11: three lost; 0 after 15 and 1 after 1: jumps back, nobody knows */
    assert_int_equal(parser.stats.seq_gaps, 3);
    assert_int_equal(parser.stats.seq_lost, 3);
}

/* Garbage made to be slow: sync bytes only, and headers without payload whose length hides what follows. The
 * work is counted in CRC checks: the parser reads a good header at most once per frame start, so the number
 * is bounded. */
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

/* PROTOCOL.md, 8 poses: each byte of a pose where the table says, and what is refused. */
static void test_poses(void **state)
{
    (void)state;
    const struct native_pose pose[2] = {
        {.t_ns = -2, .position_m = {1.0, -2.5, 1e-3}, .quat = {1, 0, 0, 0}, .frame = 7.25, .flags = 3},
        {.t_ns = INT64_C(0x123456789a), .position_m = {4, 5, 6}, .quat = {0.6, 0, 0, -0.8}, .frame = 8},
    };
    uint8_t *payload = out + NATIVE_HEADER_LEN;
    struct native_pose back;
    uint32_t n;
    size_t len = native_encode_poses(out, sizeof out, pose, 2, 99, 0);
    assert_int_equal(len, NATIVE_HEADER_LEN + 8 + 2 * 80);
    assert_int_equal(out[1], 8);
    static const uint8_t head[8] = {2};
    assert_memory_equal(payload, head, 8);
    const uint8_t *second = payload + 8 + 80;
    assert_true(le_get64(second) == 0x123456789a);
    static const double want[] = {4, 5, 6, 0.6, 0, 0, -0.8, 8};
    for (int i = 0; i < 8; i++) {
        uint64_t bits;
        memcpy(&bits, &want[i], sizeof bits);
        assert_true(le_get64(second + 8 + 8 * (size_t)i) == bits);
    }
    assert_int_equal(le_get32(payload + 8 + 72), 3);
    assert_int_equal(le_get32(payload + 8 + 76), 0);
    size_t body = len - NATIVE_HEADER_LEN;
    assert_int_equal(native_decode_poses(payload, body, &n), 0);
    assert_int_equal(n, 2);
    native_decode_pose(payload, 0, &back);
    assert_memory_equal(&back, &pose[0], sizeof back);
    assert_int_equal(native_decode_poses(payload, body - 1, &n), SH_EFORMAT);
    assert_int_equal(native_decode_poses(payload, 7, &n), SH_EFORMAT);
    assert_int_equal(native_encode_poses(out, len - 1, pose, 2, 99, 0), 0);
    assert_int_equal(native_encode_poses(out, sizeof out, pose, NATIVE_MAX_POSES + 1, 99, 0), 0);
    struct native_pose wrong[2] = {pose[0], pose[1]};
    wrong[1].t_ns = wrong[0].t_ns; /* times rise */
    native_encode_poses(out, sizeof out, wrong, 2, 99, 0);
    assert_int_equal(native_decode_poses(payload, body, &n), SH_EFORMAT);
    wrong[1] = pose[1];
    wrong[1].quat[0] = 0.7; /* a rotation */
    native_encode_poses(out, sizeof out, wrong, 2, 99, 0);
    assert_int_equal(native_decode_poses(payload, body, &n), SH_EFORMAT);
    native_encode_poses(out, sizeof out, pose, 1, 99, 0); /* one alone says nothing of the time around it */
    assert_int_equal(native_decode_poses(payload, 8 + 80, &n), SH_EFORMAT);
}

static void test_is_hashed(void **state)
{
    (void)state;
    for (int type = 0; type < 256; type++)
        for (int flags = 0; flags < 8; flags++) {
            struct native_header h = {.type = (uint8_t)type, .flags = (uint8_t)flags};
            int want =
                ((type >= 1 && type <= 4) || type == NATIVE_POSES || type == NATIVE_ATTRIBUTES) && (flags & 3) == 0;
            assert_int_equal(native_is_hashed(&h), want);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_descriptor),
        cmocka_unit_test(test_descriptor_refused),
        cmocka_unit_test(test_anchor),
        cmocka_unit_test(test_line_end),
        cmocka_unit_test(test_telemetry),
        cmocka_unit_test(test_event),
        cmocka_unit_test(test_surfaces),
        cmocka_unit_test(test_surfaces_split),
        cmocka_unit_test(test_point_extremes),
        cmocka_unit_test(test_empty_block),
        cmocka_unit_test(test_points_cut),
        cmocka_unit_test(test_parser_whole),
        cmocka_unit_test(test_parser_random_chunks),
        cmocka_unit_test(test_parser_every_byte_deleted),
        cmocka_unit_test(test_parser_every_byte_flipped),
        cmocka_unit_test(test_parser_every_byte_added),
        cmocka_unit_test(test_parser_every_late_start),
        cmocka_unit_test(test_parser_every_cut),
        cmocka_unit_test(test_parser_lost_stretches),
        cmocka_unit_test(test_parser_length_refused),
        cmocka_unit_test(test_parser_biggest_frame),
        cmocka_unit_test(test_parser_text_limits),
        cmocka_unit_test(test_seq_jumps_back),
        cmocka_unit_test(test_parser_resync_cost),
        cmocka_unit_test(test_is_hashed),
        cmocka_unit_test(test_poses),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
