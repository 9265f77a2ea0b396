/* SPDX-License-Identifier: MIT */
/* Recordings in geodetic coordinates: their digits, the antimeridian, scan angles and the scales of degrees. */
#include "tests/unit/recorder_rig.h"

enum { POINT = 32 };

static uint8_t *las;

/* East, north and up are the head's axes: its scan angles count from straight down. */
static struct native_anchor place(double lat_deg, double lon_deg, uint32_t station)
{
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_GEODETIC, 4979, station);
    const double anchor[3] = {lat_deg, lon_deg, 100}, scale[3] = {1e-8, 2e-8, 1e-3};
    static const double unit[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    memcpy(a.anchor, anchor, sizeof anchor);
    memcpy(a.scale, scale, sizeof scale);
    memcpy(a.rotation, unit, sizeof unit);
    return a;
}

static void put_scan(uint32_t scan, const struct native_anchor *a, const struct rig_point *p, uint32_t n)
{
    rig_descriptor(1, scan);
    rig_anchor(a);
    rig_points(0, 0, 0, p, n);
}

static const uint8_t *record_las(void)
{
    free(las);
    las = rig_record_bytes("a.las", (struct recorder_options){0}, NULL);
    return las + rig_uint(las + 96, 4);
}

/* Latitude is first. 1e-11 degrees are a micrometre, and rounding to 12 decimals adds half of the last one. A double of
 * 180 degrees steps by 2.8e-14. */
static void test_ply_digits(void **state)
{
    (void)state;
    struct native_anchor a = place(48.123456789012, -179.987654321098, 1);
    static const struct rig_point p = {123456, -654321, 1234, 0, 1, 1, 1};
    double lat_deg, lon_deg, height_m;
    a.scale[0] = a.scale[1] = 1e-11;
    rig_begin();
    put_scan(1, &a, &p, 1);
    char *text = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1}, NULL),
         *at = strstr(text, "end_header\n") + strlen("end_header\n");
    assert_int_equal(sscanf(at, "%lf %lf %lf", &lat_deg, &lon_deg, &height_m), 3);
    assert_true(fabs(lat_deg - (a.anchor[0] + 123456e-11)) < 0.6e-12);
    assert_true(fabs(lon_deg - (a.anchor[1] - 654321e-11)) < 0.6e-12);
    assert_true(fabs(height_m - 101.234) < 0.6e-6);
    free(text);
}

/* Longitudes go on beyond 180, for the first station's points, and for a station on the other side. */
static void test_antimeridian(void **state)
{
    (void)state;
    struct native_anchor a = place(10, 179.9999, 1), b = place(10, -179.9999, 2);
    static const struct rig_point across = {0, 15000, 0, 0, 1, 1, 1}, here = {3, 0, 0, 0, 1, 1, 1};
    rig_begin();
    put_scan(1, &a, (struct rig_point[]){across, here}, 2);
    put_scan(2, &b, &here, 1);
    const uint8_t *p = record_las();
    assert_true(rig_double(las + 131) == 2e-8 && rig_double(las + 139) == 1e-8 && rig_double(las + 147) == 1e-3);
    assert_true(rig_double(las + 155) == 179.9999 && rig_double(las + 163) == 10);
    assert_int_equal(rig_int32(p), 15000);
    assert_int_equal(rig_int32(p + POINT), 0);
    assert_int_equal(rig_int32(p + POINT + 4), 3);
    assert_int_equal(rig_int32(p + 2 * POINT), 10000);
    assert_true(fabs(rig_double(las + 179) - 180.0002) < 1e-9); /* the largest longitude */
    assert_true(fabs(rig_double(las + 187) - 179.9999) < 1e-9); /* the least */
}

/* A head lies on its side: its z axis points east, x north, y up. So an angle counts east from north and from up. Radii
 * of the ellipsoid differ from the sphere's 6371 km by less than 0.6 %: at 45 degrees 0.003 rad. */
static void test_scan_angle(void **state)
{
    (void)state;
    static const double lying[9] = {0, 0, 1, 1, 0, 0, 0, 1, 0}, degree_m = 111195;
    static const double lon_deg[2] = {10, 179.99999};
    const double tolerance = 0.003 / (M_PI / 180) / 0.006;
    for (int i = 0; i < 2; i++) {
        struct native_anchor a = place(60, lon_deg[i], 1);
        memcpy(a.rotation, lying, sizeof lying);
        const int32_t east = (int32_t)lrint(20 / (degree_m * 0.5) / 2e-8), north = (int32_t)lrint(20 / degree_m / 1e-8);
        const struct rig_point p[] = {{0, east, 20000, 0, 1, 1, 1},  /* 20 m east and up */
                                      {0, -east, 20000, 0, 1, 1, 1}, /* west and up */
                                      {north, east, 0, 0, 1, 1, 1},
                                      {north, 0, 0, 0, 1, 1, 1}};
        static const double want_deg[] = {135, 45, 135, 90};
        rig_begin();
        put_scan(1, &a, p, 4);
        const uint8_t *at = record_las();
        for (int k = 0; k < 4; k++, at += POINT) {
            const double counts = (double)rig_uint(at + 18, 2);
            if (!(fabs(counts - want_deg[k] / 0.006) < tolerance))
                fail_msg("at %g, point %d: %g counts of 0.006 degrees, not %g degrees", lon_deg[i], k, counts,
                         want_deg[k]);
        }
    }
}

/* A moving head's micrometres become tenths of a millimetre, also in degrees. */
static void test_moving_scale(void **state)
{
    (void)state;
    struct native_anchor a = place(60, 10, 1);
    static const struct rig_point p = {1234, -5678, 4000, INT16_MIN, 3, 1, 1};
    static const double scale[3] = {9e-12, 18e-12, 1e-6}, want[3] = {18e-10, 9e-10, 1e-4};
    a.moving = NATIVE_MOVING;
    a.scale_m = 1e-6;
    memcpy(a.scale, scale, sizeof scale);
    rig_begin();
    put_scan(1, &a, &p, 1);
    const uint8_t *at = record_las();
    for (int k = 0; k < 3; k++)
        assert_true(fabs(rig_double(las + 131 + 8 * k) / want[k] - 1) < 1e-12);
    assert_int_equal(rig_int32(at), -57); /* -5678 counts of a hundredth */
    assert_int_equal(rig_int32(at + 4), 12);
    assert_int_equal(rig_int32(at + 8), 40);
}

/* These formats hold metres. Without a scan no file replaces one that is there, and none is left behind. */
static void test_refused(void **state)
{
    (void)state;
    static const struct rig_point p = {0, 0, 0, 0, 1, 1, 1};
    static const char *const names[] = {"a.e57", "a.ptx", "a.obj", "a.glb"};
    struct native_anchor a = place(10, 10, 1);
    rig_begin();
    put_scan(1, &a, &p, 1);
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        struct sh_err err = {0};
        size_t len;
        const char *path = rig_path(names[i]);
        char part[160];
        snprintf(part, sizeof part, "%s.part", path);
        FILE *old = fopen(path, "wb");
        fputs("old", old);
        fclose(old);
        assert_int_equal(rig_record(path, (struct recorder_options){0}, RIG_KEEP_ALWAYS, &err), SH_EFORMAT);
        assert_non_null(strstr(err.text, "this format holds metres, and output.crs is geodetic"));
        assert_string_equal(rig_notes, "");
        uint8_t *file = rig_read(path, &len);
        assert_int_equal(len, 3);
        free(file);
        assert_int_equal(access(part, F_OK), -1);
        unlink(path);
    }
}

static int tear_down(void **state)
{
    free(las);
    return rig_tear_down(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_ply_digits),   cmocka_unit_test(test_antimeridian), cmocka_unit_test(test_scan_angle),
        cmocka_unit_test(test_moving_scale), cmocka_unit_test(test_refused),
    };
    return cmocka_run_group_tests(tests, rig_set_up, tear_down);
}
