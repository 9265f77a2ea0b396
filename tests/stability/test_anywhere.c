/* Rays that begin anywhere: at the station, within the scene, on faces, at corners, and from a thousand to a million
 * times as far away as the scene is large, up to 1e7 m. Scenes are of what is hard (odd_scenes.h). Beside the reference in long
 * double; and a ray by itself, among others from the same point, and among rays from elsewhere meets the same, to the
 * bit.
 *
 * ANYWHERE_SCENES: how many (default 300, THOROUGH=1: 1000). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/bvh.h"
#include "core/rng.h"
#include "core/vec3.h"
#include "tests/common/cases.h"
#include "tests/common/odd_rays.h"
#include "tests/common/odd_scenes.h"
#include "tests/common/reference.h"
#include "tests/common/thorough.h"

enum { ORIGINS = 16, EACH = 64, RAYS = ORIGINS * EACH };
_Static_assert((int)RAYS <= (int)BVH_CHUNK, "cast at once");

static const double RANGE_MAX_M = 1e9;

enum place { STATION, WITHIN, ON_A_FACE, AT_A_CORNER, FAR_AWAY, PLACES };
static const char *const place_name[PLACES] = {"at the station", "within", "on a face", "at a corner", "far away"};

struct tally {
    uint64_t rays, begins_on, hits, missed, extra, wrong, undecidable, differ;
    double largest_m;
};

static struct shot {
    double x[RAYS], y[RAYS], z[RAYS], px[RAYS], py[RAYS], pz[RAYS];
    double range_m[3][RAYS];
    uint32_t triangle[3][RAYS];
} shot;

static const double *a_corner(const struct scene *scene, uint64_t *random)
{
    return scene
        ->vertex_m[scene->triangle[case_between(random, 0, scene->n_triangles - 1)][case_between(random, 0, 2)]];
}

static void draw_origin(const struct odd_scene *odd, const struct scene *scene, enum place place, uint64_t *random,
                        double at_m[3])
{
    const double size_m = vec3_distance(scene->max_m, scene->min_m);
    memcpy(at_m, odd->station_m, 3 * sizeof *at_m);
    if (place == AT_A_CORNER) memcpy(at_m, a_corner(scene, random), 3 * sizeof *at_m);
    if (place == ON_A_FACE) {
        const uint32_t *t = scene->triangle[case_between(random, 0, scene->n_triangles - 1)];
        const double a = case_unit(random), b = (1.0 - a) * case_unit(random);
        for (int i = 0; i < 3; i++)
            at_m[i] = scene->vertex_m[t[0]][i] + a * (scene->vertex_m[t[1]][i] - scene->vertex_m[t[0]][i]) +
                      b * (scene->vertex_m[t[2]][i] - scene->vertex_m[t[0]][i]);
    }
    const double away_m = place == FAR_AWAY ? fmin(1e7, size_m * pow(10.0, 3.0 + 3.0 * case_unit(random))) : 0.0;
    for (int i = 0; i < 3 && place == WITHIN; i++)
        at_m[i] = scene->min_m[i] + case_unit(random) * (scene->max_m[i] - scene->min_m[i]);
    for (int i = 0; i < 3; i++)
        at_m[i] += away_m * (2.0 * case_unit(random) - 1.0);
}

static void draw_rays(const struct odd_scene *odd, const struct scene *scene, uint64_t *random)
{
    for (int k = 0; k < ORIGINS; k++) {
        struct odd_rays rays = {.scene = scene, .cells = 64, .random = case_u64(random) | 1};
        double at_m[3];
        draw_origin(odd, scene, (enum place)(k % PLACES), random, at_m);
        memcpy(rays.station_m, at_m, sizeof at_m);
        odd_rays_mix(&rays, EACH, shot.x + k * EACH, shot.y + k * EACH, shot.z + k * EACH);
        for (int i = k * EACH; i < (k + 1) * EACH; i++)
            shot.px[i] = at_m[0], shot.py[i] = at_m[1], shot.pz[i] = at_m[2];
    }
}

/* Way 0: each from its own point, in packets across the points; 1: point by point; 2: one by one. */
static void cast(const struct bvh *bvh, struct bvh_work *work, int way)
{
    const int step = way == 0 ? RAYS : EACH;
    for (int at = 0; at < RAYS; at += step) {
        struct bvh_rays rays = {.n = (uint32_t)step,
                                .dir = {shot.x + at, shot.y + at, shot.z + at},
                                .range_max_m = RANGE_MAX_M,
                                .scattered = way == 2,
                                .range_m = shot.range_m[way] + at,
                                .triangle = shot.triangle[way] + at};
        if (way == 0)
            rays.from.own = (struct vec3_in){shot.px, shot.py, shot.pz};
        else
            memcpy(rays.from.at_m, (const double[3]){shot.px[at], shot.py[at], shot.pz[at]}, sizeof rays.from.at_m);
        bvh_hits(work, bvh, &rays);
    }
}

/* Half of the wire's finest count; where the ray is far from its origin, what double precision leaves of the range at
 * the incidence of a thousandth. */
static double bound_m(const double at_m[3], long double range_m)
{
    return 5e-7 + 1e3 * 0x1p-50 * (vec3_length(at_m) + (double)range_m);
}

/* How far off the place may be where the ray meets the plane of a triangle, over the sine of the angle: 8 units of double
 * of its farthest corner's distance and of the coordinates. */
static double blur_m(const struct scene *scene, uint32_t triangle, const double at_m[3], const double dir[3])
{
    double v[3][3], e1[3], e2[3], n[3], far_m = 0.0;
    if (triangle >= scene->n_triangles) return 0.0;
    for (int i = 0; i < 3; i++) {
        vec3_sub(scene->vertex_m[scene->triangle[triangle][i]], at_m, v[i]);
        far_m = fmax(far_m, vec3_length(v[i]) + vec3_distance(scene->max_m, scene->min_m));
    }
    vec3_sub(v[1], v[0], e1);
    vec3_sub(v[2], v[0], e2);
    vec3_cross(e1, e2, n);
    const double sliver = vec3_length(e1) * vec3_length(e2) / vec3_length(n); /* what a thin one loses of its normal */
    return 8.0 * 0x1p-53 * far_m * sliver * vec3_length(n) / fabs(vec3_dot(n, dir));
}

/* Whether the ray passes outside of a triangle by no more than rounding, across the line of each edge that it is outside
 * of. Beyond the tip of a needle the lines of two edges are as near to each other: reference_is_undecidable, which looks at
 * the edges alone, does not know that. */
static int is_beside_lines(const struct scene *scene, uint32_t triangle, const double at_m[3], const double dir[3])
{
    long double v[3][3], side[3], all = 0.0L;
    if (triangle >= scene->n_triangles) return 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            v[i][j] = (long double)scene->vertex_m[scene->triangle[triangle][i]][j] - at_m[j];
    for (int i = 0; i < 3; i++) {
        const long double *a = v[i], *b = v[(i + 1) % 3];
        side[i] = dir[0] * (a[1] * b[2] - a[2] * b[1]) + dir[1] * (a[2] * b[0] - a[0] * b[2]) +
                  dir[2] * (a[0] * b[1] - a[1] * b[0]);
        all += side[i];
    }
    for (int i = 0; i < 3; i++) {
        const long double *a = v[i], *b = v[(i + 1) % 3];
        const long double ex = b[0] - a[0], ey = b[1] - a[1], ez = b[2] - a[2];
        const long double far_m =
            fmaxl(sqrtl(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]), sqrtl(b[0] * b[0] + b[1] * b[1] + b[2] * b[2]));
        if ((all < 0.0L ? side[i] : -side[i]) > 16.0L * 0x1p-53L * far_m * sqrtl(ex * ex + ey * ey + ez * ez)) return 0;
    }
    return 1;
}

static void judge(const struct scene *scene, const struct reference *reference, int i, struct tally *t)
{
    const double at_m[3] = {shot.px[i], shot.py[i], shot.pz[i]}, dir[3] = {shot.x[i], shot.y[i], shot.z[i]};
    const double range_m = shot.range_m[0][i];
    const struct reference_hit truth = reference_brute(reference, at_m, dir);
    t->rays++;
    t->hits += !isnan(range_m) ? 1 : 0;
    for (int way = 1; way < 3; way++)
        t->differ +=
            (shot.triangle[0][i] != shot.triangle[way][i] || (!isnan(range_m) && range_m != shot.range_m[way][i])) ? 1
                                                                                                                   : 0;
    if (truth.range_m < 1e-6L) {
        t->begins_on++;
        return;
    }
    if (isnan(range_m) && truth.triangle == REFERENCE_NONE) return;
    const double error_m = reference_error(&truth, range_m);
    if (error_m <= bound_m(at_m, truth.range_m)) {
        t->largest_m = fmax(t->largest_m, error_m);
        return;
    }
    const double blurred_m =
        fmax(blur_m(scene, truth.triangle, at_m, dir), blur_m(scene, shot.triangle[0][i], at_m, dir));
    const double nearer_m =
        fmin(isnan(range_m) ? INFINITY : range_m, isnan((double)truth.range_m) ? INFINITY : (double)truth.range_m);
    if (blurred_m >= fmin(error_m, nearer_m) || reference_is_undecidable(reference, at_m, dir, &truth, range_m) ||
        (truth.triangle == REFERENCE_NONE && is_beside_lines(scene, shot.triangle[0][i], at_m, dir))) {
        t->undecidable++;
        return;
    }
    t->missed += isnan(range_m) != 0;
    t->extra += isnan((double)truth.range_m) != 0;
    t->wrong += isfinite(error_m) != 0;
    printf("# %s, ray %d: %.17g m, truth %.17Lg m, blur %.2g m\n", place_name[i / EACH % PLACES], i, range_m,
           truth.range_m, blurred_m);
}

static void one_scene(uint64_t number, struct tally tally[PLACES])
{
    struct sh_err err;
    struct odd_scene odd;
    struct scene *scene;
    struct bvh *bvh;
    struct bvh_work *work;
    uint64_t random = rng_mix(number + 0x417) | 1;
    odd_scene_make(number, 5 + (uint32_t)case_between(&random, 0, 55), &odd);
    if (odd_scene_build(&odd, number / 2 % 2, &scene, &err) != SH_OK) return; /* all without area */
    assert_int_equal(bvh_create(scene, 1, NULL, &bvh, &err), SH_OK);
    assert_int_equal(bvh_work_create(&work, &err), SH_OK);
    struct reference *reference = reference_create((const double(*)[3])scene->vertex_m,
                                                   (const uint32_t(*)[3])scene->triangle, scene->n_triangles);
    assert_non_null(reference);
    draw_rays(&odd, scene, &random);
    for (int way = 0; way < 3; way++)
        cast(bvh, work, way);
    for (int i = 0; i < RAYS; i++)
        judge(scene, reference, i, &tally[i / EACH % PLACES]);
    reference_free(reference);
    bvh_work_free(work);
    bvh_free(bvh);
    scene_free(scene);
}

static void test_anywhere(void **state)
{
    (void)state;
    struct tally tally[PLACES] = {{0}};
    const char *asked = getenv("ANYWHERE_SCENES");
    const long scenes = asked != NULL ? atol(asked) : thorough(1000, 300);
    uint64_t bad = 0;
    for (long i = 0; i < scenes; i++)
        one_scene((uint64_t)i, tally);
    for (int k = 0; k < PLACES; k++) {
        const struct tally *t = &tally[k];
        printf("# %-14s %7llu rays, %7llu meet something, %llu begin on it: %llu missed, %llu extra, %llu wrong, %llu "
               "undecidable, %llu differ by packet; largest error %.2g m\n",
               place_name[k], (unsigned long long)t->rays, (unsigned long long)t->hits,
               (unsigned long long)t->begins_on, (unsigned long long)t->missed, (unsigned long long)t->extra,
               (unsigned long long)t->wrong, (unsigned long long)t->undecidable, (unsigned long long)t->differ,
               t->largest_m);
        bad += t->missed + t->extra + t->wrong + t->differ;
        assert_true(t->hits > t->rays / 8);
    }
    assert_int_equal(bad, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_anywhere),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
