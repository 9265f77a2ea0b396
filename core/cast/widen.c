/* Exact triangles, and the widened float ones for Embree. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/cast/bvh.h"
#include "core/huge.h"

static const double BVH_MAX_STRETCH = 1e4; /* reached at 89.994 degrees of incidence */

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Corners in the local frame; returns the largest distance from its origin. */
static double corners(const struct bvh *bvh, uint32_t prim, double v[3][3])
{
    double reach2 = 0.0;
    for (int i = 0; i < 3; i++) {
        const double *p = bvh->scene->vertex_m[bvh->scene->triangle[prim][i]];
        for (int j = 0; j < 3; j++)
            v[i][j] = p[j] - bvh->origin_m[j];
        reach2 = fmax(reach2, dot(v[i], v[i]));
    }
    return sqrt(reach2);
}

/* How far edge i has to move outward in the triangle's plane so that it moves by width_m across the rays: a
 * shift w in the plane is one of w |n . p| |e| / (|n| |e x p|) across the ray to a point p of the edge, and
 * both products are the same for all its points. Without this, edges of faces seen at grazing incidence
 * hardly move, and rays slip between them. Only rays from the origin have one such figure for each edge.
 * Other stations share the plain width. Who sees a triangle so edge-on that BVH_MAX_STRETCH widths are too
 * few may see past it. */
static double edge_move(double v[3][3], int i, const double n[3], double width_m, double reach_m)
{
    const double *a = v[i], *b = v[(i + 1) % 3];
    double e[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]}, c[3];
    if (reach_m > 0.0) return width_m;
    cross(e, a, c);
    double across = sqrt(dot(c, c) * dot(n, n)), along = fabs(dot(n, a)) * sqrt(dot(e, e));
    double stretch = across < BVH_MAX_STRETCH * along ? across / along : BVH_MAX_STRETCH;
    return width_m * fmax(stretch, 1.0);
}

/* Moves corner i outward so that the edges to the next and to the one before move by to_next and from_before;
 * along each of them by the other's move / sin(angle), cut where the corner is sharp. */
static void widen_corner(double v[3][3], int i, double to_next, double from_before, float out[3])
{
    double e1[3], e2[3], c[3], l1 = 0.0, l2 = 0.0;
    for (int j = 0; j < 3; j++) {
        e1[j] = v[(i + 1) % 3][j] - v[i][j];
        e2[j] = v[(i + 2) % 3][j] - v[i][j];
        l1 += e1[j] * e1[j];
        l2 += e2[j] * e2[j];
    }
    l1 = 1.0 / sqrt(l1);
    l2 = 1.0 / sqrt(l2);
    cross(e1, e2, c);
    double sine = sqrt(dot(c, c)) * l1 * l2, sum2 = 0.0, move[3];
    for (int j = 0; j < 3; j++) {
        move[j] = (from_before * e1[j] * l1 + to_next * e2[j] * l2) / sine;
        sum2 += move[j] * move[j];
    }
    double limit = BVH_MAX_MITER * fmax(to_next, from_before),
           scale = sum2 > limit * limit ? limit / sqrt(sum2) : 1.0;
    for (int j = 0; j < 3; j++)
        out[j] = (float)(v[i][j] - scale * move[j]);
}

double bvh_width_m(const struct bvh *bvh, uint32_t prim)
{
    double v[3][3];
    return BVH_WIDEN * (corners(bvh, prim, v) + bvh->station_reach_m);
}

static double with_spare(double x, uint32_t spare)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits = (bits & ~(uint64_t)((1U << BVH_SPARE_BITS) - 1)) | spare;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* Plane, guard and label. The distance from a ray to edge i, across the ray, is at least bary_i |n . dir| /
 * longest edge. It has to exceed the width by which the border was moved and once more the rounding. Embree's
 * bary_i are those of the widened triangle, which is larger; 1.1 covers the difference, and needles are
 * always decided. */
static void set_exact(struct bvh_triangle *tri, double v[3][3], double width_m, uint16_t label)
{
    double e1[3], e2[3], longest2 = 0.0;
    for (int i = 0; i < 3; i++) {
        double l2 = 0.0;
        for (int j = 0; j < 3; j++)
            l2 += (v[(i + 1) % 3][j] - v[i][j]) * (v[(i + 1) % 3][j] - v[i][j]);
        longest2 = fmax(longest2, l2);
        e1[i] = v[1][i] - v[0][i];
        e2[i] = v[2][i] - v[0][i];
    }
    cross(e1, e2, tri->n);
    double height_m = sqrt(dot(tri->n, tri->n) / longest2);
    double guard = height_m > 64.0 * width_m ? 1.1 * 2.0 * width_m * sqrt(longest2) : INFINITY;
    uint64_t bits;
    memcpy(&bits, &guard, sizeof bits);
    tri->n[0] =
        with_spare(tri->n[0], (uint32_t)((bits + ((1ULL << BVH_GUARD_SHIFT) - 1)) >> BVH_GUARD_SHIFT));
    tri->n[1] = with_spare(tri->n[1], label & ((1U << BVH_SPARE_BITS) - 1));
    tri->n[2] = with_spare(tri->n[2], (uint32_t)label >> BVH_SPARE_BITS);
    double centre[3];
    for (int j = 0; j < 3; j++)
        centre[j] = v[0][j] + (e1[j] + e2[j]) / 3.0;
    tri->d = dot(tri->n, centre);
}

static void fill_triangle(struct bvh *bvh, uint32_t prim, float *vertex)
{
    double v[3][3], e1[3], e2[3], n[3], move[3],
        width_m = BVH_WIDEN * (corners(bvh, prim, v) + bvh->station_reach_m);
    for (int j = 0; j < 3; j++) {
        e1[j] = v[1][j] - v[0][j];
        e2[j] = v[2][j] - v[0][j];
    }
    cross(e1, e2, n);
    for (int i = 0; i < 3; i++)
        move[i] = edge_move(v, i, n, width_m, bvh->station_reach_m);
    for (int i = 0; i < 3; i++)
        widen_corner(v, i, move[i], move[(i + 2) % 3], vertex + 3 * i);
    set_exact(&bvh->triangle[prim], v, width_m, bvh->scene->label[prim]);
}

int bvh_fill(struct bvh *bvh, RTCGeometry geometry, struct sh_err *err)
{
    const struct scene *scene = bvh->scene;
    size_t n = scene->n_triangles;
    bvh->triangle = huge_alloc((n + 1) * sizeof *bvh->triangle);
    float *vertex = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                            3 * sizeof(float), 3 * n);
    uint32_t *index = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                              3 * sizeof(uint32_t), n);
    if (bvh->triangle == NULL || vertex == NULL || index == NULL)
        return sh_fail(err, SH_ENOMEM, "cast: no memory for %zu triangles", n);
    for (uint32_t i = 0; i < n; i++)
        fill_triangle(bvh, i, vertex + 9 * (size_t)i);
    for (uint32_t i = 0; i < 3 * n; i++)
        index[i] = i;
    bvh->triangle[n] = (struct bvh_triangle){.n = {NAN, with_spare(NAN, LINE_LABEL_NONE & 0xfff),
                                                   with_spare(NAN, LINE_LABEL_NONE >> BVH_SPARE_BITS)},
                                             .d = NAN};
    return SH_OK;
}
