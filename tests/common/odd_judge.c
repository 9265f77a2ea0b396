/* SPDX-License-Identifier: MIT */
#include "tests/common/odd_judge.h"

#include <math.h>
#include <stdio.h>

#include "core/vec3.h"

/* Returns how wrong the place may be where the ray meets the plane of a triangle. The error is 8 * 2^-53 times the sum
 * of the farthest corner's distance and the scene's diagonal. A thin triangle makes the error larger, and so does a
 * small angle between ray and plane, by whose sine the error is divided. */
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
    const double sliver = vec3_length(e1) * vec3_length(e2) / vec3_length(n); /* a thin one has a less precise normal */
    return 8.0 * 0x1p-53 * far_m * sliver * vec3_length(n) / fabs(vec3_dot(n, dir));
}

/* Returns whether the ray is inside the line of each edge of a triangle, or outside of it by no more than rounding. A
 * ray beyond the tip of a needle may be so near to the lines of two edges, and yet far from the edges.
 * reference_is_undecidable looks at the edges alone. */
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

/* If the claimed triangle is not known, the place may be beside any of them. */
static int is_beside_any(const struct scene *scene, const struct odd_shot *shot)
{
    if (shot->triangle < scene->n_triangles) return is_beside_lines(scene, shot->triangle, shot->at_m, shot->dir);
    for (uint32_t i = 0; i < scene->n_triangles; i++)
        if (is_beside_lines(scene, i, shot->at_m, shot->dir)) return 1;
    return 0;
}

static int is_undecidable(const struct scene *scene, const struct reference *reference, const struct odd_shot *shot,
                          const struct reference_hit *truth, double error_m)
{
    const double blurred_m = fmax(blur_m(scene, truth->triangle, shot->at_m, shot->dir),
                                  blur_m(scene, shot->triangle, shot->at_m, shot->dir));
    const double nearer_m = fmin(isnan(shot->range_m) ? INFINITY : shot->range_m,
                                 isnan((double)truth->range_m) ? INFINITY : (double)truth->range_m);
    return blurred_m >= fmin(error_m, nearer_m) ||
           reference_is_undecidable(reference, shot->at_m, shot->dir, truth, shot->range_m) ||
           (truth->triangle == REFERENCE_NONE && is_beside_any(scene, shot));
}

int odd_judge(const struct scene *scene, const struct reference *reference, const struct odd_shot *shot,
              double (*bound_m)(long double range_m), struct odd_tally *tally)
{
    const struct reference_hit truth = reference_brute(reference, shot->at_m, shot->dir);
    const double error_m = reference_error(&truth, shot->range_m);
    tally->rays++;
    tally->hits += isnan(shot->range_m) == 0;
    if (truth.range_m < 1e-6L) {
        tally->begins_on++;
        return 1;
    }
    if (isnan(shot->range_m) && truth.triangle == REFERENCE_NONE) return 1;
    if (isnan(shot->range_m) && shot->most_m > 0.0 && truth.range_m > (long double)shot->most_m - 1e-6L) return 1;
    if (error_m <= bound_m(truth.range_m)) {
        tally->largest_m = fmax(tally->largest_m, error_m);
        return 1;
    }
    if (is_undecidable(scene, reference, shot, &truth, error_m)) {
        tally->undecidable++;
        return 1;
    }
    tally->missed += isnan(shot->range_m) != 0;
    tally->extra += isnan((double)truth.range_m) != 0;
    tally->wrong += isfinite(error_m) != 0;
    printf("# %.17g m, truth %.17Lg m\n", shot->range_m, truth.range_m);
    return 0;
}

uint64_t odd_print(const char *name, const struct odd_tally *t)
{
    printf("# %-14s %7llu rays, %7llu meet something, %llu begin on it: %llu missed, %llu extra, %llu wrong, %llu "
           "undecidable; largest error %.2g m\n",
           name, (unsigned long long)t->rays, (unsigned long long)t->hits, (unsigned long long)t->begins_on,
           (unsigned long long)t->missed, (unsigned long long)t->extra, (unsigned long long)t->wrong,
           (unsigned long long)t->undecidable, t->largest_m);
    return t->missed + t->extra + t->wrong;
}
