/* SPDX-License-Identifier: MIT */
/* Bounds of turned copies, from the hull of their mesh: those of all vertices of its triangles, however these lie. */
#include <math.h>

#include "core/scene/hull.h"
#include "core/vec3.h"
#include "tests/common/made.h"

enum { MOST = 60 };

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
        struct scene_hull hull;
        struct sh_err err;
        if (scene_from_arrays(&arrays, &mesh, &err) != SH_OK) continue; /* no triangle has an area */
        assert_int_equal(scene_find_hull(mesh, &hull, &err), SH_OK);
        for (int k = 0; k < 8; k++) {
            const double angle = k < 4 ? k * M_PI_2 : 6.28 * case_unit(&seed);
            struct scene_copy copy = {.shift_m = {10, 20, 30}, .scale = 1.5, .cosine = cos(angle), .sine = sin(angle)};
            double min[3], max[3], p[3];
            vec3_bound_nothing(min, max);
            for (uint32_t i = 0; i < 3 * mesh->n_triangles; i++) {
                scene_copy_put(&copy, mesh->vertex_m[mesh->triangle[i / 3][i % 3]], p);
                vec3_bound(min, max, p);
            }
            scene_set_copy_bounds(mesh, &hull, &copy);
            for (int a = 0; a < 3; a++)
                if (!(fabs(copy.min_m[a] - min[a]) < 1e-12 && fabs(copy.max_m[a] - max[a]) < 1e-12))
                    fail_msg("%d, %u vertices, %g: %g to %g, not %g to %g", turn, n, angle, copy.min_m[a],
                             copy.max_m[a], min[a], max[a]);
        }
        scene_free_hull(&hull);
        scene_free(mesh);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(bounds_are_those_of_all_vertices)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
