/* SPDX-License-Identifier: MIT */
/* In random odd scenes a station's map and the BVH give each ray the same hit, bit by bit.
 *
 * SIGHT_SCENES: how many scenes (default 400, THOROUGH=1: 1000). SIGHT_FIRST: the number of the first (0). SIGHT_RAYS:
 * rays from each station (1024). make test-sight: 50,000 scenes. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/rng.h"
#include "core/vec3.h"
#include "tests/common/cases.h"
#include "tests/common/odd_rays.h"
#include "tests/common/odd_scenes.h"
#include "tests/common/reference.h"
#include "tests/common/sight_beside.h"
#include "tests/common/thorough.h"

enum { MOST_RAYS = 1 << 16 };

/* SH_SANITIZE: sanitizers check the code, and a few scenes run all of it. */
#ifdef SH_SANITIZE
#define SCENES 20
#else
#define SCENES thorough(1000, 400)
#endif

/* This lies beyond the farthest corner of any scene, which is 2e6 m away. */
static const double RANGE_MAX_M = 1e7;

struct tally {
    uint64_t scenes, refused, rays, hits, few, asked, differ, wrong_scenes;
    uint64_t differ_by_part[ODD_PARTS];
};

static double x[MOST_RAYS], y[MOST_RAYS], z[MOST_RAYS];

static long from_environment(const char *name, long otherwise)
{
    const char *text = getenv(name);
    return text != NULL && atol(text) > 0 ? atol(text) : otherwise;
}

/* ---- one scene */

struct look {
    uint64_t number, random;
    struct odd_scene odd;
    struct scene *scene;
    struct bvh *bvh;
};

/* A cap about an axis: the view of a head that doesn't turn all the way round. */
struct cap {
    double axis[3], angle_rad;
};

static int sees_cap(const void *ctx, const double dir[3], double radius_rad)
{
    const struct cap *cap = ctx;
    return acos(fmax(-1.0, fmin(1.0, vec3_dot(cap->axis, dir)))) <= cap->angle_rad + radius_rad + 1e-6;
}

/* Prints the true hit of each kept ray where the sight and the BVH disagree. */
static void print_truth(const struct look *look, const struct sight_beside *beside)
{
    struct reference *reference =
        reference_create((const double(*)[3])look->scene->vertex_m, (const uint32_t(*)[3])look->scene->triangle,
                         look->scene->n_triangles);
    assert_non_null(reference);
    for (uint64_t i = 0; i < beside->differ && i < SIGHT_BESIDE_KEPT; i++) {
        const struct sight_difference *d = &beside->kept[i];
        struct reference_hit truth = reference_brute(reference, beside->station_m, d->dir);
        printf("# truth %.17Lg m, triangle %u; undecidable for the BVH's range: %d, for the sight's: %d\n",
               truth.range_m, truth.triangle,
               reference_is_undecidable(reference, beside->station_m, d->dir, &truth, d->range_m[0]),
               reference_is_undecidable(reference, beside->station_m, d->dir, &truth, d->range_m[1]));
    }
    reference_free(reference);
}

static void look_through_sight(struct look *look, uint32_t rays, struct tally *tally)
{
    static const uint64_t MEMORY[] = {0, 20000, 200000, 1 << 20, 64 << 20};
    struct sh_err err;
    struct sight_beside beside;
    struct cap cap = {.angle_rad = 3.0 * case_unit(&look->random)};
    struct sight_spec spec = {.bvh = look->bvh,
                              .station_m = {look->odd.station_m[0], look->odd.station_m[1], look->odd.station_m[2]},
                              .rays = pow(10.0, 2.0 + 5.5 * case_unit(&look->random)),
                              .memory_bytes = MEMORY[case_between(&look->random, 0, 4)]};
    if (case_between(&look->random, 0, 3) == 0) {
        cap.axis[look->number % 3] = 1.0;
        spec.sees = sees_cap;
        spec.ctx = &cap;
    }
    if (sight_beside_create(&spec, &beside, &err) != SH_OK) fail_msg("%s", err.text);
    struct odd_rays odd = {.scene = look->scene, .cells = beside.info.cells, .random = rng_mix(look->number + 77)};
    if (odd.cells == 0) odd.cells = 64;
    memcpy(odd.station_m, look->odd.station_m, sizeof odd.station_m);
    odd_rays_mix(&odd, rays, x, y, z);
    const struct vec3_in dir = {x, y, z};
    sight_beside_cast(&beside, rays, &dir, RANGE_MAX_M, NULL, NULL);
    tally->rays += beside.rays;
    tally->hits += beside.hits;
    tally->few += beside.few;
    tally->asked += beside.asked;
    tally->differ += beside.differ;
    for (int i = 0; i < ODD_PARTS; i++)
        tally->differ_by_part[i] += look->odd.parts >> i & 1 ? beside.differ : 0;
    if (beside.differ != 0 && tally->wrong_scenes++ < 20) {
        printf("# scene %llu, %u triangles, station %s, for %.3g rays, %llu bytes, %u "
               "cells%s: %llu of %u rays differ\n",
               (unsigned long long)look->number, look->scene->n_triangles, look->odd.stands, spec.rays,
               (unsigned long long)spec.memory_bytes, beside.info.cells, spec.sees != NULL ? ", a cap" : "",
               (unsigned long long)beside.differ, rays);
        sight_beside_print(&beside);
        print_truth(look, &beside);
    }
    sight_beside_free(&beside);
}

static void one_scene(uint64_t number, uint32_t rays, struct tally *tally)
{
    struct sh_err err;
    struct look look = {.number = number, .random = rng_mix(number + 0x51)};
    odd_scene_make(number, 5 + (uint32_t)case_between(&look.random, 0, 55), &look.odd);
    tally->scenes++;
    if (odd_scene_build(&look.odd, number / 2 % 2, &look.scene, &err) != SH_OK) { /* all without area */
        tally->refused++;
        return;
    }
    if (bvh_create(look.scene, 1, NULL, &look.bvh, &err) != SH_OK) fail_msg("%s", err.text);
    for (int sight = 0; sight < 2; sight++) /* of other sizes and parts of the sphere, and with other rays */
        look_through_sight(&look, rays, tally);
    bvh_free(look.bvh);
    scene_free(look.scene);
}

static void test_same_bits(void **state)
{
    (void)state;
    struct tally tally = {0};
    const uint64_t first = (uint64_t)from_environment("SIGHT_FIRST", 0);
    const uint64_t scenes = (uint64_t)from_environment("SIGHT_SCENES", SCENES);
    const long rays = from_environment("SIGHT_RAYS", 1024);
    assert_true(rays <= MOST_RAYS);
    for (uint64_t i = first; i < first + scenes; i++)
        one_scene(i, (uint32_t)rays, &tally);
    printf("# %llu scenes (%llu without area), %llu rays, %llu meet something, %.1f %% decided among a few, %.1f %% "
           "asked of the BVH: %llu differ\n",
           (unsigned long long)tally.scenes, (unsigned long long)tally.refused, (unsigned long long)tally.rays,
           (unsigned long long)tally.hits, 100.0 * (double)tally.few / (double)tally.rays,
           100.0 * (double)tally.asked / (double)tally.rays, (unsigned long long)tally.differ);
    for (int i = 0; i < ODD_PARTS && tally.differ != 0; i++)
        if (tally.differ_by_part[i] != 0)
            printf("# with %-10s %llu\n", odd_part_name(i), (unsigned long long)tally.differ_by_part[i]);
    assert_true(tally.refused <= tally.scenes / 100);
    assert_true(tally.hits > tally.rays / 4);
    /* Many of these rays are aimed where only the BVH decides, or their sight is of a cap or has too little memory. In
     * all, 50 % ask the BVH, and 26 % are decided among a few. A sight that always asks is of no use. */
    assert_true(tally.asked < tally.rays * 2 / 3 && tally.few > tally.rays / 10);
    assert_true(tally.differ == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_same_bits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
