/* SPDX-License-Identifier: MIT */
/* Files of poses: stations, stops, ways. Each pose is there once, gaps are reported, and the link of the scene to the
 * Earth is there. */
#include "tests/unit/recorder_rig.h"

static const struct rig_point one = {3000, -4000, 12000, -1234, 7, 1, 1};
static char *text;

static const char *record(void)
{
    free(text);
    return text = rig_record_bytes("a.poses.csv", (struct recorder_options){0}, NULL);
}

static void put_scan(int geo, uint32_t scan, const struct native_anchor *a)
{
    rig_descriptor(geo, scan);
    rig_anchor(a);
    if (!a->moving || (a->moving & NATIVE_STOP) != 0) rig_points(0, 0, 0, &one, 1);
}

static void put_poses(int64_t from_ms, int64_t to_ms, double y_m)
{
    static uint8_t out[1024];
    const struct native_pose pose[2] = {{.t_ns = from_ms * 1000000, .position_m = {0, y_m, 0}, .quat = {1, 0, 0, 0}},
                                        {.t_ns = to_ms * 1000000, .position_m = {0, y_m + 1, 0}, .quat = {1, 0, 0, 0}}};
    rig_put(out, native_encode_poses(out, sizeof out, pose, 2, 0, 0));
}

/* The heading is 90 degrees, clockwise: a turn by -90 about z. Geodetic positions are not metres, so they are NaN. */
static void test_stations(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 3), g = rig_anchor_of(NATIVE_CRS_GEODETIC, 4979, 4);
    double v[10];
    int scan, station, epsg;
    rig_begin();
    put_scan(1, 1, &a);
    const char *at = record();
    static const char head[] = "scan,station,epsg,x_m,y_m,z_m,qw,qx,qy,qz,lat_deg,lon_deg,height_m\n";
    assert_memory_equal(at, head, sizeof head - 1);
    assert_int_equal(sscanf(at + sizeof head - 1, "%d,%d,%d,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf", &scan, &station,
                            &epsg, &v[0], &v[1], &v[2], &v[3], &v[4], &v[5], &v[6], &v[7], &v[8], &v[9]),
                     13);
    assert_true(scan == 1 && station == 3 && epsg == 32632);
    assert_true(v[0] == 500000.25 && v[1] == 5e6 && v[2] == 400.125);
    assert_true(fabs(v[3] - M_SQRT1_2) < 1e-15 && v[4] == 0 && v[5] == 0 && fabs(v[6] + M_SQRT1_2) < 1e-15);
    assert_true(v[7] == 45 && v[8] == 9 && v[9] == 400.125);
    g.anchor[0] = 45;
    g.anchor[1] = 9;
    rig_begin();
    put_scan(1, 1, &g);
    assert_non_null(strstr(record(), "\n1,4,4979,nan,nan,nan,0.7071"));
}

static void test_stops(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    a.moving = NATIVE_STOP;
    a.frame = 12.5;
    rig_begin();
    put_scan(0, 1, &a);
    const char *at = record();
    assert_non_null(strstr(at, ",height_m,frame\n"));
    assert_non_null(strstr(at, ",12.5\n"));
}

/* Frames share a pose where none was lost. In the next scan times begin again. */
static void test_moving(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    a.moving = NATIVE_MOVING;
    rig_begin();
    put_scan(0, 1, &a);
    put_poses(0, 100, 5);
    put_poses(100, 200, 6);
    put_poses(300, 400, 7); /* the poses of 200 to 300 ms are lost */
    put_scan(0, 2, &a);
    put_poses(0, 50, 8);
    const char *at = record();
    static const char want[] = "scan,t_s,x_m,y_m,z_m,qw,qx,qy,qz,frame,flags\n"
                               "1,0.000000000,0,5,0,1,0,0,0,0,0\n"
                               "1,0.100000000,0,6,0,1,0,0,0,0,0\n"
                               "1,0.200000000,0,7,0,1,0,0,0,0,0\n"
                               "# poses are missing here\n"
                               "1,0.300000000,0,7,0,1,0,0,0,0,0\n"
                               "1,0.400000000,0,8,0,1,0,0,0,0,0\n"
                               "2,0.000000000,0,8,0,1,0,0,0,0,0\n"
                               "2,0.050000000,0,9,0,1,0,0,0,0,0\n";
    assert_string_equal(at, want);
}

static void put_event(uint32_t code, uint32_t scan)
{
    static uint8_t out[256];
    const struct native_event e = {.code = code, .a = scan};
    rig_put(out, native_encode_event(out, sizeof out, &e, 0, 0));
}

/* Settings that change within a scan give another descriptor. The poses go on, and their times still rise. */
static void test_other_settings(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    a.moving = NATIVE_MOVING;
    rig_begin();
    put_event(NATIVE_EV_SCAN_START, 1);
    put_scan(0, 1, &a);
    put_poses(0, 100, 5);
    put_event(NATIVE_EV_SETTINGS, 0);
    put_scan(0, 1, &a);
    put_poses(100, 200, 6);
    const char *at = record();
    assert_non_null(strstr(at, "\n1,0.000000000,0,5,0,1,0,0,0,0,0\n1,0.100000000,0,6,0,1,0,0,0,0,0\n"
                               "1,0.200000000,0,7,0,1,0,0,0,0,0\n"));
    assert_int_equal(rig_count(at, "\n"), 4);
}

/* The SCAN_START of the scan at hand comes after its first points, at 40 ms: poses go on. Then the recording is there
 * once more. */
static void test_late_start(void **state)
{
    (void)state;
    static uint8_t out[256];
    const struct native_event e = {.code = NATIVE_EV_SCAN_START, .a = 1, .b = 7000000};
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    a.moving = NATIVE_MOVING;
    rig_begin();
    rig_scan_t0_ns = 7000000;
    for (int i = 0; i < 2; i++) {
        if (i == 1) rig_put(out, native_encode_event(out, sizeof out, &e, 7000000, 0));
        put_scan(0, 1, &a);
        put_poses(0, 100, 5);
        rig_points(0, 0, 0, &one, 1);
        if (i == 0) rig_put(out, native_encode_event(out, sizeof out, &e, 40000000, 0));
        put_poses(100, 200, 6);
    }
    const char *at = record();
    for (int i = 1; i <= 2; i++) {
        char rows[160];
        snprintf(rows, sizeof rows,
                 "\n%d,0.000000000,0,5,0,1,0,0,0,0,0\n%d,0.100000000,0,6,0,1,0,0,0,0,0\n"
                 "%d,0.200000000,0,7,0,1,0,0,0,0,0\n",
                 i, i, i);
        assert_non_null(strstr(at, rows));
    }
    assert_int_equal(rig_count(at, "\n"), 1 + 2 * 3);
}

/* Two heads start again, so that each calls both of its scans 5. In the file they are 1 to 4, and no pose is left out.
 */
static void test_same_numbers(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    struct sh_err err = {0};
    struct scanhead *sh[2];
    struct scanhead_frame frame;
    struct recorder *rec;
    const char *path = rig_path("a.poses.csv");
    a.moving = NATIVE_MOVING;
    rig_begin();
    for (int i = 0; i < 2; i++) {
        put_event(NATIVE_EV_SCAN_START, 5);
        put_scan(0, 5, &a);
        put_poses(0, 100, 5);
        put_poses(100, 200, 6);
    }
    fclose(rig_stream);
    rig_stream = NULL;
    assert_int_equal(recorder_open(recorder_find(path, &err), path, &(struct recorder_options){0}, &rec, &err), 0);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(scanhead_open(rig_shs, &sh[i], NULL, 0), 0);
        while (scanhead_next(sh[i], &frame, -1) == 0)
            assert_int_equal(recorder_frame(rec, sh[i], &frame, &err), 0);
    }
    assert_int_equal(recorder_close(rec, 1, &err), 0);
    for (int i = 0; i < 2; i++)
        scanhead_close(sh[i]);
    free(text);
    text = rig_take("a.poses.csv", NULL);
    for (int i = 1; i <= 4; i++) {
        char rows[160];
        snprintf(rows, sizeof rows,
                 "%d,0.000000000,0,5,0,1,0,0,0,0,0\n%d,0.100000000,0,6,0,1,0,0,0,0,0\n"
                 "%d,0.200000000,0,7,0,1,0,0,0,0,0\n",
                 i, i, i);
        assert_non_null(strstr(text, rows));
    }
    assert_int_equal(rig_count(text, "\n"), 1 + 4 * 3);
}

static void test_link(void **state)
{
    (void)state;
    static const uint32_t crs[] = {NATIVE_CRS_LOCAL, NATIVE_CRS_ECEF, NATIVE_CRS_UTM, NATIVE_CRS_GEODETIC};
    static const char *const axes[] = {NULL, "to ECEF X Y Z,", "to easting, northing, height,", "to east, north, up,"};
    for (int i = 0; i < 4; i++) {
        struct native_anchor a = rig_anchor_of(crs[i], i == 0 ? 0 : 4978, 1);
        a.moving = NATIVE_MOVING;
        rig_begin();
        put_scan(1, 1, &a);
        put_poses(0, 100, 5);
        const char *at = record();
        assert_int_equal(rig_count(at, "\n#"), i == 0 ? 0 : 3);
        if (i == 0) continue;
        assert_non_null(strstr(at, axes[i]));
        assert_non_null(strstr(at, "ellipsoidal height_m: 10,20,30: 45,9,400.125\n"));
    }
}

static int tear_down(void **state)
{
    free(text);
    return rig_tear_down(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_stations),       cmocka_unit_test(test_stops),      cmocka_unit_test(test_moving),
        cmocka_unit_test(test_other_settings), cmocka_unit_test(test_late_start), cmocka_unit_test(test_same_numbers),
        cmocka_unit_test(test_link),
    };
    return cmocka_run_group_tests(tests, rig_set_up, tear_down);
}
