/* SPDX-License-Identifier: MIT */
#include "tests/unit/native_rig.h"

uint64_t wire(const uint8_t *p, size_t at, int bytes)
{
    uint64_t v = 0;
    for (int i = bytes - 1; i >= 0; i--)
        v = v << 8 | p[at + (size_t)i];
    return v;
}

double wire_double(const uint8_t *p, size_t at)
{
    uint64_t v = wire(p, at, 8);
    double d;
    memcpy(&d, &v, sizeof d);
    return d;
}

void check_frame(const uint8_t *frame, size_t len, int type, int flags, size_t payload_len, int64_t t_ns)
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

struct native_descriptor make_descriptor(void)
{
    struct native_descriptor d;
    memset(&d, 0xee, sizeof d); /* bytes after a NUL must not reach the wire */
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
    d.content = d.reserved = 0; /* these are not sent; test_native_attributes has them */
    return d;
}

struct native_anchor make_anchor(void)
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

char names[3][300];

void name_of(void *ctx, uint32_t label, const char **object, const char **material)
{
    (void)ctx;
    *object = names[label % 3];
    *material = "m";
}

uint32_t block_a[BLOCK_MAX], block_b[BLOCK_MAX], block_c[BLOCK_MAX], block_dt[BLOCK_MAX];
int16_t block_refl[BLOCK_MAX];
uint16_t block_label[BLOCK_MAX];
uint8_t block_echo[BLOCK_MAX];

struct line_block make_block(uint32_t n_points)
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

struct line_block make_pulses(uint32_t n_points, uint32_t echoes)
{
    struct line_block block = make_block(n_points);
    for (uint32_t i = 0; i < n_points; i++) {
        block_a[i] = i;
        block_dt[i] = i / echoes * 500;
        block_echo[i] = (uint8_t)((i % echoes + 1) | echoes << 4);
    }
    block.line = 77;
    block.pulse0 = UINT64_C(0x123456789a);
    block.n_pulses = (n_points + echoes - 1) / echoes;
    block.t0_ns = 1000;
    return block;
}
