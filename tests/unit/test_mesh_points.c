/* SPDX-License-Identifier: MIT */
/* The points of a recorded mesh: each keeps all its values while the arrays grow, and where it is moved. */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include "drivers/record/mesh_points.h"

enum { N = 20000 };

/* Each value of a point is another one, and all depend on its number. */
static struct mesh_point numbered(uint32_t i, int has_frame)
{
    const float f = (float)i;
    struct mesh_point p;
    for (int k = 0; k < 3; k++) {
        p.xyz_m[k] = i + 0.1 * (k + 1);
        p.normal[k] = f + 0.25f * (float)(k + 1);
        p.rgb[k] = (uint8_t)(i + (uint32_t)k);
    }
    p.uv[0] = f + 1.25f;
    p.uv[1] = f + 2.25f;
    p.range_m = i + 0.5;
    p.frame = has_frame ? i + 0.75 : 0;
    p.reflectance_db = -f;
    p.label = (uint16_t)(i + 1);
    p.station = (uint16_t)(i + 2);
    return p;
}

static void expect(const struct mesh_points *points, uint32_t at, uint32_t number)
{
    const struct mesh_point want = numbered(number, points->has_frame);
    struct mesh_point got = {.frame = -1};
    mesh_points_get(points, at, &got);
    assert_memory_equal(&got, &want, offsetof(struct mesh_point, rgb) + sizeof got.rgb); /* only padding is after it */
}

static void points_keep_their_values(void **state)
{
    (void)state;
    for (int has_frame = 0; has_frame < 2; has_frame++) {
        struct mesh_points points = {.has_frame = has_frame};
        struct sh_err err;
        for (uint32_t i = 0; i < N; i++) {
            const struct mesh_point p = numbered(i, 1); /* without frames, its frame is not kept */
            assert_int_equal(mesh_points_add(&points, &p, &err), SH_OK);
        }
        assert_int_equal(points.n, N);
        for (uint32_t i = 0; i < N; i++)
            expect(&points, i, i);
        mesh_points_move(&points, N - 1, 5);
        mesh_points_move(&points, 7, 7);
        for (uint32_t i = 4; i < 9; i++)
            expect(&points, i, i == 5 ? N - 1 : i);
        mesh_points_free(&points);
        assert_int_equal(points.n, 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(points_keep_their_values)};
    return cmocka_run_group_tests_name("mesh points", tests, NULL, NULL);
}
