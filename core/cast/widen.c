/* Exact triangles, and the widened float ones for Embree. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/cast/bvh.h"

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

/* Moves corner i outward so that both its edges move by `width`: along the edges' sum, width / sin(angle), cut at
 * BVH_MAX_MITER widths where the corner is sharp. */
static void widen_corner(double v[3][3], int i, double width, float out[3])
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
        move[j] = e1[j] * l1 + e2[j] * l2;
        sum2 += move[j] * move[j];
    }
    double length = sqrt(sum2), miter = sine > 0.0 ? length / sine : INFINITY;
    if (miter > BVH_MAX_MITER) miter = BVH_MAX_MITER;
    double scale = length > 0.0 ? width * miter / length : 0.0;
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

/* Plane, guard and label. The distance from a ray to edge i, across the ray, is at least bary_i |n . dir| / longest edge. It
 * has to exceed the width by which the border was moved and once more the rounding. Embree's bary_i are those of the widened
 * triangle, which is larger; 1.1 covers the difference, and needles are always decided. */
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
    tri->n[0] = with_spare(tri->n[0], (uint32_t)((bits + ((1ULL << BVH_GUARD_SHIFT) - 1)) >> BVH_GUARD_SHIFT));
    tri->n[1] = with_spare(tri->n[1], label & ((1U << BVH_SPARE_BITS) - 1));
    tri->n[2] = with_spare(tri->n[2], (uint32_t)label >> BVH_SPARE_BITS);
    double centre[3];
    for (int j = 0; j < 3; j++)
        centre[j] = v[0][j] + (e1[j] + e2[j]) / 3.0;
    tri->d = dot(tri->n, centre);
}

static void fill_triangle(struct bvh *bvh, uint32_t prim, float *vertex)
{
    double v[3][3], width_m = BVH_WIDEN * (corners(bvh, prim, v) + bvh->station_reach_m);
    for (int i = 0; i < 3; i++)
        widen_corner(v, i, width_m, vertex + 3 * i);
    set_exact(&bvh->triangle[prim], v, width_m, bvh->scene->label[prim]);
}

int bvh_fill(struct bvh *bvh, RTCGeometry geometry, struct sh_err *err)
{
    const struct scene *scene = bvh->scene;
    size_t n = scene->n_triangles;
    bvh->triangle = aligned_alloc(64, (n + 2) / 2 * 64);
    float *vertex = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), 3 * n);
    uint32_t *index = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(uint32_t), n);
    if (bvh->triangle == NULL || vertex == NULL || index == NULL)
        return sh_fail(err, SH_ENOMEM, "cast: no memory for %zu triangles", n);
    for (uint32_t i = 0; i < n; i++)
        fill_triangle(bvh, i, vertex + 9 * (size_t)i);
    for (uint32_t i = 0; i < 3 * n; i++)
        index[i] = i;
    bvh->triangle[n] = (struct bvh_triangle){
        .n = {NAN, with_spare(NAN, LINE_LABEL_NONE & 0xfff), with_spare(NAN, LINE_LABEL_NONE >> BVH_SPARE_BITS)}, .d = NAN};
    return SH_OK;
}
