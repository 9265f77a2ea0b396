/* SPDX-License-Identifier: MIT */
/* The head's pose in a recording's frame, compared with GeographicLib; the CRS texts; the place of a shot in its
 * line. */
#include "drivers/record/station_pose.h"

#include "core/georef.h"
#include "drivers/record/crs_wkt.h"
#include "drivers/record/track.h"
#include "drivers/protocol/native.h"
#include "tests/common/cases.h"
#include "tests/unit/recorder_rig.h"

static const double HEADING[9] = {0.6, 0.8, 0, -0.8, 0.6, 0, 0, 0, 1};

static struct scanhead_info info_of(const struct georef_spec *spec, const struct georef *georef)
{
    struct scanhead_info info = {.geo = 1,
                                 .crs = (int)spec->crs,
                                 .epsg = georef_epsg(georef),
                                 .lat_deg = spec->lat_deg,
                                 .lon_deg = spec->lon_deg,
                                 .height_m = spec->height_m};
    georef_anchor(georef, info.anchor);
    memcpy(info.rotation, HEADING, sizeof HEADING);
    georef_axes(georef, info.axes);
    return info;
}

/* A step of a metre along each axis of the head goes where the pose says, but for the grid's scale, so directions are
 * compared. Beyond the pose's own 1e-6 rad, the grid bends by less than 1e-6 rad over a metre, even at the pole. */
static void check_directions(const struct georef_spec *spec, double tolerance)
{
    struct georef *georef;
    struct sh_err err = {0};
    struct station_pose pose;
    if (georef_create(spec, &georef, &err) != 0) fail_msg("%s", err.text);
    struct scanhead_info info = info_of(spec, georef);
    station_pose_of(&info, &pose);
    for (int axis = 0; axis < 3; axis++) {
        const double *h = HEADING;
        double d[3] = {h[axis], h[3 + axis], h[6 + axis]}, norm = 0;
        georef_forward(georef, 1, (struct vec3_in){&d[0], &d[1], &d[2]}, (struct vec3_out){&d[0], &d[1], &d[2]});
        for (int i = 0; i < 3; i++)
            norm += d[i] * d[i];
        for (int i = 0; i < 3; i++) {
            double off = d[i] / sqrt(norm) - pose.rotation[3 * i + axis];
            if (!(fabs(off) < tolerance))
                fail_msg("lat %g lon %g epsg %d axis %d: off by %g", spec->lat_deg, spec->lon_deg, info.epsg, axis,
                         off);
        }
    }
    assert_memory_equal(pose.shift_m, info.anchor, sizeof info.anchor);
    georef_free(georef);
}

static void test_directions(void **state)
{
    (void)state;
    static const double place[][2] = {{0.1, 0.1},  {52.5, 13.4},  {52.5, 17.99}, {-33.9, 18.4},
                                      {-79, -3},   {83.9, 179.9}, {10, -179.99}, {84.5, -120.25},
                                      {89.99, 33}, {-80.5, 77},   {-89.9, -150}};
    for (size_t i = 0; i < sizeof place / sizeof place[0]; i++) {
        struct georef_spec spec = {.lat_deg = place[i][0], .lon_deg = place[i][1], .height_m = 120};
        spec.crs = GEOREF_UTM;
        check_directions(&spec, 2e-6);
        spec.crs = GEOREF_ECEF;
        check_directions(&spec, 2e-9); /* a metre as the difference of two 6e6 m, 1e-9 m each */
        spec.crs = GEOREF_LOCAL;
        check_directions(&spec, 1e-15);
    }
}

/* Random rotations, and the half turns where only one term is left: the quaternion turns as the matrix does. */
static void test_quaternion(void **state)
{
    (void)state;
    uint64_t seed = 7;
    for (int n = 0; n < 2000; n++) {
        double q[4], back[4], norm = 0;
        for (int i = 0; i < 4; i++)
            q[i] = n < 8 ? (n >> 1 == i ? 1 : n & 1 ? 1e-9 * i : 0) : 2 * case_unit(&seed) - 1;
        for (int i = 0; i < 4; i++)
            norm += q[i] * q[i];
        for (int i = 0; i < 4; i++)
            q[i] /= sqrt(norm);
        double w = q[0], x = q[1], y = q[2], z = q[3];
        struct station_pose pose = {.rotation = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
                                                 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                                                 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
        station_pose_quaternion(&pose, back);
        double dot = 0;
        for (int i = 0; i < 4; i++)
            dot += q[i] * back[i];
        assert_true(fabs(fabs(dot) - 1) < 1e-14);
        assert_true(back[0] >= 0);
    }
}

static void test_there_and_back(void **state)
{
    (void)state;
    struct station_pose pose = {.shift_m = {500000.25, 5e6, 400.125}};
    memcpy(pose.rotation, HEADING, sizeof HEADING);
    double p[3] = {0, 10, 3};
    station_pose_forward(&pose, p);
    assert_true(p[0] == 500008.25 && p[1] == 5000006 && p[2] == 403.125);
    station_pose_reverse(&pose, p);
    assert_true(fabs(p[0]) < 1e-9 && fabs(p[1] - 10) < 1e-9 && fabs(p[2] - 3) < 1e-9); /* steps of a double at 5e6 */
}

/* Every CRS of a stream has a text that fits, with balanced brackets, and no other code has one. */
static void test_wkt(void **state)
{
    (void)state;
    char text[CRS_WKT_MAX];
    int n = 0;
    for (int epsg = 0; epsg < 40000; epsg++) {
        size_t len = crs_wkt(epsg, epsg % 2, text);
        int depth = 0, want = epsg == 4978 || epsg == 4979 || epsg == 32661 || epsg == 32761 ||
                              (epsg > 32600 && epsg <= 32660) || (epsg > 32700 && epsg <= 32760);
        assert_int_equal(len, strlen(text));
        assert_true(len < CRS_WKT_MAX);
        assert_int_equal(len > 0, want);
        for (size_t i = 0; i < len; i++)
            depth += text[i] == '[' ? 1 : text[i] == ']' ? -1 : 0;
        assert_int_equal(depth, 0);
        n += want;
    }
    assert_int_equal(n, 124);
}

/* ---- rows */

struct seen {
    struct track track;
    uint32_t row[16];
    int n;
};

static int keep_rows(void *rec, int n, struct sh_err *err)
{
    (void)err;
    struct seen *seen = rec;
    for (int i = 0; i < n; i++)
        seen->row[seen->n++] = seen->track.row[i];
    return 0;
}

static void put_line_end(uint32_t line, uint64_t pulse0, uint32_t n_fired)
{
    uint8_t out[256];
    struct line_end end = {.line = line, .pulse0 = pulse0, .n_fired = n_fired};
    rig_put(out, native_encode_line_end(out, sizeof out, &end, 0));
}

/* The line's end decides the rows. If it is missing, the times decide, at the descriptor's 1 kHz. */
static void test_rows(void **state)
{
    (void)state;
    static const struct track_ops ops = {.points = keep_rows};
    const struct rig_point one = {1, 1, 1, 0, 0, 1, 1}, first = {1, 1, 1, 0, 0, 1, 2}, second = {1, 1, 1, 0, 0, 2, 2};
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    struct scanhead *sh;
    struct scanhead_frame frame;
    struct seen seen = {.track = {.path = "x", .ops = &ops, .rec = &seen}};
    struct sh_err err = {0};
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(0, 0, 2, (struct rig_point[]){one, first, second, one}, 4);
    rig_points(0, 0, 5, &one, 1);
    put_line_end(0, 0, 10);
    rig_points(1, 11, 13, &one, 1); /* by the times row 2, by the line's end row 3 */
    rig_points(2, 20, 24, &one, 1); /* the end of line 1 was lost */
    fclose(rig_stream);
    rig_stream = NULL;
    assert_int_equal(scanhead_open(rig_shs, &sh, NULL, 0), 0);
    while (scanhead_next(sh, &frame, -1) == 0)
        assert_int_equal(track_frame(&seen.track, sh, &frame, &err), 0);
    scanhead_close(sh);
    static const uint32_t want[] = {2, 3, 3, 4, 5, 3, 4};
    assert_int_equal(seen.n, 7);
    for (int i = 0; i < 7; i++)
        assert_int_equal(seen.row[i], want[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_directions), cmocka_unit_test(test_quaternion), cmocka_unit_test(test_there_and_back),
        cmocka_unit_test(test_wkt),        cmocka_unit_test(test_rows),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
