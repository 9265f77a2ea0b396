/* SPDX-License-Identifier: MIT */
/* How many triangles a sight would examine one by one. A wall of 2,048 small triangles is seen from 20 m. Listed row by
 * row, 32 that follow each other lie close together, and so few rays come to them that they are left to the BVH. Listed
 * at random, the same 32 span the wall, and each of them has to be examined. */
#include "core/sight.h"
#include "core/vec3.h"
#include "tests/common/cases.h"

enum { ACROSS = 64, UP = 32, N = ACROSS * UP };

static double vertex_m[3 * N][3];
static uint32_t triangle[N][3];
static uint16_t label[N];

/* Triangle i has the place `at[i]` of the wall: 6.4 m across, 3.2 m high. */
static struct scene *make_wall(const uint32_t *at)
{
    static const struct scene_surface surface[1] = {{.object = "wall"}};
    struct scene *scene;
    struct sh_err err;
    for (uint32_t i = 0; i < N; i++)
        for (uint32_t c = 0; c < 3; c++) {
            vertex_m[3 * i + c][0] = 0.1 * (at[i] % ACROSS) + (c == 1 ? 0.01 : 0.0);
            vertex_m[3 * i + c][1] = 20.0;
            vertex_m[3 * i + c][2] = 0.1 * (at[i] / ACROSS) + (c == 2 ? 0.01 : 0.0);
            triangle[i][c] = 3 * i + c;
        }
    const struct scene_arrays arrays = {
        (const double(*)[3])vertex_m, 3 * N, (const uint32_t(*)[3])triangle, N, label, surface, 1};
    assert_int_equal(scene_from_arrays(&arrays, &scene, &err), SH_OK);
    return scene;
}

static double examined(const uint32_t *at, double rays)
{
    struct scene *scene = make_wall(at);
    struct bvh *bvh;
    struct sh_err err;
    assert_int_equal(bvh_create(scene, 1, NULL, &bvh, &err), SH_OK);
    const struct sight_spec spec = {.bvh = bvh, .station_m = {3.2, 0, 1.6}, .rays = rays};
    const double n = sight_examined(&spec);
    bvh_free(bvh);
    scene_free(scene);
    return n;
}

/* A group of 32 is left to the BVH where fewer than 32 * 64 rays come to its box. Rays are even on a cube, whose faces
 * have 24 units of area. From 4 million rays, 13 come to the box of a row (3.2 m by 1 cm), and about 8,500 to that of
 * scattered triangles (about 6.4 m by 3.2 m). */
static void order_decides(void **state)
{
    (void)state;
    uint32_t in_order[N], scattered[N];
    for (uint32_t i = 0; i < N; i++) {
        in_order[i] = i;
        scattered[i] = i * 1021 % N; /* 1021 is odd: each place once */
    }
    assert_true(examined(in_order, 4e6) == 0.0);
    assert_true(examined(scattered, 4e6) == N);
    assert_true(examined(scattered, 4e5) == 0.0); /* for so few rays none is worth it */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(order_decides),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
