/* SPDX-License-Identifier: MIT */
/* Points spread over the meshes of a recording that is shown: how many there are, that each has the figures of its
 * triangle, and what /sparse and /mesh answer. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/bytes.h"
#include "firmware_sim/app/studio/view/encode.h"
#include "firmware_sim/app/studio/view/serve.h"
#include "firmware_sim/app/studio/view/spread.h"

/* Two meshes: a square of 2 m at z = 1, as two triangles, and a triangle of 0.5 m2 at z = 5. The first point of the
 * recording belongs to none of them. Each point has the range 10 z + x, the reflectance -z, the label of its mesh. */
enum { N = 8, N_SQUARE = 4 };
static const double places[N][3] = {{9, 9, 9}, {0, 0, 1}, {2, 0, 1}, {2, 2, 1},
                                    {0, 2, 1}, {0, 0, 5}, {1, 0, 5}, {0, 1, 5}};
static uint32_t square[2][3] = {{0, 1, 2}, {0, 2, 3}}, triangle[1][3] = {{0, 1, 2}}, order[2] = {1, 0};
static float square_ratio[2] = {2, 1}, triangle_ratio[1] = {1};
static struct viewed_mesh meshes[2] = {{.station = 3,
                                        .scan = 1,
                                        .first_point = 1,
                                        .n_points = 4,
                                        .n_faces = 2,
                                        .face = square,
                                        .ratio = square_ratio,
                                        .order = order},
                                       {.station = 4,
                                        .scan = 2,
                                        .first_point = 5,
                                        .n_points = 3,
                                        .n_faces = 1,
                                        .face = triangle,
                                        .ratio = triangle_ratio,
                                        .order = order}};
static struct viewed v;
static struct sh_err err;

static int fill(void **state)
{
    (void)state;
    const unsigned has =
        1u << CLOUD_RANGE | 1u << CLOUD_REFLECTANCE | 1u << CLOUD_LABEL | 1u << CLOUD_STATION | 1u << CLOUD_RGB;
    memset(&v, 0, sizeof v);
    v.path = "a.shs";
    if (cloud_make_room(&v.points, N, has, &err) != SH_OK) return -1;
    v.points.n = N;
    for (int i = 0; i < N; i++) {
        memcpy(v.points.xyz_m[i], places[i], sizeof places[i]);
        v.points.range_m[i] = (float)(10 * places[i][2] + places[i][0]);
        v.points.reflectance_db[i] = (float)-places[i][2];
        v.points.label[i] = i <= N_SQUARE ? 11 : 12;
        v.points.station[i] = i <= N_SQUARE ? 3 : 4;
        memcpy(v.points.rgb[i], i <= N_SQUARE ? "\x10\x20\x30" : "\x40\x50\x60", 3);
    }
    v.mesh = meshes;
    v.n_meshes = 2;
    return 0;
}

static int drop(void **state)
{
    (void)state;
    cloud_free(&v.points);
    return 0;
}

static struct cloud spread(struct view_spread wish)
{
    struct cloud out;
    if (view_spread(&v, &wish, NULL, &out, &err) != SH_OK) fail_msg("%s", err.text);
    return out;
}

/* Floats round a range of 52 m by 4e-6 m. */
static void expect_on_mesh(const struct cloud *p, uint32_t i, int is_square)
{
    const double *at = p->xyz_m[i], z = is_square ? 1 : 5;
    assert_true(fabs(at[2] - z) < 1e-12 && at[0] >= 0 && at[1] >= 0);
    assert_true(is_square ? at[0] <= 2 && at[1] <= 2 : at[0] + at[1] <= 1);
    assert_true(fabs((double)p->range_m[i] - 10 * z - at[0]) < 1e-5);
    assert_true(fabs((double)p->reflectance_db[i] + z) < 1e-6);
    assert_true(p->label[i] == (is_square ? 11 : 12) && p->station[i] == (is_square ? 3 : 4));
    assert_memory_equal(p->rgb[i], is_square ? "\x10\x20\x30" : "\x40\x50\x60", 3);
}

static void points_have_the_figures_of_their_mesh(void **state)
{
    (void)state;
    struct cloud p = spread((struct view_spread){.per_m2 = 100, .seed = 1});
    assert_int_equal(p.n, 450); /* 4 m2, then half a square metre */
    double halves = 0;
    for (uint32_t i = 0; i < p.n; i++) {
        expect_on_mesh(&p, i, i < 400);
        halves += i < 400 && p.xyz_m[i][1] > p.xyz_m[i][0];
    }
    assert_true(halves > 140 && halves < 260); /* 200 on each triangle, give or take 6 sqrt(400) / 2 */
    assert_true(p.amplitude_db == NULL && p.time_s == NULL && p.echo == NULL && p.echo_count == NULL);
    cloud_free(&p);
    /* A recording without colours has none here. */
    uint8_t(*rgb)[3] = v.points.rgb;
    v.points.rgb = NULL;
    p = spread((struct view_spread){.per_m2 = 100, .seed = 1});
    assert_true(p.n == 450 && p.rgb == NULL);
    cloud_free(&p);
    v.points.rgb = rgb;
}

/* A triangle stays if its factor of long edges equals the limit. */
static void some_meshes_and_triangles(void **state)
{
    static const struct {
        double long_edge;
        uint64_t scan;
        uint32_t n;
    } rows[] = {{0, 1, 400}, {0, 2, 50}, {1, 0, 250}, {1.5, 1, 200}, {2, 1, 400}, {0.5, 0, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct cloud p = spread(
            (struct view_spread){.per_m2 = 100, .seed = 7, .long_edge = rows[i].long_edge, .scan = rows[i].scan});
        if (p.n != rows[i].n) fail_msg("case %zu: %zu points", i, p.n);
        for (uint32_t k = 0; k < p.n && rows[i].long_edge > 0 && rows[i].long_edge < 2; k++)
            if (p.xyz_m[k][2] == 1) assert_true(p.xyz_m[k][1] >= p.xyz_m[k][0]); /* of the second triangle alone */
        cloud_free(&p);
    }
}

static void expect_error(const char *path, const char *query, const char *want)
{
    struct view_serve serve = {.viewed = &v};
    struct web_body body;
    memset(&err, 0, sizeof err);
    assert_int_equal(view_serve_get(&serve, path, query, &body, &err), SH_EINPUT);
    if (strcmp(err.text, want) != 0) fail_msg("%s?%s: %s", path, query, err.text);
    view_serve_free(&serve);
}

/* All meshes count towards the limit, one after the other: after half a square metre the sum is 4.5. */
static void too_many_are_refused(void **state)
{
    struct viewed_mesh swapped[2] = {meshes[1], meshes[0]};
    (void)state;
    v.mesh = swapped;
    expect_error("/sparse", "per_m2=9e5&seed=1",
                 "per_m2=900000: more than 4000000 points on at least 4.5 m2; allowed for these are up to 8.8e+05");
    v.mesh = meshes;
    expect_error("/sparse", "per_m2=1000001&scan=1",
                 "per_m2=1000001: more than 4000000 points on at least 4 m2; allowed for these are up to 9.9e+05");
    expect_error("/sparse", "per_m2=0", "per_m2=0: allowed numbers from 1e-06 to 1000000000");
    expect_error("/sparse", "", "per_m2 is needed: numbers from 1e-06 to 1000000000");
    expect_error("/sparse", "per_m2=1&scan=3", "scan=3: allowed whole numbers from 0 to 2");
    expect_error("/sparse", "per_m2=1&seed=1.5", "seed=1.5: allowed whole numbers from 0 to 1000000000");
    expect_error("/sparse", "per_m2=1&seed=0x10", "seed=0x10: allowed whole numbers from 0 to 1000000000");
    expect_error("/sparse", "per_m2=1&per_m2=2", "per_m2: given twice; allowed once");
    expect_error("/sparse", "per=1", "per: unknown; allowed per_m2 long_edge scan seed first count");
    expect_error("/mesh", "", "scan is needed: whole numbers from 1 to 2");
    expect_error("/mesh", "scan=3", "scan=3: allowed whole numbers from 1 to 2");
}

/* The same request again is answered from the points that are there. Another request gets other points. */
static void answers_are_parts_of_the_points(void **state)
{
    (void)state;
    struct view_serve serve = {.viewed = &v};
    struct web_body all, part, other;
    assert_int_equal(view_serve_get(&serve, "/sparse", "per_m2=10&long_edge=0", &all, &err), SH_OK);
    const double(*made)[3] = (const double(*)[3])serve.sparse.xyz_m;
    assert_int_equal(le_get32(all.bytes + 8), 45);
    assert_int_equal(
        view_serve_get(&serve, "/sparse", "per_m2=10&long_edge=0&seed=1&scan=0&first=40&count=3", &part, &err), SH_OK);
    assert_ptr_equal(serve.sparse.xyz_m, made);
    assert_true(le_get32(part.bytes + 8) == 3 && le_get32(part.bytes + 16) == 40 && le_get32(part.bytes + 24) == 45);
    const uint32_t xyz_all = le_get32(all.bytes + 56 + 28), xyz_part = le_get32(part.bytes + 56 + 28);
    assert_memory_equal(part.bytes + xyz_part, all.bytes + xyz_all + 12 * 40, 12 * 3);
    static const char *const wishes[] = {"per_m2=11&long_edge=0", "per_m2=10&long_edge=1.5",
                                         "per_m2=10&long_edge=0&seed=2", "per_m2=10&long_edge=0&scan=1"};
    for (int i = 0; i < 4; i++) {
        assert_int_equal(view_serve_get(&serve, "/sparse", wishes[i], &other, &err), SH_OK);
        if (other.len == all.len && memcmp(other.bytes, all.bytes, all.len) == 0) fail_msg("%s: the same", wishes[i]);
        free(other.bytes);
    }
    free(all.bytes);
    free(part.bytes);
    view_serve_free(&serve);
    assert_int_equal(serve.made, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(points_have_the_figures_of_their_mesh, fill, drop),
        cmocka_unit_test_setup_teardown(some_meshes_and_triangles, fill, drop),
        cmocka_unit_test_setup_teardown(too_many_are_refused, fill, drop),
        cmocka_unit_test_setup_teardown(answers_are_parts_of_the_points, fill, drop),
    };
    return cmocka_run_group_tests_name("view spread", tests, NULL, NULL);
}
