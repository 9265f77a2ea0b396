/* SPDX-License-Identifier: MIT */
/* libscanhead: what it says of the head, field by field, after frames whose fields all differ. */
#include <math.h>

#include "core/bytes.h"
#include "tests/unit/host_rig.h"

static int head;

static void put_next(size_t len)
{
    assert_true(len != 0);
    native_finish_frame(out, rig_next_seq());
    put_all(head, out, len);
}

static void take(struct scanhead *sh)
{
    struct scanhead_frame f;
    assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
}

static void expect_numbers(const double *seen, double first, int n)
{
    for (int i = 0; i < n; i++)
        assert_true(seen[i] == first + i);
}

/* Units on the wire are micro-hertz and micro-degrees (DESCRIPTOR.md), here hertz and degrees. */
static void test_info(void **state)
{
    (void)state;
    struct scanhead *sh = open_pair(&head);
    struct native_descriptor d = make_descriptor(0, 12);
    struct native_anchor anchor = {.crs = NATIVE_CRS_UTM,
                                   .epsg = 32633,
                                   .station = 7,
                                   .moving = NATIVE_STOP,
                                   .scale_m = 0.25,
                                   .lat_deg = -1,
                                   .lon_deg = -2,
                                   .height_m = -3,
                                   .heights = NATIVE_HEIGHTS_GEOID,
                                   .frame = 0.5};
    struct scanhead_info info;
    for (int i = 0; i < 9; i++) {
        anchor.rotation[i] = 20 + i;
        anchor.axes[i] = 40 + i;
        if (i >= 3) continue;
        anchor.anchor[i] = 60 + i;
        anchor.station_m[i] = 70 + i;
        anchor.scale[i] = 80 + i;
    }
    d.prr_uhz = 3500000;
    d.lines_uhz = 4500000;
    d.pan_udeg_s = 5500000;
    d.n_surfaces = 6;
    for (int moving = 0; moving < 2; moving++) {
        if (moving) anchor.moving = NATIVE_MOVING;
        put_next(native_encode_descriptor(out, sizeof out, &d, 1, 0));
        put_next(native_encode_anchor(out, sizeof out, &anchor, 1, 0));
        take(sh);
        take(sh);
        memset(&info, 0xa5, sizeof info);
        assert_int_equal(scanhead_get_info(sh, &info), SCANHEAD_OK);
        assert_string_equal(info.idn, "Maker,Model,SN1,1.0");
        assert_string_equal(info.profile, "model");
        assert_true(info.geo == 0 && info.crs == (int)NATIVE_CRS_UTM && info.epsg == 32633 && info.geoid_heights == 1);
        assert_true(info.prr_hz == 3.5 && info.lines_hz == 4.5 && info.pan_deg_s == 5.5);
        assert_true(info.range_min_m == 1.5 && info.range_max_m == 600 && info.scale_m == 0.25);
        assert_true(info.lat_deg == -1 && info.lon_deg == -2 && info.height_m == -3 && info.frame == 0.5);
        assert_true(info.station == 7 && info.n_surfaces == 6 && info.frames == 9 && info.scan == 12);
        assert_true(info.moving == moving && info.stop == !moving);
        expect_numbers(info.rotation, 20, 9);
        expect_numbers(info.axes, 40, 9);
        expect_numbers(info.anchor, 60, 3);
        expect_numbers(info.station_m, 70, 3);
        expect_numbers(info.scale, 80, 3);
    }
    close(head);
    scanhead_close(sh);
}

static struct scanhead_emitter emitter_of(struct scanhead *sh, const struct native_emitter *e,
                                          const struct native_beam *beams)
{
    static const struct scanhead_emitter none;
    struct scanhead_emitter got;
    put_next(native_encode_emitter(out, sizeof out, e, beams, 1, 0));
    take(sh);
    memset(&got, 0xa5, sizeof got);
    assert_int_equal(scanhead_get_emitter(sh, &got), SCANHEAD_OK);
    for (uint32_t i = e->n_beams; i < SCANHEAD_MAX_BEAMS; i++)
        assert_memory_equal(&got.beam[i], &none.beam[i], sizeof got.beam[i]);
    return got;
}

static void test_emitter(void **state)
{
    (void)state;
    static const struct scanhead_emitter none;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_emitter got;
    const struct native_emitter e = {.kind = NATIVE_EMIT_BEAMS,
                                     .n_beams = 2,
                                     .steps = 3,
                                     .first_step = 4,
                                     .last_step = 5,
                                     .front_step = 6,
                                     .turn = -1,
                                     .rings = 8,
                                     .sequence_ns_num = 9,
                                     .sequence_ns_den = 10,
                                     .first_ring_udeg = -1500000,
                                     .echoes = NATIVE_ECHOES_LAST};
    const struct native_beam beams[] = {{-15000000, 250000, 0}, {1000000, -500000, 2304}};
    memset(&got, 0xa5, sizeof got);
    assert_int_equal(scanhead_get_emitter(sh, &got), SCANHEAD_ESTATE);
    assert_memory_equal(&got, &none, sizeof got);
    put_descriptor(head, 0, 1, 0);
    take(sh);
    memset(&got, 0xa5, sizeof got);
    assert_int_equal(scanhead_get_emitter(sh, &got), SCANHEAD_OK); /* no emitter frame: a mirror sweeps lines */
    assert_int_equal(got.kind, SCANHEAD_EMIT_LINE);
    assert_true(got.n_beams == 0 && got.steps == 0 && got.rings == 0);
    got = emitter_of(sh, &e, beams);
    assert_true(got.kind == SCANHEAD_EMIT_BEAMS && got.steps == 3 && got.first_step == 4 && got.last_step == 5);
    assert_true(got.front_step == 6 && got.turn == -1 && got.rings == 8 && got.echoes == 2 && got.n_beams == 2);
    assert_true(got.sequence_ns_num == 9 && got.sequence_ns_den == 10);
    assert_true(got.first_ring_deg == -1.5 && got.ring_step_deg == 0);
    assert_true(got.beam[0].elevation_deg == -15 && got.beam[0].azimuth_deg == 0.25 && got.beam[0].offset_ns == 0);
    assert_true(got.beam[1].elevation_deg == 1 && got.beam[1].azimuth_deg == -0.5 && got.beam[1].offset_ns == 2304);
    struct native_beam most[SCANHEAD_MAX_BEAMS];
    struct native_emitter full = e;
    full.n_beams = SCANHEAD_MAX_BEAMS;
    for (int i = 0; i < SCANHEAD_MAX_BEAMS; i++)
        most[i] = (struct native_beam){-i * 500000, i * 250000, (uint32_t)i};
    got = emitter_of(sh, &full, most);
    for (int i = 0; i < SCANHEAD_MAX_BEAMS; i++)
        assert_true(fabs(got.beam[i].elevation_deg + 0.5 * i) < 1e-12 &&
                    fabs(got.beam[i].azimuth_deg - 0.25 * i) < 1e-12 && got.beam[i].offset_ns == (uint32_t)i);
    close(head);
    scanhead_close(sh);
}

/* Ring i has the elevation first_ring + 180 i / gaps; gaps 0 stands for rings - 1 (DESCRIPTOR.md). The first elevation,
 * rounded on the wire, is -90 + 180 j / gaps with a whole j. */
static void test_rings(void **state)
{
    (void)state;
    static const struct {
        uint32_t rings, gaps;
        int64_t first_udeg;
        double first_deg, step_deg;
    } rows[] = {
        {181, 0, -90000000, -90, 1},
        {2, 0, -90000000, -90, 180},
        {541, 0, -90000000, -90, 180.0 / 540},
        {100, 540, -33333333, -100.0 / 3, 180.0 / 540},
        {100, 540, -33666667, -101.0 / 3, 180.0 / 540},
        {1, 180, 45000000, 45, 1},
        {1, 0, 12345678, 12.345678, 0}, /* a circle */
        {0, 180, 0, 0, 1},
        {0, 0, 1000000, 1, 0},
    };
    struct scanhead *sh = open_pair(&head);
    put_descriptor(head, 0, 1, 0);
    take(sh);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct native_emitter e = {.kind = NATIVE_EMIT_SPHERE,
                                         .steps = 360,
                                         .sequence_ns_num = 1,
                                         .sequence_ns_den = 1,
                                         .turn = 1,
                                         .rings = rows[i].rings,
                                         .gaps = rows[i].gaps,
                                         .first_ring_udeg = rows[i].first_udeg};
        const struct scanhead_emitter got = emitter_of(sh, &e, NULL);
        assert_true(fabs(got.ring_step_deg - rows[i].step_deg) < 1e-12); /* some roundings of double */
        assert_true(fabs(got.first_ring_deg - rows[i].first_deg) < 1e-12);
    }
    close(head);
    scanhead_close(sh);
}

/* Losses that the head reports. The events OVERRUN and SCAN_END count the same lost pulses. A reader's count begins
 * anew with a new connection. */
static void test_losses(void **state)
{
    (void)state;
    static const struct {
        uint32_t code;
        uint64_t b, c, pulses_lost, reader_lost;
    } rows[] = {
        {NATIVE_EV_OVERRUN, 10, 90, 10, 0},     {NATIVE_EV_OVERRUN, 5, 90, 15, 0},
        {NATIVE_EV_SCAN_END, 90, 15, 15, 0},    {NATIVE_EV_SCAN_END, 90, 7, 22, 0},
        {NATIVE_EV_OVERRUN, 8, 0, 23, 0},       {NATIVE_EV_READER_LOST, 90, 4, 23, 4},
        {NATIVE_EV_READER_LOST, 90, 9, 23, 9},  {NATIVE_EV_READER_LOST, 90, 9, 23, 9},
        {NATIVE_EV_READER_LOST, 90, 2, 23, 11}, {NATIVE_EV_READER_LOST, 90, 3, 23, 12},
        {NATIVE_EV_STATE, 90, 90, 23, 12},
    };
    struct scanhead *sh = open_pair(&head);
    struct scanhead_stats stats;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        put_event(head, rows[i].code, 1, rows[i].b, rows[i].c, 0);
        take(sh);
        scanhead_get_stats(sh, &stats);
        assert_int_equal(stats.pulses_lost, rows[i].pulses_lost);
        assert_int_equal(stats.reader_lost, rows[i].reader_lost);
        assert_int_equal(stats.frames, i + 1);
    }
    close(head);
    scanhead_close(sh);
}

/* An anchor with a limit holds for points before it. The rig's points are 1 ms after the scan's start. */
static void test_anchor_ends(void **state)
{
    (void)state;
    for (uint32_t until_ms = 0; until_ms <= 2; until_ms++) {
        struct scanhead *sh = open_pair(&head);
        struct scanhead_info info;
        struct native_anchor anchor = make_anchor();
        anchor.until_ms = until_ms;
        put_descriptor(head, 1, 1, 0);
        put_next(native_encode_anchor(out, sizeof out, &anchor, 1, 0));
        put_points(head, 1, 0);
        for (int i = 0; i < 3; i++)
            take(sh);
        assert_int_equal(scanhead_get_info(sh, &info), until_ms == 1 ? SCANHEAD_ESTATE : SCANHEAD_OK);
        close(head);
        scanhead_close(sh);
    }
}

/* Adjusted standard GPS time is GPS time less 1e9 s. The scan began at 2 s of the head's clock. */
static void test_gps(void **state)
{
    (void)state;
    const uint64_t s = 1000000000;
    static const struct {
        uint32_t code;
        uint64_t b, c; /* b: device time in ns; c: GPS time in ns, for a PPS in s; 0: not known */
        double gps_s;  /* of 3 s after the scan's start; NAN: not known */
    } rows[] = {
        {NATIVE_EV_SCAN_START, 2000000000, 0, NAN},
        {NATIVE_EV_PPS, 2500000000, 1400000000, 400000002.5},
        {NATIVE_EV_TIME, 1000000000, 1400000000250000000, 400000004.25},
        {NATIVE_EV_SCAN_START, 2000000000, 1500000000750000000, 500000003.75},
        {NATIVE_EV_STATE, 5, 5, 500000003.75},
        {NATIVE_EV_SCAN_START, 2000000000, 0, NAN},
    };
    struct scanhead *sh = open_pair(&head);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        double gps_s = 0;
        const int64_t at_ns = (int64_t)(3 * s);
        put_event(head, rows[i].code, 1, rows[i].b, rows[i].c, 0);
        take(sh);
        assert_int_equal(scanhead_gps_time(sh, at_ns, &gps_s), isnan(rows[i].gps_s) ? SCANHEAD_ESTATE : SCANHEAD_OK);
        if (!isnan(rows[i].gps_s)) assert_true(fabs(gps_s - rows[i].gps_s) < 1e-7); /* half a step of double is 3e-8 */
        assert_int_equal(scanhead_gps_times(sh, &at_ns, 1, &gps_s),
                         isnan(rows[i].gps_s) ? SCANHEAD_ESTATE : SCANHEAD_OK);
    }
    close(head);
    scanhead_close(sh);
}

/* A frame whose sums are right, and whose payload is shorter than the tables of the protocol's pages, is refused. */
static void test_short_payloads(void **state)
{
    (void)state;
    static const struct {
        int type;
        uint32_t least; /* bytes, with no record; 0: any payload is right for this library */
        const char *what;
    } rows[] = {
        {NATIVE_DESCRIPTOR, 272, "a wrong descriptor"},
        {NATIVE_ANCHOR, 280, "a wrong anchor"},
        {NATIVE_POINTS, 40, "wrong points"},
        {NATIVE_EVENT, 128, "a wrong event"},
        {NATIVE_SURFACES, 8, "wrong surface names"},
        {NATIVE_POSES, 8 + 2 * 80, "wrong poses"},
        {NATIVE_ATTRIBUTES, 16, "wrong attributes"},
        {NATIVE_EMITTER, 64, "a wrong emitter"},
        {NATIVE_COLOURS, 16, "wrong colours"},
        {NATIVE_WAVES, 32, "wrong waveforms"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct scanhead *sh = open_pair(&head);
        char want[200], source[100];
        memset(out, 0, 1024);
        out[0] = NATIVE_SYNC;
        out[1] = (uint8_t)rows[i].type;
        out[2] = NATIVE_VERSION;
        le_put32(out + 4, rows[i].least - 1);
        native_reseal(out, NATIVE_HEADER_LEN + rows[i].least - 1);
        put_next(NATIVE_HEADER_LEN + rows[i].least - 1);
        const char *why = expect_refused_frame(sh);
        assert_int_equal(sscanf(why, "%99[^ ]", source), 1);
        snprintf(want, sizeof want, "%s a frame with a good CRC holds %s", source, rows[i].what);
        assert_string_equal(why, want);
        close(head);
        scanhead_close(sh);
    }
}

/* Limits of a descriptor. In the polar layout the scales are positive, and a turn has a count at least. */
static void test_descriptors(void **state)
{
    (void)state;
    static const struct {
        int geo;
        double mirror, pan, scale_m;
        uint32_t n_surfaces;
        const char *what;
    } rows[] = {
        {0, 1, 1, 1e-4, 65535, NULL},
        {0, 0.99, 1, 1e-4, 1, "a polar descriptor without scales"},
        {0, 1, 0.99, 1e-4, 1, "a polar descriptor without scales"},
        {0, 1, 1, 0, 1, "a polar descriptor without scales"},
        {1, 0, 0, 0, 1, NULL},
        {0, 1, 1, 1e-4, 65536, "a descriptor with more surfaces than labels"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct scanhead *sh = open_pair(&head);
        struct scanhead_frame f;
        struct native_descriptor d = make_descriptor(rows[i].geo, 1);
        d.mirror_counts_per_turn = rows[i].mirror;
        d.pan_counts_per_turn = rows[i].pan;
        d.range_scale_m = rows[i].scale_m;
        d.n_surfaces = rows[i].n_surfaces;
        put_next(native_encode_descriptor(out, sizeof out, &d, 1, 0));
        if (rows[i].what != NULL)
            assert_non_null(strstr(expect_refused_frame(sh), rows[i].what));
        else
            assert_int_equal(scanhead_next(sh, &f, WAIT_MS), SCANHEAD_OK);
        close(head);
        scanhead_close(sh);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_info),           cmocka_unit_test(test_emitter),     cmocka_unit_test(test_rings),
        cmocka_unit_test(test_losses),         cmocka_unit_test(test_anchor_ends), cmocka_unit_test(test_gps),
        cmocka_unit_test(test_short_payloads), cmocka_unit_test(test_descriptors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
