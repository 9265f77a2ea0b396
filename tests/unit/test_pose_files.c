/* SPDX-License-Identifier: MIT */
/* core/pose: trajectories from files of samples and of waypoints. */
#include <unistd.h>

#include "core/geoframe.h"
#include "core/vec3.h"
#include "tests/unit/file_rig.h"
#include "tests/unit/pose_rig.h"

static void write_file(const char *text)
{
    FILE *f = fopen(file_path, "w");
    assert_non_null(f);
    fputs(text, f);
    assert_int_equal(fclose(f), 0);
}

static void test_csv(void **state)
{
    (void)state;
    struct sh_err err;
    struct trajectory *angles, *quats;
    struct pose a, b;
    double frame, first, last;
    write_file("\xef\xbb\xbf# a comment behind a byte order mark\n\nt_s, x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg\r\n"
               "0,1,2,3,5,-6,370\r\n# another\n2.5,3,2,3,0,0,90\n");
    if (trajectory_read_csv(file_path, NULL, &angles, &err) != SH_OK) fail_msg("%s", err.text);
    trajectory_span(angles, &first, &last);
    assert_true(first == 0.0 && last == 2.5);
    trajectory_at(angles, 0.0, &a, &frame);
    pose_from_angles(10 * DEG, -6 * DEG, 5 * DEG, b.quat);
    assert_true(pose_angle_between(a.quat, b.quat) < 1e-14 && a.position_m[1] == 2.0);
    char text[300]; /* the same by quaternions, columns in another order, with frames */
    snprintf(text, sizeof text,
             "frame,qw,qx,qy,qz,z_m,y_m,x_m,t_s\n7,%.17g,%.17g,%.17g,%.17g,3,2,1,0\n8,1,0,0,0,3,2,3,2\n", b.quat[0],
             b.quat[1], b.quat[2], b.quat[3]);
    write_file(text);
    if (trajectory_read_csv(file_path, NULL, &quats, &err) != SH_OK) fail_msg("%s", err.text);
    trajectory_at(quats, 0.0, &b, &frame);
    assert_true(pose_angle_between(a.quat, b.quat) < 1e-14 && frame == 7.0 && b.position_m[0] == 1.0);
    trajectory_free(angles);
    trajectory_free(quats);
}

/* Nose up and nose down are allowed, and are the same by quaternion. */
static void test_csv_upright(void **state)
{
    (void)state;
    struct sh_err err;
    struct trajectory *tr;
    struct pose p;
    double frame, quat[4];
    write_file("t_s,x_m,y_m,z_m,heading_deg,pitch_deg,roll_deg\n0,0,0,0,30,90,10\n1,0,0,0,30,-90,10\n");
    if (trajectory_read_csv(file_path, NULL, &tr, &err) != SH_OK) fail_msg("%s", err.text);
    for (int i = 0; i < 2; i++) {
        trajectory_at(tr, i, &p, &frame);
        pose_from_angles(30 * DEG, i == 0 ? 90 * DEG : -90 * DEG, 10 * DEG, quat);
        assert_true(pose_angle_between(p.quat, quat) < 1e-14);
    }
    trajectory_free(tr);
}

/* A quaternion may be as long, and as short, as the text of test_csv_errors says. */
static void test_csv_lengths(void **state)
{
    (void)state;
    struct sh_err err;
    struct trajectory *tr;
    write_file("t_s,x_m,y_m,z_m,qw,qx,qy,qz\n0,0,0,0,0.9995,0,0,0\n1,0,0,0,1.0005,0,0,0\n");
    if (trajectory_read_csv(file_path, NULL, &tr, &err) != SH_OK) fail_msg("%s", err.text);
    trajectory_free(tr);
}

#define NAMES "t_s,x_m,y_m,z_m,heading_deg\n"

static void test_csv_errors(void **state)
{
    (void)state;
    static const struct {
        const char *text, *where, *what;
    } wrong[] = {
        {"", ":", "empty"},
        {"t_s,x_m,y_m\n0,1,2\n", "line 1", "columns must be"},
        {"t_s,x_m,y_m,z_m,heading_deg,qw\n", "line 1", "columns must be"},
        {"t_s,x_m,y_m,z_m,heading\n", "line 1", "\"heading\" is unknown; allowed t_s"},
        {"t_s,t_s\n", "line 1", "twice"},
        {NAMES, ":", "no samples"},
        {NAMES "0,1,2,3\n", "line 2", "4 values"},
        {NAMES "0,1,2,3,4,5\n", "line 2", "more than the 5"},
        {NAMES "0,1,2,3,4\n1,1,2,,4\n", "line 3", "z_m is not a finite decimal number: \"\""},
        {NAMES "0,1,nan,3,4\n", "line 2", "y_m"},
        {NAMES "0,0x10,2,3,4\n", "line 2", "x_m"},
        {NAMES "0,1e999,2,3,4\n", "line 2", "x_m"},
        {NAMES "0,1 m,2,3,4\n", "line 2", "x_m"},
        {NAMES "0,1,2,3,4\n# c\n0,1,2,3,4\n", "line 4", "rising times"},
        {NAMES "0,1,2,3,4\n0.00005,1,2,3,4\n", "line 3", "at least 0.0001 s"},
        {NAMES "1700000000.25,1,2,3,4\n1700000000.125,1,2,3,4\n", "line 3",
         "t_s 1700000000.125 comes after 1700000000.25;"},
        {NAMES "0,1,2,3,4\n1e300,1,2,3,4\n", "line 3", "t_s 1e+300; allowed -4e+09 to 4e+09"},
        {NAMES "-1e18,1,2,3,4\n0,1,2,3,4\n", "line 2", "t_s -1e+18; allowed"},
        {"\xef\xbb" NAMES, "line 1", "is unknown"}, /* no whole byte order mark */
        {"t_s,x_m,y_m,z_m,qw,qx,qy,qz\n0,0,0,0,1,1,0,0\n", "line 2", "1.41421; allowed 0.9995 to 1.0005"},
        {"t_s,x_m,y_m,z_m,heading_deg,pitch_deg\n0,0,0,0,0,91\n", "line 2", "pitch_deg"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        struct trajectory *tr;
        struct sh_err err = {0};
        write_file(wrong[i].text);
        assert_int_equal(trajectory_read_csv(file_path, NULL, &tr, &err), SH_EINPUT);
        assert_null(tr);
        if (strstr(err.text, file_path) == NULL || strstr(err.text, wrong[i].where) == NULL ||
            strstr(err.text, wrong[i].what) == NULL)
            fail_msg("%zu: %s", i, err.text);
    }
    struct trajectory *tr;
    struct sh_err err;
    /* Steps of the least length: doubles near 1.7e9 are 0.24 us apart. */
    write_file(NAMES "1700000000,1,2,3,4\n1700000000.0001,1,2,3,4\n1700000000.0002,1,2,3,4\n");
    assert_int_equal(trajectory_read_csv(file_path, NULL, &tr, &err), SH_OK);
    trajectory_free(tr);
    assert_int_equal(trajectory_read_csv("/nonexistent/x.csv", NULL, &tr, &err), SH_EINPUT);
    /* A number does not end at a byte 0. */
    static const char zero[] = NAMES "0,1\0002,2,3,4\n";
    FILE *file = fopen(file_path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(zero, 1, sizeof zero - 1, file), sizeof zero - 1);
    assert_int_equal(fclose(file), 0);
    assert_int_equal(trajectory_read_csv(file_path, NULL, &tr, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "x_m is not a finite decimal number: \"1?2\""));
}

static void test_waypoints(void **state)
{
    (void)state;
    struct sh_err err;
    struct trajectory *tr;
    struct pose p;
    double frame, h, pitch, roll, first, last;
    /* The way goes north at 5 m/s for 20 m, stands for 2 s, and goes on for 10 m at 2 m/s. */
    write_file("x_m,y_m,z_m,speed_m_s,pause_s\n0,0,1,5,0\n0,10,1,5,0\n0,20,1,2,2\n0,30,1,2,0\n");
    if (trajectory_read_waypoints(file_path, NULL, NULL, &tr, &err) != SH_OK) fail_msg("%s", err.text);
    trajectory_span(tr, &first, &last);
    assert_true(first == 0.0 && fabs(last - 11.0) < 1e-12);
    trajectory_at(tr, 1.0, &p, &frame);
    pose_to_angles(p.quat, &h, &pitch, &roll);
    assert_true(fabs(p.position_m[1] - 5) < 1e-3 && fabs(frame - 0.5) < 1e-3 && fabs(h) < 1e-12 &&
                p.position_m[2] == 1);
    for (double t = 4.0; t <= 6.0; t += 0.1) { /* it stands, exactly */
        trajectory_at(tr, t, &p, &frame);
        assert_true(fabs(p.position_m[1] - 20) < 1e-12 && fabs(frame - 2) < 1e-12);
    }
    /* The body comes to rest, and starts from it. In the last or first share f of a leg's time it covers (2 - f) * f^2
     * of the leg. Three times 2 * f^2 is allowed. */
    static const double f = 0.05;
    trajectory_at(tr, 4.0 - 2.0 * f, &p, &frame);
    assert_true(20 - p.position_m[1] > 0 && 20 - p.position_m[1] < 3 * 10 * 2 * f * f);
    trajectory_at(tr, 6.0 + 5.0 * f, &p, &frame);
    assert_true(p.position_m[1] - 20 > 0 && p.position_m[1] - 20 < 3 * 10 * 2 * f * f);
    trajectory_at(tr, 2.0 * f, &p, &frame); /* and at the ends it is in motion */
    assert_true(p.position_m[1] > 10 * f / 2);
    trajectory_free(tr);
    /* At a pause in a bend the car keeps the heading with which it came, and leaves with it: no jump. */
    write_file("x_m,y_m,z_m,speed_m_s,pause_s\n0,0,0,5,0\n0,20,0,5,1\n20,20,0,5,0\n");
    if (trajectory_read_waypoints(file_path, NULL, NULL, &tr, &err) != SH_OK) fail_msg("%s", err.text);
    struct pose before;
    trajectory_at(tr, 0.0, &before, &frame);
    for (double t = 0.01; t <= 9.0; t += 0.01) {
        trajectory_at(tr, t, &p, &frame);
        assert_true(pose_angle_between(before.quat, p.quat) < 0.01); /* 45 degrees in 4 s, at most 1 rad/s anywhere */
        assert_true(vec3_distance(before.position_m, p.position_m) < 0.15); /* at most three times the mean speed */
        before = p;
    }
    trajectory_free(tr);
    /* At a corner the heading turns from north to east. At the end it is that of the last leg. */
    write_file("x_m,y_m,z_m,speed_m_s\n0,0,0,10\n0,50,0,10\n50,50,0,10\n100,50,0,10\n");
    if (trajectory_read_waypoints(file_path, NULL, NULL, &tr, &err) != SH_OK) fail_msg("%s", err.text);
    trajectory_at(tr, 5.0, &p, &frame);
    pose_to_angles(p.quat, &h, &pitch, &roll);
    assert_true(fabs(h - 45 * DEG) < 1e-3); /* equal times before and after: the parabola halves the angle */
    trajectory_at(tr, 15.0, &p, &frame);
    pose_to_angles(p.quat, &h, &pitch, &roll);
    assert_true(fabs(h - 90 * DEG) < 1e-3);
    trajectory_free(tr);
    static const char *const wrong[] = {
        "x_m,y_m,z_m\n0,0,0\n", "x_m,y_m,z_m,speed_m_s\n0,0,0,1\n", "x_m,y_m,z_m,speed_m_s\n0,0,0,0\n1,0,0,1\n",
        "x_m,y_m,z_m,speed_m_s\n0,0,0,1\n0,0,0,1\n", "x_m,y_m,z_m,speed_m_s,pause_s\n0,0,0,1,-1\n1,0,0,1,0\n"};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        write_file(wrong[i]);
        assert_int_equal(trajectory_read_waypoints(file_path, NULL, NULL, &tr, &err), SH_EINPUT);
        assert_non_null(strstr(err.text, file_path));
    }
}

/* Each column is needed, whichever the others are. Without a column of frames the samples are counted from 0. */
static void test_columns_and_frames(void **state)
{
    (void)state;
    static const char *const angles[5] = {"t_s", "x_m", "y_m", "z_m", "heading_deg"}, *const quats[8] = {
                                                                                          "t_s", "x_m", "y_m", "z_m",
                                                                                          "qw",  "qx",  "qy",  "qz"};
    struct sh_err err;
    struct trajectory *tr;
    for (int form = 0; form < 2; form++) {
        const int n = form ? 8 : 5;
        for (int without = 0; without <= n; without++) {
            char text[256] = "pitch_deg", *p = text + (form ? 0 : strlen(text));
            for (int k = 0; k < n; k++)
                if (k != without) p += sprintf(p, "%s%s", p == text ? "" : ",", (form ? quats : angles)[k]);
            strcpy(p, "\n");
            write_file(text);
            assert_int_equal(trajectory_read_csv(file_path, NULL, &tr, &err), SH_EINPUT);
            assert_int_equal(strstr(err.text, "columns must be") != NULL, without < n);
        }
    }
    write_file("t_s,x_m,y_m,z_m,heading_deg\n0,0,0,0,0\n1,1,0,0,0\n2,3,0,0,0\n4,5,0,0,0\n");
    if (trajectory_read_csv(file_path, NULL, &tr, &err) != SH_OK) fail_msg("%s", err.text);
    static const double t_s[4] = {0, 1, 2, 4};
    for (int i = 0; i < 4; i++) {
        struct pose pose;
        double frame;
        trajectory_at(tr, t_s[i], &pose, &frame);
        assert_true(fabs(frame - i) < 1e-12);
    }
    trajectory_free(tr);
}

/* The limits themselves are allowed. A pause may be shorter than a second. */
static void test_speeds_and_pauses(void **state)
{
    (void)state;
    static const struct {
        const char *speed, *pause;
        double last_s; /* NaN: refused */
        const char *says;
    } row[] = {{"0.001", "0", 10000.0, NULL},
               {"0.00099", "0", NAN, "speed_m_s 0.00099; allowed 0.001 to 1000"},
               {"1000", "0", 0.01, NULL},
               {"1000.1", "0", NAN, "speed_m_s 1000.1; allowed 0.001 to 1000"},
               {"2", "0.5", 5.5, NULL},
               {"2", "0.0001", 5.0001, NULL},
               {"2", "0.00009", NAN, "pause_s 9e-05; allowed 0, or 0.0001 to 86400"},
               {"2", "86400", 86405.0, NULL},
               {"2", "86401", NAN, "pause_s 86401; allowed 0, or 0.0001 to 86400"}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        char text[160];
        struct sh_err err;
        struct trajectory *tr;
        snprintf(text, sizeof text, "x_m,y_m,z_m,speed_m_s,pause_s\n0,0,0,%s,%s\n10,0,0,1,0\n", row[i].speed,
                 row[i].pause);
        write_file(text);
        const int rc = trajectory_read_waypoints(file_path, NULL, NULL, &tr, &err);
        assert_int_equal(rc, isnan(row[i].last_s) ? SH_EINPUT : SH_OK);
        if (rc != SH_OK) {
            if (strstr(err.text, row[i].says) == NULL) fail_msg("%s", err.text);
            continue;
        }
        double first_s, last_s, frame;
        struct pose pose;
        trajectory_span(tr, &first_s, &last_s);
        assert_true(fabs(last_s - row[i].last_s) < 1e-9 * row[i].last_s);
        trajectory_at(tr, 0.9 * strtod(row[i].pause, NULL), &pose, &frame); /* it stands */
        assert_true(fabs(pose.position_m[0]) < 1e-12 && frame < 1e-12);
        trajectory_free(tr);
    }
}

/* 10 m at 1 mm/s give as many samples as their length needs. More than there is room for are an error, and so is a time
 * beyond the nanosecond counter. */
static void test_slow_waypoints(void **state)
{
    (void)state;
    struct sh_err err;
    struct trajectory *tr;
    struct pose p;
    double frame, h, pitch, roll;
    write_file("x_m,y_m,z_m,speed_m_s\n0,0,0,0.001\n0,5,0,0.001\n5,5,0,0.001\n");
    if (trajectory_read_waypoints(file_path, NULL, NULL, &tr, &err) != SH_OK) fail_msg("%s", err.text);
    const struct pose mount = {.quat = {1, 0, 0, 0}};
    struct pose_path got;
    assert_int_equal(find_path(tr, 0, 1e9, &mount, &got, &err), SH_OK);
    assert_true(got.n < 3100 && got.error_m <= 1e-4); /* legs of 5.0 to 5.5 m, each sample in up to three knots */
    free(got.knot);
    trajectory_at(tr, 5000.0, &p, &frame);
    pose_to_angles(p.quat, &h, &pitch, &roll);
    assert_true(fabs(h - 45 * DEG) < 1e-3 && fabs(frame - 1) < 1e-9);
    trajectory_free(tr);
    char text[4096] = "x_m,y_m,z_m,speed_m_s\n";
    for (int i = 0; i < 120; i++) /* each 999 m at 1 mm/s: 99,900 samples */
        snprintf(text + strlen(text), sizeof text - strlen(text), "%d,0,0,0.001\n", 999 * i);
    write_file(text);
    assert_int_equal(trajectory_read_waypoints(file_path, NULL, NULL, &tr, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, file_path));
    assert_non_null(strstr(err.text, "allowed are 10000000"));
    FILE *f = fopen(file_path, "w");
    assert_non_null(f);
    fputs("x_m,y_m,z_m,speed_m_s,pause_s\n", f);
    for (int i = 0; i < 50000; i++) /* a day each: 4e9 s are over with the 46,297th */
        fprintf(f, "0,%d,0,1000,86400\n", i);
    assert_int_equal(fclose(f), 0);
    assert_int_equal(trajectory_read_waypoints(file_path, NULL, NULL, &tr, &err), SH_EINPUT);
    /* 46,297 pauses, and 46.296 s on the way */
    assert_non_null(strstr(err.text, "line 46298: 4.00006085e+09 s from the first way-point on; "));
    assert_non_null(strstr(err.text, "allowed 4e+09"));
}

/* The way goes east in a scene in ECEF. Up is the ellipsoid's normal and forward is east, anywhere on the Earth. */
static void test_level_waypoints(void **state)
{
    (void)state;
    const double a_m = 6378137.0, e2 = 0.0066943799901413165, places[][2] = {{50, 8}, {-33, 151}, {0, -90}, {89, 30}};
    struct geoframe ecef;
    geoframe_set_ecef(&ecef);
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        double lat = places[i][0] * DEG, lon = places[i][1] * DEG, n_m = a_m / sqrt(1 - e2 * sin(lat) * sin(lat));
        const double up[3] = {cos(lat) * cos(lon), cos(lat) * sin(lon), sin(lat)}, east[3] = {-sin(lon), cos(lon), 0};
        const double at_m[3] = {n_m * up[0], n_m * up[1], n_m * (1 - e2) * up[2]};
        struct trajectory *tr;
        struct sh_err err;
        struct pose p;
        double frame, r[9];
        char text[512] = "x_m,y_m,z_m,speed_m_s\n";
        for (int k = -1; k <= 1; k++)
            snprintf(text + strlen(text), sizeof text - strlen(text), "%.9f,%.9f,%.9f,%g\n", at_m[0] + 10 * k * east[0],
                     at_m[1] + 10 * k * east[1], at_m[2] + 10 * k * east[2], i == 1 ? 0.001 : 5.0);
        write_file(text);
        if (trajectory_read_waypoints(file_path, &ecef, NULL, &tr, &err) != SH_OK) fail_msg("%s", err.text);
        trajectory_at(tr, i == 1 ? 1e4 : 2.0, &p, &frame);
        quat_matrix(p.quat, r);
        for (int k = 0; k < 3; k++) {
            assert_true(fabs(r[3 * k + 2] - up[k]) < 1e-9);
            /* Forward is a difference of coordinates that are right to 1e-9 m, over 1 mm, or 0.1 mm on the slow way. */
            assert_true(fabs(r[3 * k + 1] - east[k]) < 3e-5);
        }
        trajectory_free(tr);
    }
}

static void keep_warning(void *ctx, const char *text)
{
    snprintf(ctx, 64, "%s", text);
}

/* The text of a file may be a command for the terminal that shows the message. */
static void test_messages_are_lines(void **state)
{
    (void)state;
    struct sh_err err;
    struct trajectory *tr;
    char warning[64];
    const struct sh_report report = {.ctx = warning, .warn = keep_warning};
    write_file("t_s,\x1b[2J\x7f\a\n0,1\n");
    assert_int_equal(trajectory_read_csv(file_path, NULL, &tr, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "column \"?[2J??\" is unknown"));
    sh_warn(&report, "%s", "a name\r\n\x1b[0m\x7f \xc3\xa4");
    assert_string_equal(warning, "a name???[0m? \xc3\xa4");
    sh_warn(&report, "%s",
            "\xc2\x9b"
            "2J \xc2\xa7 \xc2"); /* CSI of one character; a sign; half of one */
    assert_string_equal(warning, "??2J \xc2\xa7 ?");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_csv),
        cmocka_unit_test(test_csv_errors),
        cmocka_unit_test(test_csv_upright),
        cmocka_unit_test(test_csv_lengths),
        cmocka_unit_test(test_waypoints),
        cmocka_unit_test(test_columns_and_frames),
        cmocka_unit_test(test_speeds_and_pauses),
        cmocka_unit_test(test_slow_waypoints),
        cmocka_unit_test(test_level_waypoints),
        cmocka_unit_test(test_messages_are_lines),
    };
    return cmocka_run_group_tests(tests, make_file, remove_file);
}
