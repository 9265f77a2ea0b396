/* core/pose: the attitude convention, what lies between poses, trajectories and their files. */
#include "tests/unit/cases.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/geoframe.h"
#include "core/pose.h"

static const double DEG = M_PI / 180.0;

/* The convention written out: R = Rz(-heading) Rx(pitch) Ry(roll) from three elementary matrices. */
static void matrix_by_hand(double heading, double pitch, double roll, double out[9])
{
    const double h = -heading;
    const double z[9] = {cos(h), -sin(h), 0, sin(h), cos(h), 0, 0, 0, 1};
    const double x[9] = {1, 0, 0, 0, cos(pitch), -sin(pitch), 0, sin(pitch), cos(pitch)};
    const double y[9] = {cos(roll), 0, sin(roll), 0, 1, 0, -sin(roll), 0, cos(roll)};
    double zx[9] = {0};
    memset(out, 0, 9 * sizeof *out);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++)
                zx[3 * i + j] += z[3 * i + k] * x[3 * k + j];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++)
                out[3 * i + j] += zx[3 * i + k] * y[3 * k + j];
}

static void test_convention(void **state)
{
    (void)state;
    uint64_t random = 3;
    for (int n = 0; n < 1000; n++) {
        double heading = 2.0 * M_PI * case_unit(&random), pitch = (case_unit(&random) - 0.5) * 3.0,
               roll = (case_unit(&random) - 0.5) * 6.0, quat[4], got[9], want[9], back[3];
        pose_from_angles(heading, pitch, roll, quat);
        pose_matrix(quat, got);
        matrix_by_hand(heading, pitch, roll, want);
        for (int i = 0; i < 9; i++) /* products of a dozen roundings */
            assert_true(fabs(got[i] - want[i]) < 2e-15);
        pose_to_angles(quat, &back[0], &back[1], &back[2]);
        /* pitch stays 0.07 rad from the pole: errors grow by 1 / cos, 14 times */
        assert_true(fabs(back[0] - heading) < 1e-13 && fabs(back[1] - pitch) < 1e-13 && fabs(back[2] - roll) < 1e-13);
        pose_from_matrix(want, quat);
        pose_matrix(quat, got);
        for (int i = 0; i < 9; i++)
            assert_true(fabs(got[i] - want[i]) < 1e-13);
    }
    /* In words: heading 90 looks east, pitch lifts the nose, roll lowers the right side. */
    double quat[4], out[3];
    const double forward[3] = {0, 1, 0}, right[3] = {1, 0, 0};
    pose_from_angles(90 * DEG, 0, 0, quat);
    pose_rotate(quat, forward, out);
    assert_true(fabs(out[0] - 1.0) < 1e-15 && fabs(out[1]) < 1e-15);
    pose_from_angles(90 * DEG, 10 * DEG, 5 * DEG, quat);
    pose_rotate(quat, forward, out);
    assert_true(fabs(out[2] - sin(10 * DEG)) < 1e-15);
    pose_rotate(quat, right, out);
    assert_true(out[2] < -0.08);
}

static void test_between(void **state)
{
    (void)state;
    struct pose a = {.position_m = {1, 2, 3}}, b = {.position_m = {3, 2, -1}}, mid;
    pose_from_angles(350 * DEG, 0, 0, a.quat);
    pose_from_angles(30 * DEG, 0, 0, b.quat);
    for (int i = 0; i < 4; i++)
        b.quat[i] = -b.quat[i]; /* the same attitude: the shorter way is found all the same */
    for (double f = 0; f <= 1.0; f += 0.125) {
        double h, p, r;
        pose_between(&a, &b, f, &mid);
        pose_to_angles(mid.quat, &h, &p, &r);
        double want = fmod(350 + 40 * f, 360.0) * DEG;
        assert_true(fabs(h - want) < 1e-14 || fabs(fabs(h - want) - 2 * M_PI) < 1e-14);
        assert_true(fabs(mid.position_m[0] - (1 + 2 * f)) < 1e-15 && fabs(mid.position_m[2] - (3 - 4 * f)) < 1e-15);
    }
    assert_true(fabs(pose_angle_between(a.quat, b.quat) - 40 * DEG) < 1e-14);
    struct pose mount = {.position_m = {0, 2, 0.5}}, head;
    pose_from_angles(90 * DEG, 0, 0, mount.quat);
    pose_from_angles(90 * DEG, 0, 0, a.quat);
    pose_mount(&a, &mount, &head); /* two metres ahead of a platform that looks east; the head looks south */
    assert_true(fabs(head.position_m[0] - 3) < 1e-15 && fabs(head.position_m[1] - 2) < 1e-15 &&
                fabs(head.position_m[2] - 3.5) < 1e-15);
    double out[3];
    pose_rotate(head.quat, (const double[3]){0, 1, 0}, out);
    assert_true(fabs(out[1] + 1) < 1e-15);
}

static struct trajectory *make(const struct pose_sample *samples, size_t n)
{
    struct trajectory *tr;
    struct sh_err err;
    if (trajectory_from_samples(samples, n, &tr, &err) != SH_OK) fail_msg("%s", err.text);
    return tr;
}

static void test_straight_line(void **state)
{
    (void)state;
    static const double times[] = {5.0, 5.1, 5.3, 5.35, 6.0};
    struct pose_sample s[5];
    for (int i = 0; i < 5; i++) {
        s[i] = (struct pose_sample){.t_s = times[i], .frame = i};
        s[i].pose = (struct pose){.position_m = {3 * times[i], -2 * times[i], 7}, .quat = {2, 0, 0, 0}};
    }
    struct trajectory *tr = make(s, 5);
    struct pose p;
    double frame;
    for (double t = 5.0; t < 6.0; t += 0.001) {
        trajectory_at(tr, t, &p, &frame);
        /* a line is a cubic: only rounding of numbers below 20 */
        assert_true(fabs(p.position_m[0] - 3 * t) < 1e-13 && fabs(p.position_m[1] + 2 * t) < 1e-13);
        assert_true(p.quat[0] == 1.0);
    }
    trajectory_at(tr, 5.2, &p, &frame);
    assert_true(fabs(frame - 1.5) < 1e-12);
    trajectory_at(tr, 4.0, &p, &frame); /* before and behind, it stands */
    assert_true(p.position_m[0] == 15.0 && frame == 0.0);
    trajectory_at(tr, 9.0, &p, &frame);
    assert_true(p.position_m[0] == 18.0 && frame == 4.0);
    trajectory_free(tr);
}

enum { TURN_SAMPLES = 100 };
static const double RADIUS_M = 10.0, RATE = 1.0, STEP_S = 0.1;

/* A car that drives a circle at 10 m/s, nose along the way: at t on the circle's angle t, heading -t. */
static void on_circle(double t, struct pose *pose)
{
    *pose = (struct pose){.position_m = {RADIUS_M * cos(RATE * t), RADIUS_M * sin(RATE * t), 0.0}};
    pose_from_angles(-RATE * t, 0.0, 0.0, pose->quat);
}

static struct trajectory *circle(void)
{
    struct pose_sample s[TURN_SAMPLES];
    for (int i = 0; i < TURN_SAMPLES; i++) {
        s[i] = (struct pose_sample){.t_s = i * STEP_S};
        on_circle(s[i].t_s, &s[i].pose);
    }
    return make(s, TURN_SAMPLES);
}

static double distance(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
}

/* With x = RATE * STEP_S: the parabola's derivative on a circle is the true one times sin(x)/x. Put into the cubic,
 * that is off along the way by R x^3/6 times the largest of f(1-f)(1-2f), 0.0962, and across it by R x^4 3/128; higher
 * powers of x = 0.1 add below 2 %. By chords it would be R x^2/8. */
static void test_constant_turn(void **state)
{
    (void)state;
    struct trajectory *tr = circle();
    const double x = RATE * STEP_S, bound = 1.02 * RADIUS_M * hypot(x * x * x / 6 * 0.0963, x * x * x * x * 3 / 128);
    double worst = 0, chord = 0, frame;
    for (double t = STEP_S; t < (TURN_SAMPLES - 2) * STEP_S; t += 0.0007) { /* without the ends */
        struct pose got, want, a, b, straight;
        trajectory_at(tr, t, &got, &frame);
        on_circle(t, &want);
        worst = fmax(worst, distance(got.position_m, want.position_m));
        assert_true(pose_angle_between(got.quat, want.quat) < 1e-14); /* constant rate is what slerp does */
        double i = floor(t / STEP_S);
        on_circle(i * STEP_S, &a);
        on_circle((i + 1) * STEP_S, &b);
        pose_between(&a, &b, t / STEP_S - i, &straight);
        chord = fmax(chord, distance(straight.position_m, want.position_m));
    }
    print_message("# circle of 10 m, 10 m/s, 10 Hz: cubic off by %.3f mm (bound %.3f), chords by %.1f mm\n",
                  1e3 * worst, 1e3 * bound, 1e3 * chord);
    assert_true(worst < bound && worst > 0.5 * bound);
    assert_true(chord > 50 * worst);
    trajectory_free(tr);
}

/* Between its knots the head moves as pose_between says: within the stated bound of the trajectory, lever arm included.
 */
static void test_knots(void **state)
{
    (void)state;
    struct trajectory *tr = circle();
    struct pose mount = {.position_m = {0.5, 1.2, 2.0}}, body, head, between;
    struct pose_knot *knot;
    size_t n;
    double error_m, frame, worst = 0, turned = 0;
    struct sh_err err;
    pose_from_angles(30 * DEG, -10 * DEG, 0, mount.quat);
    assert_int_equal(trajectory_knots(tr, 0.25, 1e9, &mount, 1e-4, 10000000, 0.01, &knot, &n, &error_m, &err), SH_OK);
    assert_true(error_m <= 1e-4 && knot[0].t_ns == 0 && knot[n - 1].t_ns == 9650000000);
    for (size_t i = 0; i + 1 < n; i++) {
        int64_t gap = knot[i + 1].t_ns - knot[i].t_ns;
        assert_true(gap > 0 && gap <= 10000001);
        for (int j = 0; j <= 4; j++) {
            int64_t t = knot[i].t_ns + gap * j / 4;
            trajectory_at(tr, 0.25 + 1e-9 * (double)t, &body, &frame);
            pose_mount(&body, &mount, &head);
            pose_between(&knot[i].pose, &knot[i + 1].pose, (double)(t - knot[i].t_ns) / (double)gap, &between);
            worst = fmax(worst, distance(head.position_m, between.position_m));
            turned = fmax(turned, pose_angle_between(head.quat, between.quat));
        }
    }
    print_message("# %zu knots in 9.65 s: off by %.4f mm, bound %.4f mm; %.2g rad\n", n, 1e3 * worst, 1e3 * error_m,
                  turned);
    assert_true(worst <= error_m * 1.0001 && worst > 0.2 * error_m);
    assert_true(turned < 1e-9); /* a knot's time is rounded to a nanosecond */
    free(knot);
    trajectory_free(tr);
}

/* Cut at end_s: the same poses up to there, and the one of that time as the last. */
static void test_knots_to_an_end(void **state)
{
    (void)state;
    struct trajectory *tr = circle();
    const struct pose mount = {.quat = {1, 0, 0, 0}};
    struct pose_knot *whole, *part;
    struct pose last;
    size_t n, m;
    double error_m, frame;
    struct sh_err err;
    assert_int_equal(trajectory_knots(tr, 0.25, 1e9, &mount, 1e-4, 10000000, 0.01, &whole, &n, &error_m, &err), SH_OK);
    assert_int_equal(trajectory_knots(tr, 0.25, 1.2345, &mount, 1e-4, 10000000, 0.01, &part, &m, &error_m, &err),
                     SH_OK);
    assert_true(m > 2 && m < n && part[m - 1].t_ns == 984500000 && part[m - 2].t_ns < 984500000);
    assert_memory_equal(whole, part, (m - 1) * sizeof *part);
    trajectory_at(tr, 1.2345, &last, &frame);
    assert_true(distance(last.position_m, part[m - 1].pose.position_m) < 1e-12 && frame == part[m - 1].frame);
    free(part);
    assert_int_equal(trajectory_knots(tr, 0.25, 0.25, &mount, 1e-4, 10000000, 0.01, &part, &m, &error_m, &err), SH_OK);
    assert_true(m == 1 && part[0].t_ns == 0);
    free(whole);
    free(part);
    trajectory_free(tr);
}

/* As many knots as the way needs, however long it takes; and a limit. */
static void test_slow_knots(void **state)
{
    (void)state;
    static const struct {
        double way_m, turn_rad, s;
        size_t least, most; /* 0: refused */
    } cases[] = {
        {0, 0, 86400, 2, 2},     /* stands for a day */
        {0, 0, 8e9, 2, 2},       /* the longest time there is */
        {1, 0, 86400, 100, 102}, /* 1 m, every 0.01 m */
        {0, 1, 86400, 100, 102}, /* 1 rad, every 0.01 rad */
        {20, 0, 1, 100, 102},    /* fast: every 10 ms */
        {1e9, 0, 101000, 0, 0},  {1e9, 0, 8e9, 0, 0},
    };
    const struct pose mount = {.quat = {1, 0, 0, 0}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct pose_sample s[2] = {{.t_s = 0, .pose = {.quat = {1, 0, 0, 0}}}, {.t_s = cases[i].s}};
        struct trajectory *tr;
        struct pose_knot *knot;
        struct sh_err err;
        double error_m;
        size_t n;
        s[1].pose.position_m[1] = cases[i].way_m;
        pose_from_angles(cases[i].turn_rad, 0, 0, s[1].pose.quat);
        assert_int_equal(trajectory_from_samples(s, 2, &tr, &err), SH_OK);
        int rc = trajectory_knots(tr, 0, 1e10, &mount, 1e-4, 10000000, 0.01, &knot, &n, &error_m, &err);
        trajectory_free(tr);
        if (cases[i].most == 0) {
            assert_int_equal(rc, SH_EINPUT);
            assert_non_null(strstr(err.text, "allowed 10000000"));
            continue;
        }
        assert_int_equal(rc, SH_OK);
        assert_true(n >= cases[i].least && n <= cases[i].most && error_m <= 1e-4);
        assert_true(knot[n - 1].t_ns == llround(1e9 * cases[i].s));
        free(knot);
    }
}

/* ---- files */

static char path[] = "/tmp/scanhead-pose-XXXXXX";

static int make_file(void **state)
{
    (void)state;
    int fd = mkstemp(path);
    return fd < 0 ? -1 : close(fd);
}

static int remove_file(void **state)
{
    (void)state;
    return unlink(path);
}

static void write_file(const char *text)
{
    FILE *f = fopen(path, "w");
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
    if (trajectory_read_csv(path, &angles, &err) != SH_OK) fail_msg("%s", err.text);
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
    if (trajectory_read_csv(path, &quats, &err) != SH_OK) fail_msg("%s", err.text);
    trajectory_at(quats, 0.0, &b, &frame);
    assert_true(pose_angle_between(a.quat, b.quat) < 1e-14 && frame == 7.0 && b.position_m[0] == 1.0);
    trajectory_free(angles);
    trajectory_free(quats);
}

#define NAMES "t_s,x_m,y_m,z_m,heading_deg\n"

static void test_csv_errors(void **state)
{
    (void)state;
    static const struct {
        const char *text, *where, *what;
    } wrong[] = {
        {"", ":", "empty"},
        {"t_s,x_m,y_m\n0,1,2\n", "line 1", "columns have to be"},
        {"t_s,x_m,y_m,z_m,heading_deg,qw\n", "line 1", "columns have to be"},
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
        {NAMES "0,1,2,3,4\n1e300,1,2,3,4\n", "line 3", "t_s 1e+300; allowed -4e+09 to 4e+09"},
        {NAMES "-1e18,1,2,3,4\n0,1,2,3,4\n", "line 2", "t_s -1e+18; allowed"},
        {"\xef\xbb" NAMES, "line 1", "is unknown"}, /* no whole byte order mark */
        {"t_s,x_m,y_m,z_m,qw,qx,qy,qz\n0,0,0,0,1,1,0,0\n", "line 2", "quaternion"},
        {"t_s,x_m,y_m,z_m,heading_deg,pitch_deg\n0,0,0,0,0,91\n", "line 2", "pitch_deg"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        struct trajectory *tr;
        struct sh_err err = {0};
        write_file(wrong[i].text);
        assert_int_equal(trajectory_read_csv(path, &tr, &err), SH_EINPUT);
        assert_null(tr);
        if (strstr(err.text, path) == NULL || strstr(err.text, wrong[i].where) == NULL ||
            strstr(err.text, wrong[i].what) == NULL)
            fail_msg("%zu: %s", i, err.text);
    }
    struct trajectory *tr;
    struct sh_err err;
    assert_int_equal(trajectory_read_csv("/nonexistent/x.csv", &tr, &err), SH_EINPUT);
}

static void test_waypoints(void **state)
{
    (void)state;
    struct sh_err err;
    struct trajectory *tr;
    struct pose p;
    double frame, h, pitch, roll, first, last;
    /* North at 5 m/s for 20 m, stand for 2 s, on for 10 m at 2 m/s. */
    write_file("x_m,y_m,z_m,speed_m_s,pause_s\n0,0,1,5,0\n0,10,1,5,0\n0,20,1,2,2\n0,30,1,2,0\n");
    if (trajectory_read_waypoints(path, NULL, &tr, &err) != SH_OK) fail_msg("%s", err.text);
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
    trajectory_free(tr);
    /* A pause in a bend: the car stands as it came and leaves as it stands, without a jerk of its nose. */
    write_file("x_m,y_m,z_m,speed_m_s,pause_s\n0,0,0,5,0\n0,20,0,5,1\n20,20,0,5,0\n");
    if (trajectory_read_waypoints(path, NULL, &tr, &err) != SH_OK) fail_msg("%s", err.text);
    struct pose before;
    trajectory_at(tr, 0.0, &before, &frame);
    for (double t = 0.01; t <= 9.0; t += 0.01) {
        trajectory_at(tr, t, &p, &frame);
        assert_true(pose_angle_between(before.quat, p.quat) < 0.01);   /* 45 degrees in 4 s, at most 1 rad/s anywhere */
        assert_true(distance(before.position_m, p.position_m) < 0.15); /* at most three times the mean speed */
        before = p;
    }
    trajectory_free(tr);
    /* A corner: heading turns from north to east, in the end along the last leg. */
    write_file("x_m,y_m,z_m,speed_m_s\n0,0,0,10\n0,50,0,10\n50,50,0,10\n100,50,0,10\n");
    if (trajectory_read_waypoints(path, NULL, &tr, &err) != SH_OK) fail_msg("%s", err.text);
    trajectory_at(tr, 5.0, &p, &frame);
    pose_to_angles(p.quat, &h, &pitch, &roll);
    assert_true(fabs(h - 45 * DEG) < 1e-3); /* equal times before and behind: the parabola halves the angle */
    trajectory_at(tr, 15.0, &p, &frame);
    pose_to_angles(p.quat, &h, &pitch, &roll);
    assert_true(fabs(h - 90 * DEG) < 1e-3);
    trajectory_free(tr);
    static const char *const wrong[] = {
        "x_m,y_m,z_m\n0,0,0\n", "x_m,y_m,z_m,speed_m_s\n0,0,0,1\n", "x_m,y_m,z_m,speed_m_s\n0,0,0,0\n1,0,0,1\n",
        "x_m,y_m,z_m,speed_m_s\n0,0,0,1\n0,0,0,1\n", "x_m,y_m,z_m,speed_m_s,pause_s\n0,0,0,1,-1\n1,0,0,1,0\n"};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        write_file(wrong[i]);
        assert_int_equal(trajectory_read_waypoints(path, NULL, &tr, &err), SH_EINPUT);
        assert_non_null(strstr(err.text, path));
    }
}

/* 10 m at 1 mm/s are as many samples as they are long; more than there is room for, and a time that is no count of
 * nanoseconds, are errors. */
static void test_slow_waypoints(void **state)
{
    (void)state;
    struct sh_err err;
    struct trajectory *tr;
    struct pose p;
    double frame, h, pitch, roll;
    write_file("x_m,y_m,z_m,speed_m_s\n0,0,0,0.001\n0,5,0,0.001\n5,5,0,0.001\n");
    if (trajectory_read_waypoints(path, NULL, &tr, &err) != SH_OK) fail_msg("%s", err.text);
    const struct pose mount = {.quat = {1, 0, 0, 0}};
    struct pose_knot *knot;
    size_t n;
    double error_m;
    assert_int_equal(trajectory_knots(tr, 0, 1e9, &mount, 1e-4, 10000000, 0.01, &knot, &n, &error_m, &err), SH_OK);
    assert_true(n < 3100 && error_m <= 1e-4); /* legs of 5.0 to 5.5 m, each step of theirs in up to three */
    free(knot);
    trajectory_at(tr, 5000.0, &p, &frame);
    pose_to_angles(p.quat, &h, &pitch, &roll);
    assert_true(fabs(h - 45 * DEG) < 1e-3 && fabs(frame - 1) < 1e-9);
    trajectory_free(tr);
    char text[4096] = "x_m,y_m,z_m,speed_m_s\n";
    for (int i = 0; i < 120; i++) /* each 999 m at 1 mm/s: 99,900 samples */
        snprintf(text + strlen(text), sizeof text - strlen(text), "%d,0,0,0.001\n", 999 * i);
    write_file(text);
    assert_int_equal(trajectory_read_waypoints(path, NULL, &tr, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, path));
    assert_non_null(strstr(err.text, "allowed 10000000"));
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs("x_m,y_m,z_m,speed_m_s,pause_s\n", f);
    for (int i = 0; i < 50000; i++) /* a day each: 4e9 s are over with the 46,297th */
        fprintf(f, "0,%d,0,1000,86400\n", i);
    assert_int_equal(fclose(f), 0);
    assert_int_equal(trajectory_read_waypoints(path, NULL, &tr, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "line 46298: "));
    assert_non_null(strstr(err.text, "allowed 4e+09"));
}

/* East in a scene in ECEF: up is the ellipsoid's normal, forward is east, wherever on the Earth. */
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
        if (trajectory_read_waypoints(path, &ecef, &tr, &err) != SH_OK) fail_msg("%s", err.text);
        trajectory_at(tr, i == 1 ? 1e4 : 2.0, &p, &frame);
        pose_matrix(p.quat, r);
        for (int k = 0; k < 3; k++) {
            assert_true(fabs(r[3 * k + 2] - up[k]) < 1e-9);
            /* differences of coordinates that are right to 1e-9 m, over 1 mm, or 0.1 mm when it is slow */
            assert_true(fabs(r[3 * k + 1] - east[k]) < 3e-5);
        }
        trajectory_free(tr);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_convention),
        cmocka_unit_test(test_between),
        cmocka_unit_test(test_straight_line),
        cmocka_unit_test(test_constant_turn),
        cmocka_unit_test(test_knots),
        cmocka_unit_test(test_knots_to_an_end),
        cmocka_unit_test(test_csv),
        cmocka_unit_test(test_csv_errors),
        cmocka_unit_test(test_waypoints),
        cmocka_unit_test(test_slow_knots),
        cmocka_unit_test(test_slow_waypoints),
        cmocka_unit_test(test_level_waypoints),
    };
    return cmocka_run_group_tests(tests, make_file, remove_file);
}
