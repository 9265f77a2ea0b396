/* SPDX-License-Identifier: MIT */
/* core/pose: trajectories and their knots. */
#include "core/vec3.h"
#include "tests/unit/pose_rig.h"

static struct trajectory *make(const struct pose_sample *samples, size_t n)
{
    struct trajectory *tr;
    struct sh_err err;
    if (trajectory_from_samples(samples, n, &tr, &err) != SH_OK) fail_msg("%s", err.text);
    return tr;
}

/* A knot counts from its own time on. Before the first knot, the first one counts. */
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

/* Each number of a sample must be finite, and its quaternion needs a direction. The error names the sample. */
static void test_samples_that_are_no_pose(void **state)
{
    (void)state;
    static const double none[] = {NAN, INFINITY, -INFINITY};
    struct trajectory *tr;
    struct sh_err err;
    for (int which = 0; which < 9; which++)
        for (size_t i = 0; i < sizeof none / sizeof none[0]; i++) {
            struct pose_sample sample[2] = {{.t_s = 1, .frame = 1, .pose = {.quat = {0, 0, 0, -3}}},
                                            {.t_s = 2, .frame = 2, .pose = {.quat = {1, 0, 0, 0}}}};
            struct pose_sample *bad = &sample[i % 2];
            *(which < 3   ? &bad->pose.position_m[which]
              : which < 7 ? &bad->pose.quat[which - 3]
              : which < 8 ? &bad->t_s
                          : &bad->frame) = none[i];
            assert_int_equal(trajectory_from_samples(sample, 2, &tr, &err), SH_EINPUT);
            assert_string_equal(err.text, i % 2 ? "sample 1: not a finite number" : "sample 0: not a finite number");
            assert_null(tr);
        }
    const struct pose_sample zero = {.t_s = 1};
    assert_int_equal(trajectory_from_samples(&zero, 1, &tr, &err), SH_EINPUT);
    assert_string_equal(err.text, "sample 0: a quaternion of length 0");
    assert_int_equal(trajectory_from_samples(&zero, 0, &tr, &err), SH_EINPUT);
    assert_string_equal(err.text, "the trajectory has no samples");
}

/* Velocities are those of a parabola through three samples, at the ends too. So a parabola stays one, with samples at
 * any distance. A few roundings, of 1e-15 of 30 m, are allowed. */
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

/* Between two samples at one place the body stands, and it comes to rest there. */
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
    trajectory_at(tr, 1.0 - 1e-3, &pose, &frame); /* at rest: off by a few times (1 - t)^2 */
    assert_true(fabs(pose.position_m[0] - 1.0) < 5e-6);
    trajectory_free(tr);
    static const double zero_m[] = {0.0, -0.0, 4.0}; /* -0 is the same place as 0 */
    tr = along_x(t_s, zero_m, 3);
    trajectory_at(tr, 0.5, &pose, &frame);
    assert_true(pose.position_m[0] == 0.0);
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
    trajectory_at(tr, 4.0, &p, &frame); /* before and after, it stands */
    assert_true(p.position_m[0] == 15.0 && frame == 0.0);
    trajectory_at(tr, 9.0, &p, &frame);
    assert_true(p.position_m[0] == 18.0 && frame == 4.0);
    trajectory_free(tr);
}

enum { TURN_SAMPLES = 100 };
static const double RADIUS_M = 10.0, RATE = 1.0, STEP_S = 0.1;

/* A car drives a circle at 10 m/s, nose along the way: at t it is at the circle's angle t, with heading -t. */
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

/* With x = RATE * STEP_S: the parabola's derivative on a circle is the true one times sin(x)/x. In the cubic that gives
 * an error along the way of R x^3/6 times the largest of f(1-f)(1-2f), 0.0962, and across it of R x^4 3/128. Higher
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
        worst = fmax(worst, vec3_distance(got.position_m, want.position_m));
        assert_true(pose_angle_between(got.quat, want.quat) < 1e-14); /* slerp has a constant rate */
        double i = floor(t / STEP_S);
        on_circle(i * STEP_S, &a);
        on_circle((i + 1) * STEP_S, &b);
        pose_between(&a, &b, t / STEP_S - i, &straight);
        chord = fmax(chord, vec3_distance(straight.position_m, want.position_m));
    }
    print_message("# circle of 10 m, 10 m/s, 10 Hz: cubic off by %.3f mm (bound %.3f), chords by %.1f mm\n",
                  1e3 * worst, 1e3 * bound, 1e3 * chord);
    assert_true(worst < bound && worst > 0.5 * bound);
    assert_true(chord > 50 * worst);
    trajectory_free(tr);
}

/* Three samples define a parabola. Position and speed are exact at the first and the last sample, too, with any times
 * between. */
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
        assert_true(vec3_distance(got.position_m, want) < 1e-14); /* some roundings of 3 m */
    }
    struct pose before, after;
    double frame;
    trajectory_at(tr, -1, &before, &frame); /* there it stands */
    trajectory_at(tr, 7, &after, &frame);
    assert_memory_equal(before.position_m, s[0].pose.position_m, sizeof before.position_m);
    assert_memory_equal(after.position_m, s[4].pose.position_m, sizeof after.position_m);
    trajectory_free(tr);
}

/* Between its knots the head moves by pose_between: within the stated bound of the trajectory, lever arm included. */
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
            worst = fmax(worst, vec3_distance(head.position_m, between.position_m));
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

/* The path is cut at end_s: it has the same poses up to there, and the pose of that time as its last. */
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
    assert_true(vec3_distance(last.position_m, part.knot[m - 1].pose.position_m) < 1e-12 &&
                frame == part.knot[m - 1].frame);
    free(part.knot);
    assert_int_equal(find_path(tr, 0.25, 0.25, &mount, &part, &err), SH_OK);
    assert_true(part.n == 1 && part.knot[0].t_ns == 0);
    free(whole.knot);
    free(part.knot);
    trajectory_free(tr);
}

/* There are as many knots as the way needs, however long it takes, up to a limit. */
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

/* The head brakes or speeds up, so that its acceleration is larger at one end of an interval. The path between knots
 * stays within the error that is given, which is within the tolerance of 0.1 mm. */
static void test_knots_where_the_acceleration_changes(void **state)
{
    (void)state;
    static const double t_s[4] = {0, 1, 2, 3}, x_m[2][4] = {{0, 10, 10.5, 10.6}, {10.6, 10.5, 10, 0}};
    const struct pose mount = {.quat = {1, 0, 0, 0}};
    for (int way = 0; way < 2; way++) {
        struct trajectory *tr = along_x(t_s, x_m[way], 4);
        struct pose_path path;
        struct sh_err err;
        double worst_m = 0, frame;
        assert_int_equal(find_path(tr, 0, 1e9, &mount, &path, &err), SH_OK);
        for (size_t i = 0; i + 1 < path.n; i++) {
            struct pose at;
            const struct pose_knot *a = &path.knot[i], *b = &path.knot[i + 1];
            trajectory_at(tr, 0.5e-9 * (double)(a->t_ns + b->t_ns), &at, &frame);
            worst_m = fmax(worst_m, fabs(at.position_m[0] - 0.5 * (a->pose.position_m[0] + b->pose.position_m[0])));
        }
        assert_true(path.error_m <= 1e-4 && worst_m <= path.error_m * 1.0001);
        free(path.knot);
        trajectory_free(tr);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_find_knot),
        cmocka_unit_test(test_parabola),
        cmocka_unit_test(test_pause),
        cmocka_unit_test(test_straight_line),
        cmocka_unit_test(test_constant_turn),
        cmocka_unit_test(test_knots),
        cmocka_unit_test(test_knots_to_an_end),
        cmocka_unit_test(test_slow_knots),
        cmocka_unit_test(test_ends),
        cmocka_unit_test(test_samples_too_near),
        cmocka_unit_test(test_samples_that_are_no_pose),
        cmocka_unit_test(test_knots_where_the_acceleration_changes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
