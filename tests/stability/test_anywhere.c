/* SPDX-License-Identifier: MIT */
/* Rays that begin anywhere: at the station, within the scene, on faces, at corners, and from a thousand to a million
 * times as far away as the scene is large, up to 1e7 m. Scenes are odd ones (odd_scenes.h), a third of them at UTM.
 * The rays are compared with the reference in long double. A ray also meets the same, to the bit, by itself, among
 * others from the same point, and among rays from elsewhere.
 *
 * ANYWHERE_SCENES: how many (default 300, THOROUGH=1: 1000). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/bvh.h"
#include "core/rng.h"
#include "core/vec3.h"
#include "tests/common/made.h"
#include "tests/common/odd_judge.h"
#include "tests/common/odd_rays.h"
#include "tests/common/odd_scenes.h"
#include "tests/common/reference.h"
#include "tests/common/thorough.h"

enum { ORIGINS = 16, EACH = 64, RAYS = ORIGINS * EACH };
_Static_assert((int)RAYS <= (int)BVH_CHUNK, "cast at once");

static const double RANGE_MAX_M = 1e9;

enum place { STATION, WITHIN, ON_A_FACE, AT_A_CORNER, FAR_AWAY, PLACES };
static const char *const place_name[PLACES] = {"at the station", "within", "on a face", "at a corner", "far away"};

struct tally {
    struct odd_tally odd;
    uint64_t differ; /* rays whose result depends on the others that they are cast with */
};

static struct shot {
    double x[RAYS], y[RAYS], z[RAYS], px[RAYS], py[RAYS], pz[RAYS];
    double range_m[3][RAYS];
    uint32_t triangle[3][RAYS];
} shot;

static const double *a_corner(const struct scene *scene, uint64_t *random)
{
    return scene
        ->vertex_m[scene->triangle[case_between(random, 0, scene->n_triangles - 1)][case_between(random, 0, 2)]];
}

static void draw_origin(const struct odd_scene *odd, const struct scene *scene, enum place place, uint64_t *random,
                        double at_m[3])
{
    const double size_m = vec3_distance(scene->max_m, scene->min_m);
    memcpy(at_m, odd->station_m, 3 * sizeof *at_m);
    if (place == AT_A_CORNER) memcpy(at_m, a_corner(scene, random), 3 * sizeof *at_m);
    if (place == ON_A_FACE) {
        const uint32_t *t = scene->triangle[case_between(random, 0, scene->n_triangles - 1)];
        const double a = case_unit(random), b = (1.0 - a) * case_unit(random);
        for (int i = 0; i < 3; i++)
            at_m[i] = scene->vertex_m[t[0]][i] + a * (scene->vertex_m[t[1]][i] - scene->vertex_m[t[0]][i]) +
                      b * (scene->vertex_m[t[2]][i] - scene->vertex_m[t[0]][i]);
    }
    const double away_m = place == FAR_AWAY ? fmin(1e7, size_m * pow(10.0, 3.0 + 3.0 * case_unit(random))) : 0.0;
    for (int i = 0; i < 3 && place == WITHIN; i++)
        at_m[i] = scene->min_m[i] + case_unit(random) * (scene->max_m[i] - scene->min_m[i]);
    for (int i = 0; i < 3; i++)
        at_m[i] += away_m * (2.0 * case_unit(random) - 1.0);
}

static void draw_rays(const struct odd_scene *odd, const struct scene *scene, uint64_t *random)
{
    for (int k = 0; k < ORIGINS; k++) {
        struct odd_rays rays = {.scene = scene, .cells = 64, .random = case_u64(random) | 1};
        double at_m[3];
        draw_origin(odd, scene, (enum place)(k % PLACES), random, at_m);
        memcpy(rays.station_m, at_m, sizeof at_m);
        odd_rays_mix(&rays, EACH, shot.x + k * EACH, shot.y + k * EACH, shot.z + k * EACH);
        for (int i = k * EACH; i < (k + 1) * EACH; i++)
            shot.px[i] = at_m[0], shot.py[i] = at_m[1], shot.pz[i] = at_m[2];
    }
}

/* Way 0 casts each ray from its own point, in packets across the points. Way 1 casts point by point, and way 2 ray by
 * ray. */
static void cast(const struct bvh *bvh, struct bvh_work *work, int way)
{
    const int step = way == 0 ? RAYS : EACH;
    for (int at = 0; at < RAYS; at += step) {
        struct bvh_rays rays = {.n = (uint32_t)step,
                                .dir = {shot.x + at, shot.y + at, shot.z + at},
                                .range_max_m = RANGE_MAX_M,
                                .scattered = way == 2,
                                .range_m = shot.range_m[way] + at,
                                .triangle = shot.triangle[way] + at};
        if (way == 0)
            rays.from.own = (struct vec3_in){shot.px, shot.py, shot.pz};
        else
            memcpy(rays.from.at_m, (const double[3]){shot.px[at], shot.py[at], shot.pz[at]}, sizeof rays.from.at_m);
        bvh_hits(work, bvh, &rays);
    }
}

/* The bound is half of the wire's finest count, and 16 roundings of the range over a cosine of incidence of
 * 0.001. */
static double bound_m(long double range_m)
{
    return 5e-7 + 16.0 * 0x1p-53 * 1e3 * (double)range_m;
}

static void judge(const struct scene *scene, const struct reference *reference, int i, struct tally *t)
{
    const double at_m[3] = {shot.px[i], shot.py[i], shot.pz[i]}, dir[3] = {shot.x[i], shot.y[i], shot.z[i]};
    const struct odd_shot one = {
        .at_m = at_m, .dir = dir, .range_m = shot.range_m[0][i], .triangle = shot.triangle[0][i]};
    for (int way = 1; way < 3; way++)
        t->differ +=
            (one.triangle != shot.triangle[way][i] || (!isnan(one.range_m) && one.range_m != shot.range_m[way][i])) ? 1
                                                                                                                    : 0;
    if (!odd_judge(scene, reference, &one, bound_m, &t->odd))
        printf("# %s, ray %d\n", place_name[i / EACH % PLACES], i);
}

/* Every third scene is moved to where one lies that is measured in UTM. */
static void move_to_utm(struct odd_scene *odd)
{
    static const double UTM_M[3] = {391431.9, 5819708.6, 110.3};
    for (uint32_t i = 0; i < 3 * odd->n; i++)
        vec3_add(odd->corner[i / 3][i % 3], UTM_M, odd->corner[i / 3][i % 3]);
    vec3_add(odd->station_m, UTM_M, odd->station_m);
}

static void one_scene(uint64_t number, struct tally tally[PLACES])
{
    struct sh_err err;
    struct odd_scene odd;
    struct scene *scene;
    uint64_t random = rng_mix(number + 0x417) | 1;
    odd_scene_make(number, 5 + (uint32_t)case_between(&random, 0, 55), &odd);
    if (number % 3 == 2) move_to_utm(&odd);
    if (odd_scene_build(&odd, number / 2 % 2, &scene, &err) != SH_OK) return; /* all without area */
    struct bvh *bvh = made_bvh(scene);
    struct bvh_work *work = made_bvh_work();
    struct reference *reference = reference_create((const double(*)[3])scene->vertex_m,
                                                   (const uint32_t(*)[3])scene->triangle, scene->n_triangles);
    assert_non_null(reference);
    draw_rays(&odd, scene, &random);
    for (int way = 0; way < 3; way++)
        cast(bvh, work, way);
    for (int i = 0; i < RAYS; i++)
        judge(scene, reference, i, &tally[i / EACH % PLACES]);
    reference_free(reference);
    bvh_work_free(work);
    bvh_free(bvh);
    scene_free(scene);
}

static void test_anywhere(void **state)
{
    (void)state;
    static struct tally tally[PLACES];
    const char *asked = getenv("ANYWHERE_SCENES");
    const long scenes = asked != NULL ? atol(asked) : thorough(1000, 300);
    uint64_t bad = 0;
    for (long i = 0; i < scenes; i++)
        one_scene((uint64_t)i, tally);
    for (int k = 0; k < PLACES; k++) {
        const struct tally *t = &tally[k];
        bad += odd_print(place_name[k], &t->odd) + t->differ;
        printf("# %llu differ by packet\n", (unsigned long long)t->differ);
        assert_true(t->odd.hits > t->odd.rays / 8);
    }
    assert_int_equal(bad, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_anywhere),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
