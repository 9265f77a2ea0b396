/* SPDX-License-Identifier: MIT */
/* Which points have a deviation along their beams: footprints beside edges, distances that don't fit, several stations
 * and many points, points that lead nowhere. */
#include <math.h>

#include "core/studio/deviation.h"
#include "tests/unit/scene_files.h"

enum { MOST = 17000 };

static double xyz[MOST][3], distance_m[MOST];
static uint32_t triangle[MOST];
static uint16_t station[MOST];
static struct cloud cloud;
static struct cloud_site site;
static const struct cloud_compared compared = {&cloud, &site, distance_m, triangle};
static struct scene *scene;
static struct bvh *scene_bvh;
static struct deviation_points out;
static struct deviation_head head[2];
static struct cast_beam beam;
static struct sh_err err;

/* Two heads at the origin, without noise. */
static void open_scene(const char *text)
{
    scene = load_text("scene.obj", text);
    assert_int_equal(bvh_create(scene, 1, NULL, &scene_bvh, &err), SH_OK);
    assert_int_equal(deviation_points_create(MOST, &out, &err), SH_OK);
    memset(head, 0, sizeof head);
    for (int i = 0; i < 2; i++) {
        head[i].setup.mirror_counts = head[i].setup.pan_counts = 4294967296.0;
        head[i].setup.layout = LINE_GEO;
        head[i].setup.rotation[0] = head[i].setup.rotation[4] = head[i].setup.rotation[8] = 1.0;
        head[i].setup.bvh = scene_bvh;
    }
    cloud = (struct cloud){.xyz_m = xyz};
    site = (struct cloud_site){.bvh = scene_bvh, .n_stations = 1, .max_m = 10, .threads = 1};
}

static void close_scene(void)
{
    deviation_points_free(&out);
    bvh_free(scene_bvh);
    scene_free(scene);
}

static void add(double x, double y, double z)
{
    assert_true(cloud.n < MOST);
    memcpy(xyz[cloud.n++], (const double[3]){x, y, z}, sizeof xyz[0]);
}

static void compare(void)
{
    if (cloud_compare(&cloud, &site, NULL, distance_m, triangle, &err) != SH_OK) fail_msg("%s", err.text);
}

static void follow(void)
{
    if (deviation_along(&compared, head, NULL, &out, &err) != SH_OK) fail_msg("%s", err.text);
}

static const char WALL[] = "v -50 10 -50\nv 50 10 -50\nv 50 10 50\nv -50 10 50\nf 1 2 3\nf 1 3 4\n";

/* Twelve rays run around a footprint at 1.1 of its radius, 30 degrees apart. The farthest one towards a straight edge
 * is at most 15 degrees aside, so it reaches 1.1 cos 15 = 1.0625 radii or more, and 1.1 at most. The wall 10 m ahead
 * has an edge in each direction, nearer than that or farther. */
static void footprints_beside_an_edge(void **state)
{
    (void)state;
    beam_init(&beam.beam, 0.02, 0.35e-3, 4e-9);
    const double radius_m = beam_radius(&beam.beam, 10.0);
    for (int turn = 0; turn < 48; turn++)
        for (int clear = 0; clear < 2; clear++) {
            const double c = cos(turn * M_PI / 24), s = sin(turn * M_PI / 24),
                         off_m = radius_m * (clear ? 1.101 : 1.061);
            char text[512];
            snprintf(text, sizeof text, "v %.17g 10 %.17g\nv %.17g 10 %.17g\nv %.17g 10 %.17g\nf 1 2 3\n",
                     off_m * c - 50 * s, off_m * s + 50 * c, off_m * c + 50 * s, off_m * s - 50 * c, -50 * c, -50 * s);
            open_scene(text);
            head[0].setup.beam = &beam;
            add(0, 10.001, 0);
            compare();
            follow();
            if (isnan(out.along_m[0]) == clear) fail_msg("edge at %g: %g", 7.5 * turn, (double)out.along_m[0]);
            head[0].setup.beam = NULL; /* a ray by itself is not cut */
            follow();
            assert_true(fabs((double)out.along_m[0] - 0.001) < 1e-6);
            close_scene();
        }
}

/* A step in the wall, of more than 1e-6 of the range and 2 um, cuts a footprint. A smaller one doesn't. */
static void footprints_over_a_step(void **state)
{
    (void)state;
    static const double step_m[] = {8e-6, 16e-6};
    beam_init(&beam.beam, 0.02, 0.35e-3, 4e-9);
    for (int i = 0; i < 2; i++) {
        char text[512];
        snprintf(text, sizeof text,
                 "v -50 10 -50\nv 0.01 10 -50\nv 0.01 10 50\nv -50 10 50\nv 0.01 %.17g -50\nv 50 %.17g -50\n"
                 "v 50 %.17g 50\nv 0.01 %.17g 50\nf 1 2 3 4\nf 5 6 7 8\n",
                 10 + step_m[i], 10 + step_m[i], 10 + step_m[i], 10 + step_m[i]);
        open_scene(text);
        head[0].setup.beam = &beam;
        add(0, 10.001, 0);
        compare();
        follow();
        assert_int_equal(isnan(out.along_m[0]), i);
        close_scene();
    }
}

/* The triangle that a beam meets is that of its middle, whatever the rays around it hit. */
static void what_the_beam_meets(void **state)
{
    (void)state;
    uint32_t met[3];
    open_scene(WALL);
    beam_init(&beam.beam, 0.02, 0.35e-3, 4e-9);
    head[0].setup.beam = &beam;
    out.met = met;
    add(0.0005, 10.001, 0); /* beside the diagonal x = z, with rays on both of its sides */
    add(0, 10.001, 0.0005);
    add(3, 9.999, -7);
    compare();
    follow();
    assert_true(met[0] == 0 && met[1] == 1 && met[2] == 0);
    for (int i = 0; i < 3; i++)
        assert_true(!isnan(out.along_m[i]));
    out.met = NULL;
    close_scene();
}

/* The point's distance may differ by 1 % of what its deviation explains, and by 2 um. */
static void distances_that_fit(void **state)
{
    (void)state;
    static const struct {
        double along_m, distance_m;
        int fits;
    } row[] = {{0.5, 0.5, 1},    {0.5, 0.5049, 1},    {0.5, 0.4951, 1},   {0.5, 0.5061, 0},
               {0.5, 0.4939, 0}, {-0.5, 0.5049, 1},   {-0.5, 0.5061, 0},  {0, 1.9e-6, 1},
               {0, 2.2e-6, 0},   {1e-4, 1.025e-4, 1}, {1e-4, 1.04e-4, 0}, {-0.5, 0.4949, 0}};
    enum { N = sizeof row / sizeof row[0] };
    open_scene(WALL);
    for (int i = 0; i < N; i++)
        add(0, 10 + row[i].along_m, 0);
    compare();
    for (int i = 0; i < N; i++)
        distance_m[i] = row[i].distance_m;
    follow();
    for (int i = 0; i < N; i++)
        if (isnan(out.along_m[i]) == row[i].fits) fail_msg("%g m, %g m away", row[i].along_m, row[i].distance_m);
    close_scene();
}

/* A point at the station, one of a body, a far one and a shot without echo have no deviation. A point before the wall
 * has one. */
static void points_without_a_deviation(void **state)
{
    (void)state;
    uint32_t met[5];
    open_scene(WALL);
    out.met = met;
    add(0, 0, 0);
    add(0, 9.5, 0);
    add(0, 12, 0);
    add((double)NAN, (double)NAN, (double)NAN);
    add(0, 9.75, 0);
    site.max_m = 100;
    compare();
    triangle[1] = CLOUD_TRIANGLE_NONE; /* of a body */
    distance_m[2] = INFINITY;
    triangle[2] = CLOUD_TRIANGLE_NONE;
    follow();
    static const double range_m[5] = {0, 9.5, 12, (double)NAN, 9.75};
    for (int i = 0; i < 5; i++) {
        const double got_m = (double)out.range_m[i];
        assert_true(i == 3 ? isnan(got_m) : got_m == range_m[i]);
        assert_int_equal(isnan(out.along_m[i]), i != 4);
        assert_int_equal(isnan(out.sigma_m[i]), i != 4);
        assert_int_equal(isnan(out.counts_m[i]), i != 4);
        assert_int_equal(isnan(out.cosine[i]), i != 4);
        if (i == 1 || i == 2) assert_int_equal(met[i], CLOUD_TRIANGLE_NONE);
    }
    assert_true((double)out.along_m[4] == -0.25 && (double)out.cosine[4] == 1);
    out.met = NULL;
    close_scene();
}

/* A beam that passes beside the wall hits nothing. The wall is the nearest surface, 5 cm from the point, and the one
 * that counts as met, but there is no deviation along the beam. */
static void a_beam_beside_the_scene(void **state)
{
    (void)state;
    uint32_t met[1];
    open_scene(WALL);
    out.met = met;
    add(50.05, 10, 0);
    compare();
    assert_true(fabs(distance_m[0] - 0.05) < 1e-9 && triangle[0] != CLOUD_TRIANGLE_NONE);
    follow();
    assert_true(isnan(out.along_m[0]) && isnan(out.sigma_m[0]) && isnan(out.counts_m[0]) && isnan(out.cosine[0]));
    assert_int_equal(met[0], triangle[0]);
    out.met = NULL;
    close_scene();
}

/* The beam goes along x = y and passes 5 cm beside the wall's edge, whichever of its edges that is. The point is nearest
 * to the wall's inside, and as far from it as a deviation along the beam would explain. */
static void a_slanted_beam_beside_an_edge(void **state)
{
    (void)state;
    static const char *const face[] = {"f 1 2 3\n", "f 2 3 1\n", "f 3 1 2\n", "f 3 2 1\n", "f 1 3 2\n", "f 2 1 3\n"};
    for (size_t i = 0; i < sizeof face / sizeof face[0]; i++)
        for (int hits = 0; hits < 2; hits++) {
            char text[128];
            snprintf(text, sizeof text, "v %s 10 -50\nv %s 10 50\nv 60 10 0\n%s", hits ? "9.95" : "10.05",
                     hits ? "9.95" : "10.05", face[i]);
            open_scene(text);
            add(10.1, 10.1, 0);
            compare();
            assert_true(fabs(distance_m[0] - 0.1) < 1e-9);
            follow();
            if (isnan(out.along_m[0]) == hits) fail_msg("%s", text);
            close_scene();
        }
}

/* Stations take turns, each by one or more points; one of them is 4 m to the right. Every point has its own deviation,
 * also the only one of a cloud, and the last of many. */
static void stations_and_numbers(void **state)
{
    (void)state;
    static const size_t n[] = {1, 2, 1024, 1025, 16384, 16385};
    open_scene(WALL);
    head[1].setup.station_m[0] = 4;
    head[1].setup.station_m[1] = 1; /* nearer to the wall */
    site.n_stations = 2;
    cloud.station = station;
    for (size_t j = 0; j < sizeof n / sizeof n[0]; j++)
        for (int together = 0; together < 2; together++) {
            cloud.n = 0;
            for (size_t i = 0; i < n[j]; i++) {
                station[i] = (uint16_t)(together ? 1 + (i >= n[j] / 2) : 1 + i / 3 % 2);
                const double *at = head[station[i] - 1].setup.station_m, along = 1e-3 * (1 + (double)(i % 7));
                /* on the beam at 45 degrees, `along` beyond the wall */
                const double far = 10 - at[1], share = 1 + along / (far * M_SQRT2);
                add(at[0] + far * share, at[1] + far * share, 0);
            }
            compare();
            follow();
            for (size_t i = 0; i < n[j]; i++) {
                const double want_m = 1e-3 * (1 + (double)(i % 7));
                if (!(fabs((double)out.along_m[i] - want_m) < 1e-7)) fail_msg("point %zu of %zu", i, n[j]);
                assert_true(fabs((double)out.cosine[i] - M_SQRT1_2) < 1e-6);
                assert_true(fabs((double)out.range_m[i] - (station[i] == 1 ? 10 : 9) * M_SQRT2 - want_m) < 1e-5);
            }
        }
    close_scene();
}

/* A small wall is 30 um behind. The searched balls touch the face and have a radius of 8 sigma, so with a noise of 3 um
 * they reach 48 um. Balls below 20 um are not searched, since surfaces so near can't be told apart. Elsewhere nothing
 * is near. */
static void surfaces_that_are_near(void **state)
{
    (void)state;
    static const struct {
        double sigma_m;
        int is_judged;
    } row[] = {{4e-6, 0}, {3e-6, 0}, {2e-6, 1}, {0, 1}};
    char text[512];
    snprintf(text, sizeof text, "%sv 8 10.00003 -12\nv 12 10.00003 -12\nv 12 10.00003 -8\nf 5 6 7\n", WALL);
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        open_scene(text);
        head[0].setup.noise_on = 1;
        head[0].setup.range_sigma_m = row[i].sigma_m;
        add(11, 10, -11);
        add(-11, 10, -11);
        compare();
        follow();
        assert_true(!isnan(out.along_m[0]) && !isnan(out.sigma_m[1]) && !isnan(out.counts_m[1]));
        assert_int_equal(isnan(out.sigma_m[0]), !row[i].is_judged);
        assert_int_equal(isnan(out.counts_m[0]), !row[i].is_judged);
        close_scene();
    }
}

/* The search for a beam's hit reaches far enough also near the head. */
static void points_near_the_head(void **state)
{
    (void)state;
    static const double far_m[] = {0.9, 0.3, 0.01};
    open_scene("v -50 0.3 -50\nv 50 0.3 -50\nv 50 0.3 50\nf 1 2 3\n");
    for (int i = 0; i < 3; i++) {
        cloud.n = 0; /* each by itself: the farthest of a batch sets the reach */
        add(0.01, far_m[i], -0.01);
        compare();
        follow();
        const double range_m = sqrt(far_m[i] * far_m[i] + 2e-4), want_m = range_m * (1 - 0.3 / far_m[i]);
        assert_true(fabs((double)out.along_m[0] - want_m) < 1e-7); /* a float of 0.6 m steps by 6e-8 */
    }
    close_scene();
}

static int stop(void *ctx)
{
    (void)ctx;
    return 1;
}

static void a_stop_is_heard(void **state)
{
    (void)state;
    const struct sh_report report = {.stop = stop};
    open_scene(WALL);
    add(0, 10, 0);
    compare();
    assert_int_equal(deviation_along(&compared, head, &report, &out, &err), SH_ESTOPPED);
    close_scene();
}

/* ---- sigma by the signal */

/* The reflectance must be known: the surface is in the table, without texels and without colours of its vertices. */
static void sigma_by_the_signal(void **state)
{
    (void)state;
    struct surface_table table;
    struct detect_signal signal = {.floor2 = 9e-6, .per_distance = 1e-5};
    struct deviation_head one = {0};
    const struct cast_detect detect = {.signal = &signal, .noise_by_signal = 1, .surfaces = &table};
    struct deviation_hit hit = {100.0, {0, 1, 0}, {0, -1, 0}, 0};
    double counts_m;
    assert_int_equal(surface_table_alloc(3, &table, &err), SH_OK);
    for (uint32_t i = 0; i < 3; i++)
        surface_table_set(&table, i, &(struct scene_surface){.object = "a"}, NULL, 0, 0.5);
    assert_int_equal(surface_table_by_vertex(&table, 1, &err), SH_OK);
    one.setup.mirror_counts = one.setup.pan_counts = 4294967296.0;
    one.setup.rotation[0] = one.setup.rotation[4] = one.setup.rotation[8] = 1.0;
    one.setup.detect = &detect;
    for (int32_t label = -1; label <= 3; label++) {
        hit.label = label;
        const double sigma_m = deviation_sigma_m(&one, &hit, &counts_m);
        if (label == 0 || label == 2)
            assert_true(fabs(sigma_m - 0.004) < 1e-12); /* 1 mm of 100 m; jitter is 0, so is the amplitude's part */
        else
            assert_true(isnan(sigma_m));
        assert_true(counts_m == 0.0);
    }
    one.has_instrument_errors = 1;
    hit.label = 0;
    assert_true(isnan(deviation_sigma_m(&one, &hit, &counts_m)) && isnan(counts_m));
    surface_table_free(&table);
}

/* Straight up the pan moves nothing. The mirror moves the beam in an unknown direction, so all of its motion counts. */
static void sigma_straight_up(void **state)
{
    (void)state;
    struct deviation_head one = {0};
    const struct deviation_hit hit = {100.0, {0, 0, 1}, {0, 0, -1}, -1};
    double counts_m;
    one.setup.mirror_counts = one.setup.pan_counts = 4294967296.0;
    one.setup.rotation[0] = one.setup.rotation[4] = one.setup.rotation[8] = 1.0;
    one.angle_sigma_rad[0] = 1e-5;
    one.angle_sigma_rad[1] = 7e-5;
    assert_true(fabs(deviation_sigma_m(&one, &hit, &counts_m) - 1e-3) < 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(footprints_beside_an_edge),
        cmocka_unit_test(footprints_over_a_step),
        cmocka_unit_test(what_the_beam_meets),
        cmocka_unit_test(distances_that_fit),
        cmocka_unit_test(points_without_a_deviation),
        cmocka_unit_test(a_beam_beside_the_scene),
        cmocka_unit_test(a_slanted_beam_beside_an_edge),
        cmocka_unit_test(stations_and_numbers),
        cmocka_unit_test(surfaces_that_are_near),
        cmocka_unit_test(a_stop_is_heard),
        cmocka_unit_test(points_near_the_head),
        cmocka_unit_test(sigma_by_the_signal),
        cmocka_unit_test(sigma_straight_up),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
