/* SPDX-License-Identifier: MIT */
/* Finds the distance to a scene by Embree's point query, among the leaves of its BVH.
 *
 * Rounding. Embree sees q' = float(q - c), c being the BVH's origin. With g the largest |q - c| over the axes, that
 * moves the query by at most sqrt(3) 2^-24 g. The boxes of leaves are rounded outward (leaves.c). So a triangle within
 * r of q is in a box within r + sqrt(3) 2^-24 g of q'. Embree's test of a box works on squares with a few roundings,
 * below 8 * 2^-24 of the distance. Both bounds go onto every radius. */
#include "core/distance.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "core/bvh/leaves.h"
#include "core/vec3.h"

struct search {
    const struct bvh *bvh;
    const double *p;
    double slack_m; /* how far rounding to float may move this point */
    double best_m;
    struct distance_hit *hit;
    int found;
};

/* Points and edges from here on are relative to the query point, which is the origin: nothing of the large
 * coordinates is left in the products. */

/* Finds the point nearest to the origin on the edge from a along ab. The point is measured from the end that is nearer
 * to it, so that less is rounded. */
static void nearest_on_edge(const double a[3], const double b[3], const double ab[3], double out[3])
{
    double along_a = -vec3_dot(a, ab), along_b = vec3_dot(b, ab), length2 = along_a + along_b;
    for (int k = 0; k < 3; k++) {
        if (along_a <= 0 || !(length2 > 0))
            out[k] = a[k];
        else if (along_b <= 0)
            out[k] = b[k];
        else
            out[k] = along_a < along_b ? a[k] + ab[k] * (along_a / length2) : b[k] - ab[k] * (along_b / length2);
    }
}

/* Is the origin's foot on the plane inside all three edges? */
static int is_inside(double corner[3][3], double edge[3][3], const double normal[3])
{
    for (int i = 0; i < 3; i++) {
        double side[3];
        vec3_cross(corner[i], edge[i], side);
        if (!(vec3_dot(side, normal) >= 0)) return 0;
    }
    return 1;
}

/* Finds the point of the triangle nearest to the origin, and returns its distance. First come the edges: their points
 * are exact even on a needle. Then comes the face, whose plane is taken through the edges' nearest point. The error of
 * a needle's normal is an angle of about 2^-53 l / h (length, height). Over the distance d this error moves the foot by
 * d times the angle, so the foot only stays inside where the angle is below h / d. The edges' nearest point lies within
 * about h of the foot, so the error of the distance is about h times the angle, which is 2^-53 l. */
static double nearest_on_triangle(double corner[3][3], double nearest[3])
{
    double edge[3][3], normal[3], best2 = INFINITY;
    for (int i = 0; i < 3; i++) {
        double q[3];
        int j = (i + 1) % 3;
        vec3_sub(corner[j], corner[i], edge[i]);
        nearest_on_edge(corner[i], corner[j], edge[i], q);
        double d2 = vec3_dot(q, q);
        if (d2 >= best2) continue;
        best2 = d2;
        memcpy(nearest, q, sizeof q);
    }
    vec3_cross(edge[0], edge[1], normal);
    double n2 = vec3_dot(normal, normal);
    if (!(n2 > 0) || !is_inside(corner, edge, normal)) return sqrt(best2);
    double height = vec3_dot(nearest, normal) / n2, foot[3];
    for (int k = 0; k < 3; k++)
        foot[k] = normal[k] * height;
    double foot2 = vec3_dot(foot, foot);
    if (foot2 >= best2) return sqrt(best2);
    memcpy(nearest, foot, sizeof foot);
    return sqrt(foot2);
}

static float query_radius(double radius_m, double slack_m)
{
    double wide = (radius_m + slack_m) * (1 + 0x1p-20);
    return wide < FLT_MAX ? nextafterf((float)wide, INFINITY) : INFINITY;
}

static void visit_triangle(struct search *s, uint32_t triangle)
{
    const struct scene *scene = s->bvh->scene;
    double corner[3][3], nearest[3] = {0}; /* where squares overflow to infinity, no edge sets nearest */
    for (int i = 0; i < 3; i++)
        vec3_sub(scene->vertex_m[scene->triangle[triangle][i]], s->p, corner[i]);
    const double d = nearest_on_triangle(corner, nearest);
    /* Where two triangles are as near, the one with the lower number is taken, in whatever order Embree asks. */
    if (d > s->best_m || (s->found && d == s->best_m && triangle > s->hit->triangle)) return;
    s->found = 1;
    s->best_m = s->hit->distance_m = d;
    s->hit->triangle = triangle;
    vec3_add(s->p, nearest, s->hit->point_m);
}

/* Embree asks for the triangles of a leaf. Returns whether the radius has become smaller. */
static bool embree_asks_distance(struct RTCPointQueryFunctionArguments *args)
{
    struct search *s = args->userPtr;
    if (args->geomID != BVH_LEAVES) return false;
    const struct bvh_leaf *leaf = &s->bvh->leaf[args->primID];
    visit_triangle(s, leaf->triangle);
    if (bvh_leaf_ahead(bvh_leaf_rest(leaf)) != 0) visit_triangle(s, bvh_leaf_triangle(leaf, 1));
    const float radius = query_radius(s->best_m, s->slack_m);
    if (!(radius < args->query->radius)) return false;
    args->query->radius = radius;
    return true;
}

/* Farther out a float can't hold the square of a distance. */
static const double FARTHEST_M = 1e18;

int distance_query(const struct bvh *bvh, const double p_prcs[3], double max_m, struct distance_hit *hit)
{
    double o[3], reach_m = 0.0;
    if (!isfinite(p_prcs[0]) || !isfinite(p_prcs[1]) || !isfinite(p_prcs[2]) || !(max_m >= 0)) return 0;
    vec3_sub(p_prcs, bvh->origin_m, o);
    for (int k = 0; k < 3; k++)
        reach_m = fmax(reach_m, fabs(o[k]));
    if (!(reach_m <= FARTHEST_M) || reach_m * (1 - 1e-12) - bvh->radius_m > max_m) return 0;
    struct search search = {
        .bvh = bvh, .p = p_prcs, .best_m = max_m, .hit = hit, .slack_m = 1.7321 * 0x1p-24 * reach_m * (1 + 1e-6)};
    struct RTCPointQuery query = {
        .x = (float)o[0], .y = (float)o[1], .z = (float)o[2], .radius = query_radius(max_m, search.slack_m)};
    struct RTCPointQueryContext context;
    rtcInitPointQueryContext(&context);
    rtcPointQuery(bvh->rtc, &query, &context, embree_asks_distance, &search);
    return search.found;
}

int distance_reaches(const struct bvh *bvh, const double p_prcs[3], double max_m)
{
    struct distance_hit hit;
    double in_mesh[3];
    int found = distance_query(bvh, p_prcs, max_m, &hit);
    for (uint32_t i = 0; i < bvh->scene->n_copies && !found; i++) {
        const struct bvh_copy *copy = &bvh->copy[i];
        scene_copy_put_back(copy->at, p_prcs, in_mesh);
        found = distance_query(copy->mesh, in_mesh, max_m / copy->at->scale, &hit);
    }
    return found;
}
