/* SPDX-License-Identifier: MIT */
/* core/pose: which samples and way-points are allowed. Each limit itself is allowed. A refusal names the line and the
 * limits (core/pose.h). */
#include <unistd.h>

#include "tests/unit/file_rig.h"
#include "tests/unit/pose_rig.h"

/* Writes the columns and up to two lines. `says` is in the message, after the file's name, and right after it where it
 * begins with a colon; NULL: the file is right. */
static void expect_file(int of_waypoints, const char *columns, const char *lines, const char *says)
{
    struct trajectory *tr;
    struct sh_err err;
    FILE *file = fopen(file_path, "w");
    assert_non_null(file);
    fprintf(file, "%s\n%s", columns, lines);
    assert_int_equal(fclose(file), 0);
    const int rc = of_waypoints ? trajectory_read_waypoints(file_path, NULL, NULL, &tr, &err)
                                : trajectory_read_csv(file_path, NULL, &tr, &err);
    if (rc != (says == NULL ? SH_OK : SH_EINPUT)) fail_msg("%s: %d, %s", lines, rc, rc != SH_OK ? err.text : "");
    if (says == NULL) {
        trajectory_free(tr);
        return;
    }
    assert_null(tr);
    const char *rest = err.text + strlen(file_path), *at = strstr(err.text, says);
    if (strncmp(err.text, file_path, strlen(file_path)) != 0 || at == NULL || (says[0] == ':' && at != rest))
        fail_msg("%s", err.text);
}

static void samples(void **state)
{
    (void)state;
    static const char angles[] = "t_s,x_m,y_m,z_m,heading_deg,pitch_deg,roll_deg",
                      quat[] = "t_s,x_m,y_m,z_m,qw,qx,qy,qz";
    static const char attitude[] =
        "line 2: an attitude out of range; allowed heading_deg -1e6 to 1e6, pitch_deg -90 to "
        "90, roll_deg -360 to 360";
    static const struct {
        const char *columns, *lines, *says;
    } is[] = {
        {angles, "-4e9,-1e9,-1e9,-1e9,-1e6,-90,-360\n4e9,1e9,1e9,1e9,1e6,90,360\n", NULL},
        {angles, "0,0,0,0,1000001,0,0\n", attitude},
        {angles, "0,0,0,0,-1000001,0,0\n", attitude},
        {angles, "0,0,0,0,0,90.1,0\n", attitude},
        {angles, "0,0,0,0,0,-90.1,0\n", attitude},
        {angles, "0,0,0,0,0,0,360.1\n", attitude},
        {angles, "0,0,0,0,0,0,-360.1\n", attitude},
        {angles, "0,1.1e9,0,0,0,0,0\n", "line 2: x_m 1.1e+09; allowed -1e9 to 1e9"},
        {angles, "0,0,-1.1e9,0,0,0,0\n", "line 2: y_m -1.1e+09; allowed -1e9 to 1e9"},
        {angles, "0,0,0,1.1e9,0,0,0\n", "line 2: z_m 1.1e+09; allowed -1e9 to 1e9"},
        {angles, "0,0,0,0,0,0,0\n4000000001,0,0,0,0,0,0\n", "line 3: t_s 4e+09; allowed -4e+09 to 4e+09"},
        {quat, "0,0,0,0,0,0.9994,0,0\n", "line 2: a quaternion of length 0.9994; allowed 0.9995 to 1.0005"},
        {quat, "0,0,0,0,0,0,1.0006,0\n", "line 2: a quaternion of length 1.0006; allowed 0.9995 to 1.0005"},
        {quat, "0,0,0,0,0,0,0,-1\n", NULL},
        {quat, "0,0,0,0,-0.5,0.5,-0.5,0.5\n", NULL},
    };
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++)
        expect_file(0, is[i].columns, is[i].lines, is[i].says);
}

static void waypoints(void **state)
{
    (void)state;
    static const struct {
        const char *lines, *says;
    } is[] = {
        {"0,0,0,1,0\n", ": fewer than two way-points"},
        {"1e9,-1e9,1e9,1,0\n1e9,-1e9,999999999,1,0\n", NULL},
        {"0,0,0,1,0\n0,-1.1e9,0,1,0\n", "line 3: y_m -1.1e+09; allowed -1e9 to 1e9"},
        {"0,0,1.1e9,1,0\n", "line 2: z_m 1.1e+09; allowed -1e9 to 1e9"},
        {"0,0,0,1,0\n0,0,0,1,0\n",
         "line 3: 0 m from the previous way-point, which take 0 s at its speed; allowed 0.0001 to 1e6 s"},
        {"0,0,0,1000,0\n0,0.09,0,1,0\n",
         "line 3: 0.09 m from the previous way-point, which take 9e-05 s at its speed; allowed 0.0001 to 1e6 s"},
        {"0,0,0,1000,0\n0,0.11,0,1,0\n", NULL},
        /* The speed is that of the point before. */
        {"0,0,0,0.001,0\n0,0,1000,1000,0\n",
         "line 3: 1000 m from the previous way-point, which take 1e+06 s at its speed; allowed 0.0001 to 1e6 s"},
        {"0,0,0,0.001,0\n0,0,999,1000,0\n", NULL},
    };
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++)
        expect_file(1, "x_m,y_m,z_m,speed_m_s,pause_s", is[i].lines, is[i].says);
    expect_file(1, "x_m,y_m,speed_m_s", "",
                "line 1: the columns must be x_m, y_m, z_m, speed_m_s, and may have pause_s");
}

/* 119 legs of 999 m at 1 mm/s have a sample every 10 mm. Each point has room for one more, at the end of its pause. */
static void samples_of_a_long_way(void **state)
{
    (void)state;
    char lines[4096] = "";
    for (int i = 0; i < 120; i++)
        snprintf(lines + strlen(lines), sizeof lines - strlen(lines), "%d,0,0,0.001\n", 999 * i);
    expect_file(1, "x_m,y_m,z_m,speed_m_s", lines,
                ": the path is too long: 11888221 samples every 0.02 s or 0.01 m; allowed are 10000000");
}

/* 4,004 legs of 999,000 s leave 4,000 s for a pause. Up to there the way is only too long to be sampled. */
static void the_longest_time(void **state)
{
    (void)state;
    enum { POINTS = 4005 };
    char *lines = malloc(POINTS * 32), *p = lines;
    for (int i = 0; i < POINTS; i++)
        p += sprintf(p, "%d,0,0,0.001,0\n", 999 * i);
    const size_t last = strlen("0\n");
    strcpy(p - last, "3999.5\n");
    expect_file(1, "x_m,y_m,z_m,speed_m_s,pause_s", lines, ": the path is too long: ");
    strcpy(p - last, "4000.5\n");
    expect_file(1, "x_m,y_m,z_m,speed_m_s,pause_s", lines,
                "line 4006: 4e+09 s from the first way-point on; allowed 4e+09");
    free(lines);
}

static void wrong_samples(void **state)
{
    (void)state;
    const struct pose right = {.quat = {0.0, 0.0, 3.0, 0.0}};
    static const char infinite[] = "sample 1: not a finite number";
    struct pose_sample s[2] = {{.t_s = 1.0, .pose = right}, {.t_s = 2.0, .pose = right}};
    double *const numbers[] = {&s[1].t_s,
                               &s[1].frame,
                               &s[1].pose.position_m[0],
                               &s[1].pose.position_m[1],
                               &s[1].pose.position_m[2],
                               &s[1].pose.quat[0],
                               &s[1].pose.quat[1],
                               &s[1].pose.quat[2],
                               &s[1].pose.quat[3]};
    struct trajectory *tr;
    struct sh_err err;
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) {
        const double before = *numbers[i];
        *numbers[i] = i % 2 ? (double)INFINITY : (double)NAN;
        assert_int_equal(trajectory_from_samples(s, 2, &tr, &err), SH_EINPUT);
        assert_null(tr);
        assert_string_equal(err.text, infinite);
        *numbers[i] = before;
    }
    s[1].pose.quat[2] = 0.0;
    assert_int_equal(trajectory_from_samples(s, 2, &tr, &err), SH_EINPUT);
    assert_string_equal(err.text, "sample 1: a quaternion of length 0");
    s[1] = s[0];
    assert_int_equal(trajectory_from_samples(s, 2, &tr, &err), SH_EINPUT);
    assert_string_equal(err.text, "sample 1: 0 s after the one before; allowed at least 0.0001 s");
    assert_int_equal(trajectory_from_samples(s, 0, &tr, &err), SH_EINPUT);
    assert_string_equal(err.text, "the trajectory has no samples");
}

/* A quaternion of any length counts as that of length 1. */
static void lengths_of_quaternions(void **state)
{
    (void)state;
    const struct pose_sample s[2] = {{.pose.quat = {2.0, 0.0, -4.0, 4.0}},
                                     {.t_s = 1.0, .pose.quat = {0.0, 1e-5, 0.0, 0.0}}};
    static const double want[2][4] = {{1.0 / 3.0, 0.0, -2.0 / 3.0, 2.0 / 3.0}, {0.0, 1.0, 0.0, 0.0}};
    struct trajectory *tr;
    struct sh_err err;
    assert_int_equal(trajectory_from_samples(s, 2, &tr, &err), SH_OK);
    for (int i = 0; i < 2; i++) {
        struct pose pose;
        double frame;
        trajectory_at(tr, i, &pose, &frame);
        for (int k = 0; k < 4; k++)
            assert_true(fabs(pose.quat[k] - want[i][k]) < 1e-15);
    }
    trajectory_free(tr);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(samples),          cmocka_unit_test(waypoints),
        cmocka_unit_test(wrong_samples),    cmocka_unit_test(samples_of_a_long_way),
        cmocka_unit_test(the_longest_time), cmocka_unit_test(lengths_of_quaternions),
    };
    return cmocka_run_group_tests(tests, make_file, remove_file);
}
