/* SPDX-License-Identifier: MIT */
/* Point clouds against a scene: the way back to it, and distances and statistics with known results. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/studio/cloud.h"

#define LENGTH(a) (sizeof(a) / sizeof *(a))

/* A plate z = 0 from (0, 0) to (8, 8) as two triangles, of surface 0 (below its diagonal) and 2. */
static struct scene *make_plate(void)
{
    static const double v[4][3] = {{0, 0, 0}, {8, 0, 0}, {8, 8, 0}, {0, 8, 0}};
    static const uint32_t t[2][3] = {{0, 1, 2}, {0, 2, 3}};
    static const uint16_t label[2] = {0, 2};
    static const struct scene_surface surface[3] = {{.object = "floor", .material = "oak"},
                                                    {.object = "roof", .material = "tin"},
                                                    {.object = "floor", .material = "pine"}};
    struct scene *s;
    struct sh_err err;
    if (scene_from_arrays(&(struct scene_arrays){v, 4, t, 2, label, surface, 3}, &s, &err) != SH_OK)
        fail_msg("%s", err.text);
    return s;
}

static struct bvh *make_bvh(const struct scene *s)
{
    struct bvh *bvh;
    struct sh_err err;
    if (bvh_create(s, 1, NULL, &bvh, &err) != SH_OK) fail_msg("%s", err.text);
    return bvh;
}

static void offsets_from_a_plate(void **state)
{
    (void)state;
    /* Whole binary fractions: differences, nearest points and 3-4-5 roots are exact. */
    static double xyz[][3] = {
        {3, 1, 0},   {3, 1, 0.0009765625}, {1, 6, -0.25},         {NAN, NAN, NAN}, {12, 4, 3},
        {-3, -4, 0}, {4, 1, 10},           {4, 1, 10.0009765625}, {4, 1, -1e300},  {1, 7, 0.0078125},
    };
    static const double expected[] = {0, 0.0009765625, 0.25, NAN, 5, 5, 10, INFINITY, INFINITY, 0.0078125};
    static const uint32_t nearest[] = {0, 0, 1, CLOUD_TRIANGLE_NONE, 0, 0, 0, CLOUD_TRIANGLE_NONE, CLOUD_TRIANGLE_NONE,
                                       1};
    enum { N = LENGTH(expected) };
    struct scene *s = make_plate();
    struct bvh *bvh = make_bvh(s);
    const struct cloud c = {.n = N, .xyz_m = xyz, .epsg = CLOUD_EPSG_UNKNOWN};
    const struct cloud_site site = {.bvh = bvh, .n_stations = 1, .max_m = 10, .threads = 1};
    double distance_m[N];
    uint32_t triangle[N];
    assert_int_equal(cloud_compare(&c, &site, NULL, distance_m, triangle, NULL), SH_OK);
    for (int i = 0; i < N; i++) {
        assert_true(distance_m[i] == expected[i] || (isnan(distance_m[i]) && isnan(expected[i])));
        if (i != 4 && i != 5)
            assert_int_equal(triangle[i], nearest[i]); /* these two lie nearest to the diagonal's ends */
    }
    struct cloud_stats stats;
    cloud_stats(distance_m, N, 0.005, &stats);
    assert_int_equal(stats.points, 9);
    assert_int_equal(stats.empty, 1);
    assert_int_equal(stats.far, 2);
    assert_int_equal(stats.beyond, 7);
    assert_int_equal(stats.worst, 7);
    assert_true(stats.max_m == 10);
    bvh_free(bvh);
    scene_free(s);
}

static void threads_change_nothing(void **state)
{
    (void)state;
    enum { N = 30011 };
    double(*xyz)[3] = malloc(N * sizeof *xyz), *distance_m = malloc(2 * N * sizeof *distance_m);
    uint32_t *triangle = malloc(2 * N * sizeof *triangle);
    srand(7);
    for (int i = 0; i < N; i++)
        for (int k = 0; k < 3; k++)
            xyz[i][k] = i % 100 == 0 ? NAN : 16.0 * rand() / RAND_MAX - 4;
    struct scene *s = make_plate();
    struct bvh *bvh = make_bvh(s);
    const struct cloud c = {.n = N, .xyz_m = xyz, .epsg = CLOUD_EPSG_UNKNOWN};
    static const unsigned threads[] = {1, 2, 7};
    for (size_t i = 0; i < LENGTH(threads); i++) {
        size_t to = i > 0 ? N : 0;
        const struct cloud_site site = {.bvh = bvh, .n_stations = 1, .max_m = 10, .threads = threads[i]};
        assert_int_equal(cloud_compare(&c, &site, NULL, distance_m + to, triangle + to, NULL), SH_OK);
        assert_memory_equal(distance_m, distance_m + to, N * sizeof *distance_m);
        assert_memory_equal(triangle, triangle + to, N * sizeof *triangle);
    }
    bvh_free(bvh);
    scene_free(s);
    free(xyz);
    free(distance_m);
    free(triangle);
}

/* Each point is compared, also the last of a full part of the work, and one alone in a part. */
static void the_last_point_counts(void **state)
{
    (void)state;
    enum { MOST = 2 * 4096 + 1 };
    static double xyz[MOST][3], distance_m[MOST];
    static uint32_t triangle[MOST];
    struct scene *s = make_plate();
    struct bvh *bvh = make_bvh(s);
    const struct cloud_site site = {.bvh = bvh, .n_stations = 1, .max_m = 10, .threads = 1};
    for (size_t n = 4095; n <= MOST; n += n == 4097 ? 4096 - 2 : 1) {
        for (size_t i = 0; i < n; i++) {
            xyz[i][0] = xyz[i][1] = 1.0;
            xyz[i][2] = 0.25;
            distance_m[i] = -1.0;
        }
        const struct cloud c = {.n = n, .xyz_m = xyz, .epsg = CLOUD_EPSG_UNKNOWN};
        assert_int_equal(cloud_compare(&c, &site, NULL, distance_m, triangle, NULL), SH_OK);
        for (size_t i = 0; i < n; i++)
            assert_true(distance_m[i] == 0.25);
    }
    bvh_free(bvh);
    scene_free(s);
}

static const struct georef *make_georef(enum georef_crs crs, int station)
{
    /* The stations are half a degree apart, though two metres apart in the scene: a mixed-up station is kilometres
     * away. */
    const struct georef_spec spec = {.crs = crs,
                                     .station_m = {1.0 + 2 * station, 2, 1.5},
                                     .utm_zone = 33,
                                     .lat_deg = 52.5 + 0.5 * station,
                                     .lon_deg = 13.4,
                                     .height_m = 110};
    struct georef *g;
    struct sh_err err;
    if (georef_create(&spec, &g, &err) != SH_OK) fail_msg("%s", err.text);
    return g;
}

/* Points of two stations, 2 mm above the plate and on it, go there and back. */
static void check_crs(enum georef_crs crs, int epsg)
{
    const struct georef *georef[2] = {make_georef(crs, 0), make_georef(crs, 1)};
    static const double p_prcs[4][3] = {{7, 1, 0.002}, {0.5, 7.5, 0}, {4, 4, 0.002}, {1, 2, 0}};
    uint16_t station[4] = {1, 2, 2, 1};
    double xyz[4][3], distance_m[4];
    uint32_t triangle[4];
    for (int i = 0; i < 4; i++) {
        double anchor[3], d[3], station_m[3] = {1.0 + 2 * (station[i] - 1), 2, 1.5};
        for (int k = 0; k < 3; k++)
            d[k] = p_prcs[i][k] - station_m[k];
        georef_anchor(georef[station[i] - 1], anchor);
        georef_forward(georef[station[i] - 1], 1, (struct vec3_in){&d[0], &d[1], &d[2]},
                       (struct vec3_out){&d[0], &d[1], &d[2]});
        for (int k = 0; k < 3; k++)
            xyz[i][k] = anchor[k] + d[k];
    }
    struct scene *s = make_plate();
    struct bvh *bvh = make_bvh(s);
    struct cloud c = {.n = 4, .xyz_m = xyz, .station = station, .epsg = epsg};
    struct cloud_site site = {.bvh = bvh, .georef = georef, .n_stations = 2, .max_m = 10, .threads = 2};
    struct sh_err err;
    assert_int_equal(cloud_compare(&c, &site, NULL, distance_m, triangle, &err), SH_OK);
    /* Sums of 6e6 m round by 4.7e-10 on each axis; GeographicLib states 5 nm for its transverse Mercator,
     * each way. */
    const double tolerance_m = 1.2e-8;
    for (int i = 0; i < 4; i++)
        assert_true(fabs(distance_m[i] - p_prcs[i][2]) < tolerance_m);
    /* Moved into the scene, once for all, they are where they were, and need no georefs. */
    double moved[4][3];
    memcpy(moved, xyz, sizeof xyz);
    struct cloud within = {.n = 4, .xyz_m = moved, .station = station, .epsg = epsg};
    struct cloud_site there = site;
    assert_int_equal(cloud_into_scene(&within, &there, NULL, &err), SH_OK);
    assert_true(within.epsg == 0 && there.georef == NULL);
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 3; k++)
            assert_true(fabs(moved[i][k] - p_prcs[i][k]) < tolerance_m);
    assert_int_equal(cloud_compare(&within, &there, NULL, distance_m, triangle, &err), SH_OK);
    within.epsg = epsg + 1;
    there = site;
    assert_int_equal(cloud_into_scene(&within, &there, NULL, &err), SH_EINPUT);
    assert_true(within.epsg == epsg + 1 && there.georef != NULL);
    c.epsg = epsg + 1;
    assert_int_equal(cloud_compare(&c, &site, NULL, distance_m, triangle, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "EPSG"));
    c.epsg = CLOUD_EPSG_UNKNOWN;
    site.n_stations = 1;
    assert_int_equal(cloud_compare(&c, &site, NULL, distance_m, triangle, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "point 2 is of station 2; there are 1"));
    station[0] = 3;
    assert_int_equal(cloud_compare(&c, &site, NULL, distance_m, triangle, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "point 1 is of station 3; there are 1"));
    for (int i = 0; i < 2; i++)
        georef_free((struct georef *)(uintptr_t)georef[i]);
    bvh_free(bvh);
    scene_free(s);
}

static void points_go_back_to_the_scene(void **state)
{
    (void)state;
    check_crs(GEOREF_LOCAL, 0);
    check_crs(GEOREF_ECEF, 4978);
    check_crs(GEOREF_UTM, 32633);
    check_crs(GEOREF_GEODETIC, 4979);
}

/* Points of `record --crs` need the same system in the scene, which --set gives. Other systems are none of a head's. */
static void points_in_a_system_of_a_head_get_advice(void **state)
{
    (void)state;
    static const struct {
        int64_t epsg;
        const char *end;
    } rows[] = {{4978, "(0: scene frame); allowed with --set output.layout=geo --set output.crs=ecef"},
                {4979, "(0: scene frame); allowed with --set output.layout=geo --set output.crs=geodetic"},
                {32601, "(0: scene frame); allowed with --set output.layout=geo --set output.crs=utm"},
                {32761, "(0: scene frame); allowed with --set output.layout=geo --set output.crs=utm"},
                {32600, "(0: scene frame)"},
                {32762, "(0: scene frame)"},
                {25832, "(0: scene frame)"}};
    double xyz[1][3] = {{0}}, distance_m[1];
    uint16_t station[1] = {1};
    uint32_t triangle[1];
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct cloud c = {.n = 1, .xyz_m = xyz, .station = station, .epsg = rows[i].epsg};
        const struct cloud_site site = {.n_stations = 1, .max_m = 10, .threads = 1};
        struct sh_err err;
        assert_int_equal(cloud_compare(&c, &site, NULL, distance_m, triangle, &err), SH_EINPUT);
        const size_t len = strlen(err.text), end = strlen(rows[i].end);
        if (len < end || strcmp(err.text + len - end, rows[i].end) != 0) fail_msg("case %zu: %s", i, err.text);
    }
}

static void coverage_is_counted(void **state)
{
    (void)state;
    struct scene *s = make_plate();
    uint16_t label[5] = {1, CLOUD_LABEL_NONE, 1, 2, 0};
    const uint32_t triangle[5] = {1, CLOUD_TRIANGLE_NONE, 1, CLOUD_TRIANGLE_NONE, 0};
    struct cloud c = {.n = 4, .label = label};
    struct cloud_coverage cover;
    struct sh_err err;
    assert_int_equal(cloud_cover(&c, s, s->n_surfaces, triangle, &cover, &err), SH_OK);
    assert_int_equal(cover.surfaces_hit, 2);
    assert_int_equal(cover.triangles_hit, 1);
    c.label = NULL;
    assert_int_equal(cloud_surface(&c, s, triangle, 0), 2);
    assert_int_equal(cloud_surface(&c, s, triangle, 1), CLOUD_LABEL_NONE);
    assert_int_equal(cloud_cover(&c, s, s->n_surfaces, triangle, &cover, &err), SH_OK);
    assert_int_equal(cover.surfaces_hit, 1);
    c.label = label;
    c.n = 1; /* the first point alone; then five, the last on a triangle of its own */
    assert_int_equal(cloud_cover(&c, s, s->n_surfaces, triangle, &cover, &err), SH_OK);
    assert_true(cover.surfaces_hit == 1 && cover.triangles_hit == 1);
    c.n = 5;
    assert_int_equal(cloud_cover(&c, s, s->n_surfaces, triangle, &cover, &err), SH_OK);
    assert_true(cover.surfaces_hit == 3 && cover.triangles_hit == 2);
    label[2] = 3;
    assert_int_equal(cloud_cover(&c, s, s->n_surfaces, triangle, &cover, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "point 3 has label 3; the scene has 3 surfaces"));
    scene_free(s);
}

/* The values are 1 to 1000 in a stirred order, between shots without echo. Sums have closed forms. */
static void statistics_of_whole_numbers(void **state)
{
    (void)state;
    enum { N = 1000 };
    double d[2 * N];
    for (int i = 0; i < N; i++) {
        d[2 * i] = NAN;
        d[2 * i + 1] = i * 389 % N + 1; /* 389 is prime: each once */
    }
    struct cloud_stats s;
    cloud_stats(d, 2 * N, 950, &s);
    assert_int_equal(s.points, N);
    assert_int_equal(s.empty, N);
    assert_int_equal(s.far, 0);
    assert_int_equal(s.beyond, 50); /* 950 itself isn't beyond */
    assert_true(s.mean_m == (N + 1) / 2.0);
    assert_true(s.rms_m == sqrt((N + 1) * (2 * N + 1) / 6.0));
    assert_true(s.p50_m == 500 && s.p95_m == 950 && s.p999_m == 999 && s.max_m == 1000);
    assert_true(d[s.worst] == 1000);
    d[0] = INFINITY;
    cloud_stats(d, 2 * N, 950, &s);
    assert_int_equal(s.far, 1);
    assert_int_equal(s.beyond, 51);
    assert_int_equal(s.worst, 0);
    assert_true(s.mean_m == (N + 1) / 2.0 && s.max_m == 1000);
}

static void statistics_of_little(void **state)
{
    (void)state;
    static const double one[] = {0.25}, same[] = {0.5, 0.5, 0.5}, none[] = {NAN, INFINITY};
    struct cloud_stats s;
    cloud_stats(one, 1, 1, &s);
    assert_true(s.mean_m == 0.25 && s.rms_m == 0.25 && s.p50_m == 0.25 && s.p999_m == 0.25 && s.max_m == 0.25);
    assert_int_equal(s.worst, 0);
    cloud_stats(same, 3, 0, &s);
    assert_true(s.p50_m == 0.5 && s.p95_m == 0.5);
    assert_int_equal(s.beyond, 3);
    assert_int_equal(s.worst, 0);
    cloud_stats(none, 2, 1, &s);
    assert_true(isnan(s.mean_m) && isnan(s.p50_m) && isnan(s.max_m));
    assert_int_equal(s.points, 1);
    assert_int_equal(s.worst, 1);
    cloud_stats(none, 1, 1, &s);
    assert_int_equal(s.points, 0);
    assert_int_equal(s.worst, 1);
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Percentiles are compared with those of the sorted values, over all magnitudes of a double. */
static void percentiles_are_nearest_ranks(void **state)
{
    (void)state;
    srand(11);
    for (size_t n = 1; n < 2600; n += n / 3 + 1) {
        double d[2600], sorted[2600];
        for (size_t i = 0; i < n; i++)
            sorted[i] = d[i] = rand() % 9 == 0 ? 0 : ldexp(rand(), rand() % 1900 - 1000);
        qsort(sorted, n, sizeof *sorted, by_value);
        struct cloud_stats s;
        cloud_stats(d, n, 1, &s);
        assert_true(s.p50_m == sorted[(n * 500 + 999) / 1000 - 1]);
        assert_true(s.p95_m == sorted[(n * 950 + 999) / 1000 - 1]);
        assert_true(s.p999_m == sorted[(n * 999 + 999) / 1000 - 1]);
        assert_true(s.max_m == sorted[n - 1]);
    }
}

/* Adding a million equal values in double drifts. */
static void sums_do_not_drift(void **state)
{
    (void)state;
    enum { N = 1000000 };
    double *d = malloc(N * sizeof *d), naive = 0;
    for (int i = 0; i < N; i++)
        naive += d[i] = 0.1;
    struct cloud_stats s;
    cloud_stats(d, N, 1, &s);
    assert_true(fabs(naive / N - 0.1) > 1e-13); /* else this test shows nothing */
    /* The long double sum has a relative error of N * 2^-64 at most: 5.4e-14; half as much below the root. */
    assert_true(fabs(s.mean_m - 0.1) < 0.1 * (N * 0x1p-64 + 0x1p-52));
    assert_true(fabs(s.rms_m - 0.1) < 0.1 * (N * 0x1p-64 + 0x1p-52));
    free(d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_last_point_counts),
        cmocka_unit_test(offsets_from_a_plate),
        cmocka_unit_test(threads_change_nothing),
        cmocka_unit_test(points_go_back_to_the_scene),
        cmocka_unit_test(points_in_a_system_of_a_head_get_advice),
        cmocka_unit_test(coverage_is_counted),
        cmocka_unit_test(statistics_of_whole_numbers),
        cmocka_unit_test(statistics_of_little),
        cmocka_unit_test(percentiles_are_nearest_ranks),
        cmocka_unit_test(sums_do_not_drift),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
