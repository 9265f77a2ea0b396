/* SPDX-License-Identifier: MIT */
/* core/pose: how many knots a path has, when they are and which error is given. The expected figures follow from the
 * rules in core/pose.h: a step may deviate by (acceleration + turning rate^2 * lever arm) * step^2 / 8. */
#include "core/vec3.h"
#include "tests/unit/pose_rig.h"

enum { MOST = 5 };

struct way {
    const char *what;
    size_t n;
    double t_s[MOST], p_m[MOST][3], heading_rad[MOST];
    double arm_m[3];
    struct pose_knot_rules rules;
    size_t knots;
    double error_m;
};

static const struct way ways[] = {
    /* The acceleration is |(2, -3, 6)| = 7 m/s^2 all the way: 10 parts of 1 s, 19 of 2 s. */
    {"a parabola",
     3,
     {0, 1, 3},
     {{0}, {1, -1.5, 3}, {9, -13.5, 27}},
     {0},
     {0},
     {0, 1e9, 0.01, INT64_MAX, 1e9},
     1 + 10 + 19,
     3.5 / 361},
    /* Five of the first ten knots come after 0.5 s. */
    {"from within",
     3,
     {0, 1, 3},
     {{0}, {1, -1.5, 3}, {9, -13.5, 27}},
     {0},
     {0},
     {0.5, 1e9, 0.01, INT64_MAX, 1e9},
     1 + 5 + 19,
     3.5 / 361},
    /* Nine of the last 19 knots come before 2 s, where the path ends. */
    {"to within",
     3,
     {0, 1, 3},
     {{0}, {1, -1.5, 3}, {9, -13.5, 27}},
     {0},
     {0},
     {0.5, 2, 0.01, INT64_MAX, 1e9},
     1 + 5 + 9 + 1,
     3.5 / 361},
    /* From rest to 3 m/s in 1 s and 3 m: the cubic begins with 6 * 3 - 2 * 3 = 12 m/s^2. 13 parts. */
    {"a start",
     4,
     {0, 1, 2, 3},
     {{0}, {0}, {0, 3, 0}, {0, 6, 0}},
     {0},
     {0},
     {0, 1e9, 0.01, INT64_MAX, 1e9},
     1 + 1 + 13 + 1,
     1.5 / 169},
    {"a stop",
     4,
     {0, 1, 2, 3},
     {{0, 6, 0}, {0, 3, 0}, {0}, {0}},
     {0},
     {0},
     {0, 1e9, 0.01, INT64_MAX, 1e9},
     1 + 1 + 13 + 1,
     1.5 / 169},
    /* The body turns by 0.3 rad in 2 s with the head 0.5 m away: 0.3^2 * 0.5 / 8 m. Three parts. */
    {"a turn",
     2,
     {0, 2},
     {{0}, {0}},
     {0, 0.3},
     {0.3, 0.4, 0},
     {0, 1e9, 0.001, INT64_MAX, 1e9},
     1 + 3,
     0.09 * 0.5 / 8 / 9},
    /* As many parts as the least step allows, though they should be more. */
    {"a turn that is too quick",
     2,
     {0, 0.00035},
     {{0}, {0}},
     {0, 0.3},
     {0.3, 0.4, 0},
     {0, 1e9, 1e-9, INT64_MAX, 1e9},
     1 + 3,
     0.09 * 0.5 / 8 / 9},
    /* 1 m of the body and 0.004 rad with an arm of 50 m: 1.2 m in steps of 0.29 m. */
    {"a length",
     2,
     {0, 2},
     {{0}, {0, 1, 0}},
     {0, 0.004},
     {0, 50, 0},
     {0, 1e9, 1, 1000, 0.29},
     1 + 5,
     16e-6 * 50 / 8 / 25},
    /* Steps of 0.7 s are allowed at any length, so the same way has three parts. */
    {"a time",
     2,
     {0, 2},
     {{0}, {0, 1, 0}},
     {0, 0.004},
     {0, 50, 0},
     {0, 1e9, 1, 700000000, 0.29},
     1 + 3,
     16e-6 * 50 / 8 / 9},
    /* 0.055 rad in steps of 0.01 rad. */
    {"an angle", 2, {0, 2}, {{0}, {0}}, {0, 0.055}, {0}, {0, 1e9, 1, 1000, 1e9}, 1 + 6, 0},
};

static struct trajectory *make(const struct way *way)
{
    struct pose_sample sample[MOST];
    struct trajectory *tr;
    struct sh_err err;
    for (size_t i = 0; i < way->n; i++) {
        sample[i] = (struct pose_sample){.t_s = way->t_s[i], .frame = 10.0 * (double)i};
        memcpy(sample[i].pose.position_m, way->p_m[i], sizeof way->p_m[i]);
        pose_from_angles(way->heading_rad[i], 0, 0, sample[i].pose.quat);
    }
    if (trajectory_from_samples(sample, way->n, &tr, &err) != SH_OK) fail_msg("%s: %s", way->what, err.text);
    return tr;
}

/* Each knot has the head's pose of its time, and the frame. */
static void expect_knots(const struct trajectory *tr, const struct pose *mount, double start_s,
                         const struct pose_path *path)
{
    for (size_t i = 0; i < path->n; i++) {
        struct pose body, head;
        double frame;
        trajectory_at(tr, start_s + 1e-9 * (double)path->knot[i].t_ns, &body, &frame);
        pose_mount(&body, mount, &head);
        assert_true(frame == path->knot[i].frame && path->knot[i].flags == 0);
        assert_true(i == 0 ? path->knot[i].t_ns == 0 : path->knot[i].t_ns > path->knot[i - 1].t_ns);
        assert_memory_equal(&head, &path->knot[i].pose, sizeof head);
    }
}

static void test_number_and_error(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof ways / sizeof ways[0]; i++) {
        const struct way *way = &ways[i];
        struct trajectory *tr = make(way);
        struct pose mount = {.quat = {1, 0, 0, 0}};
        struct pose_path path;
        struct sh_err err;
        memcpy(mount.position_m, way->arm_m, sizeof way->arm_m);
        assert_int_equal(trajectory_knots(tr, &mount, &way->rules, NULL, &path, &err), SH_OK);
        /* Rounding: 1e-16 of some metres of position, over intervals of a second. */
        if (path.n != way->knots || fabs(path.error_m - way->error_m) > 1e-12)
            fail_msg("%s: %zu knots, error %.12g m", way->what, path.n, path.error_m);
        const double end_s = fmin(way->rules.end_s, way->t_s[way->n - 1]);
        assert_true(path.knot[path.n - 1].t_ns == llround(1e9 * (end_s - way->rules.start_s)));
        expect_knots(tr, &mount, way->rules.start_s, &path);
        free(path.knot);
        trajectory_free(tr);
    }
}

/* Parts are equally long, and each sample has its knot. */
static void test_times(void **state)
{
    (void)state;
    struct trajectory *tr = make(&ways[0]);
    const struct pose mount = {.quat = {1, 0, 0, 0}};
    struct pose_path path;
    struct sh_err err;
    assert_int_equal(trajectory_knots(tr, &mount, &ways[0].rules, NULL, &path, &err), SH_OK);
    for (int i = 0; i <= 10; i++)
        assert_true(path.knot[i].t_ns == 100000000 * i);
    for (int i = 0; i <= 19; i++)
        assert_true(path.knot[10 + i].t_ns == 1000000000 + llround(2e9 * i / 19));
    free(path.knot);
    trajectory_free(tr);
}

/* 1e9 m in 101,000 s are cut by time, every 10 ms. One knot more is kept for the interval's end, and one for the
 * start. */
static void test_too_many(void **state)
{
    (void)state;
    static const struct way far = {.what = "far", .n = 2, .t_s = {0, 101000}, .p_m = {{0}, {1e9, 0, 0}}};
    struct trajectory *tr = make(&far);
    const struct pose mount = {.quat = {1, 0, 0, 0}};
    struct pose_path path;
    struct sh_err err;
    assert_int_equal(find_path(tr, 0.25, 1e10, &mount, &path, &err), SH_EINPUT);
    assert_null(path.knot);
    assert_string_equal(err.text, "the trajectory needs up to 10100002 poses from 0.25 s on; allowed 10000000");
    trajectory_free(tr);
}

static int stop_at_once(void *ctx)
{
    (void)ctx;
    return 1;
}

static void test_stopped(void **state)
{
    (void)state;
    const struct sh_report report = {.stop = stop_at_once};
    struct trajectory *tr = make(&ways[0]);
    const struct pose mount = {.quat = {1, 0, 0, 0}};
    struct pose_path path;
    struct sh_err err;
    assert_int_equal(trajectory_knots(tr, &mount, &ways[0].rules, &report, &path, &err), SH_ESTOPPED);
    free(path.knot);
    trajectory_free(tr);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_number_and_error),
        cmocka_unit_test(test_times),
        cmocka_unit_test(test_too_many),
        cmocka_unit_test(test_stopped),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
