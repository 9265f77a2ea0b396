/* SPDX-License-Identifier: MIT */
/* Bounds of turned copies, from the hull of their mesh: those of all vertices of its triangles, however these lie. The
 * scene's bounds hold them all. */
#include <math.h>

#include "core/scene/hull.h"
#include "core/vec3.h"
#include "tests/common/made.h"

enum { MOST = 60, COPIES = 8 };

/* Places are small whole numbers, so that many share an axis, lie on one line or at one place. */
static void bounds_are_those_of_all_vertices(void **state)
{
    (void)state;
    uint64_t seed = 7;
    for (int turn = 0; turn < 300; turn++) {
        static double vertex_m[MOST][3];
        static uint32_t triangle[MOST / 3][3];
        const uint32_t n = 3 * (uint32_t)case_between(&seed, 1, MOST / 3);
        const int64_t wide = case_between(&seed, 0, 4), deep = case_between(&seed, wide == 0, 4);
        for (uint32_t i = 0; i < n; i++) {
            vertex_m[i][0] = (double)case_between(&seed, 0, wide);
            vertex_m[i][1] = (double)case_between(&seed, -deep, 0);
            vertex_m[i][2] = i % 3 == 0 ? 5.0 : (double)case_between(&seed, -9, 4);
            triangle[i / 3][i % 3] = i;
        }
        const struct scene_arrays arrays = {
            (const double(*)[3])vertex_m, n, (const uint32_t(*)[3])triangle, n / 3, NULL, NULL, 0};
        struct scene *mesh;
        struct scene_copy copy[COPIES];
        struct scene scene;
        struct sh_err err;
        if (scene_from_arrays(&arrays, &mesh, &err) != SH_OK) continue; /* no triangle has an area */
        for (int k = 0; k < COPIES; k++) {
            const double angle = k < 4 ? k * M_PI_2 : 6.28 * case_unit(&seed);
            copy[k] =
                (struct scene_copy){.shift_m = {10, 20, 30}, .scale = 1.5, .cosine = cos(angle), .sine = sin(angle)};
        }
        vec3_bound_nothing(scene.min_m, scene.max_m);
        assert_int_equal(scene_bound_copies(&scene, mesh, copy, COPIES, NULL, &err), SH_OK);
        double all_min[3], all_max[3];
        vec3_bound_nothing(all_min, all_max);
        for (int k = 0; k < COPIES; k++) {
            double min[3], max[3], p[3];
            vec3_bound_nothing(min, max);
            for (uint32_t i = 0; i < 3 * mesh->n_triangles; i++) {
                scene_copy_put(&copy[k], mesh->vertex_m[mesh->triangle[i / 3][i % 3]], p);
                vec3_bound(min, max, p);
            }
            vec3_bound(all_min, all_max, copy[k].min_m);
            vec3_bound(all_min, all_max, copy[k].max_m);
            for (int a = 0; a < 3; a++)
                if (!(fabs(copy[k].min_m[a] - min[a]) < 1e-12 && fabs(copy[k].max_m[a] - max[a]) < 1e-12))
                    fail_msg("%d, %u vertices, copy %d: %g to %g, not %g to %g", turn, n, k, copy[k].min_m[a],
                             copy[k].max_m[a], min[a], max[a]);
        }
        assert_memory_equal(scene.min_m, all_min, sizeof all_min);
        assert_memory_equal(scene.max_m, all_max, sizeof all_max);
        scene_free(mesh);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(bounds_are_those_of_all_vertices)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
