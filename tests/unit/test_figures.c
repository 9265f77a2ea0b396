/* SPDX-License-Identifier: MIT */
/* Figures of clouds, worked out by hand. */
#include <math.h>

#include "core/studio/figures.h"
#include "tests/unit/scene_files.h"

static uint32_t group_of(void *ctx, size_t i)
{
    return ((const uint32_t *)ctx)[i];
}

static void near_to(double value, double expected)
{
    if (!(fabs(value - expected) <= 1e-6 * fabs(expected) + 1e-15)) fail_msg("%.9g, not %.9g", value, expected);
}

/* Two groups, a point that is far, one without echo, one of no group. Floats hold 7 digits. */
static void groups_have_their_own_figures(void **state)
{
    (void)state;
    const double distance_m[] = {0.001, 0.003, INFINITY, NAN, 0.002, 9.0, 0.010};
    float along_m[] = {0.001f, -0.003f, NAN, NAN, 0.004f, 9.0f, 0.02f};
    float sigma_m[] = {0.001f, 0.001f, NAN, NAN, NAN, 1.0f, 0.01f},
          counts_m[] = {0.0f, 0.001f, NAN, NAN, NAN, 0.0f, 0.0f};
    float cosine[] = {1.0f, 0.5f, NAN, NAN, 1.0f, 1.0f, 0.1f}, range_m[] = {1, 2, 3, NAN, 5, 6, 7};
    uint32_t group[] = {0, 0, 0, 0, 1, FIGURES_NO_GROUP, 1};
    const struct deviation_points points = {along_m, sigma_m, counts_m, cosine, range_m, NULL};
    const struct figures_in in = {7, distance_m, &points};
    struct figures f[3];
    struct sh_err err;
    assert_int_equal(figures_by(&in, 3, group_of, group, f, &err), SH_OK);
    assert_true(f[0].points == 3 && f[0].far == 1 && f[0].along == 2 && f[0].judged == 2 && f[0].noisy == 2);
    near_to(f[0].mean_m, 0.002);
    near_to(f[0].rms_m, sqrt(5e-6));
    near_to(f[0].p95_m, 0.003);
    near_to(f[0].max_m, 0.003);
    near_to(f[0].along_mean_m, -0.001);
    near_to(f[0].along_rms_m, sqrt(5e-6));
    near_to(f[0].along_max_m, 0.003);
    near_to(f[0].judged_mean_m, -0.001);
    near_to(f[0].judged_rms_m, sqrt(5e-6));
    near_to(f[0].expected_rms_m, sqrt(1.5e-6)); /* sigma and counts: (1, 0) and (1, 1) mm */
    near_to(f[0].z_mean, -1.0);
    near_to(f[0].z_rms, sqrt(5.0));
    near_to(f[0].z_counts, sqrt(0.5));
    /* The second point, at an incidence of 84 degrees, has no deviation along the beam. The first one's sigma is not
     * known. */
    assert_true(f[1].points == 2 && f[1].along == 1 && f[1].judged == 0);
    assert_true(f[1].far == 0 && f[1].noisy == 0);
    near_to(f[1].mean_m, 0.006);
    near_to(f[1].rms_m, sqrt(52e-6));
    near_to(f[1].p95_m, 0.010);
    near_to(f[1].max_m, 0.010);
    near_to(f[1].along_mean_m, 0.004);
    assert_true(isnan(f[1].z_rms) && isnan(f[1].expected_rms_m));
    assert_true(f[2].points == 0 && isnan(f[2].mean_m) && isnan(f[2].p95_m) && isnan(f[2].max_m));
}

/* Group 1 comes first in the file, and two of its points are far. The 95th percentile of 20 values is the 19th. Without
 * groups all points count together. */
static void percentiles_by_group(void **state)
{
    (void)state;
    double distance_m[25];
    uint32_t group[25];
    struct figures f[2];
    struct sh_err err;
    for (uint32_t i = 0; i < 25; i++) {
        distance_m[i] = i < 3 ? 0.01 * (i + 1) : i >= 23 ? (double)INFINITY : 0.1 * ((7 * i) % 20 + 1);
        group[i] = i < 3 || i >= 23;
    }
    const struct figures_in in = {25, distance_m, NULL};
    assert_int_equal(figures_by(&in, 2, group_of, group, f, &err), SH_OK);
    near_to(f[0].p95_m, 1.9);
    near_to(f[0].max_m, 2.0);
    near_to(f[1].p95_m, 0.03);
    assert_true(f[0].points == 20 && f[1].points == 5 && f[1].far == 2 && f[0].along == 0 && isnan(f[0].along_max_m));
    assert_int_equal(figures_by(&in, 1, NULL, NULL, f, &err), SH_OK);
    near_to(f[0].p95_m, 1.9); /* the 22nd of 23 */
    assert_int_equal(f[0].points, 25);
}

/* A sigma of 0 is known, but no deviation can be counted in it. At 80 degrees a point still has a deviation along the
 * beam, and beyond it has none. */
static void sigmas_and_angles_at_their_bounds(void **state)
{
    (void)state;
    const double distance_m[4] = {0, 0, 0, 0};
    const float steepest = (float)(FIGURES_STEEPEST * (1 + 1e-6)), beyond = (float)(FIGURES_STEEPEST * (1 - 1e-6));
    float along_m[4] = {0.002f, -0.004f, 0.006f, 0.5f}, sigma_m[4] = {0, 0.002f, NAN, 0.001f};
    float counts_m[4] = {0.001f, 0.001f, 0.001f, 0}, cosine[4] = {1, steepest, 1, beyond}, range_m[4] = {1, 1, 1, 1};
    const struct deviation_points points = {along_m, sigma_m, counts_m, cosine, range_m, NULL};
    const struct figures_in in = {4, distance_m, &points};
    struct figures f;
    struct sh_err err;
    assert_int_equal(figures_by(&in, 1, NULL, NULL, &f, &err), SH_OK);
    assert_true(f.along == 3 && f.judged == 2 && f.noisy == 1);
    near_to(f.along_max_m, 0.006);
    near_to(f.along_mean_m, 0.004 / 3);
    near_to(f.judged_mean_m, -0.001);
    near_to(f.judged_rms_m, sqrt(10e-6));
    near_to(f.expected_rms_m, sqrt((1e-6 + 4e-6 + 1e-6) / 2));
    near_to(f.z_mean, -2);
    near_to(f.z_rms, 2);
    near_to(f.z_counts, 0.5);
}

static void nice_numbers_are_1_2_5(void **state)
{
    (void)state;
    const double row[][2] = {{1.0, 1.0}, {1.1, 2.0},   {2.0, 2.0},   {3.0, 5.0},     {5.1, 10.0},
                             {70, 100},  {0.03, 0.05}, {1e-6, 1e-6}, {1.2e-5, 2e-5}, {0.001, 0.001}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++)
        near_to(figures_nice(row[i][0]), row[i][1]);
    for (int power = -20; power <= 20; power++) /* 1, 2 and 5 times a power of ten stay as they are, to the last bit */
        for (int k = 0; k < 3; k++) {
            char text[16];
            snprintf(text, sizeof text, "%de%d", k == 0 ? 1 : k == 1 ? 2 : 5, power);
            assert_true(figures_nice(strtod(text, NULL)) == strtod(text, NULL));
        }
}

static void histograms_count_each_value_once(void **state)
{
    (void)state;
    double value[1003];
    float both[1003];
    for (int i = 0; i < 1000; i++) {
        value[i] = 1e-3 * i / 1000.0; /* even up to 1 mm */
        both[i] = (float)(value[i] * (i % 2 == 0 ? 1.0 : -1.0));
    }
    value[1000] = (double)NAN;
    value[1001] = (double)INFINITY;
    value[1002] = 1.0; /* beyond the axis */
    for (int i = 1000; i < 1003; i++)
        both[i] = (float)value[i];
    struct figures_histogram h;
    figures_histogram_of(value, 1003, 0.99, &h);
    uint64_t sum = h.below + h.above;
    for (uint32_t k = 0; k < h.bins; k++)
        sum += h.count[k];
    assert_true(sum == 1001 && h.below == 0 && h.above >= 1 && h.above <= 11 && h.from == 0.0);
    near_to((double)h.count[0], 1000.0 * h.width / 1e-3);
    figures_histogram_of_signed(both, 1003, 0.99, &h);
    near_to(h.from, -(double)h.bins / 2.0 * h.width);
    for (sum = h.below + h.above; h.bins > 0; h.bins--)
        sum += h.count[h.bins - 1];
    assert_int_equal(sum, 1001);
    figures_histogram_of(value + 1000, 1, 0.99, &h);
    assert_int_equal(h.bins, 0);
    const double zero = 0.0;
    figures_histogram_of(&zero, 1, 0.99, &h);
    assert_true(h.bins > 0 && h.count[0] == 1);
}

/* A bin begins at its lower edge: a value at the upper edge of the last one is above all. */
static void edges_belong_to_the_bin_above(void **state)
{
    (void)state;
    double value[6] = {1, 1, 1, 1};
    float both[6] = {1, 1, 1, 1};
    struct figures_histogram h, again;
    figures_histogram_of(value, 4, 0.5, &h);
    value[4] = h.from + h.bins * h.width;
    value[5] = h.from;
    figures_histogram_of(value, 6, 0.5, &again);
    assert_true(again.bins == h.bins && fabs(again.width - h.width) <= 0.0);
    assert_true(again.above == 1 && again.below == 0 && again.count[0] == h.count[0] + 1);
    figures_histogram_of_signed(both, 4, 0.5, &h);
    both[4] = (float)(h.from + h.bins * h.width);
    both[5] = nextafterf((float)h.from, -9);
    figures_histogram_of_signed(both, 6, 0.5, &again);
    assert_true(again.bins == h.bins && again.above == 1 && again.below == 1);
}

/* The size of values counts without their sign. What is beyond the axis is counted on its side, however large it is. */
static void histograms_of_one_side(void **state)
{
    (void)state;
    float value[104];
    double size[104];
    struct figures_histogram h;
    uint64_t sum = 0;
    for (int i = 0; i < 100; i++)
        value[i] = -1.0f - 0.01f * (float)i; /* from -1 to -1.99 */
    value[100] = -1e30f;
    value[101] = -50.0f;
    value[102] = 1e30f;
    value[103] = 40.0f;
    figures_histogram_of_signed(value, 104, 0.96, &h);
    for (uint32_t k = 0; k < h.bins; k++)
        sum += h.count[k];
    assert_true(sum == 100 && h.below == 2 && h.above == 2);
    assert_true(h.from <= -1.99 && h.from >= -2.5 && h.bins <= FIGURES_MAX_BINS);
    for (int i = 0; i < 104; i++)
        size[i] = i < 4 ? 0.0 : 1e300;
    figures_histogram_of(size, 104, 0.01, &h);
    assert_true(h.count[0] == 4 && h.above == 100 && h.bins > 0);
    figures_histogram_of(size, 104, 0.99, &h);
    assert_true(h.count[0] == 4 && h.above == 100 && isfinite(h.width));
}

/* A square of 2 m at 45 degrees has cells of 1 m with 1.414 m2. There are 4 columns of points with 9, 9, 1, 1. */
static void density_is_points_by_area(void **state)
{
    (void)state;
    struct scene *scene = load_text("plane.obj", "v 0 0 0\nv 2 0 2\nv 2 2 2\nv 0 2 0\nf 1 2 3 4\n");
    double xyz[20][3];
    float range_m[20];
    uint32_t triangle[20];
    double distance_m[20];
    size_t n = 0;
    for (int cell = 0; cell < 4; cell++)
        for (int k = 0; k < (cell < 2 ? 9 : 1); k++, n++) {
            xyz[n][0] = (cell & 1) + 0.1 + 0.09 * k;
            xyz[n][1] = (cell >> 1) + 0.5;
            xyz[n][2] = xyz[n][0];
            range_m[n] = cell < 2 ? 3.0f : 5.0f;
            distance_m[n] = 0.0;
            triangle[n] = xyz[n][1] > xyz[n][0]; /* the two triangles are of one plane */
        }
    const struct cloud cloud = {.n = n, .xyz_m = xyz};
    const struct cloud_site site = {.n_stations = 1, .max_m = 10, .threads = 1};
    const struct cloud_compared compared = {&cloud, &site, distance_m, triangle};
    const struct figures_on_scene in = {&compared, scene, range_m};
    struct figures_density d;
    struct figures_density_row row;
    struct sh_err err;
    assert_int_equal(figures_density_of(&in, 1.0, NULL, &d, &err), SH_OK);
    assert_int_equal(d.n, 4);
    figures_density_within(&d, 0, 0.0, (double)INFINITY, &row);
    assert_true(row.cells == 4 && row.points == 20);
    near_to(row.p5, 1.0 / M_SQRT2); /* one point of 20 is 5 % */
    near_to(row.p50, 9.0 / M_SQRT2);
    near_to(row.p95, 9.0 / M_SQRT2);
    figures_density_within(&d, 1, 4.0, 6.0, &row);
    assert_true(row.cells == 2 && row.points == 2);
    near_to(row.p95, 1.0 / M_SQRT2);
    figures_density_within(&d, 2, 0.0, (double)INFINITY, &row);
    assert_true(row.cells == 0 && isnan(row.p50));
    figures_density_within(&d, 1, 3.0, 5.0, &row); /* 3.0 itself is within, 5.0 is not */
    assert_true(row.cells == 2 && row.points == 18);
    figures_density_free(&d);
    /* Two stations come in turns. If both have points there are two cells in one place. */
    uint16_t station[20];
    for (size_t i = 0; i < n; i++)
        station[i] = (uint16_t)(1 + i % 2);
    const struct cloud both = {.n = n, .xyz_m = xyz, .station = station};
    const struct cloud_site two = {.n_stations = 2, .max_m = 10, .threads = 1};
    const struct cloud_compared by_two = {&both, &two, distance_m, triangle};
    assert_int_equal(figures_density_of(&(struct figures_on_scene){&by_two, scene, range_m}, 1.0, NULL, &d, &err),
                     SH_OK);
    assert_int_equal(d.n, 6);
    figures_density_within(&d, 2, 0.0, (double)INFINITY, &row);
    assert_true(row.cells == 3 && row.points == 10);
    figures_density_free(&d);
    scene_free(scene);
}

static void times_go_by_station_and_scan(void **state)
{
    (void)state;
    double time_s[] = {0.0, 0.1, 0.2, 5.0, 0.9, 1.0, 0.5, 0.7, NAN};
    uint16_t station[] = {1, 1, 1, 2, 1, 1, 1, 1, 1};
    const struct cloud cloud = {.n = 9, .station = station, .time_s = time_s};
    struct figures_times t[2];
    figures_times_of(&cloud, 2, (const double[]){0.15, 0.15}, t);
    assert_true(t[0].points == 7 && t[0].scans == 2 && t[0].gaps == 2); /* 0.2..0.9; 0.5..0.7 of the second scan */
    near_to(t[0].span_s, 1.2);
    near_to(t[0].longest_s, 0.7);
    near_to(t[0].longest_at_s, 0.2);
    near_to(t[0].last_s, 0.7);
    assert_true(t[0].first_s == 0.0 && t[1].first_s == 5.0 && t[1].last_s == 5.0 && t[1].longest_s == 0.0);
    assert_true(t[1].points == 1 && t[1].scans == 1 && t[1].span_s == 0.0 && t[1].gaps == 0);
}

/* A gap that is as long as allowed is none. Each station has its own allowed gap. A station without points has no
 * times. */
static void gaps_are_longer_than_allowed(void **state)
{
    (void)state;
    double time_s[] = {1.0, 2.0, 1.5, 1.75, 1.75, 3.0, 4.0}; /* echoes of one shot have one time */
    uint16_t station[] = {1, 2, 1, 1, 1, 2, 2};
    const struct cloud cloud = {.n = 7, .station = station, .time_s = time_s};
    struct figures_times t[3];
    figures_times_of(&cloud, 3, (const double[]){0.25, 0.5, 1}, t);
    assert_true(t[0].gaps == 1 && t[0].longest_s == 0.5 && t[0].longest_at_s == 1.0 && t[0].scans == 1);
    assert_true(t[1].gaps == 2 && t[1].longest_s == 1.0 && t[1].longest_at_s == 2.0); /* the first of the longest */
    assert_true(t[0].span_s == 0.75 && t[1].span_s == 2.0);
    assert_true(t[2].points == 0 && t[2].scans == 0 && isnan(t[2].first_s) && isnan(t[2].last_s));
}

/* Shots with 15 echoes or more are counted together. */
static void many_echoes_are_one_class(void **state)
{
    (void)state;
    uint8_t echo[] = {1, 1, 1, 1, 2, 0}, count[] = {14, 15, 16, 255, 255, 0};
    uint64_t shots[FIGURES_MAX_ECHOES + 1];
    const struct cloud cloud = {.n = 6, .echo = echo, .echo_count = count};
    figures_echoes_of(&cloud, shots);
    assert_true(shots[14] == 1 && shots[15] == 3 && shots[0] == 1);
}

static void shots_count_by_their_first_echo(void **state)
{
    (void)state;
    uint8_t echo[] = {1, 1, 2, 0, 1, 2, 3}, count[] = {1, 2, 2, 0, 3, 3, 3};
    uint64_t shots[FIGURES_MAX_ECHOES + 1];
    const struct cloud cloud = {.n = 7, .echo = echo, .echo_count = count};
    figures_echoes_of(&cloud, shots);
    assert_true(shots[0] == 1 && shots[1] == 1 && shots[2] == 1 && shots[3] == 1 && shots[4] == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(groups_have_their_own_figures),
        cmocka_unit_test(percentiles_by_group),
        cmocka_unit_test(sigmas_and_angles_at_their_bounds),
        cmocka_unit_test(nice_numbers_are_1_2_5),
        cmocka_unit_test(histograms_count_each_value_once),
        cmocka_unit_test(edges_belong_to_the_bin_above),
        cmocka_unit_test(histograms_of_one_side),
        cmocka_unit_test_setup_teardown(density_is_points_by_area, make_folder, remove_folder),
        cmocka_unit_test(times_go_by_station_and_scan),
        cmocka_unit_test(gaps_are_longer_than_allowed),
        cmocka_unit_test(many_echoes_are_one_class),
        cmocka_unit_test(shots_count_by_their_first_echo),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
