/* SPDX-License-Identifier: MIT */
/* Rays that float misjudges: two surfaces within its resolution of each other, a sheet along the ray, a sheet that the
 * ray begins on. */
#include <math.h>
#include <string.h>

#include "core/bvh/edges.h"
#include "core/footprint.h"
#include "core/vec3.h"
#include "tests/unit/bvh_rig.h"

enum { RAYS = 512, SMALL = 0, LARGE = 1 };

/* Rays from ORIGIN, and their hits. */
struct fan {
    double x[RAYS], y[RAYS], z[RAYS], range_m[RAYS];
    uint32_t triangle[RAYS], label[RAYS];
};

static void set_ray(struct fan *fan, uint32_t i, double x, double y, double z)
{
    const double length = sqrt(x * x + y * y + z * z);
    fan->x[i] = x / length;
    fan->y[i] = y / length;
    fan->z[i] = z / length;
}

static void cast_fan(const struct bvh *bvh, struct bvh_work *work, struct fan *fan)
{
    const struct bvh_rays rays = {.n = RAYS,
                                  .from.at_m = {ORIGIN[0], ORIGIN[1], ORIGIN[2]},
                                  .dir = {fan->x, fan->y, fan->z},
                                  .range_max_m = 1e6,
                                  .range_m = fan->range_m,
                                  .triangle = fan->triangle,
                                  .label = fan->label};
    bvh_hits(work, bvh, &rays);
}

/* Casts rays at the middle of the small sheet. Returns how many meet a triangle with that label. */
static uint32_t shoot(const struct bvh *bvh, struct bvh_work *work, int want, double far_m)
{
    static struct fan fan;
    uint64_t random = 3;
    uint32_t found = 0;
    for (uint32_t i = 0; i < RAYS; i++) {
        const double x = 0.3 + 0.04 * case_unit(&random);
        set_ray(&fan, i, x, far_m, 0.2 + 0.04 * case_unit(&random));
    }
    cast_fan(bvh, work, &fan);
    for (uint32_t i = 0; i < RAYS; i++)
        found += fan.label[i] == (uint32_t)want;
    return found;
}

/* One sheet lies at y = 60, and another one cuts it: y = 60 + slope x. */
static struct scene *crossing(double slope)
{
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {3, 4, 5}};
    static const uint16_t label[2] = {SMALL, LARGE};
    double v[6][3] = {{-9, 60, -9}, {9, 60, -9}, {0, 60, 9}, {-1, 0, -150}, {-1, 0, 150}, {1, 0, 20}};
    for (int i = 0; i < 6; i++) {
        if (i >= 3) v[i][0] *= slope < 100.0 ? 1.0 : 0.01;
        if (i >= 3) v[i][1] = 60.0 + slope * v[i][0];
        vec3_add(v[i], ORIGIN, v[i]);
    }
    return scene_of((const double(*)[3])v, 6, triangle, 2, label);
}

static uint32_t wrong_of_crossing(const struct bvh *bvh, struct bvh_work *work, double slope)
{
    static struct fan fan;
    /* This is the resolution of double at the place, over the angle. */
    const double least_m = 8.0 * 0x1p-53 * 300.0 * slope + 1e-9;
    int want[RAYS];
    uint64_t random = 5;
    uint32_t wrong = 0;
    for (uint32_t i = 0; i < RAYS; i++) {
        const double size_m = fmax(least_m, pow(10.0, -7.0 + 5.0 * case_unit(&random)));
        const double gap_m = i & 1 ? -size_m : size_m;
        set_ray(&fan, i, gap_m / slope, 60.0 + gap_m, case_unit(&random));
        want[i] = gap_m > 0.0 ? SMALL : LARGE;
    }
    cast_fan(bvh, work, &fan);
    for (uint32_t i = 0; i < RAYS; i++)
        wrong += fan.label[i] != (uint32_t)want[i];
    return wrong;
}

/* The small sheet is seen at the slant y = 9 + slope x. The large one reaches 3 km x times. */
struct sheets {
    double slope, times;
};

static struct scene *small_and_large(const struct sheets *s, double gap_m, int large_first)
{
    static const uint32_t order[2][2][3] = {{{0, 1, 2}, {3, 4, 5}}, {{3, 4, 5}, {0, 1, 2}}};
    static const uint16_t label[2][2] = {{SMALL, LARGE}, {LARGE, SMALL}};
    double v[6][3] = {{0.2, 0, 0},          {0.5, 0, 0},         {0.3, 0, 0.6},
                      {-300.7, 0, -2100.1}, {400.3, 0, -1900.9}, {7, 0, 3000.7}};
    for (int i = 0; i < 6; i++) {
        for (int k = 0; i >= 3 && k < 3; k += 2)
            v[i][k] *= s->times;
        v[i][1] = 9.0 + s->slope * v[i][0] + (i < 3 ? gap_m * sqrt(1.0 + s->slope * s->slope) : 0.0);
        vec3_add(v[i], ORIGIN, v[i]);
    }
    return scene_of((const double(*)[3])v, 6, order[large_first], 2, label[large_first]);
}

/* A small sheet is just before a large one, or behind it. Float would misjudge the large one, as it rounds
 * the far corners by millimetres or more. At a slant this moves the large sheet here by more than the gap between the
 * sheets. All rays meet the nearer one, whichever stands first in the mesh. */
static void a_small_sheet_at_a_large_one(void **state)
{
    (void)state;
    static const double gaps_m[] = {1e-6, 1e-4, 3e-4};
    static const struct sheets sheets[] = {{30.0, 1.0}, {0.5, 70.0}, {0.4, 110.0}, {0.4, 1000.1}, {0.39, 1001.9}};
    struct bvh_work *work = made_bvh_work();
    for (size_t n = 0; n < sizeof sheets / sizeof sheets[0]; n++)
        for (size_t k = 0; k < 4 * sizeof gaps_m / sizeof gaps_m[0]; k++) {
            const double gap_m = gaps_m[k / 4] * (sheets[n].times > 500.0 ? 300.0 : 1.0);
            const int behind = k & 1, large_first = k >> 1 & 1, want = behind ? LARGE : SMALL;
            struct scene *scene = small_and_large(&sheets[n], (behind ? 1.0 : -1.0) * gap_m, large_first);
            struct bvh *bvh = made_bvh(scene);
            assert_int_equal(shoot(bvh, work, want, 9.0 + sheets[n].slope * 0.32), RAYS);
            bvh_free(bvh);
            scene_free(scene);
        }
    bvh_work_free(work);
}

/* A ray does not meet a surface that it begins on, within half a micrometre, whichever way it goes. The ray meets a
 * surface that is twice as far, and surfaces behind it. Sheets are at y = 9 and 10. */
static void what_a_ray_begins_on_is_not_met(void **state)
{
    (void)state;
    static const double v[6][3] = {{-5, 9, -5}, {5, 9, -5}, {0, 9, 5}, {-5, 10, -5}, {5, 10, -5}, {0, 10, 5}};
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {3, 4, 5}};
    static const double before_m[] = {0.0, 4e-7, -4e-7, 1e-6}, way_m[] = {1.0, 1.0, 1.0, 1e-6};
    double p[6][3];
    for (int i = 0; i < 6; i++)
        vec3_add(v[i], ORIGIN, p[i]);
    struct scene *scene = scene_of((const double(*)[3])p, 6, triangle, 2, NULL);
    struct bvh *bvh = made_bvh(scene);
    struct bvh_work *work = made_bvh_work();
    for (int k = 0; k < 8; k++) {
        const int back = k & 1;
        const double at[3] = {ORIGIN[0] + 0.1, ORIGIN[1] + 9.0 + (back ? 1.0 : -1.0) * before_m[k / 2], ORIGIN[2]};
        const double dir[3] = {0.0, back ? -1.0 : 1.0, 0.0};
        double range_m;
        uint32_t met;
        const struct bvh_rays ray = {.n = 1,
                                     .from.own = {&at[0], &at[1], &at[2]},
                                     .dir = {&dir[0], &dir[1], &dir[2]},
                                     .range_max_m = 100.0,
                                     .scattered = 1,
                                     .range_m = &range_m,
                                     .triangle = &met};
        bvh_hits(work, bvh, &ray);
        if (back && way_m[k / 2] == 1.0)
            assert_true(isnan(range_m) && met == BVH_NO_TRIANGLE);
        else /* 5e-7 of the place, and 2^-52 of coordinates of 20 m */
            assert_true(fabs(range_m - way_m[k / 2]) < 5e-7 && met == (way_m[k / 2] == 1.0));
    }
    bvh_work_free(work);
    bvh_free(bvh);
    scene_free(scene);
}

/* A sheet faces the ray, and another one cuts it at a slant of up to 1 in 20,000. Rays meet the slanted one 0.1 um to 1
 * cm before or behind the other. */
static void sheets_that_cross_at_a_slant(void **state)
{
    (void)state;
    static const double slope[] = {1.0, 30.0, 1000.0, 20000.0};
    struct bvh_work *work = made_bvh_work();
    for (int s = 0; s < 4; s++) {
        struct scene *scene = crossing(slope[s]);
        struct bvh *bvh = made_bvh(scene);
        assert_int_equal(wrong_of_crossing(bvh, work, slope[s]), 0);
        bvh_free(bvh);
        scene_free(scene);
    }
    bvh_work_free(work);
}

/* Draws two unit vectors at right angles. */
static void any_axes(uint64_t *random, double u[3], double v[3])
{
    double d[3];
    for (int i = 0; i < 3; i++)
        d[i] = case_unit(random) - 0.5;
    const double length = vec3_length(d);
    for (int i = 0; i < 3; i++)
        d[i] /= length;
    beam_axes(d, u, v);
}

/* Rays within the plane of a sheet, as far as double precision shows, do not meet it. They would meet surfaces that
 * join its edges, but there are none here. The plane is turned in all directions, as float then has it at a small
 * angle to the rays. */
static void a_sheet_along_the_ray_is_not_met(void **state)
{
    (void)state;
    static const double corner[3][2] = {{9, -5}, {9, 5}, {19, 1}};
    static const uint32_t triangle[1][3] = {{0, 1, 2}};
    static struct fan fan;
    uint64_t random = 77;
    struct bvh_work *work = made_bvh_work();
    for (int n = 0; n < 8; n++) {
        double u[3], v[3], p[3][3];
        any_axes(&random, u, v);
        for (int i = 0; i < 9; i++)
            p[i / 3][i % 3] = ORIGIN[i % 3] + corner[i / 3][0] * u[i % 3] + corner[i / 3][1] * v[i % 3];
        for (uint32_t i = 0; i < RAYS; i++) {
            const double c = cos(0.4 * (i / (RAYS - 1.0) - 0.5)), s = sin(0.4 * (i / (RAYS - 1.0) - 0.5));
            set_ray(&fan, i, c * u[0] + s * v[0], c * u[1] + s * v[1], c * u[2] + s * v[2]);
        }
        struct scene *scene = scene_of((const double(*)[3])p, 3, triangle, 1, NULL);
        struct bvh *bvh = made_bvh(scene);
        cast_fan(bvh, work, &fan);
        for (uint32_t i = 0; i < RAYS; i++)
            assert_true(isnan(fan.range_m[i]));
        bvh_free(bvh);
        scene_free(scene);
    }
    bvh_work_free(work);
}

/* Rays begin all over a sheet of any attitude, to both sides. In float they begin before it or behind it. None meets
 * it. */
static void nobody_meets_what_he_stands_on(void **state)
{
    (void)state;
    static const double v[3][3] = {{-5, 9, -5}, {5, 11, -4.3}, {0.3, 9.7, 5}};
    static const uint32_t triangle[1][3] = {{0, 1, 2}};
    static double x[RAYS], y[RAYS], z[RAYS];
    static struct fan fan;
    double p[3][3];
    uint64_t random = 78;
    for (int i = 0; i < 3; i++)
        vec3_add(v[i], ORIGIN, p[i]);
    for (uint32_t i = 0; i < RAYS; i++) {
        const double a = 0.1 + 0.4 * case_unit(&random), b = 0.1 + 0.3 * case_unit(&random), c = 1.0 - a - b;
        x[i] = a * p[0][0] + b * p[1][0] + c * p[2][0];
        y[i] = a * p[0][1] + b * p[1][1] + c * p[2][1];
        z[i] = a * p[0][2] + b * p[1][2] + c * p[2][2];
        set_ray(&fan, i, case_unit(&random) - 0.5, i & 1 ? 1.0 : -1.0, case_unit(&random) - 0.5);
    }
    struct scene *scene = scene_of((const double(*)[3])p, 3, triangle, 1, NULL);
    struct bvh *bvh = made_bvh(scene);
    struct bvh_work *work = made_bvh_work();
    bvh_hits(work, bvh,
             &(struct bvh_rays){.n = RAYS,
                                .from.own = {x, y, z},
                                .dir = {fan.x, fan.y, fan.z},
                                .range_max_m = 100.0,
                                .range_m = fan.range_m,
                                .triangle = fan.triangle});
    for (uint32_t i = 0; i < RAYS; i++)
        assert_true(isnan(fan.range_m[i]));
    bvh_work_free(work);
    bvh_free(bvh);
    scene_free(scene);
}

/* Two triangles of an edge name its corners in opposite orders. The side on which a ray passes is then the same number
 * with the other sign, to the last bit. Rays go through the edge, where only rounding decides. */
static void both_triangles_of_an_edge_agree(void **state)
{
    (void)state;
    uint64_t random = 21;
    for (int n = 0; n < 20000; n++) {
        double a[3], b[3], dir[3];
        const double part = case_unit(&random);
        for (int i = 0; i < 3; i++) {
            a[i] = 20.0 * (case_unit(&random) - 0.5);
            b[i] = n % 4 == 0 && i == 0 ? a[i] : 20.0 * (case_unit(&random) - 0.5);
            dir[i] = a[i] + part * (b[i] - a[i]);
        }
        const double there = edge_side(a, b, dir), back = edge_side(b, a, dir);
        assert_true(there == -back && fabs(there) < 1e-11);
    }
}

/* Plates stand one behind the other. The ray goes through their boxes, 1.4 cm beside the plates. A wall is behind. */
enum { PLATES = 100 };

static struct scene *plates(void)
{
    static double v[3 * PLATES + 3][3];
    static uint32_t t[PLATES + 1][3];
    static const double corner[3][2] = {{-0.03, 0.05}, {0.05, -0.03}, {0.05, 0.05}};
    static const double wall[3][2] = {{-50.0, -50.0}, {50.0, -50.0}, {-50.0, 50.0}};
    for (uint32_t i = 0; i < 3 * (PLATES + 1); i++) {
        const uint32_t plate = i / 3;
        v[i][0] = plate == PLATES ? 20.0 : 1.0 + 0.1 * plate;
        v[i][1] = plate == PLATES ? wall[i % 3][0] : corner[i % 3][0];
        v[i][2] = plate == PLATES ? wall[i % 3][1] : corner[i % 3][1];
        t[plate][i % 3] = i;
    }
    return made_scene(&(struct scene_arrays){(const double(*)[3])v, 3 * PLATES + 3, (const uint32_t(*)[3])t, PLATES + 1,
                                             NULL, NULL, 0});
}

/* Rays come from the scene, and from far away. A bound of 1e-9 m is ample: 2^-53 of 30 km is 3e-12 m. */
static void no_number_of_plates_hides_a_wall(void **state)
{
    (void)state;
    static const double back_m[] = {0.0, 300.0, 30000.0};
    static const double along_x[3] = {1.0, 0.0, 0.0};
    struct scene *scene = plates();
    struct bvh *bvh = made_bvh(scene);
    for (size_t i = 0; i < sizeof back_m / sizeof *back_m; i++) {
        const double here[3] = {-back_m[i], 0, 0};
        assert_true(fabs(bvh_ray(bvh, here, along_x) - 20.0 - back_m[i]) < 1e-9);
    }
    bvh_free(bvh);
    scene_free(scene);
}

enum { WALLS = 4 };

/* Wall k is 4 + 9 k km to the east. Seen from the middle, each wall covers other directions to the north of
 * east. */
static struct scene *walls(void)
{
    static double v[4 * WALLS][3];
    static uint32_t t[2 * WALLS][3];
    for (uint32_t k = 0; k < WALLS; k++) {
        const double x = 4000.0 + 9000.0 * k;
        for (uint32_t c = 0; c < 4; c++)
            memcpy(v[4 * k + c], ((const double[3]){x, x * (0.1 * k + (c & 1 ? 0.09 : 0.0)), x * (c & 2 ? 0.1 : -0.1)}),
                   sizeof v[0]);
        memcpy(t[2 * k], ((const uint32_t[3]){4 * k, 4 * k + 1, 4 * k + 3}), sizeof t[0]);
        memcpy(t[2 * k + 1], ((const uint32_t[3]){4 * k, 4 * k + 3, 4 * k + 2}), sizeof t[0]);
    }
    return made_scene(
        &(struct scene_arrays){(const double(*)[3])v, 4 * WALLS, (const uint32_t(*)[3])t, 2 * WALLS, NULL, NULL, 0});
}

/* Float rays are 8 km long, so that each ray to a farther wall is cast in pieces, while others of its packet have hit.
 * Ranges end exactly at range_max_m. Rays begin at the origin, or each at a point of its own. At 30 km a
 * double is exact to 4e-12 m. */
static void rays_go_on_beyond_their_first_piece(void **state)
{
    (void)state;
    static const double most_m[] = {1e5, 25000.0, 9000.0};
    static struct fan fan;
    static double px[RAYS], py[RAYS], pz[RAYS];
    struct scene *scene = walls();
    struct bvh *bvh = made_bvh(scene);
    struct bvh_work *work = made_bvh_work();
    for (uint32_t i = 0; i < RAYS; i++) {
        set_ray(&fan, i, 1.0, 0.1 * (i % (WALLS + 1)) + 0.045, 0.0003 * (double)i - 0.08);
        px[i] = -0.1 * (i % 7), py[i] = 0.2 * (i % 3), pz[i] = 0.01 * i;
    }
    for (size_t m = 0; m < sizeof most_m / sizeof *most_m; m++)
        for (int own = 0; own < 2; own++) {
            struct bvh_rays rays = {.n = RAYS,
                                    .dir = {fan.x, fan.y, fan.z},
                                    .range_max_m = most_m[m],
                                    .range_m = fan.range_m,
                                    .triangle = fan.triangle,
                                    .label = fan.label};
            if (own) rays.from.own = (struct vec3_in){px, py, pz};
            bvh_hits(work, bvh, &rays);
            for (uint32_t i = 0; i < RAYS; i++) {
                const uint32_t wall = i % (WALLS + 1);
                const double want_m = (4000.0 + 9000.0 * wall - (own ? px[i] : 0.0)) / fan.x[i];
                if (wall == WALLS || want_m > most_m[m]) {
                    assert_true(isnan(fan.range_m[i]) && fan.triangle[i] == BVH_NO_TRIANGLE);
                    continue;
                }
                assert_true(fan.triangle[i] / 2 == wall && fan.label[i] == 0);
                assert_true(fabs(fan.range_m[i] - want_m) < 1e-9);
            }
        }
    bvh_work_free(work);
    bvh_free(bvh);
    scene_free(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_small_sheet_at_a_large_one),     cmocka_unit_test(sheets_that_cross_at_a_slant),
        cmocka_unit_test(a_sheet_along_the_ray_is_not_met), cmocka_unit_test(nobody_meets_what_he_stands_on),
        cmocka_unit_test(what_a_ray_begins_on_is_not_met),  cmocka_unit_test(both_triangles_of_an_edge_agree),
        cmocka_unit_test(no_number_of_plates_hides_a_wall), cmocka_unit_test(rays_go_on_beyond_their_first_piece),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
