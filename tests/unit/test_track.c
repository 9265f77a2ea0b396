/* SPDX-License-Identifier: MIT */
/* A moving head in all formats of points. Each has the same points, without those that have no pose. */
#include "tests/unit/recorder_rig.h"

enum { LINES = 3, SHOTS = 10 };

/* The head goes north at 10 m/s and turns clockwise by 90 degrees a second, from heading 0 at (10, 20, 30). */
static void put_poses(int64_t from_ms, int64_t to_ms)
{
    static uint8_t out[4096];
    struct native_pose pose[2];
    for (int i = 0; i < 2; i++) {
        double t = 1e-3 * (double)(i == 0 ? from_ms : to_ms), half = 0.25 * M_PI * t;
        pose[i] = (struct native_pose){.t_ns = (i == 0 ? from_ms : to_ms) * 1000000,
                                       .position_m = {10, 20 + 10 * t, 30},
                                       .quat = {cos(half), 0, 0, -sin(half)},
                                       .frame = 100 + 4 * t};
    }
    rig_put(out, native_encode_poses(out, sizeof out, pose, 2, 0, 0));
}

/* Shot i of line l hits at 5 m + i mm straight ahead, at *t_s. Lines have 10 shots, from 0, 150 and 200 ms on. */
static const int START_MS[LINES] = {0, 150, 200};

static void hit(int line, int i, double p[3], double *t_s)
{
    *t_s = 1e-3 * (START_MS[line] + i);
    double heading = 0.5 * M_PI * *t_s, range = 5 + 1e-3 * i;
    p[0] = 10 + range * sin(heading);
    p[1] = 20 + 10 * *t_s + range * cos(heading);
    p[2] = 30;
}

/* The poses of 100 to 200 ms are lost, so the second line has none. The last shot of a line is empty. */
static void put_stream(void)
{
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    struct rig_point p[SHOTS];
    a.moving = NATIVE_MOVING;
    rig_begin();
    rig_descriptor(0, 1);
    rig_anchor(&a);
    for (int l = 0; l < LINES; l++) {
        if (l != 1) put_poses(START_MS[l], START_MS[l] + 100);
        for (int i = 0; i < SHOTS; i++)
            p[i] = (struct rig_point){5000 + i, 0, 0, INT16_MIN, 3, 1, 1};
        p[SHOTS - 1] = (struct rig_point){0, 0, 0, INT16_MIN, 0xffff, 0, 0};
        rig_points((uint32_t)l, (uint64_t)START_MS[l], (uint64_t)START_MS[l], p, SHOTS);
    }
}

static uint8_t *record(const char *name, struct recorder_options options, size_t *len)
{
    put_stream();
    uint8_t *file = rig_record_bytes(name, options, len);
    assert_non_null(strstr(rig_notes, "9 points left out whose pose was lost"));
    return file;
}

/* tolerance_m is half a step of the format; the steps of a sine (1e-15) are neglected. Without frame: NULL. */
static void expect(int n, const double p[3], const double *t_s, const double *frame, double tolerance_m)
{
    double want[3], want_s;
    hit(n < SHOTS - 1 ? 0 : 2, n % (SHOTS - 1), want, &want_s);
    for (int k = 0; k < 3; k++)
        if (!(fabs(p[k] - want[k]) <= tolerance_m + 1e-12)) fail_msg("%d: %.9f, not %.9f", n, p[k], want[k]);
    if (t_s != NULL) assert_true(fabs(*t_s - want_s) < 1e-12);
    if (frame != NULL) assert_true(fabs(*frame - (100 + 4 * want_s)) < 1e-9);
}

static void test_ply(void **state)
{
    (void)state;
    char *text = (char *)record("a.ply", (struct recorder_options){.ascii = 1}, NULL), *at;
    assert_non_null(strstr(text, "comment points_without_pose 9\n"));
    assert_non_null(strstr(text, "element vertex 18\n"));
    at = strstr(text, "end_header\n") + 11;
    for (int n = 0; n < 18; n++) {
        double p[3], t_s, frame;
        int used;
        assert_int_equal(
            sscanf(at, "%lf %lf %lf %*f nan %lf 1 1 3 1 %lf\n%n", &p[0], &p[1], &p[2], &t_s, &frame, &used), 5);
        expect(n, p, &t_s, &frame, 0.5e-6);
        at += used;
    }
    assert_int_equal(*at, 0);
    free(text);
}

static void test_las(void **state)
{
    (void)state;
    uint8_t *las = record("a.las", (struct recorder_options){0}, NULL), *p = las + rig_uint(las + 96, 4);
    assert_int_equal(rig_uint(las + 247, 8), 18);
    for (int n = 0; n < 18; n++, p += 32) {
        double xyz[3], t_s = rig_double(p + 22);
        for (int k = 0; k < 3; k++)
            xyz[k] = rig_int32(p + 4 * k) * rig_double(las + 131 + 8 * k) + rig_double(las + 155 + 8 * k);
        expect(n, xyz, &t_s, NULL, 0.5 * rig_double(las + 131));
        assert_int_equal(rig_uint(p + 18, 2), 0); /* no scan angle */
    }
    free(las);
}

/* The grid keeps its shape: three lines of ten shots. */
static void test_ptx(void **state)
{
    (void)state;
    char *text = (char *)record("a.ptx", (struct recorder_options){0}, NULL), *at = text;
    static const char head[] = "3\n10\n0.000000000 0.000000000 0.000000000\n1.000000000000000 0.000000000000000";
    assert_memory_equal(text, head, sizeof head - 1);
    for (int i = 0; i < 10; i++)
        at = strchr(at, '\n') + 1;
    int n = 0;
    for (int cell = 0; cell < LINES * SHOTS; cell++) {
        double p[3], intensity;
        int used;
        assert_int_equal(sscanf(at, "%lf %lf %lf %lf\n%n", &p[0], &p[1], &p[2], &intensity, &used), 4);
        at += used;
        int empty = p[0] == 0 && p[1] == 0 && p[2] == 0;
        assert_int_equal(empty, cell / SHOTS == 1 || cell % SHOTS == SHOTS - 1);
        if (!empty) expect(n++, p, NULL, NULL, 0.5e-6);
    }
    assert_int_equal(*at, 0);
    free(text);
}

static double number_of(const char *xml, const char *tag)
{
    const char *at = strstr(xml, tag);
    assert_non_null(at);
    return strtod(strchr(at, '>') + 1, NULL);
}

/* Checks count, bounds and pose. Pages' checksums are not in the first kilobyte of the XML. Other readers check the
 * points (tests/wire/test_moving_readers.c). */
static void test_e57(void **state)
{
    (void)state;
    size_t len;
    uint8_t *e57 = record("a.e57", (struct recorder_options){0}, &len);
    static char xml[1 << 16];
    size_t n = 0;
    for (size_t at = rig_uint(e57 + 24, 8); at < len && n < sizeof xml - 1; at++)
        if (at % 1024 < 1020) xml[n++] = (char)e57[at];
    assert_non_null(strstr(xml, "recordCount=\"18\""));
    double lo[3] = {INFINITY, INFINITY, INFINITY}, hi[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int i = 0; i < 18; i++) {
        double p[3], t_s;
        hit(i < SHOTS - 1 ? 0 : 2, i % (SHOTS - 1), p, &t_s);
        for (int k = 0; k < 3; k++) {
            lo[k] = fmin(lo[k], p[k]);
            hi[k] = fmax(hi[k], p[k]);
        }
    }
    static const char *const tag[3][2] = {
        {"<xMinimum", "<xMaximum"}, {"<yMinimum", "<yMaximum"}, {"<zMinimum", "<zMaximum"}};
    for (int k = 0; k < 3; k++)
        assert_true(fabs(number_of(xml, tag[k][0]) - lo[k]) <= 0.5e-3 &&
                    fabs(number_of(xml, tag[k][1]) - hi[k]) <= 0.5e-3);
    assert_true(number_of(xml, "<w") == 1); /* the points are where they were hit */
    free(e57);
}

/* In the geo layout a point needs no pose, but its frame scalar does. */
static void test_geo(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    a.moving = NATIVE_MOVING;
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    put_poses(0, 100);
    rig_points(0, 0, 0, (struct rig_point[]){{1000, 2000, 3000, INT16_MIN, 3, 1, 1}}, 1);
    rig_points(1, 150, 150, (struct rig_point[]){{1001, 2001, 3001, INT16_MIN, 3, 1, 1}}, 1);
    char *text = rig_record_bytes("g.ply", (struct recorder_options){.ascii = 1}, NULL);
    assert_string_equal(rig_notes, "");
    assert_non_null(strstr(text, "\n500001.250000 5000002.000000 403.125000 nan nan 0.000000000 1 1 3 1 100\n"
                                 "500001.251000 5000002.001000 403.126000 nan nan 0.150000000 1 1 3 1 nan\n"));
    free(text);
}

/* A shot without echo is kept where that is asked for, also if its pose was lost. The frame scalar of a shot without a
 * pose is not known. */
static void test_empty_shot(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    a.moving = NATIVE_MOVING;
    rig_begin();
    rig_descriptor(0, 1);
    rig_anchor(&a);
    put_poses(0, 100);
    rig_points(0, 0, 100, (struct rig_point[]){{0, 0, 0, INT16_MIN, 65535, 0, 0}}, 1);
    rig_points(1, 150, 150, (struct rig_point[]){{0, 0, 0, INT16_MIN, 65535, 0, 0}}, 1);
    char *text = rig_record_bytes("g.ply", (struct recorder_options){.ascii = 1, .empty_shots = 1}, NULL);
    assert_non_null(strstr(text, "\nnan nan nan nan nan 0.100000000 0 0 65535 1 "));
    assert_null(strstr(text, "\nnan nan nan nan nan 0.100000000 0 0 65535 1 nan\n"));
    assert_non_null(strstr(text, "\nnan nan nan nan nan 0.150000000 0 0 65535 1 nan\n"));
    free(text);
}

/* Counts of a recording are at least 0.1 mm where the head moves: 32 bits of them are 214 km, of 1e-6 m 2 km. */
static void test_long_way(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    a.moving = NATIVE_MOVING;
    a.scale_m = a.scale[0] = a.scale[1] = a.scale[2] = 1e-6;
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, (struct rig_point[]){{1234567, -7654321, 49, INT16_MIN, 3, 1, 1}}, 1);
    a.anchor[0] += 200000; /* where the head has come to */
    rig_anchor(&a);
    rig_points(1, 150, 150, (struct rig_point[]){{130, 0, 51, INT16_MIN, 3, 1, 1}}, 1);
    uint8_t *las = rig_record_bytes("g.las", (struct recorder_options){0}, NULL), *p = las + rig_uint(las + 96, 4);
    static const int32_t want[2][3] = {{12346, -76543, 0}, {2000000001, 0, 1}};
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 3; k++) {
            assert_true(fabs(rig_double(las + 131 + 8 * k) - 1e-4) < 1e-18);
            assert_int_equal(rig_int32(p + 32 * i + 4 * k), want[i][k]);
        }
    free(las);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_ply),        cmocka_unit_test(test_las), cmocka_unit_test(test_ptx),
        cmocka_unit_test(test_e57),        cmocka_unit_test(test_geo), cmocka_unit_test(test_long_way),
        cmocka_unit_test(test_empty_shot),
    };
    return cmocka_run_group_tests_name("track", tests, rig_set_up, rig_tear_down);
}
