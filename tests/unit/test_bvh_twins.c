/* A face that stands twice in a mesh is met as the first of the two, wherever it is met, whatever its label and however
 * large it is. */
#include <math.h>
#include <stdlib.h>

#include "core/bvh.h"
#include "core/vec3.h"
#include "tests/common/cases.h"

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
    struct scene *scene;
    struct bvh *bvh;
    struct bvh_work *work;
    struct sh_err err;
    if (scene_from_arrays(&arrays, &scene, &err) != SH_OK || bvh_create(scene, 1, NULL, &bvh, &err) != SH_OK ||
        bvh_work_create(&work, &err) != SH_OK)
        fail_msg("%s", err.text);
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

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_first_is_met)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
