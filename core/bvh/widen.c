/* Exact triangles, and the widened float ones for Embree. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/bvh/bvh_inside.h"
#include "core/vec3.h"
#include "core/huge.h"

double bvh_corners(const struct bvh *bvh, uint32_t prim, double v[3][3])
{
    double reach2 = 0.0;
    for (int i = 0; i < 3; i++) {
        vec3_sub(bvh->scene->vertex_m[bvh->scene->triangle[prim][i]], bvh->origin_m, v[i]);
        reach2 = fmax(reach2, vec3_dot(v[i], v[i]));
    }
    return sqrt(reach2);
}

/* Moves corner i outward within the plane, so that both its edges move by `offset_m`: along the sum of their
 * directions, offset / sin(angle); a sharp corner ends at most_m. */
static void widen_corner(double v[3][3], int i, double offset_m, double most_m, double out[3])
{
    double e1[3], e2[3], c[3], move[3];
    vec3_sub(v[(i + 1) % 3], v[i], e1);
    vec3_sub(v[(i + 2) % 3], v[i], e2);
    double l1 = vec3_length(e1), l2 = vec3_length(e2);
    for (int j = 0; j < 3; j++) {
        e1[j] /= l1;
        e2[j] /= l2;
        move[j] = e1[j] + e2[j];
    }
    vec3_cross(e1, e2, c);
    double sine = sqrt(vec3_dot(c, c)), length = sqrt(vec3_dot(move, move));
    double factor = offset_m * length < most_m * sine ? offset_m / sine : length > 0.0 ? most_m / length : 0.0;
    for (int j = 0; j < 3; j++)
        out[j] = v[i][j] - factor * move[j];
}

/* A corner so sharp that it would have to move too far for both its edges to move by offset_m. */
static int is_too_sharp(double v[3][3], int i, double offset_m, double most_m)
{
    double e1[3], e2[3], c[3];
    vec3_sub(v[(i + 1) % 3], v[i], e1);
    vec3_sub(v[(i + 2) % 3], v[i], e2);
    vec3_cross(e1, e2, c);
    return 2.0 * offset_m * vec3_length(e1) * vec3_length(e2) > most_m * vec3_length(c) && vec3_dot(e1, e2) > 0.0;
}

static void edge_lengths(double v[3][3], double length[3])
{
    for (int i = 0; i < 3; i++)
        length[i] = vec3_distance(v[(i + 1) % 3], v[i]);
}

/* The bound of float's error at the edges of a triangle, as a distance across the ray (bvh_inside.h). far_m:
 * of its farthest corner from any origin of rays. */
static double float_error_m(const struct bvh *bvh, double far_m, const double length[3])
{
    double longest = fmax(fmax(length[0], length[1]), length[2]);
    double sum = length[0] + length[1] + length[2] - longest;
    double product = length[0] * length[1] * length[2] / (longest * longest);
    double function = bvh->station_reach_m > 0.0 ? 8.0 : 6.5, vertices = bvh->station_reach_m > 0.0 ? 3.0 : 2.0;
    double at_v0 = (function + vertices) * far_m;
    double opposite = (function * sum / longest + vertices) * far_m + 15.0 * product;
    return 0x1p-24 * fmax(at_v0, opposite);
}

double bvh_width_m(const struct bvh *bvh, uint32_t prim)
{
    double v[3][3], length[3], far_m = bvh_corners(bvh, prim, v) + bvh->station_reach_m;
    edge_lengths(v, length);
    return float_error_m(bvh, far_m, length);
}

static double with_spare(double x, uint32_t spare)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits = (bits & ~(uint64_t)((1U << BVH_SPARE_BITS) - 1)) | spare;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* Twice the area of a triangle, its normal so long, and its longest edge. */
static double measure(double v[3][3], double n[3], double *longest)
{
    double e1[3], e2[3], length[3];
    vec3_sub(v[1], v[0], e1);
    vec3_sub(v[2], v[0], e2);
    vec3_cross(e1, e2, n);
    edge_lengths(v, length);
    *longest = fmax(fmax(length[0], length[1]), length[2]);
    return vec3_length(n);
}

/* The plane with normal n, as it is stored, passes through the triangle's centre. */
static void set_offset(struct bvh_plane *tri, double v[3][3])
{
    double centre[3];
    for (int j = 0; j < 3; j++)
        centre[j] = v[0][j] + ((v[1][j] - v[0][j]) + (v[2][j] - v[0][j])) / 3.0;
    tri->d = vec3_dot(tri->n, centre);
}

/* What the smallest of Embree's weights has to reach for a hit to be safe. Within the plane, the distance to
 * edge i of the widened triangle is at least weight_i * area2' / longest'. It has to exceed what the edge was
 * moved by, and once more the error of float there, width / cosine of the incidence: seen from the origin no
 * more than the offset. From elsewhere the incidence is another one, so there the weight is multiplied by
 * area2 * cosine first (refine.c). */
static double guard(const struct bvh *bvh, double offset, double width_m, double longest_wide, double area2_wide,
                    double area2)
{
    if (bvh->station_reach_m > 0.0) return (offset + width_m) * longest_wide * area2 / area2_wide;
    return offset < BVH_MAX_SLANT * width_m ? 2.0 * offset * longest_wide / area2_wide : (double)INFINITY;
}

static uint32_t guard_code(double guard)
{
    const int64_t most = (1 << BVH_SPARE_BITS) - 1;
    uint64_t bits;
    memcpy(&bits, &guard, sizeof bits);
    if (!(guard < INFINITY)) return (uint32_t)most;
    int64_t code = (int64_t)((bits + ((1ULL << BVH_GUARD_SHIFT) - 1)) >> BVH_GUARD_SHIFT) - BVH_GUARD_BASE;
    return (uint32_t)(code < 0 ? 0 : code > most ? most : code);
}

static void set_exact(struct bvh_plane *tri, double v[3][3], double guard, uint16_t label)
{
    tri->n[0] = with_spare(tri->n[0], guard_code(guard));
    tri->n[1] = with_spare(tri->n[1], label & ((1U << BVH_SPARE_BITS) - 1));
    tri->n[2] = with_spare(tri->n[2], (uint32_t)label >> BVH_SPARE_BITS);
    set_offset(tri, v);
}

static void mark_holes(struct bvh *bvh, uint32_t prim)
{
    struct bvh_plane *tri = &bvh->triangle[prim];
    double v[3][3];
    bvh_corners(bvh, prim, v);
    tri->n[2] = with_spare(tri->n[2], bvh_spare(tri->n[2]) | BVH_HOLES_BIT);
    set_offset(tri, v);
}

/* How far the edges have to move within the plane, so that seen from the origin, at a slant, they have moved
 * by width_m: width / cosine of the incidence, which at the farthest corner is the plane's distance by the
 * corner's. */
static double offset_m(double v[3][3], const double unit_n[3], double width_m, double far_m)
{
    double above_m = fabs(vec3_dot(v[0], unit_n));
    return width_m * (above_m * BVH_MAX_SLANT > far_m ? far_m / above_m : BVH_MAX_SLANT);
}

/* The sine of the angle at which the farthest corner is seen from a point of the local frame. */
static double slant(double v[3][3], const double unit_n[3], const double from_m[3], double reach_m)
{
    double to[3], far_m = 0.0;
    for (int i = 0; i < 3; i++) {
        vec3_sub(v[i], from_m, to);
        far_m = fmax(far_m, vec3_length(to));
    }
    return fabs(vec3_dot(to, unit_n)) / (far_m + reach_m);
}

double bvh_border_m(const struct bvh *bvh, uint32_t triangle, const double station_m[3])
{
    static const double origin[3] = {0.0, 0.0, 0.0};
    double v[3][3], n[3], longest, at[3];
    vec3_sub(station_m, bvh->origin_m, at);
    if (at[0] == 0.0 && at[1] == 0.0 && at[2] == 0.0) return 0.0;
    bvh_corners(bvh, triangle, v);
    const double area2 = measure(v, n, &longest);
    for (int j = 0; j < 3; j++)
        n[j] /= area2;
    if (slant(v, n, at, 0.0) > 1.01 * slant(v, n, origin, bvh->station_reach_m)) return 0.0;
    return 2.0 * bvh_width_m(bvh, triangle);
}

static void widen(double v[3][3], double offset, double width_m, double wide[3][3])
{
    for (int i = 0; i < 3; i++)
        widen_corner(v, i, offset, BVH_MAX_MOVE * width_m, wide[i]);
}

/* Around a triangle with a corner that is too sharp: one twice as long as its longest edge, with the new corner
 * beyond the end of that edge which the third corner is further from. At that end the new edges are as far from the
 * longest one as half of what they are at the other, so all of the triangle lies offset inside of them. */
static void widen_sharp(double v[3][3], const double unit_n[3], double offset, double wide[3][3])
{
    double length[3], along[3], up[3], to[3];
    edge_lengths(v, length);
    int p = length[0] >= length[1] && length[0] >= length[2] ? 0 : length[1] >= length[2] ? 1 : 2, q = (p + 1) % 3;
    const double *third = v[(p + 2) % 3];
    if (vec3_distance(third, v[p]) < vec3_distance(third, v[q])) {
        int swap = p;
        p = q;
        q = swap;
    }
    const double longest = vec3_distance(v[q], v[p]);
    for (int j = 0; j < 3; j++)
        along[j] = (v[q][j] - v[p][j]) / longest;
    vec3_cross(unit_n, along, up);
    vec3_sub(third, v[p], to);
    double height = vec3_dot(to, up), low = 2.02 * offset, high = 2.02 * (offset + fabs(height));
    if (height < 0.0) {
        double swap = low;
        low = high;
        high = swap;
    }
    for (int j = 0; j < 3; j++) {
        wide[0][j] = v[p][j] - (longest + offset) * along[j];
        wide[1][j] = v[q][j] + offset * along[j] + high * up[j];
        wide[2][j] = v[q][j] + offset * along[j] - low * up[j];
    }
}

/* The longest edge lies opposite the first corner (bvh_inside.h). */
static void set_vertices(double wide[3][3], float *vertex)
{
    double length[3];
    edge_lengths(wide, length);
    int first = length[0] >= length[1] && length[0] >= length[2] ? 2 : length[1] >= length[2] ? 0 : 1;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            vertex[3 * i + j] = (float)wide[(first + i) % 3][j];
}

/* Where a corner is too sharp to move. Its new edges are up to twice as long, and one corner lies further away, so
 * the offset grows. Returns 0 for triangles that need no such thing, or are seen at so small an angle that no corner
 * could move far enough. */
static int replace_sharp(const struct bvh *bvh, double v[3][3], const double unit_n[3], double width_m, double offset,
                         double far_m, double wide[3][3])
{
    double length[3];
    if (offset > 0.03125 * BVH_MAX_MOVE * width_m) return 0;
    int sharp = 0;
    for (int i = 0; i < 3; i++)
        sharp |= is_too_sharp(v, i, offset, BVH_MAX_MOVE * width_m);
    if (!sharp) return 0;
    edge_lengths(v, length);
    const double longest = fmax(length[0], fmax(length[1], length[2])), most = 2.1 * longest + 20.0 * offset;
    const double new_length[3] = {most, most, offset < 0.004 * longest ? 0.1 * most : most};
    const double new_far_m = far_m + longest + 4.0 * offset;
    const double new_width_m = 1.01 * float_error_m(bvh, new_far_m, new_length);
    widen_sharp(v, unit_n, offset_m(v, unit_n, new_width_m, new_far_m), wide);
    return 1;
}

static void fill_triangle(struct bvh *bvh, uint32_t prim, float *vertex)
{
    double v[3][3], wide[3][3], unit[3], wide_n[3], length[3], longest;
    struct bvh_plane *tri = &bvh->triangle[prim];
    double far_m = bvh_corners(bvh, prim, v) + bvh->station_reach_m;
    double area2 = measure(v, tri->n, &longest);
    for (int j = 0; j < 3; j++)
        unit[j] = tri->n[j] / area2;
    edge_lengths(v, length);
    double width_m = float_error_m(bvh, far_m, length), offset = offset_m(v, unit, width_m, far_m);
    bvh->widest_m = fmax(bvh->widest_m, width_m);
    widen(v, offset, width_m, wide);
    edge_lengths(wide, length);
    if (float_error_m(bvh, far_m, length) > width_m) { /* very small or thin: two sides make at most twice the third */
        const double worst[3] = {longest, longest, longest};
        width_m = 1.01 * float_error_m(bvh, far_m, worst);
        offset = offset_m(v, unit, width_m, far_m);
        widen(v, offset, width_m, wide);
        edge_lengths(wide, length);
    }
    const int sharp = replace_sharp(bvh, v, unit, width_m, offset, far_m, wide);
    set_vertices(wide, vertex);
    double area2_wide = measure(wide, wide_n, &longest);
    double border = sharp ? (double)INFINITY : guard(bvh, offset, width_m, longest, area2_wide, area2);
    set_exact(tri, v, border, bvh->scene->label[prim]);
}

int bvh_fill(struct bvh *bvh, RTCGeometry geometry, const struct sh_report *report, struct sh_err *err)
{
    const struct scene *scene = bvh->scene;
    size_t n = scene->n_triangles;
    bvh->triangle = huge_alloc((n + 1) * sizeof *bvh->triangle);
    float *vertex =
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), 3 * n);
    uint32_t *index =
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(uint32_t), n);
    if (bvh->triangle == NULL || vertex == NULL || index == NULL)
        return sh_fail(err, SH_ENOMEM, "cast: no memory for %zu triangles", n);
    for (uint32_t i = 0; i < n; i++) {
        if ((i & 0xffff) == 0 && sh_check_stop(report, err) != SH_OK) return SH_ESTOPPED;
        fill_triangle(bvh, i, vertex + 9 * (size_t)i);
    }
    for (uint32_t i = 0; i < 3 * n; i++)
        index[i] = i;
    for (uint32_t i = 0; i < n && scene->cutout != NULL; i++)
        if (scene_cutout(scene, i) != NULL) mark_holes(bvh, i);
    bvh->triangle[n] = (struct bvh_plane){
        .n = {NAN, with_spare(NAN, BVH_NO_LABEL & 0xfff), with_spare(NAN, BVH_NO_LABEL >> BVH_SPARE_BITS)}, .d = NAN};
    return bvh_drop_twins(bvh, vertex, report, err);
}
