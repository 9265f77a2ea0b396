/* SPDX-License-Identifier: MIT */
/* libscanhead: points of both layouts in metres. */
#include <math.h>

#include "tests/unit/host_rig.h"

static int decode(int geo, uint32_t n, struct scanhead_point *points)
{
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    put_descriptor(head, geo, 1, 0);
    put_anchor(head, 0);
    put_points(head, n, 0);
    for (int i = 0; i < 3; i++)
        assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
    int rc = scanhead_points(sh, &f, 0, points, n);
    close(head);
    scanhead_close(sh);
    return rc;
}

static void test_polar_points(void **state)
{
    (void)state;
    static struct scanhead_point p[MAX_POINTS];
    const uint32_t n = 3000;
    uint32_t x = 5;
    for (uint32_t i = 0; i < n; i++) {
        x = x * 1664525u + 1013904223u;
        a[i] = 15000 + (x >> 8) % 6000000;
        x = x * 1664525u + 1013904223u;
        b[i] = (x >> 4) % 3600000;
        x = x * 1664525u + 1013904223u;
        c[i] = (x >> 4) % 7200000;
        dt[i] = i;
        refl[i] = (int16_t)(i * 3);
        label[i] = (uint16_t)i;
        echo[i] = 0x21;
    }
    echo[7] = 0;
    refl[8] = INT16_MIN;
    assert_int_equal(decode(0, n, p), n);
    for (uint32_t i = 0; i < n; i++) {
        long double m = 2 * acosl(-1.0L) * b[i] / 3600000, pan = 2 * acosl(-1.0L) * c[i] / 7200000, r = a[i] * 1e-4L;
        /* the turn around the middle of -40..220 degrees is -90..270 */
        long double shown = b[i] >= 2700000 ? m - 2 * acosl(-1.0L) : m;
        /* count * (1 / counts_per_turn) rounds twice, 2^-52 of a turn: 1.4e-15 rad for each angle; sine,
         * cosine and the products add 5 roundings of 1.1e-16: 3.4e-15 at most */
        long double tol = 4e-15L * r;
        assert_true(fabsl(p[i].mirror_rad - shown) < 4e-15L && fabsl(p[i].pan_rad - pan) < 4e-15L);
        assert_int_equal(p[i].t_ns, 1000000 + i);
        assert_int_equal(p[i].label, i);
        if (i == 7) {
            assert_true(isnan(p[i].x) && isnan(p[i].y) && isnan(p[i].z) && isnan(p[i].range_m));
            assert_true(p[i].echo == 0 && p[i].echo_count == 0);
            continue;
        }
        assert_true(p[i].echo == 1 && p[i].echo_count == 2);
        assert_true(fabsl(p[i].range_m - r) < tol);
        assert_true(fabsl(p[i].x - r * sinl(pan) * cosl(m)) < tol);
        assert_true(fabsl(p[i].y - r * cosl(pan) * cosl(m)) < tol);
        assert_true(fabsl(p[i].z - r * sinl(m)) < tol);
        if (i == 8)
            assert_true(isnan(p[i].reflectance_db));
        else
            assert_true(p[i].reflectance_db == (int16_t)(i * 3) / 100.0);
    }
}

/* Directions in the head's frame: forward, right, up, backward over the zenith. */
static void test_polar_directions(void **state)
{
    (void)state;
    static const struct {
        uint32_t mirror, pan;
        double x, y, z;
    } want[] = {{0, 0, 0, 1, 0},        {0, 1800000, 1, 0, 0}, {900000, 1234567, 0, 0, 1}, {1800000, 0, 0, -1, 0},
                {2700000, 0, 0, 0, -1}, {3600000, 0, 0, 1, 0}, {0, 3600000, 0, -1, 0}};
    struct scanhead_point p[7];
    for (int i = 0; i < 7; i++) {
        a[i] = 10000;
        b[i] = want[i].mirror;
        c[i] = want[i].pan;
        echo[i] = 0x11;
    }
    assert_int_equal(decode(0, 7, p), 7);
    for (int i = 0; i < 7; i++) { /* cos(pi/2) as a double is 6e-17 */
        assert_true(fabs(p[i].x - want[i].x) < 1e-15);
        assert_true(fabs(p[i].y - want[i].y) < 1e-15);
        assert_true(fabs(p[i].z - want[i].z) < 1e-15);
    }
}

static void test_geo_points(void **state)
{
    (void)state;
    static const int32_t xyz[3][3] = {{300000, -400000, 1200000}, {INT32_MAX, -INT32_MAX, 0}, {1, 2, 3}};
    struct scanhead_point p[3];
    for (int i = 0; i < 3; i++) {
        a[i] = (uint32_t)xyz[i][0];
        b[i] = (uint32_t)xyz[i][1];
        c[i] = (uint32_t)xyz[i][2];
        echo[i] = 0x11;
    }
    echo[2] = 0;
    dt[0] = 0xffffff;
    label[0] = 0xffff;
    assert_int_equal(decode(1, 3, p), 3);
    for (int i = 0; i < 2; i++) {
        assert_true(p[i].x == 4e6 + 1e-5 * xyz[i][0]);
        assert_true(p[i].y == 8e5 + 1e-5 * xyz[i][1]);
        assert_true(p[i].z == 4.8e6 + 1e-5 * xyz[i][2]);
        assert_true(isnan(p[i].mirror_rad) && isnan(p[i].pan_rad));
    }
    assert_true(fabs(p[0].range_m - 13) < 1e-14); /* 3, 4, 12 */
    assert_true(isnan(p[2].x) && isnan(p[2].y) && isnan(p[2].z) && isnan(p[2].range_m));
    assert_int_equal(p[0].t_ns, 1000000 + 0xffffff);
    assert_int_equal(p[0].label, SCANHEAD_NO_LABEL);
}

/* In degrees longitudes stay within 180, and ranges are straight through space. On the meridian a degree is its radius
 * of curvature at the middle (WGS 84) and the ellipsoidal height, here 100 m or, by heights above the geoid, 147 m. These
 * 47 m are 15 mm of the range. The difference of the arc and the chord is 1e-8 of 2 km. */
static void test_geodetic_points(void **state)
{
    (void)state;
    static const double lon_deg[] = {179.9999, -179.9999};
    static const int32_t count[4][3] = {{0, 30000, 0}, {0, -30000, 0}, {1800000, 0, 0}, {0, 0, 5000}};
    for (int k = 0; k < 4; k++) {
        int head;
        struct scanhead *sh = open_pair(&head);
        struct scanhead_frame f;
        struct scanhead_point p[4];
        struct native_anchor anchor = make_anchor();
        const double at[3] = {45, lon_deg[k % 2], 100}, scale[3] = {1e-8, 1e-8, 1e-3};
        anchor.crs = NATIVE_CRS_GEODETIC;
        anchor.epsg = 4979;
        anchor.heights = k < 2 ? NATIVE_HEIGHTS_ELLIPSOID : NATIVE_HEIGHTS_GEOID;
        anchor.height_m = k < 2 ? 100 : 147;
        memcpy(anchor.anchor, at, sizeof at);
        memcpy(anchor.scale, scale, sizeof scale);
        for (int i = 0; i < 4; i++) {
            a[i] = (uint32_t)count[i][0];
            b[i] = (uint32_t)count[i][1];
            c[i] = (uint32_t)count[i][2];
            echo[i] = 0x11;
        }
        put_descriptor(head, 1, 1, 0);
        const size_t len = native_encode_anchor(out, sizeof out, &anchor, 0, 0);
        native_finish_frame(out, rig_next_seq());
        put_all(head, out, len);
        put_points(head, 4, 0);
        for (int i = 0; i < 3; i++)
            assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
        assert_int_equal(scanhead_points(sh, &f, 0, p, 4), 4);
        assert_true(fabs(p[0].y - (k % 2 == 0 ? -179.9998 : -179.9996)) < 1e-12);
        assert_true(fabs(p[1].y - (k % 2 == 0 ? 179.9996 : 179.9998)) < 1e-12);
        assert_true(fabs(p[2].x - 45.018) < 1e-12 && fabs(p[3].z - 105) < 1e-12);
        const double e2 = (2 - 1 / 298.257223563) / 298.257223563, s = sin(45.009 * M_PI / 180);
        const double meridian_m = 6378137.0 * (1 - e2) / pow(1 - e2 * s * s, 1.5) + anchor.height_m;
        assert_true(fabs(p[2].range_m - 0.018 * M_PI / 180 * meridian_m) < 1e-3);
        assert_true(fabs(p[3].range_m - 5) < 1e-8); /* differences of 6.4e6 m */
        close(head);
        scanhead_close(sh);
    }
}

/* Each axis has a scale of its own. */
static void test_scales(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_point p;
    struct native_anchor anchor = make_anchor();
    const double scale[3] = {1e-5, 2e-5, 3e-5};
    memcpy(anchor.scale, scale, sizeof scale);
    a[0] = b[0] = c[0] = 100000;
    echo[0] = 0x11;
    put_descriptor(head, 1, 1, 0);
    const size_t len = native_encode_anchor(out, sizeof out, &anchor, 0, 0);
    native_finish_frame(out, rig_next_seq());
    put_all(head, out, len);
    put_points(head, 1, 0);
    for (int i = 0; i < 3; i++)
        assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
    assert_int_equal(scanhead_points(sh, &f, 0, &p, 1), 1);
    assert_true(p.x == anchor.anchor[0] + scale[0] * 100000 && p.y == anchor.anchor[1] + scale[1] * 100000 &&
                p.z == anchor.anchor[2] + scale[2] * 100000);
    close(head);
    scanhead_close(sh);
}

/* Between two poses the head turns the short way, whatever the signs of their quaternions: half of 0.2 rad about z.
 * Flags are those of both. */
static void test_poses(void **state)
{
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        int head;
        struct scanhead *sh = open_pair(&head);
        struct scanhead_frame f;
        struct scanhead_pose pose;
        const struct native_pose at[2] = {{.t_ns = 0, .quat = {1, 0, 0, 0}, .flags = 0},
                                          {.t_ns = 1000,
                                           .position_m = {2, 0, 0},
                                           .quat = {sign * cos(0.1), 0, 0, sign * sin(0.1)},
                                           .frame = 4,
                                           .flags = 2}};
        put_descriptor(head, 0, 1, 0);
        const size_t len = native_encode_poses(out, sizeof out, at, 2, 0, 0);
        native_finish_frame(out, rig_next_seq());
        put_all(head, out, len);
        for (int i = 0; i < 2; i++)
            assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
        assert_int_equal(scanhead_pose(sh, 500, &pose), SCANHEAD_OK);
        assert_true(pose.position_m[0] == 1 && pose.frame == 2 && pose.flags == 2);
        assert_true(fabs(pose.quat[0] - cos(0.05)) < 1e-15 && fabs(pose.quat[3] - sin(0.05)) < 1e-15);
        close(head);
        scanhead_close(sh);
    }
}

/* Lost pulses are reported as they are lost, and once more at the scan's end. */
static void test_pulses_lost(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_stats stats;
    put_event(head, NATIVE_EV_OVERRUN, 1, 5, 0, 0);
    put_event(head, NATIVE_EV_SCAN_END, 1, 100, 5, 0);
    for (int i = 0; i < 2; i++)
        expect_frame(sh, SCANHEAD_EVENT, &f);
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.pulses_lost, 5);
    close(head);
    scanhead_close(sh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_polar_points), cmocka_unit_test(test_polar_directions),
        cmocka_unit_test(test_geo_points),   cmocka_unit_test(test_geodetic_points),
        cmocka_unit_test(test_scales),       cmocka_unit_test(test_poses),
        cmocka_unit_test(test_pulses_lost),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
