/* Rays that are not refined, against the long double reference: away from borders the true triangle, at a range within
 * the bound that core/bvh/bvh_inside.h derives; near them, another one that the ray passes within what float may be off by.
 * Where that fails first: grazing incidence, far away, far from the BVH's origin, on UTM coordinates, on flat caps. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/bvh/bvh_inside.h"
#include "tests/common/generate.h"
#include "core/rng.h"
#include "core/vec3.h"
#include "tests/common/reference.h"

/* SH_SANITIZE: sanitizers are for the code, not for the count. */
#ifdef SH_SANITIZE
enum { RAYS = 2000 };
#else
enum { RAYS = 60000 };
#endif
enum { BATCH = 1000 };

struct tally {
    uint32_t rays, same, beside, lost;  /* same: the true triangle; beside: another one, at a border */
    double max_m, max_share, refined_m; /* of the same: error, and as a share of the bound; the refined cast's */
};

struct rays {
    double dx[BATCH], dy[BATCH], dz[BATCH], range_m[2][BATCH];
    uint32_t triangle[2][BATCH];
};

static double unit(uint64_t key, uint64_t i)
{
    return (double)(int64_t)(rng_u64(key, i) >> 11) * 0x1p-53;
}

static double bound_m(const struct bvh *bvh, uint32_t prim, const double station_m[3], const double dir[3])
{
    double v[3][3], e[3][3], n[3], length[3], far_m = bvh_corners(bvh, prim, v), off2 = 0.0;
    for (int j = 0; j < 3; j++)
        off2 += (station_m[j] - bvh->origin_m[j]) * (station_m[j] - bvh->origin_m[j]);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            e[i][j] = v[(i + 1) % 3][j] - v[i][j];
        length[i] = sqrt(vec3_dot(e[i], e[i]));
    }
    vec3_cross(e[0], e[1], n);
    double area2 = sqrt(vec3_dot(n, n)), longest = fmax(length[0], fmax(length[1], length[2]));
    double between = fmax(fmin(length[0], length[1]), fmin(fmax(length[0], length[1]), length[2]));
    double shape = length[0] * length[1] * length[2] / longest * between / area2;
    return 0x1p-24 * (17.0 * (far_m + sqrt(off2)) + longest + 2.2 * shape) * area2 / fabs(vec3_dot(n, dir));
}

static void judge(const struct reference *reference, const struct bvh *exact, const double station_m[3],
                  const struct rays *r, uint32_t i, struct tally *t)
{
    const double dir[3] = {r->dx[i], r->dy[i], r->dz[i]};
    struct reference_hit truth = reference_cast(reference, station_m, dir);
    uint32_t named = r->triangle[1][i];
    t->rays++;
    if (named == truth.triangle) {
        if (named == REFERENCE_NONE) return;
        double error_m = fabs((double)(truth.range_m - (long double)r->range_m[1][i]));
        double bound = bound_m(exact, named, station_m, dir);
        t->same++;
        t->max_m = fmax(t->max_m, error_m);
        t->max_share = fmax(t->max_share, error_m / bound);
        if (r->triangle[0][i] == truth.triangle)
            t->refined_m = fmax(t->refined_m, reference_error(&truth, r->range_m[0][i]));
        if (error_m > bound) fail_msg("ray %u: off by %g m, bound %g m", t->rays, error_m, bound);
        return;
    }
    double margin_m = INFINITY, width_m = 0.0;
    const uint32_t met[2] = {named, truth.triangle};
    for (int k = 0; k < 2; k++) {
        if (met[k] == REFERENCE_NONE) continue;
        margin_m = fmin(margin_m, reference_margin_m(reference, station_m, dir, met[k]));
        width_m = fmax(width_m, bvh_width_m(exact, met[k]));
    }
    t->beside++;
    t->lost += named == REFERENCE_NONE;
    if (!(margin_m <= width_m))
        fail_msg("ray %u: triangle %u in place of %u, but %g m from a border, width %g m", t->rays, named,
                 truth.triangle, margin_m, width_m);
}

/* Directions by chance: elevations, and a pan about y. */
struct view {
    double low_rad, high_rad, pan_rad;
};

static struct tally look(const char *what, const struct scene *scene, const double station_m[3],
                         const double origin_m[3], const struct view *view)
{
    struct tally t = {0};
    struct sh_err err;
    struct bvh *bvh[2];
    struct caster *caster;
    static struct rays r;
    double reach_m = 0.0;
    for (int k = 0; k < 3; k++)
        reach_m += fabs(station_m[k] - origin_m[k]);
    struct reference *reference = reference_create((const double(*)[3])scene->vertex_m,
                                                   (const uint32_t(*)[3])scene->triangle, scene->n_triangles);
    assert_non_null(reference);
    if (bvh_create(scene, origin_m, reach_m, 1, NULL, &bvh[0], &err) != SH_OK ||
        bvh_create_other(bvh[0], 1, NULL, &bvh[1], &err) != SH_OK || caster_create(&caster, &err) != SH_OK)
        fail_msg("%s", err.text);
    for (uint32_t at = 0; at < RAYS; at += BATCH) {
        for (uint32_t i = 0; i < BATCH; i++) {
            double up = view->low_rad + (view->high_rad - view->low_rad) * unit(7, 2 * (uint64_t)(at + i));
            double turn = view->pan_rad * (unit(7, 2 * (uint64_t)(at + i) + 1) - 0.5);
            r.dx[i] = cos(up) * sin(turn);
            r.dy[i] = cos(up) * cos(turn);
            r.dz[i] = sin(up);
        }
        for (int k = 0; k < 2; k++)
            caster_hits(caster, bvh[k], station_m, 1e4, BATCH, r.dx, r.dy, r.dz, r.range_m[k], r.triangle[k]);
        for (uint32_t i = 0; i < BATCH; i++)
            judge(reference, bvh[0], station_m, &r, i, &t);
    }
    printf(
        "# %-44s largest error %8.2g m, %4.1f %% of the bound; refined %8.2g m; %u of %u rays at a border, %u lost\n",
        what, t.max_m, 100.0 * t.max_share, t.refined_m, t.beside, t.rays, t.lost);
    caster_free(caster);
    bvh_free(bvh[0]);
    bvh_free(bvh[1]);
    reference_free(reference);
    return t;
}

/* Looks at terrain of such a size about a place, from 4.7 m above it; the BVH's origin is off_m beside. The largest
 * error is to show: more than more_than_m. */
static void look_at_terrain(const char *what, uint32_t triangles, double side_m, const double centre_m[2], double off_m,
                            const struct view *view, double more_than_m)
{
    const double station_m[3] = {centre_m[0], centre_m[1], 4.7}, origin_m[3] = {centre_m[0] + off_m, centre_m[1], 4.7};
    struct scene *scene;
    struct sh_err err;
    if (generate_terrain(triangles, side_m, 3.0, centre_m, 1, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    struct tally t = look(what, scene, station_m, origin_m, view);
    /* Silhouettes and creases are few; and the promise of the refined cast would not hold here. */
    assert_true(t.same > 0.99 * t.rays && t.beside < 1e-3 * t.rays);
    assert_true(t.max_m > more_than_m);
    assert_true(t.refined_m < 1e-6);
    scene_free(scene);
}

static void test_terrain(void **state)
{
    (void)state;
    static const double here[2] = {0.0, 0.0}, berlin[2] = {391431.123, 5819712.456};
    const double turn = 2.0 * acos(-1.0), deg = turn / 360.0;
    const struct view all = {-60.0 * deg, 60.0 * deg, turn}, grazing = {-1.0 * deg, -0.1 * deg, turn};
    look_at_terrain("200 m wide, all round", 20000, 200.0, here, 0.0, &all, 1e-6);
    look_at_terrain("the same on UTM coordinates", 20000, 200.0, berlin, 0.0, &all, 1e-6);
    look_at_terrain("3 km wide, 89 to 89.9 deg of incidence", 20000, 3000.0, here, 0.0, &grazing, 1e-4);
    look_at_terrain("the same, UTM, the BVH's origin 900 m off", 20000, 3000.0, berlin, 900.0, &grazing, 1e-4);
}

/* A band of caps, 10 m long and 1 mm high, that lies across all axes 10 m away: the cross product of their short edges,
 * which are almost parallel, tilts the planes along the band. */
static void test_caps(void **state)
{
    (void)state;
    enum { CAPS = 400 };
    static double vertex[3 * CAPS][3];
    static uint32_t triangle[CAPS][3];
    static const double station_m[3] = {0.3, 0.2, 0.1}, along[3] = {0.64, 0.48, 0.6}, up[3] = {-0.6, 0.0, 0.64};
    const struct view at_band = {-0.3, 0.3, 0.8};
    struct scene *scene;
    struct sh_err err;
    for (uint32_t i = 0; i < CAPS; i++) {
        double low = 0.001 * (i - 0.5 * CAPS);
        const double at[3][2] = {{-5.0, low}, {5.0, low}, {0.0, low + 0.001}};
        for (uint32_t k = 0; k < 3; k++) {
            for (int j = 0; j < 3; j++)
                vertex[3 * i + k][j] = (j == 1 ? 10.0 : 0.0) + at[k][0] * along[j] + at[k][1] * up[j] / 0.877268;
            triangle[i][k] = 3 * i + k;
        }
    }
    if (scene_from_arrays(&(struct scene_arrays){(const double(*)[3])vertex, 3 * CAPS, (const uint32_t(*)[3])triangle,
                                                 CAPS, NULL, NULL, 0},
                          &scene, &err) != SH_OK)
        fail_msg("%s", err.text);
    struct tally t = look("a band of caps, 10 m by 1 mm", scene, station_m, station_m, &at_band);
    assert_true(t.same > RAYS / 100);
    /* Far more than the other terms of the bound allow for, 1.6e-5 m at 17 m. */
    assert_true(t.max_m > 1e-4);
    assert_true(t.refined_m < 1e-6);
    scene_free(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_terrain), cmocka_unit_test(test_caps)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
