/* SPDX-License-Identifier: MIT */
/* These tests compare the distance to the scene with brute force in 113-bit arithmetic by another algorithm. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "core/distance.h"
#include "core/vec3.h"
#include "tests/common/made.h"
#include "tests/common/thorough.h"

#ifdef __SIZEOF_FLOAT128__
typedef __float128 quad;
#else
typedef long double quad; /* on ARM, which lacks __float128, this has 113 bits, too */
#endif

/* Corner differences, relative to the query point, round by 2^-53 of themselves on each axis. Products, the foot and
 * the square root add a few more. All of them are within 16 half-units in the last place of the largest difference. The
 * size of the coordinates does not matter, since a difference of doubles rounds relative to itself. */
static const double ROUNDING = 16 * 0x1p-53;

static double uniform(double low, double high)
{
    return low + (high - low) * (rand() / (double)RAND_MAX);
}

static quad dotq(const quad a[3], const quad b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Ericson, Real-Time Collision Detection, 5.1.5, by regions. */
static double reference_distance(const double p[3], const double ca[3], const double cb[3], const double cc[3])
{
    quad ab[3], ac[3], ap[3], bp[3], cp[3], v = 0, w = 0;
    for (int k = 0; k < 3; k++) {
        ab[k] = (quad)cb[k] - ca[k];
        ac[k] = (quad)cc[k] - ca[k];
        ap[k] = (quad)p[k] - ca[k];
        bp[k] = (quad)p[k] - cb[k];
        cp[k] = (quad)p[k] - cc[k];
    }
    quad d1 = dotq(ab, ap), d2 = dotq(ac, ap), d3 = dotq(ab, bp), d4 = dotq(ac, bp), d5 = dotq(ab, cp),
         d6 = dotq(ac, cp);
    quad va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
    if (d1 <= 0 && d2 <= 0) {
    } else if (d3 >= 0 && d4 <= d3) {
        v = 1;
    } else if (d6 >= 0 && d5 <= d6) {
        w = 1;
    } else if (vc <= 0 && d1 >= 0 && d3 <= 0) {
        v = d1 / (d1 - d3);
    } else if (vb <= 0 && d2 >= 0 && d6 <= 0) {
        w = d2 / (d2 - d6);
    } else if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        v = 1 - w;
    } else {
        /* If v and w came from areas, needles would lose precision even here. The distance from the plane does not. */
        quad n[3] = {ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2], ab[0] * ac[1] - ab[1] * ac[0]};
        quad height = dotq(n, ap);
        return (double)sqrtl((long double)(height * height / dotq(n, n)));
    }
    quad r[3];
    for (int k = 0; k < 3; k++)
        r[k] = ap[k] - ab[k] * v - ac[k] * w;
    return (double)sqrtl((long double)dotq(r, r));
}

static double brute_force(const struct scene *s, const double p[3], uint32_t *nearest)
{
    double best = INFINITY;
    for (uint32_t i = 0; i < s->n_triangles; i++) {
        const uint32_t *t = s->triangle[i];
        double d = reference_distance(p, s->vertex_m[t[0]], s->vertex_m[t[1]], s->vertex_m[t[2]]);
        if (d >= best) continue;
        best = d;
        *nearest = i;
    }
    return best;
}

/* Returns the distance to the farthest corner of a triangle. A distance to the triangle rounds relative to it. */
static double farthest_corner(const struct scene *s, uint32_t triangle, const double p[3])
{
    double d = 0;
    for (int i = 0; i < 3; i++)
        d = fmax(d, vec3_distance(p, s->vertex_m[s->triangle[triangle][i]]));
    return d;
}

static struct scene *make_scene(double (*v)[3], uint32_t n_triangles)
{
    uint32_t(*t)[3] = malloc(n_triangles * sizeof *t);
    for (uint32_t i = 0; i < n_triangles; i++)
        for (uint32_t c = 0; c < 3; c++)
            t[i][c] = i * 3 + c;
    struct scene *scene = made_scene(&(struct scene_arrays){(const double(*)[3])v, n_triangles * 3,
                                                            (const uint32_t(*)[3])t, n_triangles, NULL, NULL, 0});
    free(t);
    assert_int_equal(scene->n_triangles, n_triangles);
    return scene;
}

static struct bvh *make_bvh(const struct scene *scene)
{
    struct bvh *bvh;
    struct sh_err err;
    if (bvh_create(scene, 1, NULL, &bvh, &err) != SH_OK) fail_msg("%s", err.text);
    return bvh;
}

/* Compares one query with brute force. Then it asks again with limits just beyond and just within that distance. */
static void check_query(const struct bvh *bvh, const struct scene *s, const double p[3])
{
    struct distance_hit hit;
    uint32_t nearest = 0;
    double expected = brute_force(s, p, &nearest);
    assert_int_equal(distance_query(bvh, p, INFINITY, &hit), 1);
    double size = fmax(farthest_corner(s, nearest, p), farthest_corner(s, hit.triangle, p));
    double bound = ROUNDING * size;
    if (fabs(hit.distance_m - expected) > bound)
        fail_msg("distance %.17g, not %.17g: off by %g, bound %g", hit.distance_m, expected, hit.distance_m - expected,
                 bound);
    double largest = fmax(fmax(fabs(p[0]), fabs(p[1])), fabs(p[2])) + size;
    /* the point itself is rounded to its coordinates' last place, on three axes */
    if (fabs(vec3_distance(p, hit.point_m) - expected) > bound + 2 * largest * 0x1p-53)
        fail_msg("the point is %g off", vec3_distance(p, hit.point_m) - expected);
    if (expected > 0) {
        assert_int_equal(distance_query(bvh, p, expected + bound, &hit), 1);
        if (expected > bound) assert_int_equal(distance_query(bvh, p, expected - bound, &hit), 0);
    }
}

static void random_scene(const double origin[3], int queries)
{
    enum { COUNT = 300 };
    static double v[COUNT * 3][3];
    srand(11);
    for (int i = 0; i < COUNT; i++) {
        double size = pow(10, uniform(-3, 2)), at[3];
        for (int k = 0; k < 3; k++)
            at[k] = origin[k] + uniform(-100, 100);
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++)
                v[i * 3 + c][k] = at[k] + uniform(-size, size);
    }
    struct scene *s = make_scene(v, COUNT);
    struct bvh *bvh = make_bvh(s);
    for (int i = 0; i < queries; i++) {
        double p[3];
        /* Every second point is close to a surface, where a query prunes most. The others are spread out. */
        const double *near = v[rand() % (COUNT * 3)];
        for (int k = 0; k < 3; k++)
            p[k] = i % 2 ? near[k] + uniform(-1, 1) * 1e-3 : origin[k] + uniform(-300, 300);
        check_query(bvh, s, p);
    }
    bvh_free(bvh);
    scene_free(s);
}

static void random_points_near_the_origin(void **state)
{
    (void)state;
    random_scene((double[3]){0, 0, 0}, 400);
}

static void random_points_at_utm(void **state)
{
    (void)state;
    random_scene((double[3]){500000, 5800000, 100}, 400);
}

/* 16 sheets are 1 um apart, 200 m from the centre, where a float's step is 15 um. In float they coincide, so the
 * nearest one is only found if no candidate is lost to rounding. */
static void sheets_that_float_cannot_tell(void **state)
{
    (void)state;
    enum { SHEETS = 16 };
    double v[(SHEETS + 1) * 3][3] = {{-200, 0, -200}, {-200, 1, -200}, {-200, 0, -199}};
    for (int i = 0; i < SHEETS; i++) {
        double z = 200 - 1e-6 * i;
        double corner[3][3] = {{190, -10, z}, {210, -10, z}, {200, 10, z}};
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++)
                v[(i + 1) * 3 + c][k] = corner[c][k];
    }
    for (int utm = 0; utm < 2; utm++) {
        for (int i = 0; utm && i < (SHEETS + 1) * 3; i++) {
            v[i][0] += 500000;
            v[i][1] += 5800000;
        }
        struct scene *s = make_scene(v, SHEETS + 1);
        struct bvh *bvh = make_bvh(s);
        srand(5);
        for (int i = 0; i < 300; i++) {
            double p[3] = {uniform(199, 201), uniform(-2, 2), 200 + uniform(-20, 5) * 1e-6};
            if (utm) {
                p[0] += 500000;
                p[1] += 5800000;
            }
            check_query(bvh, s, p);
        }
        bvh_free(bvh);
        scene_free(s);
    }
}

/* Points are made on faces, edges and corners, as near as their own coordinates can be written. */
static void points_on_the_surface(void **state)
{
    (void)state;
    srand(23);
    for (int turn = 0; turn < fewer(200); turn++) {
        double origin[3] = {turn % 2 ? 500000 : 0, turn % 2 ? 5800000 : 0, 0}, v[3][3];
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++)
                v[c][k] = origin[k] + uniform(-5, 5);
        struct scene *s = make_scene(v, 1);
        struct bvh *bvh = make_bvh(s);
        for (int i = 0; i < 30; i++) {
            double a = i % 3 == 0 ? 0 : uniform(0, 1), b = i % 3 == 1 ? 0 : uniform(0, 1), p[3];
            if (a + b > 1) {
                a = 1 - a;
                b = 1 - b;
            }
            if (i < 3) a = b = 0;
            for (int k = 0; k < 3; k++)
                p[k] = v[0][k] + (v[1][k] - v[0][k]) * a + (v[2][k] - v[0][k]) * b;
            struct distance_hit hit;
            assert_int_equal(distance_query(bvh, p, 1, &hit), 1);
            /* On each of three axes there are at most three roundings of half a unit of the largest coordinate, and
             * three of the differences (below 20). */
            double largest = turn % 2 ? 5800010 : 10;
            double bound = sqrt(3) * (1.5 * largest * 0x1p-52 + 3 * 20 * 0x1p-53) + ROUNDING * 20;
            if (hit.distance_m > bound) fail_msg("%g m off the surface, bound %g", hit.distance_m, bound);
            if (i < 3) assert_true(hit.distance_m == 0);
        }
        bvh_free(bvh);
        scene_free(s);
    }
}

/* Height over length goes from 1e-2 to 1e-11, with the third corner at an end or in the middle. Points are around, and
 * straight above, where a needle's uncertain normal counts. The bound is that of any other triangle. */
static void needles(void **state)
{
    (void)state;
    srand(31);
    for (int turn = 0; turn < fewer(400); turn++) {
        double length = pow(10, uniform(-1, 2)), ratio = pow(10, uniform(-11, -2)), d[3], e[3], v[3][3];
        double azimuth = uniform(0, 7), dip = uniform(-1.5, 1.5);
        d[0] = cos(azimuth) * cos(dip); /* along */
        d[1] = sin(azimuth) * cos(dip);
        d[2] = sin(dip);
        e[0] = -sin(azimuth); /* across */
        e[1] = cos(azimuth);
        e[2] = 0;
        double normal[3] = {-cos(azimuth) * sin(dip), -sin(azimuth) * sin(dip), cos(dip)};
        double along = turn % 2 ? 1 : uniform(0.2, 0.8);
        for (int k = 0; k < 3; k++) {
            v[0][k] = uniform(-10, 10);
            v[1][k] = v[0][k] + d[k] * length;
            v[2][k] = v[0][k] + d[k] * length * along + e[k] * ratio * length;
        }
        struct scene *s = make_scene(v, 1);
        struct bvh *bvh = make_bvh(s);
        for (int i = 0; i < 20; i++) {
            double at = uniform(-0.2, 1.2), off = i % 2 ? pow(10, uniform(-12, 0)) : 0, p[3];
            double up = i % 3 ? 0 : pow(10, uniform(-12, 0)) * length, in = i % 3 ? 0 : 0.1 * ratio * at * length;
            for (int k = 0; k < 3; k++)
                p[k] = v[0][k] + (v[1][k] - v[0][k]) * at + uniform(-off, off) * (i % 3 ? length : 0) + e[k] * in +
                       normal[k] * up;
            struct distance_hit hit;
            double expected = reference_distance(p, s->vertex_m[0], s->vertex_m[1], s->vertex_m[2]);
            double bound = ROUNDING * farthest_corner(s, 0, p);
            assert_int_equal(distance_query(bvh, p, INFINITY, &hit), 1);
            if (fabs(hit.distance_m - expected) > bound)
                fail_msg("ratio %g: %.17g, not %.17g: off by %g, bound %g", ratio, hit.distance_m, expected,
                         hit.distance_m - expected, bound);
        }
        bvh_free(bvh);
        scene_free(s);
    }
}

static void limits_and_ties(void **state)
{
    (void)state;
    double v[6][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0, 1, 0}, {1, 0, 0}};
    struct scene *s = make_scene(v, 2);
    struct bvh *bvh = make_bvh(s);
    struct distance_hit hit;
    const double above_the_edge[3] = {0.5, 0.5, 2}, nowhere[3] = {NAN, 0, 0}, far[3] = {1e9, 0, 0};
    assert_int_equal(distance_query(bvh, above_the_edge, 2, &hit), 1); /* the limit itself counts as within */
    assert_true(hit.distance_m == 2 && hit.point_m[2] == 0 && hit.triangle == 0);
    assert_int_equal(distance_query(bvh, above_the_edge, 1.9999999, &hit), 0);
    assert_int_equal(distance_query(bvh, above_the_edge, 0, &hit), 0);
    assert_int_equal(distance_query(bvh, above_the_edge, -1, &hit), 0);
    assert_int_equal(distance_query(bvh, above_the_edge, NAN, &hit), 0);
    assert_int_equal(distance_query(bvh, nowhere, INFINITY, &hit), 0);
    assert_int_equal(distance_query(bvh, far, 1e9, &hit), 1);
    assert_true(hit.distance_m == 999999999);
    /* A double or a float can't hold the squares of these. */
    for (int k = 0; k < 3; k++) {
        static const double size_m[] = {1e19, 1e30, 1e39, 1e160, 1e300};
        for (int i = 0; i < 10; i++) {
            double p[3] = {0.3, 0.3, 0};
            p[k] = i % 2 == 0 ? size_m[i / 2] : -size_m[i / 2];
            assert_int_equal(distance_query(bvh, p, 1e9, &hit), 0);
            assert_int_equal(distance_query(bvh, p, INFINITY, &hit), 0);
        }
    }
    const double beyond_utm[3] = {0.5, 0.25, -1e15};
    assert_int_equal(distance_query(bvh, beyond_utm, INFINITY, &hit), 1);
    assert_true(fabs(hit.distance_m - 1e15) <= 1);
    bvh_free(bvh);
    scene_free(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_points_near_the_origin),
        cmocka_unit_test(random_points_at_utm),
        cmocka_unit_test(sheets_that_float_cannot_tell),
        cmocka_unit_test(points_on_the_surface),
        cmocka_unit_test(needles),
        cmocka_unit_test(limits_and_ties),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
