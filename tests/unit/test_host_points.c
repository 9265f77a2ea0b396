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
        assert_int_equal(scanhead_next(sh, &f, 5000), 0);
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

/* The frame of the head: forward, right, up, backward over the zenith. */
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_polar_points),
        cmocka_unit_test(test_polar_directions),
        cmocka_unit_test(test_geo_points),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
