/* How much wider float triangles are than the real ones, and which triangles float can't order: by the budget that
 * core/bvh/bvh_inside.h adds up, and by rays that meet two surfaces within float's resolution of each other. */
#include <math.h>
#include <string.h>

#include "core/bvh/bvh_inside.h"
#include "core/bvh/edges.h"
#include "core/vec3.h"
#include "tests/common/cases.h"

static const double ORIGIN[3] = {10.0, -20.0, 5.0};

static struct scene *scene_of(const double (*vertex)[3], uint32_t n_vertices, const uint32_t (*triangle)[3], uint32_t n,
                              const uint16_t *label)
{
    static const struct scene_surface named[2] = {{.object = "small"}, {.object = "large"}};
    struct scene *scene;
    struct sh_err err;
    if (scene_from_arrays(&(struct scene_arrays){vertex, n_vertices, triangle, n, label, named, 2}, &scene, &err) != 0)
        fail_msg("%s", err.text);
    return scene;
}

static struct bvh *bvh_of(const struct scene *scene, double reach_m)
{
    struct bvh *bvh;
    struct sh_err err;
    if (bvh_create(scene, ORIGIN, reach_m, 1, NULL, &bvh, &err) != 0) fail_msg("%s", err.text);
    return bvh;
}

/* The sums of bvh_inside.h, in units of 2^-24 of R: 6.5 and 8 at an edge; (6.5 or 8) (a + b) / L at the longest one; 15
 * a b / L for 9 + 6; and the rounding of a vertex and of the ray's direction, from elsewhere of its origin, too. */
static double budget_m(double r_m, double a_m, double b_m, double l_m, int elsewhere)
{
    const double function = elsewhere ? 8.0 : 6.5, rounding = elsewhere ? 3.0 : 2.0;
    const double plain = (function + rounding) * r_m;
    const double third = (function * (a_m + b_m) / l_m + rounding) * r_m + 15.0 * a_m * b_m / l_m;
    return ldexp(plain > third ? plain : third, -24);
}

/* Triangles with two short edges and a long one, one tiny, one far, one that is larger than its distance; in a row, so
 * that each has its own R. 1e-9 of the width is for the rounding of these sums. */
static void widths_are_the_budget(void **state)
{
    (void)state;
    static const double at[4][3] = {{0, 30, 0}, {0, 4, 0}, {0, 5000, 0}, {-40, 1, -30}};
    static const double a_m[4] = {3.0, 0.001, 40.0, 90.0}, b_m[4] = {4.0, 0.0008, 5.0, 70.0};
    double vertex[12][3], r_m[4] = {0}, l_m[4];
    uint32_t triangle[4][3];
    for (uint32_t t = 0; t < 4; t++) {
        const double corner[3][3] = {{0, 0, 0}, {a_m[t], 0, 0}, {0, 0.1 * b_m[t], sqrt(0.99) * b_m[t]}};
        for (uint32_t i = 0; i < 3; i++) {
            double p[3];
            vec3_add(at[t], corner[i], p);
            r_m[t] = fmax(r_m[t], vec3_length(p));
            vec3_add(p, ORIGIN, vertex[3 * t + i]);
            triangle[t][i] = 3 * t + (i + t) % 3; /* the longest edge is another one each time */
        }
        l_m[t] = vec3_distance(corner[1], corner[2]);
    }
    struct scene *scene = scene_of((const double(*)[3])vertex, 12, (const uint32_t(*)[3])triangle, 4, NULL);
    for (int elsewhere = 0; elsewhere < 2; elsewhere++) {
        const double reach_m = elsewhere ? 7.0 : 0.0;
        struct bvh *bvh = bvh_of(scene, reach_m);
        for (uint32_t t = 0; t < 4; t++) {
            const double want_m = budget_m(r_m[t] + reach_m, a_m[t], b_m[t], l_m[t], elsewhere);
            if (!(fabs(bvh_width_m(bvh, t) / want_m - 1.0) < 1e-9))
                fail_msg("triangle %u, reach %g m: %.9g m wide, not %.9g", t, reach_m, bvh_width_m(bvh, t), want_m);
        }
        bvh_free(bvh);
    }
    scene_free(scene);
}

/* A small sheet at y = 9, and gap_m beyond it a large one; or beside it, in the same plane. */
static struct scene *two_sheets(double gap_m, int beside, int large_first)
{
    static const uint32_t order[2][2][3] = {{{0, 1, 2}, {3, 4, 5}}, {{3, 4, 5}, {0, 1, 2}}};
    const double over[3][3] = {{-20, 9 + gap_m, -20}, {900, 9 + gap_m, -20}, {-20, 9 + gap_m, 900}};
    const double side[3][3] = {{-gap_m, 9, -5}, {-gap_m, 9, 5}, {-900, 9, 0}};
    double v[6][3] = {{0, 9, 0}, {0.1, 9, 0}, {0, 9, 0.1}};
    memcpy(v[3], beside ? side : over, sizeof over);
    for (int i = 0; i < 6; i++)
        vec3_add(v[i], ORIGIN, v[i]);
    return scene_of((const double(*)[3])v, 6, order[large_first], 2, NULL);
}

static void expect_rivals(double gap_m, int beside, int large_first, int want)
{
    struct scene *scene = two_sheets(gap_m, beside, large_first);
    struct bvh *bvh = bvh_of(scene, 0.0);
    assert_int_equal(bvh_are_rivals(bvh, 0, 1), want);
    assert_int_equal(bvh_are_rivals(bvh, 1, 0), want);
    bvh_free(bvh);
    scene_free(scene);
}

/* Rivals come nearer to each other than twice the larger of their widths, whichever stands first: here that of the large
 * one, 900 m and some 5e-7 of it. A millimetre of gap changes it by a part in a million. */
static void rivals_are_within_two_widths(void **state)
{
    (void)state;
    for (int beside = 0; beside < 2; beside++)
        for (int large_first = 0; large_first < 2; large_first++) {
            struct scene *scene = two_sheets(1e-3, beside, large_first);
            struct bvh *bvh = bvh_of(scene, 0.0);
            const double most_m = 2.0 * fmax(bvh_width_m(bvh, 0), bvh_width_m(bvh, 1));
            assert_true(most_m > 1e-4);
            bvh_free(bvh);
            scene_free(scene);
            expect_rivals(0.99 * most_m, beside, large_first, 1);
            expect_rivals(1.01 * most_m, beside, large_first, 0);
        }
}

enum { RAYS = 512, SMALL = 0, LARGE = 1 };

/* Rays from the BVH's origin, and what they meet. */
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

static void cast_fan(const struct bvh *bvh, struct bvh_work *work, struct fan *fan, int ordered)
{
    static uint8_t order[RAYS];
    const struct bvh_rays rays = {.n = RAYS,
                                  .from.at_m = {ORIGIN[0], ORIGIN[1], ORIGIN[2]},
                                  .dir = {fan->x, fan->y, fan->z},
                                  .range_max_m = 1e6,
                                  .range_m = fan->range_m,
                                  .triangle = fan->triangle,
                                  .label = fan->label};
    memset(order, 1, sizeof order);
    if (ordered)
        bvh_hits_ordered(work, bvh, &rays, order);
    else
        bvh_hits(work, bvh, &rays);
}

/* Rays at the middle of the small sheet. Returns how many meet a triangle with that label. */
static uint32_t shoot(const struct bvh *bvh, struct bvh_work *work, int ordered, int want, double far_m)
{
    static struct fan fan;
    uint64_t random = 3;
    uint32_t found = 0;
    for (uint32_t i = 0; i < RAYS; i++) {
        const double x = 0.3 + 0.04 * case_unit(&random);
        set_ray(&fan, i, x, far_m, 0.2 + 0.04 * case_unit(&random));
    }
    cast_fan(bvh, work, &fan, ordered);
    for (uint32_t i = 0; i < RAYS; i++)
        found += fan.label[i] == (uint32_t)want;
    return found;
}

/* A sheet at y = 60, and one through it: y = 60 + slope x. */
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
    const double least_m = 4.0 * 0x1p-40 * 300.0 * slope + 1e-9;
    int want[RAYS];
    uint64_t random = 5;
    uint32_t wrong = 0;
    for (uint32_t i = 0; i < RAYS; i++) {
        const double size_m = fmax(least_m, pow(10.0, -7.0 + 5.0 * case_unit(&random)));
        const double gap_m = i & 1 ? -size_m : size_m;
        set_ray(&fan, i, gap_m / slope, 60.0 + gap_m, case_unit(&random));
        want[i] = gap_m > 0.0 ? SMALL : LARGE;
    }
    cast_fan(bvh, work, &fan, 0);
    for (uint32_t i = 0; i < RAYS; i++)
        wrong += fan.label[i] != (uint32_t)want[i];
    return wrong;
}

/* The small sheet is seen at the slant y = 9 + slope x, the large one reaches so much further than 3 km. */
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

/* A small sheet close before a large one, or behind it. Float misjudges the large one: seen at a slant by micrometres,
 * where it is rounded hundreds of kilometres away by millimetres, and so by more than the small one. Ordered exactly,
 * all rays meet the nearer, whichever stands first in the mesh; without, float has many of them wrong: what is asked
 * for is there. */
static void a_small_sheet_at_a_large_one(void **state)
{
    (void)state;
    static const double gaps_m[] = {3e-7, 1e-6, 1e-5, 1e-4, 3e-4, 1e-3};
    static const struct sheets sheets[] = {{30.0, 1.0}, {0.5, 70.0}, {0.4, 110.0}, {0.4, 1000.1}, {0.39, 1001.9}};
    struct bvh_work *work;
    struct sh_err err;
    assert_int_equal(bvh_work_create(&work, &err), 0);
    for (size_t n = 0; n < sizeof sheets / sizeof sheets[0]; n++) {
        const double ahead_m = 9.0 + sheets[n].slope * 0.32;
        uint32_t misjudged = 0;
        for (size_t k = 0; k < 4 * sizeof gaps_m / sizeof gaps_m[0]; k++) {
            const double gap_m = gaps_m[k / 4] * (sheets[n].times > 500.0 ? 300.0 : 1.0);
            const int behind = k & 1, large_first = k >> 1 & 1, want = behind ? LARGE : SMALL;
            struct scene *scene = small_and_large(&sheets[n], (behind ? 1.0 : -1.0) * gap_m, large_first);
            struct bvh *bvh = bvh_of(scene, 0.0);
            misjudged += RAYS - shoot(bvh, work, 0, want, ahead_m);
            assert_int_equal(shoot(bvh, work, 1, want, ahead_m), RAYS);
            assert_int_equal(bvh_order_exactly(bvh, NULL, &err), SH_OK);
            assert_int_equal(shoot(bvh, work, 0, want, ahead_m), RAYS);
            bvh_free(bvh);
            scene_free(scene);
        }
        print_message("# slope %g: %u of %zu rays have the wrong one of two by float\n", sheets[n].slope, misjudged,
                      RAYS * 4 * sizeof gaps_m / sizeof gaps_m[0]);
        assert_true(misjudged > 500);
    }
    bvh_work_free(work);
}

/* A ray does not meet what it begins on, within half a micrometre, whichever way it goes; it does what is twice as far,
 * and what stands behind. Sheets at y = 9 and 10. */
static void what_a_ray_begins_on_is_not_met(void **state)
{
    (void)state;
    static const double v[6][3] = {{-5, 9, -5}, {5, 9, -5}, {0, 9, 5}, {-5, 10, -5}, {5, 10, -5}, {0, 10, 5}};
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {3, 4, 5}};
    static const double before_m[] = {0.0, 4e-7, -4e-7, 1e-6}, way_m[] = {1.0, 1.0, 1.0, 1e-6};
    double p[6][3];
    struct bvh_work *work;
    struct sh_err err;
    for (int i = 0; i < 6; i++)
        vec3_add(v[i], ORIGIN, p[i]);
    struct scene *scene = scene_of((const double(*)[3])p, 6, triangle, 2, NULL);
    struct bvh *bvh = bvh_of(scene, 20.0);
    assert_int_equal(bvh_work_create(&work, &err), 0);
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

/* A facing sheet, and one through it at a slant of up to 1 in 20,000: rays that meet the slanted one so much before or
 * behind the other, 0.1 um to 1 cm. Float misjudges the slanted one by that; ordered exactly none is wrong. A stored
 * plane is tilted by up to 2^-40, here about a triangle of 300 m: along the ray so much times the slope. */
static void sheets_that_cross_at_a_slant(void **state)
{
    (void)state;
    static const double slope[] = {1.0, 30.0, 1000.0, 20000.0};
    struct bvh_work *work;
    struct sh_err err;
    assert_int_equal(bvh_work_create(&work, &err), 0);
    for (int s = 0; s < 4; s++) {
        struct scene *scene = crossing(slope[s]);
        struct bvh *bvh = bvh_of(scene, 0.0);
        const uint32_t by_float = wrong_of_crossing(bvh, work, slope[s]);
        assert_int_equal(bvh_order_exactly(bvh, NULL, &err), SH_OK);
        print_message("# crossing, slope %g: %u of %d rays have the wrong one by float\n", slope[s], by_float, RAYS);
        assert_int_equal(wrong_of_crossing(bvh, work, slope[s]), 0);
        bvh_free(bvh);
        scene_free(scene);
    }
    bvh_work_free(work);
}

/* A sheet along the ray, as far as double precision shows, is not met: what stands on its edges is. Here nothing. */
static void a_sheet_along_the_ray_is_not_met(void **state)
{
    (void)state;
    static const double v[3][3] = {{-5, 9, 0}, {5, 9, 0}, {1, 19, 0}};
    static const uint32_t triangle[1][3] = {{0, 1, 2}};
    static struct fan fan;
    double p[3][3];
    struct bvh_work *work;
    struct sh_err err;
    for (int i = 0; i < 3; i++)
        vec3_add(v[i], ORIGIN, p[i]);
    for (uint32_t i = 0; i < RAYS; i++) {
        const double turn = 0.4 * (i / (RAYS - 1.0) - 0.5);
        fan.x[i] = sin(turn);
        fan.y[i] = cos(turn);
    }
    struct scene *scene = scene_of((const double(*)[3])p, 3, triangle, 1, NULL);
    struct bvh *bvh = bvh_of(scene, 0.0);
    assert_int_equal(bvh_work_create(&work, &err), 0);
    cast_fan(bvh, work, &fan, 0);
    for (uint32_t i = 0; i < RAYS; i++)
        assert_true(isnan(fan.range_m[i]));
    bvh_work_free(work);
    bvh_free(bvh);
    scene_free(scene);
}

/* Labels take 16 bits, of which the plane has room for all: 12 and 4, beside the mark of holes. */
static void labels_of_all_sizes(void **state)
{
    (void)state;
    static const uint16_t label[] = {0, 1, 4095, 4096, 4097, 8191, 12345, 32767, 61440, 65534};
    enum { N = sizeof label / sizeof label[0] };
    double v[3 * N][3];
    uint32_t triangle[N][3];
    for (uint32_t i = 0; i < 3 * N; i++) {
        const double p[3] = {i % 3 == 1 ? 1.0 : 0.0, 9.0 + i / 3, i % 3 == 2 ? 1.0 : 0.0};
        vec3_add(p, ORIGIN, v[i]);
        triangle[i / 3][i % 3] = i;
    }
    struct scene *scene = scene_of((const double(*)[3])v, 3 * N, (const uint32_t(*)[3])triangle, N, NULL);
    memcpy(scene->label, label, sizeof label);
    struct bvh *bvh = bvh_of(scene, 0.0);
    for (uint32_t i = 0; i < N; i++)
        assert_int_equal(bvh_label(bvh_plane(bvh, i)), label[i]);
    bvh_free(bvh);
    scene_free(scene);
}

/* Two triangles of an edge name its corners in opposite orders: on which side a ray passes is the same number with the
 * other sign, to the last bit. Rays through the edge, where rounding is all there is. */
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(widths_are_the_budget),
        cmocka_unit_test(rivals_are_within_two_widths),
        cmocka_unit_test(a_small_sheet_at_a_large_one),
        cmocka_unit_test(what_a_ray_begins_on_is_not_met),
        cmocka_unit_test(both_triangles_of_an_edge_agree),
        cmocka_unit_test(sheets_that_cross_at_a_slant),
        cmocka_unit_test(labels_of_all_sizes),
        cmocka_unit_test(a_sheet_along_the_ray_is_not_met),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
