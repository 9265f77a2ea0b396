/* SPDX-License-Identifier: MIT */
/* libscanhead: a frame of points depends on other frames. The tests cover its anchor and until when that holds, the
 * frames that follow it, its emitter, the head's clock, and the turn between two poses. */
#include <math.h>

#include "tests/unit/host_rig.h"

/* Sends the frame in `out`, with the next number, after `lost` others. */
static void put(int fd, size_t len, int lost)
{
    uint32_t seq = rig_next_seq();
    while (lost-- > 0)
        seq = rig_next_seq();
    native_finish_frame(out, seq);
    put_all(fd, out, len);
}

static void put_anchor_of(int fd, const struct native_anchor *anchor)
{
    put(fd, native_encode_anchor(out, sizeof out, anchor, 1, 0), 0);
}

static void expect_points(struct scanhead *sh, struct scanhead_frame *f, struct scanhead_point *p, int n)
{
    do
        assert_int_equal(scanhead_next(sh, f, WAIT_MS), 0);
    while (f->type != SCANHEAD_POINTS);
    assert_int_equal(scanhead_points(sh, f, 0, p, MAX_POINTS), n);
}

/* A station is 1e-4 degrees from the antimeridian, on either side. Points are 2e-4 degrees away, across it. */
static void test_antimeridian(void **state)
{
    (void)state;
    for (int side = -1; side <= 1; side += 2) {
        int head;
        struct scanhead *sh = open_pair(&head);
        struct scanhead_frame f;
        struct scanhead_point p[2];
        struct native_anchor anchor = make_anchor();
        anchor.crs = NATIVE_CRS_GEODETIC;
        anchor.epsg = 4979;
        memcpy(anchor.anchor, (double[3]){49.0, side * 179.9999, 400.0}, sizeof anchor.anchor);
        memcpy(anchor.scale, (double[3]){1e-9, 1e-9, 1e-5}, sizeof anchor.scale);
        memset(echo, 0x11, sizeof echo);
        for (int i = 0; i < 2; i++) {
            a[i] = c[i] = 0;
            b[i] = (uint32_t)(int32_t)(i == 0 ? 0 : side * 200000);
        }
        put_descriptor(head, 1, 1, 0);
        put_anchor_of(head, &anchor);
        put_points(head, 2, 0);
        expect_points(sh, &f, p, 2);
        assert_true(fabs(p[0].y - side * 179.9999) < 1e-12);
        assert_true(fabs(p[1].y + side * 179.9999) < 1e-12); /* 180.0001 the other way round */
        /* 2e-4 degrees of the parallel: 14.6 m at 49 degrees; and no way round the Earth */
        assert_true(p[1].range_m > 14.0 && p[1].range_m < 15.0);
        close(head);
        scanhead_close(sh);
    }
}

/* An anchor is for points before until_ms. A point at that very time has another anchor, which did not come. */
static void test_until(void **state)
{
    (void)state;
    for (uint32_t until_ms = 1; until_ms <= 2; until_ms++) {
        int head;
        struct scanhead *sh = open_pair(&head);
        struct scanhead_frame f;
        struct scanhead_point p[1];
        struct native_anchor anchor = make_anchor();
        anchor.until_ms = until_ms;
        put_descriptor(head, 0, 1, 0);
        put_anchor_of(head, &anchor);
        put_points(head, 1, 0); /* at 1 ms */
        for (int i = 0; i < 3; i++)
            assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
        assert_int_equal(scanhead_points(sh, &f, 0, p, 1), until_ms == 1 ? SCANHEAD_ESTATE : 1);
        close(head);
        scanhead_close(sh);
    }
}

/* Points have attributes and colours: a frame of each follows. One of the frames is left out, at `lost`. */
static void put_with_attributes(int fd, int lost)
{
    static int16_t amplitude[MAX_POINTS];
    static uint16_t width[MAX_POINTS];
    static uint8_t rgb[MAX_POINTS][3];
    struct line_block block = make_block(3, 0);
    block.amplitude_cdb = amplitude;
    block.width_cns = width;
    block.rgb = rgb;
    const size_t all = native_encode_points(out, sizeof out, &block, 500);
    static uint8_t copy[1 << 18];
    memcpy(copy, out, all);
    int number = 0;
    for (size_t at = 0, len; at < all; at += len, number++) {
        len = native_frame_len(copy + at);
        memcpy(out, copy + at, len);
        native_finish_frame(out, rig_next_seq());
        if (number != lost) put_all(fd, out, len);
    }
    assert_int_equal(number, 3);
}

static void expect_both(struct scanhead *sh, int want)
{
    struct scanhead_frame f;
    struct scanhead_attribute attribute[3];
    struct scanhead_colour colour[3];
    expect_frame(sh, SCANHEAD_ATTRIBUTES, &f);
    assert_int_equal(scanhead_attributes(sh, &f, 0, attribute, 3), want);
    expect_frame(sh, SCANHEAD_COLOURS, &f);
    assert_int_equal(scanhead_colours(sh, &f, 0, colour, 3), want);
}

/* The same points are sent twice, and lost the second time. What follows then does not belong to the first ones. */
static void test_followers(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct native_descriptor d = make_descriptor(0, 1);
    d.content = NATIVE_HAS_ATTRIBUTES | NATIVE_HAS_COLOURS;
    put(head, native_encode_descriptor(out, sizeof out, &d, 1, 0), 0);
    put_anchor(head, 0);
    put_with_attributes(head, -1);
    put_with_attributes(head, 0);
    for (int i = 0; i < 2; i++)
        assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    expect_both(sh, 3);
    expect_both(sh, SCANHEAD_ESTATE);
    close(head);
    scanhead_close(sh);
}

/* A scan without a frame of its emitter is that of a line head, whatever the one before was. */
static void test_emitter(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_emitter e;
    const struct native_emitter sphere = {.kind = NATIVE_EMIT_SPHERE,
                                          .steps = 360,
                                          .turn = 1,
                                          .rings = 181,
                                          .sequence_ns_den = 1,
                                          .first_ring_udeg = -90000000};
    put_descriptor(head, 0, 1, 0);
    put(head, native_encode_emitter(out, sizeof out, &sphere, NULL, 1, 0), 0);
    put_anchor(head, 0);
    put_descriptor(head, 0, 1, NATIVE_REPEAT);
    put_descriptor(head, 0, 2, 0);
    for (int i = 0; i < 4; i++)
        assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
    assert_int_equal(scanhead_get_emitter(sh, &e), 0);
    assert_int_equal(e.kind, NATIVE_EMIT_SPHERE);
    assert_true(e.rings == 181 && e.ring_step_deg == 1.0);
    expect_frame(sh, SCANHEAD_DESCRIPTOR, &f);
    assert_int_equal(scanhead_get_emitter(sh, &e), 0);
    assert_int_equal(e.kind, NATIVE_EMIT_LINE);
    close(head);
    scanhead_close(sh);
}

/* A client reads each figure of an emitter, with every beam of its firing sequence from the first to the last. */
static void test_beams(void **state)
{
    (void)state;
    enum { N = 3 };
    static const struct native_beam beam[N] = {{-15000000, 1500000, 0}, {1000000, -250000, 2304}, {15000001, 0, 4608}};
    const struct native_emitter emitter = {.kind = NATIVE_EMIT_BEAMS,
                                           .steps = 0,
                                           .turn = -1,
                                           .echoes = 3,
                                           .n_beams = N,
                                           .sequence_ns_num = 55296,
                                           .sequence_ns_den = 7};
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_emitter is;
    assert_int_equal(scanhead_get_emitter(sh, &is), SCANHEAD_ESTATE);
    put_descriptor(head, 0, 1, 0);
    put(head, native_encode_emitter(out, sizeof out, &emitter, beam, 1, 0), 0);
    for (int i = 0; i < 2; i++)
        assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
    assert_int_equal(scanhead_get_emitter(sh, &is), 0);
    assert_int_equal(is.kind, SCANHEAD_EMIT_BEAMS);
    assert_int_equal(is.steps, 0);
    assert_int_equal(is.turn, -1);
    assert_int_equal(is.echoes, 3);
    assert_true(is.sequence_ns_num == 55296 && is.sequence_ns_den == 7);
    assert_int_equal(is.n_beams, N);
    for (int i = 0; i < N; i++) {
        assert_true(fabs(is.beam[i].elevation_deg - 1e-6 * beam[i].elevation_udeg) < 1e-12);
        assert_true(fabs(is.beam[i].azimuth_deg - 1e-6 * beam[i].azimuth_udeg) < 1e-12);
        assert_int_equal(is.beam[i].offset_ns, beam[i].offset_ns);
    }
    close(head);
    scanhead_close(sh);
}

/* Each of the three events has the head's clock: PPS in whole seconds, the others in ns. Adjusted standard GPS time is
 * 1e9 s less. */
static void test_clock(void **state)
{
    (void)state;
    static const struct {
        uint32_t code;
        uint64_t gps;
    } row[] = {{NATIVE_EV_SCAN_START, 1400000000u * UINT64_C(1000000000)},
               {NATIVE_EV_TIME, 1400000000u * UINT64_C(1000000000)},
               {NATIVE_EV_PPS, 1400000000u}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        int head;
        struct scanhead *sh = open_pair(&head);
        struct scanhead_frame f;
        double gps_s;
        put_descriptor(head, 0, 1, 0);
        put_anchor(head, 0);
        put_event(head, NATIVE_EV_SCAN_START, 1, 2000000000u, 0, 0); /* of a head without that clock */
        put_event(head, row[i].code, 1, 2000000000u, row[i].gps, 0); /* at 2 s of device time */
        for (int k = 0; k < 3; k++)
            assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
        assert_int_equal(scanhead_gps_time(sh, 0, &gps_s), SCANHEAD_ESTATE);
        assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
        assert_int_equal(scanhead_gps_time(sh, 500000000, &gps_s), 0); /* the scan began at 2 s, too */
        assert_true(fabs(gps_s - 400000000.5) < 1e-6);
        close(head);
        scanhead_close(sh);
    }
}

/* Quaternions q and -q are one rotation. Between two poses the head turns by 30 degrees about z, not by 330. */
static void test_short_turn(void **state)
{
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        int head;
        struct scanhead *sh = open_pair(&head);
        struct scanhead_frame f;
        struct scanhead_pose at;
        const double half = 0.5 * 30.0 * M_PI / 180.0;
        const struct native_pose pose[2] = {
            {.t_ns = 0, .quat = {1, 0, 0, 0}},
            {.t_ns = 1000, .position_m = {1, 0, 0}, .quat = {sign * cos(half), 0, 0, sign * sin(half)}}};
        put_descriptor(head, 0, 1, 0);
        put_anchor(head, 0);
        put(head, native_encode_poses(out, sizeof out, pose, 2, 1, 0), 0);
        for (int i = 0; i < 3; i++)
            assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
        assert_int_equal(scanhead_pose(sh, 500, &at), 0);
        assert_true(fabs(fabs(at.quat[0]) - cos(0.5 * half)) < 1e-15); /* some roundings of numbers below 1 */
        assert_true(fabs(at.quat[3] * at.quat[0] - sin(0.5 * half) * cos(0.5 * half)) < 1e-15);
        assert_true(at.position_m[0] == 0.5);
        close(head);
        scanhead_close(sh);
    }
}

/* A client reads the poses of a frame as they were sent: all, some from one on, or none beyond the last. */
static void test_poses(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_pose is[4];
    const struct native_pose pose[3] = {
        {.t_ns = 5, .position_m = {1, 2, 3}, .quat = {1, 0, 0, 0}, .frame = 0.5},
        {.t_ns = 7, .position_m = {4, 5, 6}, .quat = {0, 1, 0, 0}, .frame = 1.5, .flags = 1},
        {.t_ns = 9, .position_m = {7, 8, 9}, .quat = {0, 0, 0, 1}, .frame = 2.5}};
    put_descriptor(head, 0, 1, 0);
    put_anchor(head, 0);
    put(head, native_encode_poses(out, sizeof out, pose, 3, 1, 0), 0);
    for (int i = 0; i < 3; i++)
        assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
    assert_int_equal(f.type, SCANHEAD_POSES);
    for (uint32_t first = 0; first < 5; first++)
        for (uint32_t max = 0; max < 5; max++) {
            const uint32_t left = first < 3 ? 3 - first : 0, n = max < left ? max : left;
            memset(is, 0, sizeof is);
            assert_int_equal(scanhead_poses(sh, &f, first, is, max), n);
            for (uint32_t i = 0; i < n; i++) {
                const struct native_pose *want = &pose[first + i];
                assert_true(is[i].t_ns == want->t_ns && is[i].frame == want->frame);
                assert_int_equal(is[i].flags, want->flags);
                assert_memory_equal(is[i].position_m, want->position_m, sizeof want->position_m);
                assert_memory_equal(is[i].quat, want->quat, sizeof want->quat);
            }
            if (n < 4) assert_int_equal(is[n].t_ns, 0);
        }
    put_anchor(head, 0);
    assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
    assert_int_equal(scanhead_poses(sh, &f, 0, is, 4), SCANHEAD_EINPUT); /* no frame of poses */
    close(head);
    scanhead_close(sh);
}

/* A client reads each figure of the end of a line, and no other frame for one. */
static void test_line_end(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_line_end is;
    const struct line_end end = {.frame = 2,
                                 .line = 3,
                                 .pulse0 = 4000000000000,
                                 .t0_ns = 5000,
                                 .t1_ns = 6000,
                                 .n_fired = 70,
                                 .n_cast = 60,
                                 .n_echoes = 90,
                                 .mirror_count = 10,
                                 .pan_count = 11,
                                 .status = 12,
                                 .n_crowded = 13,
                                 .n_faint = 14,
                                 .n_unfit = 15};
    put_descriptor(head, 0, 1, 0);
    put(head, native_encode_line_end(out, sizeof out, &end, 1), 0);
    assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
    assert_int_equal(scanhead_line_end(sh, &f, &is), SCANHEAD_EINPUT);
    assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
    assert_int_equal(f.type, SCANHEAD_LINE_END);
    assert_int_equal(scanhead_line_end(sh, &f, &is), 0);
    assert_true(is.scan_frame == 2 && is.scan_line == 3 && is.pulse0 == 4000000000000);
    assert_true(is.t0_ns == 5000 && is.t1_ns == 6000);
    assert_true(is.n_fired == 70 && is.n_cast == 60 && is.n_echoes == 90);
    assert_true(is.mirror_count == 10 && is.pan_count == 11 && is.status == 12);
    assert_true(is.n_crowded == 13 && is.n_faint == 14 && is.n_unfit == 15);
    close(head);
    scanhead_close(sh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_antimeridian), cmocka_unit_test(test_until),    cmocka_unit_test(test_followers),
        cmocka_unit_test(test_emitter),      cmocka_unit_test(test_clock),    cmocka_unit_test(test_short_turn),
        cmocka_unit_test(test_poses),        cmocka_unit_test(test_line_end), cmocka_unit_test(test_beams),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
