/* SPDX-License-Identifier: MIT */
/* The places that `coverage --next` compares, and the rays that it compares them by. The floors, the head's field of
 * view and its pulses are the test's. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/studio/viewpoint.h"
#include "firmware_sim/app/studio/coverage/next.h"
#include "firmware_sim/config/places.h"
#include "firmware_sim/config/profile.h"
#include "tests/unit/schedule_rig.h"

static const struct config_profile profile = {.name = "model"};
static struct config_station configured = {.heading_deg = 77};
static struct site_station stations[3];
static struct scene scene = {.min_m = {-1, -2, -3}, .max_m = {4, 5, 6}};
static struct site site;
static struct coverage_next_options options;
static struct coverage_result result;
static struct coverage_next next;
static struct coverage_finder finder;
static struct sh_err err;
static const struct sh_report report;

static struct viewpoint_grid asked;
static uint32_t n_found;
static double least_z; /* the head sees directions from this z upwards */
static struct schedule_spec spec;

const struct config_profile *site_profile(const struct site *of)
{
    assert_ptr_equal(of, &site);
    return &profile;
}

const char *site_file(const struct site *of)
{
    assert_ptr_equal(of, &site);
    return "head.yaml";
}

int site_scans(const struct site *of, uint32_t station, const double dir[3])
{
    assert_true(of == &site && station == 2);
    assert_true(fabs(dir[0] * dir[0] + dir[1] * dir[1] + dir[2] * dir[2] - 1.0) < 1e-12);
    return dir[2] >= least_z;
}

void coverage_scan_of(const struct site *of, uint32_t station, struct coverage_scan_at *at)
{
    assert_true(of == &site && station == 2);
    schedule_start(&at->scan.segment, &spec);
}

int viewpoint_places(const struct bvh *bvh, const struct viewpoint_grid *grid, const struct sh_report *to,
                     struct viewpoint_place **out, uint32_t *n, struct sh_err *e)
{
    assert_true(bvh == site.bvh && to == &report);
    (void)e;
    asked = *grid;
    *n = n_found;
    *out = calloc(n_found + 1, sizeof **out);
    assert_non_null(*out);
    for (uint32_t i = 0; i < n_found; i++)
        (*out)[i] = (struct viewpoint_place){{i, 10 + i, 20 + i}, 30 + i};
    return SH_OK;
}

static int make(void **state)
{
    (void)state;
    memset(&site, 0, sizeof site);
    memset(stations, 0, sizeof stations);
    site.n_stations = 3;
    site.station = stations;
    site.scene = &scene;
    site.bvh = (struct bvh *)&scene;
    site.emitter.kind = EMITTER_LINE;
    stations[2].station = &configured;
    result = (struct coverage_result){.site = &site, .base = 2};
    options = (struct coverage_next_options){.grid_m = 0.5, .height_m = 1.6, .step_deg = 30};
    for (int i = 0; i < 3; i++)
        options.area_m[0][i] = options.area_m[1][i] = (double)NAN;
    n_found = 2;
    least_z = -2;
    return 0;
}

static int end(void **state)
{
    (void)state;
    coverage_next_free(&next, &finder);
    next = (struct coverage_next){0};
    finder = (struct coverage_finder){0};
    return 0;
}

static void open_it(int rc)
{
    end(NULL);
    assert_int_equal(coverage_next_open(&options, &result, &report, &next, &finder, &err), rc);
}

static void refuse(const char *text)
{
    open_it(SH_EINPUT);
    assert_string_equal(err.text, text);
}

/* Limits that are not given are those of the scene along x and y. Along z there are none: the lowest floor that a ray
 * finds may lie just below the scene's box, by its rounding. */
static void a_grid(void **state)
{
    (void)state;
    open_it(SH_OK);
    assert_true(asked.step_m == 0.5 && asked.height_m == 1.6);
    assert_memory_equal(asked.min_m, scene.min_m, 2 * sizeof *asked.min_m);
    assert_memory_equal(asked.max_m, scene.max_m, 2 * sizeof *asked.max_m);
    assert_true(asked.min_m[2] == -INFINITY && asked.max_m[2] == INFINITY);
    assert_int_equal(next.n, 2);
    for (uint32_t i = 0; i < 2; i++) {
        const struct coverage_next_place *p = &next.place[i];
        assert_true(p->position_m[0] == i && p->position_m[1] == 10 + i && p->position_m[2] == 20 + i);
        assert_true(p->floor_m == 30 + i && p->heading_deg == 77 && p->state == COVERAGE_PLACE_OPEN);
    }
    options.area_m[0][1] = 0.25;
    options.area_m[1][2] = 2.5;
    open_it(SH_OK);
    assert_true(asked.min_m[0] == -1 && asked.min_m[1] == 0.25 && asked.min_m[2] == -INFINITY);
    assert_true(asked.max_m[0] == 4 && asked.max_m[1] == 5 && asked.max_m[2] == 2.5);
}

static void grids_that_do_not_go(void **state)
{
    (void)state;
    n_found = 0;
    refuse(
        "--grid 0.5: no place to stand: no floor there has 1.8 m of room above it; allowed is another grid, --height "
        "or --at");
    options.of_page = 1;
    refuse("no place to stand: no floor has 1.8 m of room above it; allowed is another height_m");
    options.of_page = 0;
    n_found = 100000;
    open_it(SH_OK);
    n_found++;
    refuse("--grid 0.5: 100001 places to stand; allowed are 100000: use a wider grid, or a part with --at");
    n_found = 1;
    site.anchor.known = 1;
    site.anchor.frame.kind = GEOFRAME_ECEF;
    refuse("head.yaml: scene.anchor.source: ecef, where z is not up, so a grid has no floors; allowed is --candidates");
    site.anchor.frame.kind = GEOFRAME_GRID;
    open_it(SH_OK);
    site.anchor.known = 0;
    site.anchor.frame.kind = GEOFRAME_ECEF; /* there is no anchor */
    open_it(SH_OK);
}

/* ---- places of a file */

static char path[64];

static void write_file(const char *text)
{
    strcpy(path, "/tmp/scanhead-places-XXXXXX");
    const int fd = mkstemp(path);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
    options.candidates = path;
}

static void candidates(void **state)
{
    (void)state;
    write_file("y_m,x_m,z_m\n2,1,3\n# a remark\n-1e9,1e9,0\n");
    open_it(SH_OK);
    unlink(path);
    assert_int_equal(next.n, 2);
    assert_memory_equal(next.place[0].position_m, ((const double[]){1, 2, 3}), sizeof(double[3]));
    assert_memory_equal(next.place[1].position_m, ((const double[]){1e9, -1e9, 0}), sizeof(double[3]));
    assert_true(next.place[0].heading_deg == 77 && isnan(next.place[0].floor_m));
    write_file("x_m,y_m,z_m,heading_deg\n1,2,3,360\n4,5,6,-360\n7,8,9,0\n");
    open_it(SH_OK);
    unlink(path);
    assert_true(next.place[0].heading_deg == 360 && next.place[1].heading_deg == -360 &&
                next.place[2].heading_deg == 0);
}

static void wrong_candidates(void **state)
{
    static const struct {
        const char *text, *after; /* the error is the path and this */
    } rows[] = {{"x_m,y_m\n1,2\n", ": its first line needs x_m,y_m,z_m, and may have heading_deg"},
                {"x_m,z_m,heading_deg\n1,2,3\n", ": its first line needs x_m,y_m,z_m, and may have heading_deg"},
                {"x_m,y_m,z_m\n", ": there are no places in it"},
                {"x_m,y_m,z_m\n1,2,3\n1,1.1e9,3\n",
                 ", line 3: 1.1e+09 is out of range; allowed are metres within 1e9, and -360 "
                 "to 360 deg"},
                {"x_m,y_m,z_m,heading_deg\n1,2,3,360.5\n",
                 ", line 2: 360.5 is out of range; allowed are metres within 1e9, and "
                 "-360 to 360 deg"},
                {"x_m,y_m,z_m\n-1.1e9,2,3\n",
                 ", line 2: -1.1e+09 is out of range; allowed are metres within 1e9, and -360 to 360 "
                 "deg"}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char expected[256];
        write_file(rows[i].text);
        snprintf(expected, sizeof expected, "%s%s", path, rows[i].after);
        refuse(expected);
        unlink(path);
    }
}

/* ---- rays */

/* Rings of equal steps cover the whole sphere. Each ray stands for the same part of its ring. */
static void rays_all_around(void **state)
{
    double sum_sr = 0, mean[3] = {0};
    (void)state;
    open_it(SH_OK);
    assert_true(next.directions == finder.n_dir && next.step_deg == 30 && next.whole_cells == 0);
    /* 6 rings of 30 degrees: z = (sin low + sin high) / 2, and ceil(2 pi r / step) rays of each, at least 3 */
    assert_int_equal(finder.n_dir, 2 * (5 + 9 + 12));
    for (uint32_t i = 0; i < finder.n_dir; i++) {
        sum_sr += finder.each_sr[i];
        for (int k = 0; k < 3; k++)
            mean[k] += finder.each_sr[i] * finder.dir[i][k];
    }
    assert_true(fabs(sum_sr - 4 * M_PI) < 1e-12);
    assert_true(fabs(mean[0]) < 1e-12 && fabs(mean[1]) < 1e-12 && fabs(mean[2]) < 1e-12);
    assert_true(fabs(finder.dir[0][2] + 0.5 * (1 + sqrt(0.75))) < 1e-15); /* the lowest ring comes first */
    assert_true(fabs(finder.each_sr[0] - 2 * M_PI * (1 - sqrt(0.75)) / 5) < 1e-15);
    const double r = sqrt(1 - finder.dir[0][2] * finder.dir[0][2]); /* its first ray is half a step from y to x */
    assert_true(fabs(finder.dir[0][0] - r * sin(M_PI / 5)) < 1e-15 &&
                fabs(finder.dir[0][1] - r * cos(M_PI / 5)) < 1e-15);
    options.step_deg = 90;
    open_it(SH_OK);
    assert_int_equal(finder.n_dir, 2 * 4); /* 2 rings at z = 0.5, of ceil(4 sqrt(0.75)) */
}

/* Only rays within the field of view count, and none into the cone below the tripod's head. */
static void rays_of_a_head(void **state)
{
    static const struct config_tripod tripod;
    (void)state;
    least_z = 0.0;
    open_it(SH_OK);
    assert_int_equal(finder.n_dir, 5 + 9 + 12);
    least_z = 0.99;
    refuse("--step-deg 30: no ray lies within the head's field of view; allowed is a smaller step");
    least_z = -2;
    stations[2].tripod.cast.cos_opening = 0.5; /* there is no tripod */
    open_it(SH_OK);
    assert_int_equal(finder.n_dir, 2 * (5 + 9 + 12));
    stations[2].tripod.from = &tripod;
    open_it(SH_OK);
    assert_int_equal(finder.n_dir, 5 + 9 + 12 + 12); /* rings at z = -0.25, 0.25, 0.68 and 0.93 */
}

/* A head that fires in a plane or on cones is compared by its own pulses. Of 36 pulses of a line, those from -40 to 60
 * degrees are cast; the pan goes on by 18 degrees a second. */
static void rays_that_are_pulses(void **state)
{
    static const enum emitter_kind kinds[] = {EMITTER_PLANAR, EMITTER_BEAMS};
    (void)state;
    spec = plain_schedule(1);
    spec.prr_uhz = 36 * HZ;
    spec.lines_uhz = HZ;
    spec.pan_stop_udeg = 54 * DEG; /* three lines */
    for (int i = 0; i < 2; i++) {
        site.emitter.kind = kinds[i];
        options.step_given = 0;
        open_it(SH_OK);
        assert_true(next.whole_cells == 1 && next.directions == finder.n_dir);
        assert_int_equal(finder.n_dir, 3 * 16);
        for (uint32_t k = 0; k < finder.n_dir; k++) {
            const uint32_t pulse = k / 16 * 36 + k % 16;
            const double mirror = (-40 + 240.0 * (k % 16) / 36) * M_PI / 180, pan = 18.0 * pulse / 36 * M_PI / 180;
            assert_true(isinf(finder.each_sr[k]));
            assert_true(fabs(finder.dir[k][0] - sin(pan) * cos(mirror)) < 1e-6);
            assert_true(fabs(finder.dir[k][1] - cos(pan) * cos(mirror)) < 1e-6);
            assert_true(fabs(finder.dir[k][2] - sin(mirror)) < 1e-6);
        }
        options.step_given = 1;
        refuse("--step-deg: head profile model scans planes or cones, so places are compared by its pulses; leave "
               "--step-deg out");
    }
    options.step_given = 0;
    spec = plain_schedule(1); /* 3 million pulses, of which 40000 are drawn evenly: 101 of 240 degrees are cast */
    open_it(SH_OK);
    assert_in_range(finder.n_dir, 40000 * 99 / 240, 40000 * 102 / 240);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_grid, make, end),
        cmocka_unit_test_setup_teardown(grids_that_do_not_go, make, end),
        cmocka_unit_test_setup_teardown(candidates, make, end),
        cmocka_unit_test_setup_teardown(wrong_candidates, make, end),
        cmocka_unit_test_setup_teardown(rays_all_around, make, end),
        cmocka_unit_test_setup_teardown(rays_of_a_head, make, end),
        cmocka_unit_test_setup_teardown(rays_that_are_pulses, make, end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
