/* SPDX-License-Identifier: MIT */
/* Leaves: each triangle is in one of them, with its own corners; memory of large scenes; and rays of a packet that
 * begin apart. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/bvh/leaves.h"
#include "core/rng.h"
#include "core/vec3.h"
#include "tests/common/generate.h"
#include "tests/unit/bvh_rig.h"

static struct scene *terrain(uint32_t n_triangles)
{
    static const double middle_m[2] = {3e5, 5e6};
    struct scene *scene;
    struct sh_err err = {0};
    if (generate_terrain(n_triangles, 100.0, 3.0, middle_m, 1, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    return scene;
}

/* Makes the same triangles, each with vertices of its own. */
static struct scene *torn(const struct scene *s)
{
    double(*v)[3] = malloc((size_t)s->n_triangles * 3 * sizeof *v);
    uint32_t(*t)[3] = malloc((size_t)s->n_triangles * sizeof *t);
    assert_non_null(v);
    assert_non_null(t);
    for (uint32_t i = 0; i < 3 * s->n_triangles; i++) {
        memcpy(v[i], s->vertex_m[s->triangle[i / 3][i % 3]], sizeof *v);
        t[i / 3][i % 3] = i;
    }
    const struct scene_arrays arrays = {.vertex_m = (const double(*)[3])v,
                                        .n_vertices = 3 * s->n_triangles,
                                        .triangle = (const uint32_t(*)[3])t,
                                        .n_triangles = s->n_triangles};
    struct scene *scene = made_scene(&arrays);
    free(v);
    free(t);
    return scene;
}

static void corner_of(const struct bvh *bvh, const struct bvh_leaf *leaf, int k, double v[3])
{
    for (int j = 0; j < 3; j++)
        v[j] = bvh->origin_m[j] + (double)leaf->base_m[j] + (double)leaf->corner_m[j][k];
}

/* Each corner of the triangle is one of the leaf's. The two corners differ by rounding alone: of the leaf's size to
 * float, and of coordinates in double, which are up to 5e6 m here. Planes are those of the triangles, bit by bit. */
static void check_corners(const struct bvh *bvh, const struct bvh_leaf *leaf, int which)
{
    static const int of[2][3] = {{0, 1, 2}, {1, 3, 2}};
    const uint32_t *corner = bvh->scene->triangle[bvh_leaf_triangle(leaf, which)];
    const double most_m = 0x1p-24 * (double)bvh_leaf_size_m(bvh_leaf_rest(leaf)) + 4e-9;
    struct bvh_plane plane;
    for (int i = 0; i < 3; i++) {
        int found = 0;
        for (int k = 0; k < 3; k++) {
            double v[3];
            corner_of(bvh, leaf, of[which][k], v);
            found += vec3_distance(v, bvh->scene->vertex_m[corner[i]]) <= 2.0 * most_m;
        }
        assert_int_equal(found, 1);
    }
    bvh_set_plane(bvh, bvh_leaf_triangle(leaf, which), &plane);
    assert_memory_equal(&plane, &leaf->plane[which], sizeof plane);
}

/* The size is at least each edge and each distance from the base. The size is larger by at most 1/64, by the rounding
 * to float, and by 2^-15 of the distance from the origin. */
static void check_size(const struct bvh *bvh, const struct bvh_leaf *leaf)
{
    double v[5][3], far_m, edge_m = 0.0, least_m = 0.0;
    for (int i = 0; i < 4; i++)
        corner_of(bvh, leaf, i, v[i]);
    for (int j = 0; j < 3; j++)
        v[4][j] = bvh->origin_m[j] + (double)leaf->base_m[j];
    far_m = vec3_distance(v[4], bvh->origin_m);
    for (int i = 0; i < 5; i++)
        for (int k = 0; k < i; k++) {
            least_m = fmax(least_m, vec3_distance(v[i], v[k]));
            if (i < 4) edge_m = fmax(edge_m, vec3_distance(v[i], v[k]));
        }
    const double size_m = (double)bvh_leaf_size_m(bvh_leaf_rest(leaf));
    assert_true(size_m >= least_m * (1.0 - 0x1p-20));
    assert_true(size_m <= (edge_m + 0x1p-15 * far_m) * (1.0 + 1.0 / 64.0 + 0x1p-20));
}

static uint32_t check_leaves(const struct scene *scene)
{
    struct bvh bvh = {.scene = scene};
    struct sh_err err = {0};
    uint8_t *seen = calloc(scene->n_triangles, 1);
    assert_non_null(seen);
    assert_int_equal(bvh_make_leaves(&bvh, NULL, &err), SH_OK);
    for (uint32_t i = 0; i < bvh.n_leaves; i++)
        for (int which = 0; which <= (bvh_leaf_ahead(bvh_leaf_rest(&bvh.leaf[i])) != 0); which++) {
            assert_int_equal(seen[bvh_leaf_triangle(&bvh.leaf[i], which)]++, 0);
            check_corners(&bvh, &bvh.leaf[i], which);
            check_size(&bvh, &bvh.leaf[i]);
        }
    for (uint32_t i = 0; i < scene->n_triangles; i++)
        assert_int_equal(seen[i], 1);
    const uint32_t n = bvh.n_leaves;
    free(bvh.leaf);
    free(seen);
    return n;
}

/* Shuffles triangles among 40. A leaf takes neighbours that are up to 15 apart in the list; some are farther now. */
static void shuffle(struct scene *scene)
{
    for (uint32_t i = 0; i + 1 < scene->n_triangles; i++) {
        const uint32_t most = scene->n_triangles - i < 40 ? scene->n_triangles - i : 40;
        const uint32_t k = i + (uint32_t)(rng_u64(7, i) % most);
        uint32_t was[3];
        memcpy(was, scene->triangle[i], sizeof was);
        memcpy(scene->triangle[i], scene->triangle[k], sizeof was);
        memcpy(scene->triangle[k], was, sizeof was);
    }
}

static void test_each_triangle_once(void **state)
{
    (void)state;
    struct scene *shared = terrain(4000), *private = torn(shared);
    assert_in_range(check_leaves(shared), shared->n_triangles / 2, shared->n_triangles * 6 / 10);
    assert_int_equal(check_leaves(private), private->n_triangles);
    shuffle(shared);
    assert_in_range(check_leaves(shared), shared->n_triangles / 2, shared->n_triangles * 9 / 10);
    scene_free(shared);
    scene_free(private);
}

/* Stops at its second call. */
static int stop_later(void *ctx)
{
    return ++*(unsigned *)ctx > 1;
}

/* Triangles are paired before there is memory for leaves. Pairing takes most of the time, so it asks whether to
 * stop. */
static void test_pairing_stops(void **state)
{
    (void)state;
    struct scene *scene = terrain(140000);
    struct bvh bvh = {.scene = scene};
    struct sh_err err = {0};
    unsigned calls = 0;
    const struct sh_report report = {.ctx = &calls, .stop = stop_later};
    assert_int_equal(bvh_make_leaves(&bvh, &report, &err), SH_ESTOPPED);
    assert_int_equal(calls, 2);
    assert_null(bvh.leaf);
    free(bvh.leaf);
    scene_free(scene);
}

enum { RAYS = 1000 };
static void cast(const struct bvh *bvh, const double d[3][RAYS], double *range_m, uint32_t *triangle)
{
    struct bvh_work *work = made_bvh_work();
    const struct bvh_rays rays = {.n = RAYS,
                                  .from.at_m = {3e5, 5e6, 4.0},
                                  .dir = {d[0], d[1], d[2]},
                                  .range_max_m = 1e4,
                                  .range_m = range_m,
                                  .triangle = triangle};
    bvh_hits(work, bvh, &rays);
    bvh_work_free(work);
}

/* A large connected surface takes less memory, and has the same hits to the bit. In bytes a triangle: half a leaf, 64;
 * the place of a plane, 4; and Embree's nodes, 20 with four leaves each, or 52 with one (measured at a million). */
static void test_memory_of_a_large_surface(void **state)
{
    (void)state;
    static double d[3][RAYS], range_m[2][RAYS];
    static uint32_t triangle[2][RAYS];
    struct scene *scene[2] = {terrain(520000), NULL};
    struct bvh_info info;
    scene[1] = torn(scene[0]);
    for (int i = 0; i < RAYS; i++) {
        const double round = 6.3 * i / RAYS, up = 0.4 * sin(17.0 * i) - 0.2;
        d[0][i] = cos(round) * cos(up);
        d[1][i] = sin(round) * cos(up);
        d[2][i] = sin(up);
    }
    for (int k = 0; k < 2; k++) {
        struct bvh *bvh = made_bvh(scene[k]);
        info = *bvh_get_info(bvh);
        if (k == 0) assert_in_range(info.bytes / scene[k]->n_triangles, 68, 104);
        cast(bvh, (const double(*)[RAYS])d, range_m[k], triangle[k]);
        bvh_free(bvh);
        scene_free(scene[k]);
    }
    assert_memory_equal(range_m[0], range_m[1], sizeof range_m[0]);
    assert_memory_equal(triangle[0], triangle[1], sizeof triangle[0]);
}

/* Two triangles share an edge, along w at u = 0. Rays go along v through points beside that edge, up to a third of a
 * metre away and down to 0.1 um. Rays of a packet begin up to 8 m apart along u. A leaf that took them to begin at one
 * point would judge 4 in 10 wrong at 8 m. Axes are turned, since each part of the distance counts. */
enum { BESIDE = 1024 };
#define HALF_TURN 0.7071067811865476
static const double FRAME[][3][3] = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                                     {{0, 1, 0}, {0, 0, 1}, {1, 0, 0}},
                                     {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}},
                                     {{HALF_TURN, HALF_TURN, 0}, {-HALF_TURN, HALF_TURN, 0}, {0, 0, 1}}};

static void place(const double frame[3][3], const double uvw[3], double xyz[3])
{
    for (int j = 0; j < 3; j++)
        xyz[j] = ORIGIN[j] + uvw[0] * frame[0][j] + uvw[1] * frame[1][j] + uvw[2] * frame[2][j];
}

static void beside_the_edge(uint64_t *random, const double frame[3][3], double side_m, double apart_m, double o[3],
                            double d[3])
{
    const double from[3] = {apart_m * (case_unit(random) - 0.5), 0.01 * case_unit(random), 0.0};
    const double to[3] = {side_m, 60.0, 8.0 * case_unit(random) - 4.0};
    double p[3];
    place(frame, from, o);
    place(frame, to, p);
    vec3_sub(p, o, d);
    const double length_m = vec3_length(d);
    for (int j = 0; j < 3; j++)
        d[j] /= length_m;
}

static uint32_t wrong_beside(const struct bvh *bvh, struct bvh_work *work, const double frame[3][3], double apart_m)
{
    static double side_m[BESIDE], o[3][BESIDE], d[3][BESIDE], range_m[BESIDE];
    static uint32_t triangle[BESIDE];
    uint64_t random = 31;
    uint32_t wrong = 0;
    for (uint32_t i = 0; i < BESIDE; i++) {
        double from[3], dir[3];
        side_m[i] = (i & 1 ? -1.0 : 1.0) * pow(10.0, -7.0 + 6.5 * case_unit(&random));
        beside_the_edge(&random, frame, side_m[i], apart_m, from, dir);
        for (int j = 0; j < 3; j++) {
            o[j][i] = from[j];
            d[j][i] = dir[j];
        }
    }
    bvh_hits(work, bvh,
             &(struct bvh_rays){.n = BESIDE,
                                .from.own = {o[0], o[1], o[2]},
                                .dir = {d[0], d[1], d[2]},
                                .range_max_m = 100.0,
                                .range_m = range_m,
                                .triangle = triangle});
    for (uint32_t i = 0; i < BESIDE; i++)
        wrong += triangle[i] != (side_m[i] < 0.0);
    return wrong;
}

static void test_rays_that_begin_apart(void **state)
{
    static const double shape[4][3] = {{9, 60, 0}, {0, 60, -9}, {0, 60, 9}, {-9, 60, 0}};
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {3, 2, 1}};
    struct bvh_work *work = made_bvh_work();
    (void)state;
    for (size_t k = 0; k < sizeof FRAME / sizeof FRAME[0]; k++) {
        double v[4][3];
        for (int i = 0; i < 4; i++)
            place(FRAME[k], shape[i], v[i]);
        struct scene *scene = scene_of((const double(*)[3])v, 4, triangle, 2, NULL);
        struct bvh *bvh = made_bvh(scene);
        for (uint32_t packet = 4; packet <= 16; packet *= 2) {
            bvh_set_packet(bvh, packet);
            for (double apart_m = 8.0; apart_m > 1e-4; apart_m *= 0.1)
                assert_int_equal(wrong_beside(bvh, work, FRAME[k], apart_m), 0);
        }
        bvh_free(bvh);
        scene_free(scene);
    }
    bvh_work_free(work);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_each_triangle_once),
        cmocka_unit_test(test_pairing_stops),
        cmocka_unit_test(test_memory_of_a_large_surface),
        cmocka_unit_test(test_rays_that_begin_apart),
    };
    cmocka_set_message_output(CM_OUTPUT_TAP);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
