/* SPDX-License-Identifier: MIT */
/* Deviations along beams, and their expected values, worked out by hand. */
#include <math.h>

#include "core/studio/deviation.h"
#include "tests/unit/scene_files.h"

static const double UNIT[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};

static void near_to(double value, double expected)
{
    if (!(fabs(value - expected) <= 1e-9 * fabs(expected) + 1e-15)) fail_msg("%.12g, not %.12g", value, expected);
}

static struct deviation_head ideal_head(void)
{
    struct deviation_head head = {0};
    head.setup.mirror_counts = head.setup.pan_counts = 4294967296.0;
    head.setup.layout = LINE_GEO;
    memcpy(head.setup.rotation, UNIT, sizeof UNIT);
    return head;
}

/* The beam is level and ahead. A face leans back by 60 degrees, or is turned by as much. */
static const struct deviation_hit HEAD_ON = {100.0, {0, 1, 0}, {0, -1, 0}, -1};
static const struct deviation_hit LEANING = {100.0, {0, 1, 0}, {0, -0.5, 0.86602540378443865}, -1};
static const struct deviation_hit TURNED = {100.0, {0, 1, 0}, {0.86602540378443865, -0.5, 0}, -1};

/* A head that lies on its side: its axis points along x of the scene. */
static const double ON_ITS_SIDE[9] = {0, 0, 1, 0, 1, 0, -1, 0, 0};

static double sigma(const struct deviation_head *head, const struct deviation_hit *hit)
{
    double counts_m;
    return deviation_sigma_m(head, hit, &counts_m);
}

static void sigma_of_ranges(void **state)
{
    (void)state;
    struct deviation_head head = ideal_head();
    assert_true(sigma(&head, &HEAD_ON) == 0.0);
    head.setup.noise_on = 1;
    head.setup.range_sigma_m = 0.003;
    head.setup.range_sigma_ppm = 10.0;
    near_to(sigma(&head, &HEAD_ON), 0.004); /* 10 ppm of 100 m is 1 mm */
    near_to(sigma(&head, &LEANING), 0.004); /* along the beam, whatever the incidence */
    head.has_instrument_errors = 1;
    assert_true(isnan(sigma(&head, &HEAD_ON)));
}

/* tan 60 degrees = sqrt 3. At an elevation of 60 degrees the pan moves the beam half as far. */
static void sigma_of_angles(void **state)
{
    (void)state;
    struct deviation_head head = ideal_head();
    const struct deviation_hit high = {100.0, {0, 0.5, 0.86602540378443865}, {1, 0, 0}, -1};
    const struct deviation_hit high_turned = {
        100.0, {0, 0.5, 0.86602540378443865}, {M_SQRT1_2, -0.5 * M_SQRT1_2, -0.86602540378443865 * M_SQRT1_2}, -1};
    head.angle_sigma_rad[0] = 1e-5;
    head.angle_sigma_rad[1] = 3e-5;
    near_to(sigma(&head, &HEAD_ON), 0.0);
    near_to(sigma(&head, &LEANING), 100.0 * 1e-5 * sqrt(3.0));
    near_to(sigma(&head, &TURNED), 100.0 * 3e-5 * sqrt(3.0));
    near_to(sigma(&head, &high_turned), 100.0 * 3e-5 * 0.5); /* tan 45 degrees = 1 */
    assert_true(isinf(sigma(&head, &high)));                 /* the beam never meets that face */
    /* The same holds for a head that is upside down. */
    const double over[9] = {-1, 0, 0, 0, 1, 0, 0, 0, -1};
    memcpy(head.setup.rotation, over, sizeof over);
    near_to(sigma(&head, &LEANING), 100.0 * 1e-5 * sqrt(3.0));
    /* The pan of one on its side moves the beam up and down. */
    memcpy(head.setup.rotation, ON_ITS_SIDE, sizeof ON_ITS_SIDE);
    near_to(sigma(&head, &LEANING), 100.0 * 3e-5 * sqrt(3.0));
    near_to(sigma(&head, &TURNED), 100.0 * 1e-5 * sqrt(3.0));
}

/* A uniform ball has a variance of r^2 / 5 along any line. */
static void sigma_of_a_ball(void **state)
{
    (void)state;
    struct deviation_head head = ideal_head();
    struct detect_ball ball = {.radius_m = 0.01, .factor = {1, 1, 1}, .per_distance_1_m = 0.01};
    const struct cast_detect detect = {.ball = &ball};
    head.setup.detect = &detect;
    near_to(sigma(&head, &HEAD_ON), 0.02 / sqrt(5.0)); /* twice as large at 100 m */
    near_to(sigma(&head, &LEANING), 0.04 / sqrt(5.0));
    near_to(deviation_bound_m(&head, 100.0), 0.02);
    ball.factor[1] = 3.0; /* the factors are along the scene's axes: the 3 is along y */
    near_to(sigma(&head, &HEAD_ON), 0.06 / sqrt(5.0));
    ball.local = 1; /* factors are along the beam, to the right, up: the 3 is to the right */
    near_to(sigma(&head, &HEAD_ON), 0.02 / sqrt(5.0));
    near_to(sigma(&head, &TURNED), 0.04 / sqrt(5.0) * sqrt(0.25 + 0.75 * 9.0));
    near_to(deviation_bound_m(&head, 100.0), 0.06);
    memcpy(head.setup.rotation, ON_ITS_SIDE, sizeof ON_ITS_SIDE); /* the head's right is down */
    near_to(sigma(&head, &LEANING), 0.04 / sqrt(5.0) * sqrt(0.25 + 0.75 * 9.0));
    near_to(sigma(&head, &TURNED), 0.04 / sqrt(5.0));
}

static void counts_and_bounds(void **state)
{
    (void)state;
    struct deviation_head head = ideal_head();
    double counts_m;
    head.cast_error_m = 1e-6;
    head.georef_error_m = 2e-6;
    head.count_m = 1e-3;
    deviation_sigma_m(&head, &LEANING, &counts_m);
    near_to(counts_m, 2e-3 / sqrt(12.0));
    near_to(deviation_bound_m(&head, 100.0), 3e-6 + 0.5 * sqrt(3.0) * 1e-3);
    head.count_m = head.georef_error_m = 0.0;
    head.setup.layout = LINE_POLAR;
    head.setup.range_scale_m = 1e-3;
    head.setup.mirror_counts = head.setup.pan_counts = 2.0 * M_PI * 1e5; /* 1e-5 rad: 1 mm at 100 m */
    near_to(deviation_bound_m(&head, 100.0), 1e-6 + 0.5e-3 * sqrt(3.0));
    deviation_sigma_m(&head, &TURNED, &counts_m); /* the pan's counts show, times tan 60 degrees; the mirror's don't */
    near_to(counts_m, sqrt((1.0 + 3.0) / 12.0) * 1e-3);
    head.setup.layout = LINE_GEO; /* positions follow the encoders in this layout, too */
    near_to(deviation_bound_m(&head, 100.0), 1e-6 + 0.5e-3 * sqrt(2.0));
    head.setup.noise_on = 1;
    assert_true(isinf(deviation_bound_m(&head, 100.0)));
    head.setup.noise_on = 0;
    head.angle_sigma_rad[1] = 1e-9;
    assert_true(isinf(deviation_bound_m(&head, 100.0)));
}

/* Each effect alone leaves no bound. The largest factor of a ball counts, on whichever axis; the file's counts add to
 * the stream's. */
static void bounds_by_each_effect(void **state)
{
    (void)state;
    for (int k = 0; k < 3; k++) {
        struct deviation_head head = ideal_head();
        struct detect_ball ball = {.radius_m = 0.01, .factor = {1, 1, 1}, .per_distance_1_m = 0.01};
        const struct cast_detect detect = {.ball = &ball};
        head.count_m = 2e-3;
        head.file_count_m = 1e-3;
        near_to(deviation_bound_m(&head, 100.0), 0.5 * sqrt(3.0) * 3e-3);
        ball.factor[k] = 3;
        head.setup.detect = &detect;
        near_to(deviation_bound_m(&head, 100.0), 0.5 * sqrt(3.0) * 3e-3 + 0.01 * 2 * 3);
        if (k == 2) head.has_instrument_errors = 1;
        if (k < 2) head.angle_sigma_rad[k] = 1e-9;
        assert_true(isinf(deviation_bound_m(&head, 100.0)));
    }
}

/* The figures for clients, put into the formulas of core/studio/deviation.h, give what the function gives. */
static void terms_give_the_same_sigma(void **state)
{
    (void)state;
    struct deviation_head head = ideal_head();
    struct deviation_terms t;
    const struct detect_ball ball = {.radius_m = 0.01, .factor = {1, 2, 3}, .per_distance_1_m = 0.01, .local = 1};
    const struct detect_signal signal = {.floor2 = 9e-6, .jitter2 = 16e-4, .per_distance = 1e-5};
    const struct cast_detect detect = {.ball = &ball, .signal = &signal, .noise_by_signal = 1};
    head.setup.detect = &detect;
    head.setup.noise_on = 1;
    head.setup.range_sigma_m = 0.003;
    head.setup.range_sigma_ppm = 10.0;
    head.setup.layout = LINE_POLAR;
    head.setup.range_scale_m = 2e-3;
    head.setup.mirror_counts = head.setup.pan_counts = 2.0 * M_PI * 1e5;
    head.angle_sigma_rad[0] = 1e-5;
    head.angle_sigma_rad[1] = 3e-5;
    head.count_m = 3e-3;
    head.file_count_m = 4e-3;
    assert_true(deviation_terms_of(&head, &t));
    double counts_m, sigma_m = deviation_sigma_m(&head, &TURNED, &counts_m);
    /* The face is 100 m away and turned by 60 degrees: cosine 1/2, to the right sqrt(3)/2, and nothing by the
     * mirror. */
    const double pan = sqrt(3.0) * 100.0, ball_m = t.ball_m * (1.0 + t.ball_per_m * 100.0) / sqrt(5.0);
    const double range_m = t.range_sigma_m + t.range_sigma_per_m * 100.0;
    const double along = t.ball_factor[0], right = sqrt(3.0) * t.ball_factor[1];
    near_to(sigma_m, sqrt(range_m * range_m + pow(pan * t.angle_sigma_rad[1], 2) +
                          ball_m * ball_m * (along * along + right * right)));
    near_to(counts_m,
            sqrt((pow(t.range_step_m, 2) + pow(2.0 * t.place_step_m, 2) + pow(pan * t.angle_step_rad[1], 2)) / 12.0));
    assert_true(isnan(t.range_jitter_m) && t.ball_local == 1 && t.angle_sigma_rad[0] == 1e-5);
    head.setup.noise_on = 0; /* noise by the signal: a floor of 3 mm, and 40 mm at the threshold */
    assert_true(deviation_terms_of(&head, &t));
    near_to(t.range_floor_m, 0.003);
    near_to(t.range_jitter_m, 0.04);
    near_to(t.range_sigma_per_m, 1e-5);
    head.setup.detect = NULL; /* no noise at all */
    memset(&t, 0x55, sizeof t);
    assert_true(deviation_terms_of(&head, &t));
    assert_true(isnan(t.range_floor_m) && isnan(t.range_jitter_m) && t.range_sigma_m == 0 && t.range_sigma_per_m == 0);
    assert_true(t.ball_m == 0 && t.ball_per_m == 0);
    head.has_instrument_errors = 1;
    assert_false(deviation_terms_of(&head, &t));
}

/* A wall is 10 m ahead, and a pane before its right half, 8 m ahead. Points lie on beams to places of the wall (y = 10)
 * or of the pane (y = 8), that much further. */
static const struct {
    double at[3], further_m, along_m;
} POINT[] = {
    {{-3, 10, 1}, 0.003, 0.003},
    {{-3, 10, 1}, -0.002, -0.002},
    {{3, 8, 1}, 0.001, 0.001},
    {{5, 10, -1}, 0.004, 0.004}, /* seen through the pane: the nearest surface counts */
    {{5, 10, -1}, -0.004, -0.004},
    /* a mixed point: its beam meets the wall, and the pane's edge at x = 0 is nearer */
    {{-0.0001, 10, 0}, -1.5, NAN},
    {{-3, 10, 1}, 40.0, NAN}, /* no surface is within max_m */
    {{NAN, NAN, NAN}, 0.0, NAN},
    /* through the pane to the wall's other triangle, in which no place has x above z */
    {{5, 10, 20}, 0.004, 0.004},
};
enum { N = sizeof POINT / sizeof POINT[0] };

static void deviations_along_the_beam(void **state)
{
    (void)state;
    struct scene *scene = load_text("walls.obj", "v -50 10 -50\nv 50 10 -50\nv 50 10 50\nv -50 10 50\n"
                                                 "v 0 8 -50\nv 50 8 -50\nv 50 8 50\nv 0 8 50\nf 1 2 3 4\nf 5 6 7 8\n");
    double xyz[N][3], distance_m[N];
    uint32_t triangle[N];
    struct deviation_points out;
    struct bvh *bvh;
    struct sh_err err;
    for (int i = 0; i < N; i++) {
        const double *p = POINT[i].at, range_m = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
        for (int k = 0; k < 3; k++)
            xyz[i][k] = p[k] * (1.0 + POINT[i].further_m / range_m);
    }
    assert_int_equal(bvh_create(scene, 1, NULL, &bvh, &err), SH_OK);
    assert_int_equal(deviation_points_create(N, &out, &err), SH_OK);
    struct deviation_head head = ideal_head();
    head.setup.bvh = bvh;
    head.setup.noise_on = 1;
    head.setup.range_sigma_m = 0.005;
    const struct cloud cloud = {.n = N, .xyz_m = xyz};
    const struct cloud_site site = {.bvh = bvh, .n_stations = 1, .max_m = 10, .threads = 2};
    const struct cloud_compared compared = {&cloud, &site, distance_m, triangle};
    assert_int_equal(cloud_compare(&cloud, &site, NULL, distance_m, triangle, &err), SH_OK);
    assert_int_equal(deviation_along(&compared, &head, NULL, &out, &err), SH_OK);
    for (int i = 0; i < N; i++) {
        const double along_m = (double)out.along_m[i];
        if (isnan(along_m) != isnan(POINT[i].along_m) || fabs(along_m - POINT[i].along_m) > 1e-6)
            fail_msg("point %d: %g, not %g", i, along_m, POINT[i].along_m);
        if (i < 5 && fabs((double)out.sigma_m[i] - 0.005) > 1e-9)
            fail_msg("point %d: sigma %g", i, (double)out.sigma_m[i]);
    }
    assert_true(fabs((double)out.cosine[0] - 10.0 / sqrt(110.0)) < 1e-6);
    assert_true(fabs((double)out.range_m[0] - (sqrt(110.0) + 0.003)) < 1e-5);
    /* 8 sigma of 0.2 m reach from pane to wall, so neither counts alone. */
    head.setup.range_sigma_m = 0.2;
    assert_int_equal(deviation_along(&compared, &head, NULL, &out, &err), SH_OK);
    assert_true(isnan(out.sigma_m[3]) && isnan(out.sigma_m[2]) && !isnan(out.along_m[3]));
    head.setup.range_sigma_m = 0.1; /* 0.8 m before and behind the wall there is nothing */
    assert_int_equal(deviation_along(&compared, &head, NULL, &out, &err), SH_OK);
    assert_true(fabs((double)out.sigma_m[0] - 0.1) < 1e-6);
    deviation_points_free(&out);
    bvh_free(bvh);
    scene_free(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sigma_of_ranges),
        cmocka_unit_test(sigma_of_angles),
        cmocka_unit_test(sigma_of_a_ball),
        cmocka_unit_test(counts_and_bounds),
        cmocka_unit_test(bounds_by_each_effect),
        cmocka_unit_test(terms_give_the_same_sigma),
        cmocka_unit_test_setup_teardown(deviations_along_the_beam, make_folder, remove_folder),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
