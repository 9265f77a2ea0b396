/* SPDX-License-Identifier: MIT */
/* Distance to the scene by Embree's point query.
 *
 * Rounding. Embree sees v' = float(v - c) and q' = float(q - c), c the centre of the bounds. With h the
 * largest |v - c| and g the largest |q - c| over the axes, a triangle's points and the query move by at most
 * sqrt(3) 2^-24 (h + g), so a triangle within r of q is, for Embree, within r + sqrt(3) 2^-24 (h + g). Its
 * box test works on squares with a few roundings, below 8 * 2^-24 of the distance. Both go onto every radius.
 */
#include "core/distance.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/embree.h"
#include "core/vec3.h"

struct distance {
    const struct scene *scene;
    RTCDevice device;
    RTCScene bvh;
    double centre_m[3];
    double half_m; /* the largest |vertex - centre| along an axis */
};

struct search {
    const struct distance *index;
    const double *p;
    double slack_m; /* of the float frame, for this point */
    double best_m;
    struct distance_hit *hit;
    int found;
};

/* Points and edges from here on are relative to the query point, which is the origin: nothing of the large
 * coordinates is left in the products. */

/* The point nearest to the origin on the edge from a along ab. Measured from whichever end is nearer. */
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

/* The point of the triangle nearest to the origin. First come the edges: their points are exact even on a needle. Then
 * comes the face, whose plane is taken through the edges' nearest point. The error of a needle's normal is an angle of
 * about 2^-53 l / h (length, height). Over the distance d this error moves the foot by d times the angle, so the
 * foot only stays inside where the angle is below h / d. Then the error of the distance is below 2^-53 l. */
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

static bool visit_triangle(struct RTCPointQueryFunctionArguments *args)
{
    struct search *s = args->userPtr;
    const struct scene *scene = s->index->scene;
    double corner[3][3], nearest[3] = {0}; /* squares of the largest numbers are infinite: no edge is nearer then */
    for (int i = 0; i < 3; i++)
        vec3_sub(scene->vertex_m[scene->triangle[args->primID][i]], s->p, corner[i]);
    double d = nearest_on_triangle(corner, nearest);
    /* The lower number of two that are as near: an answer that doesn't depend on Embree's order. */
    if (d > s->best_m || (s->found && d == s->best_m && args->primID > s->hit->triangle)) return false;
    bool nearer = d < s->best_m;
    s->found = 1;
    s->best_m = d;
    s->hit->distance_m = d;
    s->hit->triangle = args->primID;
    vec3_add(s->p, nearest, s->hit->point_m);
    float radius = query_radius(d, s->slack_m);
    if (!nearer || !(radius < args->query->radius)) return false;
    args->query->radius = radius;
    return true;
}

static double farthest_from(const double centre[3], const double p[3])
{
    double g = 0;
    for (int k = 0; k < 3; k++)
        g = fmax(g, fabs(p[k] - centre[k]));
    return g;
}

/* Farther out a float can't hold the square of a distance. */
static const double FARTHEST_M = 1e18;

/* Whether the whole box of the scene is farther than max_m along one axis. */
static int is_out_of_reach(const struct distance *index, double reach_m, double max_m)
{
    return !(reach_m <= FARTHEST_M) || reach_m * (1 - 1e-12) - index->half_m > max_m;
}

int distance_query(const struct distance *index, const double p_prcs[3], double max_m, struct distance_hit *hit)
{
    if (!isfinite(p_prcs[0]) || !isfinite(p_prcs[1]) || !isfinite(p_prcs[2]) || !(max_m >= 0)) return 0;
    double reach = farthest_from(index->centre_m, p_prcs);
    if (is_out_of_reach(index, reach, max_m)) return 0;
    struct search search = {
        .index = index,
        .p = p_prcs,
        .best_m = max_m,
        .hit = hit,
        .slack_m = 1.7321 * 0x1p-24 * (index->half_m + reach) * (1 + 1e-6),
    };
    struct RTCPointQuery query = {
        .x = (float)(p_prcs[0] - index->centre_m[0]),
        .y = (float)(p_prcs[1] - index->centre_m[1]),
        .z = (float)(p_prcs[2] - index->centre_m[2]),
        .radius = query_radius(max_m, search.slack_m),
    };
    struct RTCPointQueryContext context;
    rtcInitPointQueryContext(&context);
    rtcPointQuery(index->bvh, &query, &context, visit_triangle, &search);
    return search.found;
}

static int embree_failed(RTCDevice device, struct sh_err *err)
{
    enum RTCError code = rtcGetDeviceError(device);
    return code == RTC_ERROR_NONE ? SH_OK : embree_fail(code, "the index for distances", err);
}

/* Vertices that no triangle uses may lie anywhere, so they go to the centre. */
static void fill_vertices(struct distance *d, float (*out)[3])
{
    const struct scene *s = d->scene;
    memset(out, 0, s->n_vertices * sizeof *out);
    for (uint32_t i = 0; i < s->n_triangles; i++) {
        for (int c = 0; c < 3; c++) {
            const double *v = s->vertex_m[s->triangle[i][c]];
            for (int k = 0; k < 3; k++)
                out[s->triangle[i][c]][k] = (float)(v[k] - d->centre_m[k]);
        }
    }
}

static int build_bvh(struct distance *d, struct sh_err *err)
{
    d->device = rtcNewDevice(NULL);
    if (d->device == NULL) return embree_failed(NULL, err);
    d->bvh = rtcNewScene(d->device);
    RTCGeometry mesh = rtcNewGeometry(d->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    float(*vertex)[3] = rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof *vertex,
                                                d->scene->n_vertices);
    rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, d->scene->triangle, 0,
                               sizeof *d->scene->triangle, d->scene->n_triangles);
    if (vertex != NULL) {
        fill_vertices(d, vertex);
        rtcCommitGeometry(mesh);
        rtcAttachGeometry(d->bvh, mesh);
        rtcSetSceneFlags(d->bvh, RTC_SCENE_FLAG_ROBUST);
        rtcCommitScene(d->bvh);
    }
    rtcReleaseGeometry(mesh);
    return embree_failed(d->device, err);
}

int distance_create(const struct scene *scene, struct distance **out, struct sh_err *err)
{
    *out = NULL;
    struct distance *d = calloc(1, sizeof *d);
    if (d == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the distance index");
    d->scene = scene;
    for (int k = 0; k < 3; k++)
        d->centre_m[k] = scene->min_m[k] + (scene->max_m[k] - scene->min_m[k]) / 2;
    d->half_m = fmax(farthest_from(d->centre_m, scene->min_m), farthest_from(d->centre_m, scene->max_m));
    int rc = build_bvh(d, err);
    if (rc == SH_OK)
        *out = d;
    else
        distance_free(d);
    return rc;
}

void distance_free(struct distance *index)
{
    if (index == NULL) return;
    if (index->bvh != NULL) rtcReleaseScene(index->bvh);
    if (index->device != NULL) rtcReleaseDevice(index->device);
    free(index);
}
