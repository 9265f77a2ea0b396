/* SPDX-License-Identifier: MIT */
/* core/pose: the attitude convention, what lies between poses, trajectories and their knots. */
#include "tests/unit/pose_rig.h"

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
        quat_matrix(quat, got);
        matrix_by_hand(heading, pitch, roll, want);
        for (int i = 0; i < 9; i++) /* products of a dozen roundings */
            assert_true(fabs(got[i] - want[i]) < 2e-15);
        pose_to_angles(quat, &back[0], &back[1], &back[2]);
        /* pitch stays 0.07 rad from the pole: errors grow by 1 / cos, 14 times */
        assert_true(fabs(back[0] - heading) < 1e-13 && fabs(back[1] - pitch) < 1e-13 && fabs(back[2] - roll) < 1e-13);
        pose_from_matrix(want, quat);
        quat_matrix(quat, got);
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

/* Nose straight up or down: heading and roll turn about one axis, and only their sum or difference counts. The angles that
 * come back give the same attitude, also just beside the pole. Nearer to it than 1e-9 roll is put into the heading. */
static void test_pole(void **state)
{
    (void)state;
    static const double pitch_deg[] = {90, -90, 90 - 1e-5, -90 + 1e-5, 90 - 1e-7};
    for (size_t i = 0; i < sizeof pitch_deg / sizeof pitch_deg[0]; i++)
        for (int heading_deg = 0; heading_deg < 360; heading_deg += 45)
            for (int roll_deg = -150; roll_deg <= 180; roll_deg += 30) {
                double quat[4], again[4], matrix[9], h, p, r;
                matrix_by_hand(heading_deg * DEG, pitch_deg[i] * DEG, roll_deg * DEG, matrix);
                pose_from_angles(heading_deg * DEG, pitch_deg[i] * DEG, roll_deg * DEG, quat);
                pose_to_angles(quat, &h, &p, &r);
                assert_true(h >= 0 && h < 2 * M_PI + 1e-9 && fabs(p - pitch_deg[i] * DEG) < 1e-12);
                pose_from_angles(h, p, r, again);
                if (pose_angle_between(quat, again) > 2e-15) /* products of a dozen roundings */
                    fail_msg("%d %.9g %d: off by %g", heading_deg, pitch_deg[i], roll_deg,
                             pose_angle_between(quat, again));
                pose_from_matrix(matrix, again);
                assert_true(pose_angle_between(quat, again) < 2e-15);
            }
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

/* A quaternion and its negative are one attitude: the way between two is the short one, whatever their signs. */
static void test_short_way(void **state)
{
    (void)state;
    uint64_t random = 8;
    for (int n = 0; n < 100; n++) {
        struct pose a = {.position_m = {0}}, b = {.position_m = {0}}, mid, other;
        double axis[3], r[9], want[9];
        pose_from_angles(6.0 * case_unit(&random), case_unit(&random), case_unit(&random), a.quat);
        pose_from_angles(6.0 * case_unit(&random), case_unit(&random), case_unit(&random), b.quat);
        const double turn = pose_angle_between(a.quat, b.quat);
        pose_between(&a, &b, 0.25, &mid);
        for (int k = 0; k < 4; k++)
            b.quat[k] = -b.quat[k];
        pose_between(&a, &b, 0.25, &other);
        quat_matrix(mid.quat, want);
        quat_matrix(other.quat, r);
        assert_true(turn <= M_PI && fabs(pose_angle_between(a.quat, b.quat) - turn) < 1e-12);
        assert_true(fabs(pose_angle_between(a.quat, other.quat) - 0.25 * turn) < 1e-12);
        for (int i = 0; i < 9; i++)
            assert_true(fabs(r[i] - want[i]) < 1e-12);
        quat_turn(a.quat, b.quat, axis, r);
        assert_true(fabs(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2] - 1.0) < 1e-12);
    }
}

/* Straight up and straight down heading and roll turn about one axis: their difference, or sum, is said as heading. */
static void test_straight_up(void **state)
{
    (void)state;
    for (int up = 0; up < 2; up++)
        for (int n = 0; n < 12; n++) {
            const double heading = (25 + 30 * n) * DEG, roll = (n % 3) * 10 * DEG, pitch = (up ? 90 : -90) * DEG;
            double quat[4], said[3], r[9], want[9];
            pose_from_angles(heading, pitch, roll, quat);
            quat_matrix(quat, want);
            pose_to_angles(quat, &said[0], &said[1], &said[2]);
            /* the cosine of the pitch is what rounding leaves, of which the pitch is the root's error: 2e-8 */
            assert_true(fabs(said[1] - pitch) < 5e-8 && said[2] == 0.0);
            const double off = said[0] - (up ? heading - roll : heading + roll);
            assert_true(fabs(remainder(off, 2.0 * M_PI)) < 1e-12);
            pose_from_matrix(want, quat);
            quat_matrix(quat, r);
            for (int i = 0; i < 9; i++)
                assert_true(fabs(r[i] - want[i]) < 5e-8);
        }
}

/* A knot counts from its own time on; before the first it is the first. */
static void test_find_knot(void **state)
{
    (void)state;
    static const struct pose_knot knot[4] = {{.t_ns = 0}, {.t_ns = 10}, {.t_ns = 20}, {.t_ns = 35}};
    static const int64_t t_ns[] = {-5, 0, 9, 10, 11, 20, 34, 35, 1000};
    static const size_t want[] = {0, 0, 0, 1, 1, 2, 2, 3, 3};
    for (size_t i = 0; i < sizeof t_ns / sizeof t_ns[0]; i++)
        assert_int_equal(pose_find_knot(knot, 4, t_ns[i]), want[i]);
}

static struct trajectory *along_x(const double *t_s, const double *x_m, size_t n)
{
    struct pose_sample sample[8] = {{0}};
    struct trajectory *tr;
    struct sh_err err;
    for (size_t i = 0; i < n; i++)
        sample[i] = (struct pose_sample){.t_s = t_s[i],
                                         .pose = {.position_m = {x_m[i], 0.0, 0.0}, .quat = {1.0, 0.0, 0.0, 0.0}}};
    if (trajectory_from_samples(sample, n, &tr, &err) != 0) fail_msg("%s", err.text);
    return tr;
}

/* Samples are at least POSE_MIN_STEP_US apart, to a rounding of their times; nearer ones are refused. */
static void test_samples_too_near(void **state)
{
    (void)state;
    for (int near = 0; near < 2; near++) {
        const double step_s = 1e-6 * POSE_MIN_STEP_US * (near ? 0.99 : 1.0);
        const struct pose_sample sample[2] = {{.t_s = 7.0, .pose = {.quat = {1.0, 0.0, 0.0, 0.0}}},
                                              {.t_s = 7.0 + step_s, .pose = {.quat = {1.0, 0.0, 0.0, 0.0}}}};
        struct trajectory *tr;
        struct sh_err err;
        assert_int_equal(trajectory_from_samples(sample, 2, &tr, &err), near ? SH_EINPUT : SH_OK);
        if (near) assert_non_null(strstr(err.text, "sample 1: "));
        trajectory_free(tr);
    }
}

/* Velocities are those of a parabola through three samples, at the ends too: what is a parabola stays one, with samples
 * at any distance. Rounding: 1e-15 of 30 m, some times. */
static void test_parabola(void **state)
{
    (void)state;
    static const double t_s[] = {-1.0, 0.0, 2.5, 3.0, 5.0};
    double x_m[5];
    for (int i = 0; i < 5; i++)
        x_m[i] = 2.0 - 3.0 * t_s[i] + 1.5 * t_s[i] * t_s[i];
    struct trajectory *tr = along_x(t_s, x_m, 5);
    for (double t = -1.0; t <= 5.0; t += 0.03125) {
        struct pose pose;
        double frame;
        trajectory_at(tr, t, &pose, &frame);
        assert_true(fabs(pose.position_m[0] - (2.0 - 3.0 * t + 1.5 * t * t)) < 1e-13);
    }
    trajectory_free(tr);
}

/* Where two samples have one place the body stands between them, and comes to rest there. */
static void test_pause(void **state)
{
    (void)state;
    static const double t_s[] = {0.0, 1.0, 2.0, 3.0}, x_m[] = {0.0, 1.0, 1.0, 2.0};
    struct trajectory *tr = along_x(t_s, x_m, 4);
    struct pose pose;
    double frame;
    for (double t = 1.0; t <= 2.0; t += 0.0625) {
        trajectory_at(tr, t, &pose, &frame);
        assert_true(pose.position_m[0] == 1.0);
    }
    trajectory_at(tr, 1.0 - 1e-3, &pose, &frame); /* within (1 - t)^2 of it, some times: at rest */
    assert_true(fabs(pose.position_m[0] - 1.0) < 5e-6);
    trajectory_free(tr);
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

/* A parabola is what three samples show: position and speed are exact at the first and the last one, too, whatever lies
 * between their times. */
static void test_ends(void **state)
{
    (void)state;
    static const double times_s[] = {0, 0.1, 0.35, 0.4, 1.0};
    struct pose_sample s[5];
    for (int i = 0; i < 5; i++) {
        const double t = times_s[i];
        s[i] = (struct pose_sample){.t_s = t, .pose = {{3 + 2 * t - 5 * t * t, 4 * t, t * t}, {1, 0, 0, 0}}};
    }
    struct trajectory *tr = make(s, 5);
    for (int i = 0; i <= 1000; i++) {
        const double t = 1e-3 * i, want[3] = {3 + 2 * t - 5 * t * t, 4 * t, t * t};
        struct pose got;
        double frame;
        trajectory_at(tr, t, &got, &frame);
        assert_true(distance(got.position_m, want) < 1e-14); /* some roundings of 3 m */
    }
    struct pose before, after;
    double frame;
    trajectory_at(tr, -1, &before, &frame); /* there it stands */
    trajectory_at(tr, 7, &after, &frame);
    assert_memory_equal(before.position_m, s[0].pose.position_m, sizeof before.position_m);
    assert_memory_equal(after.position_m, s[4].pose.position_m, sizeof after.position_m);
    trajectory_free(tr);
}

/* Between its knots the head moves as pose_between says: within the stated bound of the trajectory, lever arm included.
 */
static void test_knots(void **state)
{
    (void)state;
    struct trajectory *tr = circle();
    struct pose mount = {.position_m = {0.5, 1.2, 2.0}}, body, head, between;
    struct pose_path path;
    double frame, worst = 0, turned = 0;
    struct sh_err err;
    pose_from_angles(30 * DEG, -10 * DEG, 0, mount.quat);
    assert_int_equal(find_path(tr, 0.25, 1e9, &mount, &path, &err), SH_OK);
    const struct pose_knot *knot = path.knot;
    const size_t n = path.n;
    assert_true(path.error_m <= 1e-4 && knot[0].t_ns == 0 && knot[n - 1].t_ns == 9650000000);
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
    print_message("# %zu knots in 9.65 s: off by %.4f mm, bound %.4f mm; %.2g rad\n", n, 1e3 * worst,
                  1e3 * path.error_m, turned);
    assert_true(worst <= path.error_m * 1.0001 && worst > 0.2 * path.error_m);
    assert_true(turned < 1e-9); /* a knot's time is rounded to a nanosecond */
    free(path.knot);
    trajectory_free(tr);
}

/* Cut at end_s: the same poses up to there, and the one of that time as the last. */
static void test_knots_to_an_end(void **state)
{
    (void)state;
    struct trajectory *tr = circle();
    const struct pose mount = {.quat = {1, 0, 0, 0}};
    struct pose_path whole, part;
    struct pose last;
    double frame;
    struct sh_err err;
    assert_int_equal(find_path(tr, 0.25, 1e9, &mount, &whole, &err), SH_OK);
    assert_int_equal(find_path(tr, 0.25, 1.2345, &mount, &part, &err), SH_OK);
    const size_t m = part.n;
    assert_true(m > 2 && m < whole.n && part.knot[m - 1].t_ns == 984500000 && part.knot[m - 2].t_ns < 984500000);
    assert_memory_equal(whole.knot, part.knot, (m - 1) * sizeof *part.knot);
    trajectory_at(tr, 1.2345, &last, &frame);
    assert_true(distance(last.position_m, part.knot[m - 1].pose.position_m) < 1e-12 && frame == part.knot[m - 1].frame);
    free(part.knot);
    assert_int_equal(find_path(tr, 0.25, 0.25, &mount, &part, &err), SH_OK);
    assert_true(part.n == 1 && part.knot[0].t_ns == 0);
    free(whole.knot);
    free(part.knot);
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
        struct pose_path path;
        struct sh_err err;
        s[1].pose.position_m[1] = cases[i].way_m;
        pose_from_angles(cases[i].turn_rad, 0, 0, s[1].pose.quat);
        assert_int_equal(trajectory_from_samples(s, 2, &tr, &err), SH_OK);
        int rc = find_path(tr, 0, 1e10, &mount, &path, &err);
        trajectory_free(tr);
        if (cases[i].most == 0) {
            assert_int_equal(rc, SH_EINPUT);
            assert_non_null(strstr(err.text, "allowed 10000000"));
            continue;
        }
        assert_int_equal(rc, SH_OK);
        assert_true(path.n >= cases[i].least && path.n <= cases[i].most && path.error_m <= 1e-4);
        assert_true(path.knot[path.n - 1].t_ns == llround(1e9 * cases[i].s));
        free(path.knot);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_short_way),
        cmocka_unit_test(test_find_knot),
        cmocka_unit_test(test_straight_up),
        cmocka_unit_test(test_parabola),
        cmocka_unit_test(test_pause),
        cmocka_unit_test(test_convention),
        cmocka_unit_test(test_between),
        cmocka_unit_test(test_straight_line),
        cmocka_unit_test(test_constant_turn),
        cmocka_unit_test(test_knots),
        cmocka_unit_test(test_knots_to_an_end),
        cmocka_unit_test(test_slow_knots),
        cmocka_unit_test(test_pole),
        cmocka_unit_test(test_ends),
        cmocka_unit_test(test_samples_too_near),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
