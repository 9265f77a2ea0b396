/* SPDX-License-Identifier: MIT */
/* Streams whose frames are whole and whose numbers are absurd. No such point is written, and those left out are
 * counted. Each file's reader would take infinities, or wrapped integers, for points. */
#include "tests/unit/recorder_rig.h"

static const struct rig_point points[3] = {
    {0, 0, 0, 0, 0, 1, 1}, {2, 0, 0, 0, 0, 1, 1}, {0, 0, 0, INT16_MIN, 0xffff, 0, 0}};

static struct native_anchor local_anchor(void)
{
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    memset(a.anchor, 0, sizeof a.anchor);
    return a;
}

static int record(const char *name, const struct native_anchor *a, struct sh_err *err)
{
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(a);
    rig_points(0, 0, 0, points, 3);
    return rig_record(rig_path(name), (struct recorder_options){.ascii = 1}, RIG_KEEP, err);
}

/* 2 counts of 1.5e308 are beyond any number. */
static void test_infinite(void **state)
{
    (void)state;
    static const char *const name[] = {"a.ply", "a.ptx"}, *const absent[] = {"inf", "nan"};
    for (int i = 0; i < 2; i++) {
        struct sh_err err = {0};
        struct native_anchor a = local_anchor();
        a.scale[0] = 1.5e308;
        assert_int_equal(record(name[i], &a, &err), SH_OK);
        assert_non_null(strstr(rig_notes, "1 points left out whose coordinates are infinite"));
        char *text = rig_take(name[i], NULL), *end = strstr(text, "end_header");
        for (int k = 0; k < 2; k++)
            assert_null(strstr(end != NULL ? strchr(end, '\n') : text, absent[k]));
        if (end != NULL) assert_non_null(strstr(text, "element vertex 1\n"));
        free(text);
    }
}

/* The point is finite at first, and the pose makes it infinite. */
static void test_infinite_by_pose(void **state)
{
    (void)state;
    struct sh_err err = {0};
    struct native_anchor a = local_anchor();
    for (int i = 0; i < 9; i++)
        a.rotation[i] = 1.7e308;
    rig_begin();
    rig_descriptor(0, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, (const struct rig_point[]){{4000000, 900, 0, 0, 0, 1, 1}}, 1); /* 4 km up */
    assert_int_equal(rig_record(rig_path("a.ply"), (struct recorder_options){0}, RIG_KEEP, &err), SH_OK);
    assert_non_null(strstr(rig_notes, "1 points left out whose coordinates are infinite"));
    unlink(rig_path("a.ply"));
}

/* A pose of 300 digits: the header's numbers are checked one by one. */
static void test_long_pose(void **state)
{
    (void)state;
    struct sh_err err = {0};
    struct native_anchor a = local_anchor();
    for (int i = 0; i < 9; i++)
        a.rotation[i] = -1e300;
    assert_int_equal(record("a.ptx", &a, &err), SH_EFORMAT);
    assert_non_null(strstr(err.text, "more digits"));
    unlink(rig_path("a.ptx.part")); /* the received part is kept */
    unlink(rig_path("a.ptx.grid"));
}

/* The angle comes from the inverse of the pose. If that is beyond any number, there is no angle. */
static void test_no_scan_angle(void **state)
{
    (void)state;
    struct sh_err err = {0};
    struct native_anchor a = local_anchor();
    static const double rotation[9] = {1e308, 1e308, 1e308, 1e308, 1e308, 1e308, -1e308, -1e308, -1e308};
    memcpy(a.rotation, rotation, sizeof rotation);
    a.scale_m = 1e9;
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, (const struct rig_point[]){{1, 1, 5, 0, 0, 1, 1}, {1, 1, 5, 0, 0, 1, 1}}, 2);
    assert_int_equal(rig_record(rig_path("a.las"), (struct recorder_options){0}, RIG_KEEP, &err), SH_OK);
    assert_non_null(strstr(rig_notes, "2 points without a scan angle"));
    unlink(rig_path("a.las"));
}

/* Rows beyond 32 bits, by pulse numbers and by times. */
static void test_far_rows(void **state)
{
    (void)state;
    struct sh_err err = {0};
    struct native_anchor a = local_anchor();
    static uint8_t out[1024];
    struct line_end end = {.line = 0, .pulse0 = 0, .n_fired = 1};
    for (int i = 0; i < 2; i++) {
        rig_begin();
        rig_descriptor(1, 1);
        rig_anchor(&a);
        if (i == 0) rig_put(out, native_encode_line_end(out, sizeof out, &end, 0));
        /* line 1 begins with pulse 1; times: 2^63 ns at 1 kHz are 9e12 pulses */
        rig_points(1, i == 0 ? 1 : (uint64_t)(INT64_MIN / 1000000), i == 0 ? UINT64_MAX : 9000000000000, points, 3);
        assert_int_equal(rig_record(rig_path("a.e57"), (struct recorder_options){0}, RIG_KEEP, &err), SH_EFORMAT);
        assert_non_null(strstr(err.text, "more than 2^32 pulses"));
        unlink(rig_path("a.e57.part"));
    }
}

/* The times of two poses are further apart than a signed difference holds. Half-way is half-way all the same. */
static void test_poses_far_apart(void **state)
{
    (void)state;
    static uint8_t out[1024];
    struct native_anchor a = local_anchor();
    const struct native_pose pose[2] = {{.t_ns = INT64_MIN, .quat = {1, 0, 0, 0}},
                                        {.t_ns = INT64_MAX, .quat = {1, 0, 0, 0}, .position_m = {0, 10, 0}}};
    double x, y, z;
    a.moving = NATIVE_MOVING;
    rig_begin();
    rig_descriptor(0, 1);
    rig_anchor(&a);
    rig_put(out, native_encode_poses(out, sizeof out, pose, 2, 0, 0));
    rig_points(0, 0, 0, (const struct rig_point[]){{1000, 0, 0, 0, 0, 1, 1}}, 1); /* 1 m ahead, at 0 s */
    char *text = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1}, NULL),
         *end = strstr(text, "end_header\n");
    assert_non_null(end);
    assert_int_equal(sscanf(end, "end_header %lf %lf %lf", &x, &y, &z), 3);
    assert_true(x == 0.0 && y == 6.0 && z == 0.0);
    free(text);
}

/* ---- every figure of an anchor is as large as possible: a file has only finite numbers, or there is no file */

static void expect_numbers(const char *name, const uint8_t *file, size_t len)
{
    if (strstr(name, ".las") != NULL) {
        for (size_t at = 131; at < 227; at += 8)
            if (!isfinite(rig_double(file + at))) fail_msg("%s: %g at %zu", name, rig_double(file + at), at);
        return;
    }
    static const char *const absent[] = {"inf", "nan"};
    const char *text = (const char *)file;
    const size_t xml_at = strstr(name, ".e57") != NULL ? rig_uint(file + 24, 8) : 0;
    for (int k = 0; k < 2; k++)
        for (size_t at = xml_at; at + 3 < len; at++)
            if (memcmp(text + at, absent[k], 3) == 0 && strchr("->,; \n", text[at - 1]) != NULL &&
                memcmp(text + at, "nan: ", 5) != 0)
                fail_msg("%s: %.60s", name, text + at - 20);
}

static void test_extremes(void **state)
{
    (void)state;
    static const char *const name[] = {"a.las", "a.e57", "a.ptx", "a.ply", "a.poses.csv"};
    static const double most[] = {1.7e308, -1.7e308, 5e-324};
    static const struct rig_point point = {4000000, 900, 1700, 0, 0, 1, 1};
    for (int i = 0; i < 5 * 2 * 3 * 6; i++) {
        const int format = i % 5, geo = i / 5 % 2, field = i / 30;
        const double v = most[i / 10 % 3];
        struct native_anchor a = geo ? rig_anchor_of(NATIVE_CRS_UTM, 32632, 1) : local_anchor();
        struct sh_err err = {0};
        size_t len;
        double *const to[] = {a.anchor, a.station_m, a.rotation, a.axes, a.scale, &a.scale_m};
        static const int n[] = {3, 3, 9, 9, 3, 1};
        for (int k = 0; k < n[field]; k++)
            to[field][k] = v;
        rig_begin();
        rig_descriptor(geo, 1);
        rig_anchor(&a);
        rig_points(0, 0, 0, &point, 1);
        const char *path = rig_path(name[format]);
        const int rc = rig_record(path, (struct recorder_options){.ascii = 1}, RIG_KEEP, &err);
        if (rc != SH_OK) {
            assert_true(rc == SH_EFORMAT && strstr(err.text, "a.") != NULL);
            char left[160];
            snprintf(left, sizeof left, "%s.part", path);
            unlink(left);
            snprintf(left, sizeof left, "%s.grid", path);
            unlink(left);
            continue;
        }
        uint8_t *file = rig_read(path, &len);
        expect_numbers(name[format], file, len);
        free(file);
        unlink(path);
    }
}

static void note_why(void *ctx, const struct scanhead_notice *notice)
{
    if (notice->kind == SCANHEAD_NOTICE_REFUSED) snprintf(ctx, 256, "%s", notice->why);
}

/* There are so few counts that a turn has less than one. */
static void test_no_counts(void **state)
{
    (void)state;
    char why[256] = "";
    static uint8_t out[1024];
    struct scanhead *sh;
    struct scanhead_frame frame;
    struct native_descriptor d = {.idn = "a,b,c,d",
                                  .layout = NATIVE_POLAR,
                                  .prr_uhz = 1000000000,
                                  .mirror_counts_per_turn = 5e-324,
                                  .pan_counts_per_turn = 3600,
                                  .range_scale_m = 1e-3};
    rig_begin();
    rig_put(out, native_encode_descriptor(out, sizeof out, &d, 0, 0));
    fclose(rig_stream);
    rig_stream = NULL;
    assert_int_equal(scanhead_open(rig_shs, &sh, NULL, 0), 0);
    scanhead_on_notice(sh, note_why, why);
    assert_int_equal(scanhead_next(sh, &frame, -1), SCANHEAD_ECLOSED);
    assert_non_null(strstr(why, "polar descriptor without scales"));
    scanhead_close(sh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_infinite),        cmocka_unit_test(test_infinite_by_pose),
        cmocka_unit_test(test_long_pose),       cmocka_unit_test(test_no_scan_angle),
        cmocka_unit_test(test_far_rows),        cmocka_unit_test(test_no_counts),
        cmocka_unit_test(test_poses_far_apart), cmocka_unit_test(test_extremes),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
