/* SPDX-License-Identifier: MIT */
/* A packet at a leaf: finds which rays hit its triangles, and at what range. Single precision says where that is
 * certain, else double. The rules are in bvh_inside.h. */
#include "core/bvh/meet.h"

#include <math.h>

#include "core/bvh/bvh_inside.h"
#include "core/bvh/edges.h"
#include "core/bvh/leaves.h"
#include "core/bvh/nearest.h"
#include "core/bvh/packet.h"
#include "core/vec3.h"
#include "core/vecmath.h"

/* A leaf's edges, from one corner to another: three of triangle 0, then two of triangle 1. The third edge of triangle 1
 * is the second of triangle 0 in the other direction. */
enum { EDGES = 5 };
static const uint8_t edge_from[EDGES] = {0, 1, 2, 1, 3}, edge_to[EDGES] = {1, 2, 0, 3, 2};

/* An edge's side is (p x (q - p)) . d. L is the leaf's size: no edge is longer, and no corner is further from the
 * leaf's base. F is the distance of that base from the ray's origin, plus L. In single precision the side's error is at
 * most 15 units of 2^-24 of F L: the base from the ray's origin, rounded, 1; the corner, rounded and added to it, 2;
 * the edge 3; the cross product 3; the direction 1; the dot product 5. |p| itself is no measure, since it may be far
 * smaller than its summands. Where rays begin at points o of their own, p counts from one of these, c. Then the side is
 * (p x (q - p)) . d + (q - p) . ((o - c) x d). The second term rounds like the first, with |o - c| for F; the sum adds
 * 1. The doubt of double precision (edges.h) is far less than the rest of the bound. */
#define SIDE_DOUBT (24.0F * 0x1p-24F)
/* Where a plane is seen at a smaller sine, the range comes from the edges. */
#define FLAT 1e-6

/* How a ray passes a triangle of the leaf, as bits; those of triangle 1 are shifted by two. */
enum { INSIDE = 1, DOUBT = 2, SECOND = 2, EITHER = INSIDE | DOUBT };

/* Lanes of a packet that Embree asks for, a byte each. */
struct lanes {
    uint8_t of[BVH_PACKET];
};

static int any(const struct lanes *lanes, uint8_t bits)
{
    uint64_t half[2];
    memcpy(half, lanes->of, sizeof half);
    return ((half[0] | half[1]) & UINT64_C(0x0101010101010101) * bits) != 0;
}

/* Judges by the sides of a triangle's edges: inside where all certainly have one sign, outside where two have
 * different ones. */
VEC_INLINE int32_t judge(float a, float b, float c, float doubt)
{
    const float ab_lo = a < b ? a : b, ab_hi = a < b ? b : a, lo = ab_lo < c ? ab_lo : c, hi = ab_hi < c ? c : ab_hi;
    const int32_t in = (int32_t)(lo > doubt) | (int32_t)(hi < -doubt),
                  out = (int32_t)(hi > doubt) & (int32_t)(lo < -doubt);
    return in | (1 - (in | out)) << 1;
}

/* The figures of a leaf by which rays are judged: edges e, and their moments m = p x (q - p). All rays from one point
 * share them. */
struct edges {
    float m[EDGES][3], e[EDGES][3], doubt;
};

VEC_INLINE void find_edges(const struct bvh_query *query, const struct bvh_leaf *leaf, float size_m,
                           struct edges *edges)
{
    float base[3], p[3][4];
    for (int j = 0; j < 3; j++) {
        base[j] = (float)((double)leaf->base_m[j] - query->at_local[j]);
        for (int i = 0; i < 4; i++)
            p[j][i] = base[j] + leaf->corner_m[j][i];
    }
    for (int k = 0; k < EDGES; k++) {
        float *e = edges->e[k], *m = edges->m[k];
        const int from = edge_from[k], to = edge_to[k];
        for (int j = 0; j < 3; j++)
            e[j] = leaf->corner_m[j][to] - leaf->corner_m[j][from];
        m[0] = p[1][from] * e[2] - p[2][from] * e[1];
        m[1] = p[2][from] * e[0] - p[0][from] * e[2];
        m[2] = p[0][from] * e[1] - p[1][from] * e[0];
    }
    const float far_m = fabsf(base[0]) + fabsf(base[1]) + fabsf(base[2]) + size_m + (float)query->apart_m;
    edges->doubt = SIDE_DOUBT * 1.001F * far_m * size_m;
}

/* Judges the first `width` lanes of a packet; those without a ray may have any result. found: in, all bits of the rays
 * that Embree asks for; out, how each passes. */
VEC_INLINE void judge_packet(const struct bvh_query *query, const struct edges *edges, uint32_t width,
                             struct lanes *found)
{
    const float *dx = query->dir_float, *dy = dx + query->width, *dz = dy + query->width;
    const float(*m)[3] = edges->m, doubt = edges->doubt;
    int32_t wide[BVH_PACKET];
    VEC_LOOP
    for (uint32_t i = 0; i < width; i++) {
        const float x = dx[i], y = dy[i], z = dz[i];
        const float s0 = m[0][0] * x + m[0][1] * y + m[0][2] * z, s1 = m[1][0] * x + m[1][1] * y + m[1][2] * z,
                    s2 = m[2][0] * x + m[2][1] * y + m[2][2] * z, s3 = m[3][0] * x + m[3][1] * y + m[3][2] * z,
                    s4 = m[4][0] * x + m[4][1] * y + m[4][2] * z;
        wide[i] = judge(s0, s1, s2, doubt) | judge(s3, s4, -s1, doubt) << SECOND;
    }
    for (uint32_t i = 0; i < width; i++)
        found->of[i] &= (uint8_t)wide[i];
}

/* Judges a packet whose rays begin at points of their own. */
VEC_INLINE void judge_packet_own(const struct bvh_query *query, const struct edges *edges, uint32_t width,
                                 struct lanes *found)
{
    const float *dx = query->dir_float, *dy = dx + query->width, *dz = dy + query->width;
    const float *ux = query->turned[0], *uy = query->turned[1], *uz = query->turned[2];
    const float(*m)[3] = edges->m, (*e)[3] = edges->e, doubt = edges->doubt;
    int32_t wide[BVH_PACKET];
    VEC_LOOP
    for (uint32_t i = 0; i < width; i++) {
        const float x = dx[i], y = dy[i], z = dz[i], u = ux[i], v = uy[i], w = uz[i];
        const float s0 = (m[0][0] * x + m[0][1] * y + m[0][2] * z) + (e[0][0] * u + e[0][1] * v + e[0][2] * w),
                    s1 = (m[1][0] * x + m[1][1] * y + m[1][2] * z) + (e[1][0] * u + e[1][1] * v + e[1][2] * w),
                    s2 = (m[2][0] * x + m[2][1] * y + m[2][2] * z) + (e[2][0] * u + e[2][1] * v + e[2][2] * w),
                    s3 = (m[3][0] * x + m[3][1] * y + m[3][2] * z) + (e[3][0] * u + e[3][1] * v + e[3][2] * w),
                    s4 = (m[4][0] * x + m[4][1] * y + m[4][2] * z) + (e[4][0] * u + e[4][1] * v + e[4][2] * w);
        wide[i] = judge(s0, s1, s2, doubt) | judge(s3, s4, -s1, doubt) << SECOND;
    }
    for (uint32_t i = 0; i < width; i++)
        found->of[i] &= (uint8_t)wide[i];
}

/* ---- hits */

/* Whether the triangle has a hole where the ray is at that range. */
static int is_hole(const struct bvh_query *query, uint32_t lane, uint32_t triangle, double range_m)
{
    const struct scene *scene = query->bvh->scene;
    if (scene->cutout == NULL || scene_cutout(scene, triangle) == NULL) return 0;
    double v[3][3], p[3], uv[2];
    for (int j = 0; j < 3; j++)
        p[j] = range_m * query->dir[j][lane];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            v[i][j] = scene->vertex_m[scene->triangle[triangle][i]][j] -
                      (query->has_own ? query->org[j][lane] : query->at[j]);
    const double *const corner[3] = {v[0], v[1], v[2]};
    scene_uv_at(scene, triangle, corner, p, uv);
    return texture_is_hole(scene_cutout(scene, triangle), uv);
}

/* Notes a hit whose range is no further than the nearest, or counts as the same. */
VEC_INLINE void note(struct bvh_query *query, float *tfar, uint32_t lane, uint32_t triangle, double range_m)
{
    if (query->bvh->scene->cutout != NULL && is_hole(query, lane, triangle, range_m)) return;
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

/* Notes a triangle that the ray misses by no more than double precision resolves at its edges. Of several, the
 * nearest counts; of equally near ones, that with the lowest number. */
static void note_miss(struct bvh_query *query, uint32_t lane, uint32_t triangle, double range_m)
{
    if (!(range_m > query->at_origin_m) || range_m > query->near_m[lane]) return;
    if (range_m == query->near_m[lane] && triangle > query->near[lane]) return;
    if (is_hole(query, lane, triangle, range_m)) return;
    query->near_m[lane] = range_m;
    query->near[lane] = triangle;
}

/* Decides one ray and one triangle where single precision is in doubt whether they meet, or the plane's range is of no
 * use. */
static void try_one(struct bvh_query *query, float *tfar, uint32_t lane, const struct bvh_leaf *leaf, int which)
{
    const uint32_t triangle = bvh_leaf_triangle(leaf, which);
    const struct bvh_plane *plane = &leaf->plane[which];
    const struct scene *scene = query->bvh->scene;
    const uint32_t *corner = scene->triangle[triangle];
    double v[3][3], dir[3], o[3], side[3];
    for (int j = 0; j < 3; j++) {
        dir[j] = query->dir[j][lane];
        o[j] = query->has_own ? query->local[j][lane] : query->at_local[j];
        for (int i = 0; i < 3; i++)
            v[i][j] = scene->vertex_m[corner[i]][j] - (query->has_own ? query->org[j][lane] : query->at[j]);
    }
    int near = 0;
    for (int i = 0; i < 3; i++) {
        const double *a = v[i], *b = v[(i + 1) % 3];
        side[i] = edge_side(a, b, dir);
        near |= fabs(side[i]) <= 4.0 * blur(a, b);
    }
    query->decided += (uint64_t)near;
    const int met = is_inside(side);
    if (!met && !near) return;
    if (is_edge_on(v, side) || vec3_is_any_zero(v) || (!met && !is_near_miss(v, side, dir))) return;
    const double along = vec3_dot(plane->n, dir);
    double range_m = (plane->d - vec3_dot(plane->n, o)) / along;
    if (!(along * along > FLAT * FLAT * vec3_dot(plane->n, plane->n))) range_m = held_range(v, dir, range_m);
    const double nearest_m = query->range_m[lane];
    if (!met)
        note_miss(query, lane, triangle, range_m);
    else if (range_m > query->at_origin_m && range_m <= nearest_m + BVH_SAME * nearest_m)
        note(query, tfar, lane, triangle, range_m);
}

/* The fate of a ray that is inside of a triangle for certain. */
enum { BEHIND, NEARER, SAME, FLAT_SEEN };

/* Finds the ranges of one triangle's plane, and the fate of each ray. */
VEC_INLINE void find_ranges(const struct bvh_query *query, const struct bvh_plane *plane, double *range_m,
                            int64_t *becomes)
{
    const double *dx = query->dir[0], *dy = query->dir[1], *dz = query->dir[2], *o = query->at_local;
    const double *px = query->local[0], *py = query->local[1], *pz = query->local[2], *nearest_m = query->range_m;
    const double nx = plane->n[0], ny = plane->n[1], nz = plane->n[2], d = plane->d;
    const double least = FLAT * FLAT * vec3_dot(plane->n, plane->n), off = nx * o[0] + ny * o[1] + nz * o[2];
    const double begin_m = query->at_origin_m;
    const int own = query->has_own;
    VEC_LOOP
    for (uint32_t i = 0; i < BVH_PACKET; i++) {
        const double along = nx * dx[i] + ny * dy[i] + nz * dz[i];
        const double here = own ? nx * px[i] + ny * py[i] + nz * pz[i] : off, range = (d - here) / along;
        const double more = range + BVH_SAME * range, most = nearest_m[i] + BVH_SAME * nearest_m[i];
        const int64_t ahead = range > begin_m, nearer = more < nearest_m[i], as_near = range <= most;
        range_m[i] = range;
        becomes[i] = along * along > least ? (ahead & as_near) << (1 - nearer) : FLAT_SEEN;
    }
}

/* Takes the triangle as the hit of rays for which it is the nearest so far. */
VEC_INLINE void take_nearer(struct bvh_query *query, float *tfar, uint32_t triangle, const double *range_m,
                            const uint32_t *takes)
{
    float above[BVH_PACKET];
    VEC_LOOP
    for (uint32_t i = 0; i < BVH_PACKET; i++) {
        const int64_t take = takes[i];
        query->range_m[i] = take ? range_m[i] : query->range_m[i];
        query->hit_m[i] = take ? range_m[i] : query->hit_m[i];
        above[i] = tfar_of(range_m[i], query->start_m[i]);
    }
    VEC_LOOP
    for (uint32_t i = 0; i < BVH_PACKET; i++)
        query->triangle[i] = takes[i] ? triangle : query->triangle[i];
    if (query->width == BVH_PACKET)
        for (uint32_t i = 0; i < BVH_PACKET; i++)
            tfar[i] = takes[i] ? above[i] : tfar[i];
    else
        for (uint32_t i = 0; i < query->width; i++)
            tfar[i] = takes[i] ? above[i] : tfar[i];
}

VEC_INLINE void meet_triangle(struct bvh_query *query, float *tfar, const struct bvh_leaf *leaf, int which,
                              const struct lanes *found)
{
    const int shift = which * SECOND, may_pass = query->bvh->scene->cutout != NULL;
    const uint32_t triangle = bvh_leaf_triangle(leaf, which);
    double range_m[BVH_PACKET];
    int64_t becomes[BVH_PACKET];
    uint32_t takes[BVH_PACKET], others = 0;
    if (any(found, (uint8_t)(INSIDE << shift))) {
        find_ranges(query, &leaf->plane[which], range_m, becomes);
        for (uint32_t i = 0; i < BVH_PACKET; i++) {
            const uint32_t in = (uint32_t)found->of[i] >> shift & INSIDE;
            takes[i] = in & (becomes[i] == NEARER) & !may_pass;
            others |= in & (becomes[i] != BEHIND) & !takes[i];
        }
        take_nearer(query, tfar, triangle, range_m, takes);
    }
    if (others == 0 && !any(found, (uint8_t)(DOUBT << shift))) return;
    for (uint32_t i = 0; i < BVH_PACKET; i++) {
        const unsigned it = (unsigned)found->of[i] >> shift & EITHER;
        if (it == DOUBT || (it == INSIDE && becomes[i] == FLAT_SEEN))
            try_one(query, tfar + i, i, leaf, which);
        else if (it == INSIDE && !takes[i] && becomes[i] != BEHIND)
            note(query, tfar + i, i, triangle, range_m[i]);
    }
}

VEC_CLONES
static void meet(struct bvh_query *query, float *tfar, const struct bvh_leaf *leaf, struct lanes *found)
{
    const uint32_t rest = bvh_leaf_rest(leaf);
    struct edges edges;
    query->leaves++;
    find_edges(query, leaf, bvh_leaf_size_m(rest), &edges);
    if (query->has_own)
        judge_packet_own(query, &edges, BVH_PACKET, found);
    else if (query->width == BVH_PACKET)
        judge_packet(query, &edges, BVH_PACKET, found);
    else
        judge_packet(query, &edges, BVH_PACKET / 2, found);
    if (any(found, EITHER)) meet_triangle(query, tfar, leaf, 0, found);
    if (bvh_leaf_ahead(rest) != 0 && any(found, EITHER << SECOND)) meet_triangle(query, tfar, leaf, 1, found);
}

/* Rays that meet a leaf mostly meet the leaves next to it. So this many more are fetched into the cache, since waiting
 * for them costs most. A fetch after the last leaf does nothing. */
enum { AHEAD = 5 };

void bvh_meet_leaf(const struct RTCIntersectFunctionNArguments *args)
{
    struct bvh_query *query = (struct bvh_query *)(void *)args->context;
    const struct bvh_leaf *leaf = &query->bvh->leaf[args->primID];
    struct lanes found = {{0}};
    for (int i = 0; i <= AHEAD; i++) {
        __builtin_prefetch(&leaf[i]);
        __builtin_prefetch(leaf[i].plane);
    }
    if (args->N == BVH_PACKET)
        for (uint32_t i = 0; i < BVH_PACKET; i++)
            found.of[i] = args->valid[i] != 0 ? 0xff : 0;
    else
        for (uint32_t i = 0; i < args->N; i++)
            found.of[i] = args->valid[i] != 0 ? 0xff : 0;
    meet(query, bvh_field(args->rayhit, args->N, tfar), leaf, &found);
}
