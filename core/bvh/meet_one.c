/* SPDX-License-Identifier: MIT */
/* One ray at one triangle, in double and without vectors: where a packet was in doubt, where a hit is as near as
 * another one, or where there may be a hole. */
#include <math.h>

#include "core/bvh/edges.h"
#include "core/bvh/meet.h"
#include "core/bvh/nearest.h"
#include "core/vec3.h"

/* Sets v to the corners, from the ray's origin. */
static void find_corners(const struct bvh_query *query, uint32_t lane, uint32_t triangle, double v[3][3])
{
    const struct scene *scene = query->bvh->scene;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            v[i][j] = scene->vertex_m[scene->triangle[triangle][i]][j] -
                      (query->has_own ? query->org[j][lane] : query->at[j]);
}

/* Whether the triangle has a hole where the ray is at that range. */
static int is_hole(const struct bvh_query *query, uint32_t lane, uint32_t triangle, double range_m)
{
    const struct scene *scene = query->bvh->scene;
    if (!query->may_pass || scene_cutout(scene, triangle) == NULL) return 0;
    double v[3][3], p[3], uv[2];
    for (int j = 0; j < 3; j++)
        p[j] = range_m * query->dir[j][lane];
    find_corners(query, lane, triangle, v);
    const double *const corner[3] = {v[0], v[1], v[2]};
    scene_uv_at(scene, triangle, corner, p, uv);
    return texture_is_hole(scene_cutout(scene, triangle), uv);
}

void bvh_note_hit(struct bvh_query *query, float *tfar, uint32_t lane, uint32_t triangle, double range_m)
{
    if (is_hole(query, lane, triangle, range_m)) return;
    bvh_take_hit(query, tfar, lane, triangle, range_m, range_m);
}

/* Range to a triangle that the ray hits almost in its plane. The plane's own range is then useless, so it is limited
 * to between the edges that the ray passes. NaN: it passes none. */
static double held_range(double v[3][3], const double dir[3], double range_m)
{
    double lo = INFINITY, hi = -INFINITY, longest = 0.0;
    for (int i = 0; i < 3; i++)
        longest = fmax(longest, vec3_distance(v[i], v[(i + 1) % 3]));
    for (int i = 0; i < 3; i++) {
        const double *a = v[i], *b = v[(i + 1) % 3];
        double t = edge_range(a, b, dir), blur = 0x1p-40 * vec3_distance(a, b) + 0x1p-46 * fabs(t);
        if (edge_gap(a, b, dir, t) > blur + 1e-6 * longest) continue; /* the ray does not pass here */
        lo = fmin(lo, t);
        hi = fmax(hi, t);
    }
    if (!(lo <= hi)) return NAN;
    return range_m < lo || isnan(range_m) ? lo : range_m > hi ? hi : range_m;
}

void bvh_try_one(struct bvh_query *query, float *tfar, uint32_t lane, const struct bvh_leaf *leaf, int which)
{
    const uint32_t triangle = bvh_leaf_triangle(leaf, which);
    const struct bvh_plane *plane = &leaf->plane[which];
    double v[3][3], dir[3], o[3], side[3];
    for (int j = 0; j < 3; j++) {
        dir[j] = query->dir[j][lane];
        o[j] = query->has_own ? query->local[j][lane] : query->at_local[j];
    }
    find_corners(query, lane, triangle, v);
    int near = 0;
    for (int i = 0; i < 3; i++) {
        const double *a = v[i], *b = v[(i + 1) % 3];
        side[i] = edge_side(a, b, dir);
        near |= fabs(side[i]) <= 4.0 * blur(a, b);
    }
    query->counters.decided += (uint64_t)near;
    const int hits = is_inside(side);
    if (!hits && !near) return;
    if (is_edge_on(v, side) || vec3_is_any_zero(v) || (!hits && !is_near_miss(v, side, dir))) return;
    const double along = vec3_dot(plane->n, dir);
    double range_m = (plane->d - vec3_dot(plane->n, o)) / along;
    if (!(along * along > BVH_FLAT * BVH_FLAT * vec3_dot(plane->n, plane->n))) range_m = held_range(v, dir, range_m);
    if (!(range_m > query->at_origin_m)) return;
    const double nearest_m = query->range_m[lane];
    if (hits && range_m <= nearest_m + BVH_SAME * nearest_m)
        bvh_note_hit(query, tfar, lane, triangle, range_m);
    else if (!hits && !is_hole(query, lane, triangle, range_m))
        bvh_note_miss(query, lane, triangle, range_m);
}
