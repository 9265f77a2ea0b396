/* How much wider float triangles are than the real ones, and which triangles float can't order: by the budget that
 * core/bvh/bvh_inside.h adds up. And what their planes carry beside. */
#include <math.h>
#include <string.h>

#include "core/bvh/edges.h"
#include "core/vec3.h"
#include "tests/unit/bvh_rig.h"

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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(widths_are_the_budget),
        cmocka_unit_test(rivals_are_within_two_widths),
        cmocka_unit_test(both_triangles_of_an_edge_agree),
        cmocka_unit_test(labels_of_all_sizes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
