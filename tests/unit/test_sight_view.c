/* SPDX-License-Identifier: MIT */
/* A map of the directions of a head's view knows all of them, including those at the corners of the view. */
#include "tests/unit/cast_rig.h"

#include "core/sight.h"
#include "tests/common/made.h"

static const double LO[3] = {-4.0, -6.0, -1.5}, HI[3] = {5.0, 7.0, 2.5}, STATION[3] = {0.31, -0.42, 0.17};
enum { DIRECTIONS = 400 };

/* There is only this ray. */
static int sees(const void *ctx, const double dir[3], double radius_rad)
{
    const double *ray = ctx;
    return acos(fmin(1.0, vec3_dot(ray, dir))) <= radius_rad;
}

/* Returns how often the BVH is asked for that ray. */
static uint64_t asked_for(const struct bvh *bvh, const double ray[3])
{
    struct sight_spec spec = {.bvh = bvh, .rays = 1e5, .memory_bytes = 1 << 20, .sees = sees, .ctx = ray};
    struct sight *sight = NULL;
    struct sight_work *work = NULL;
    struct bvh_work *bvh_work = NULL;
    struct sh_err err;
    double x = ray[0], y = ray[1], z = ray[2], range_m;
    uint32_t triangle;
    memcpy(spec.station_m, STATION, sizeof STATION);
    if (sight_create(&spec, 1, NULL, &sight, &err) != SH_OK || sight_work_create(&work, &err) != SH_OK ||
        bvh_work_create(&bvh_work, &err) != SH_OK)
        fail_msg("%s", err.text);
    struct bvh_rays rays = {
        .n = 1, .dir = {&x, &y, &z}, .range_max_m = 100.0, .range_m = &range_m, .triangle = &triangle};
    memcpy(rays.from.at_m, STATION, sizeof STATION);
    sight_hits(work, bvh_work, sight, &rays);
    assert_true(range_m > 1.0 && range_m < 20.0);
    const uint64_t asked = sight_work_counters(work)->asked;
    sight_work_free(work);
    bvh_work_free(bvh_work);
    sight_free(sight);
    return asked;
}

/* In a closed room rays are on a spiral of the golden angle. None of them is in doubt, so none asks the BVH. At the six
 * axes the corners of four cells meet, farthest from the middles of the cells. */
static void rays_that_are_there_are_known(void **state)
{
    (void)state;
    struct scene *scene = box_scene(LO, HI);
    struct bvh *bvh = made_bvh(scene);
    for (int i = 0; i < DIRECTIONS; i++) {
        const double z = (2.0 * i + 1.0) / DIRECTIONS - 1.0, r = sqrt(1.0 - z * z), turn = i * 2.399963229728653;
        double ray[3] = {r * cos(turn), r * sin(turn), z};
        if (i < 6)
            for (int k = 0; k < 3; k++)
                ray[k] = k == i / 2 ? (i % 2 == 0 ? 1.0 : -1.0) : 0.0;
        if (asked_for(bvh, ray) != 0) fail_msg("ray %d (%g %g %g) asks", i, ray[0], ray[1], ray[2]);
    }
    bvh_free(bvh);
    scene_free(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(rays_that_are_there_are_known)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
