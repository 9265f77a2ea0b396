/* SPDX-License-Identifier: MIT */
/* A face that stands twice in a mesh is met as the first of the two, at any place and size and with any label. Where
 * any number of faces lie within 1e-12 of the nearest range, the first is met. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/bvh.h"
#include "core/vec3.h"
#include "tests/common/made.h"
#include "tests/common/thorough.h"

enum { SIDE = 100, RAYS = SIDE * SIDE };

static double x[RAYS], y[RAYS], z[RAYS], range_m[RAYS];
static uint32_t triangle[RAYS];

/* Rays towards a square before the station, as wide as it is far. */
static void aim(double far_m)
{
    for (int i = 0; i < RAYS; i++) {
        const double d[3] = {far_m * ((i % SIDE + 0.3) / SIDE - 0.5), far_m, far_m * ((i / SIDE + 0.7) / SIDE - 0.5)};
        const double length = vec3_length(d);
        x[i] = d[0] / length;
        y[i] = d[1] / length;
        z[i] = d[2] / length;
    }
}

/* Two faces side_m long, with a corner before the station. Returns how many rays meet the second one. */
static uint32_t seconds(double side_m, double far_m, double slope, const uint32_t second[3], const uint16_t label[2])
{
    static struct scene_surface surface[4096];
    const double vertex[3][3] = {{-0.1 * side_m, far_m - 0.1 * slope * side_m, -0.1 * side_m},
                                 {0.9 * side_m, far_m + 0.9 * slope * side_m, -0.1 * side_m},
                                 {0.1 * side_m, far_m + 0.1 * slope * side_m, 0.9 * side_m}};
    const uint32_t face[2][3] = {{0, 1, 2}, {second[0], second[1], second[2]}};
    const struct scene_arrays arrays = {vertex, 3, face, 2, label, surface, 4096};
    struct scene *scene = made_scene(&arrays);
    struct bvh *bvh = made_bvh(scene);
    struct bvh_work *work = made_bvh_work();
    aim(far_m);
    bvh_hits(
        work, bvh,
        &(struct bvh_rays){.n = RAYS, .dir = {x, y, z}, .range_max_m = 1e5, .range_m = range_m, .triangle = triangle});
    uint32_t first = 0, others = 0;
    for (int i = 0; i < RAYS; i++) {
        first += triangle[i] == 0;
        others += triangle[i] == 1;
    }
    assert_true(first + others > RAYS / 2);
    bvh_work_free(work);
    bvh_free(bvh);
    scene_free(scene);
    return others;
}

static void the_first_is_met(void **state)
{
    (void)state;
    static const uint32_t order[3][3] = {{0, 1, 2}, {1, 2, 0}, {0, 2, 1}};
    static const uint16_t label[2][2] = {{0, 3000}, {3000, 0}};
    static const double size[][3] = {{20, 1, 1}, {100, 4, -0.3}, {100, 16, 1}, {500, 16, -0.3}, {2000, 16, 1}};
    uint32_t wrong = 0;
    for (size_t i = 0; i < sizeof size / sizeof *size; i++)
        for (int k = 0; k < 3; k++)
            for (int l = 0; l < 2; l++) {
                const uint32_t n = seconds(size[i][0], size[i][1], size[i][2], order[k], label[l]);
                if (n > 0)
                    print_message(
                        "%g m, %g m away, slope %g, corners %d, labels %u and %u: %u of %u rays meet the second\n",
                        size[i][0], size[i][1], size[i][2], k, label[l][0], label[l][1], n, RAYS);
                wrong += n;
            }
    assert_int_equal(wrong, 0);
}

enum { STACK = 64, STACKS = 60 };

/* Stacks faces that are apart by a twelfth or less of the distance that counts as the same. The faces are in a random
 * order, or each one is before or behind the last. */
static void stack_up(uint64_t *random, double vertex[3 * STACK][3], uint32_t face[STACK][3])
{
    const double far_m = 1.0 + 49.0 * case_unit(random), step_m = far_m * 1e-12 / (12.0 + 40.0 * case_unit(random));
    const int64_t order = case_between(random, 0, 2);
    uint32_t place[STACK];
    for (uint32_t i = 0; i < STACK; i++) {
        const uint32_t j = order == 0 ? (uint32_t)case_between(random, 0, i) : i;
        place[i] = place[j];
        place[j] = order == 2 ? STACK - i : i;
    }
    for (uint32_t i = 0; i < STACK; i++) {
        const double at_m = far_m + place[i] * step_m, size_m = 4.0 * far_m * (1.0 + case_unit(random));
        const double corner[3][3] = {{-size_m, at_m, -size_m}, {size_m, at_m, -size_m}, {0.0, at_m, size_m}};
        memcpy(vertex + 3 * i, corner, sizeof corner);
        for (uint32_t k = 0; k < 3; k++)
            face[i][k] = 3 * i + k;
    }
}

/* Returns the hit by the definition: the nearest of all, then the first that is as near. */
static uint32_t first_of_nearest(const struct bvh *bvh, const double dir[3], uint32_t *ties)
{
    static const double at_m[3] = {0};
    double range[STACK], nearest_m = INFINITY;
    uint32_t first = STACK;
    for (uint32_t i = 0; i < STACK; i++) {
        range[i] = bvh_range_of(bvh, i, at_m, dir);
        nearest_m = fmin(nearest_m, range[i]);
    }
    for (uint32_t i = STACK; i-- > 0;)
        if (range[i] <= nearest_m + 1e-12 * nearest_m) first = i;
    *ties += range[first] > nearest_m;
    return first;
}

static void one_stack(uint64_t *random, uint32_t packet, uint32_t *ties)
{
    static struct scene_surface surface[1];
    static uint16_t label[STACK];
    double vertex[3 * STACK][3];
    uint32_t face[STACK][3], wrong = 0;
    stack_up(random, vertex, face);
    const struct scene_arrays arrays = {
        (const double(*)[3])vertex, 3 * STACK, (const uint32_t(*)[3])face, STACK, label, surface, 1};
    struct scene *scene = made_scene(&arrays);
    struct bvh *bvh = made_bvh(scene);
    struct bvh_work *work = made_bvh_work();
    bvh_set_packet(bvh, packet);
    aim(10.0);
    bvh_hits(
        work, bvh,
        &(struct bvh_rays){.n = RAYS, .dir = {x, y, z}, .range_max_m = 1e5, .range_m = range_m, .triangle = triangle});
    for (int i = 0; i < RAYS; i++) {
        const double dir[3] = {x[i], y[i], z[i]};
        wrong += triangle[i] != first_of_nearest(bvh, dir, ties);
    }
    assert_int_equal(wrong, 0);
    bvh_work_free(work);
    bvh_free(bvh);
    scene_free(scene);
}

static void of_many_the_first(void **state)
{
    (void)state;
    uint64_t random = 0x57ac;
    uint32_t ties = 0;
    for (int i = 0; i < fewer(STACKS); i++)
        one_stack(&random, i % 2 == 0 ? 16 : 1, &ties);
    assert_true(ties > (uint32_t)(fewer(STACKS) * RAYS / 2)); /* the first is seldom the nearest */
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_first_is_met), cmocka_unit_test(of_many_the_first)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
