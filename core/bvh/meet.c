/* SPDX-License-Identifier: MIT */
/* A packet at a leaf: finds which of its rays hit the leaf's triangles, and at what range. Where single precision is
 * certain, it decides which rays hit; elsewhere double decides. Ranges are computed in double. */
#include "core/bvh/meet.h"

#include "core/bvh/nearest.h"

/* Packets here have up to eight rays; those of 16 are in meet_wide.c. */
enum { LANES = 8 };

/* How a ray passes a triangle of the leaf, as bits; those of triangle 1 are shifted by two. */
enum { INSIDE = 1, DOUBT = 2, SECOND = 2, EITHER = INSIDE | DOUBT };

/* Lanes of a packet that Embree asks for, a byte each. */
struct lanes {
    uint8_t of[LANES];
};

static int any(const struct lanes *lanes, uint8_t bits)
{
    uint64_t all;
    memcpy(&all, lanes->of, sizeof all);
    return (all & UINT64_C(0x0101010101010101) * bits) != 0;
}

/* Judges a ray by a, b and c, which say on which side of each of the triangle's edges it passes. The ray is inside
 * where all three certainly have the same sign, and outside where two certainly have different ones. */
VEC_INLINE int32_t judge(float a, float b, float c, float doubt)
{
    const float ab_lo = a < b ? a : b, ab_hi = a < b ? b : a, lo = ab_lo < c ? ab_lo : c, hi = ab_hi < c ? c : ab_hi;
    const int32_t in = (int32_t)(lo > doubt) | (int32_t)(hi < -doubt),
                  out = (int32_t)(hi > doubt) & (int32_t)(lo < -doubt);
    return in | (1 - (in | out)) << 1;
}

/* Judges all lanes of a packet; those without a ray may have any result. own: rays begin at points of their own. both:
 * with the second term of each side. asked: all bits of the rays that Embree asks for. found: how each passes. */
VEC_INLINE void judge_packet(const struct bvh_query *query, const struct bvh_edges *edges, int own, int both,
                             const struct lanes *asked, struct lanes *found)
{
    const float *dx = query->dir_float, *dy = dx + query->width, *dz = dy + query->width;
    const float *ux = query->turned[0], *uy = query->turned[1], *uz = query->turned[2];
    const float(*m)[8] = edges->m, (*e)[8] = edges->e, *apart_m = query->apart_m;
    const float more_doubt = edges->size_m * (both ? BVH_BOTH_DOUBT : BVH_FIRST_DOUBT);
    int32_t wide[LANES];
    VEC_LOOP
    for (uint32_t i = 0; i < LANES; i++) {
        const float doubt = own ? edges->doubt + more_doubt * apart_m[i] : edges->doubt;
        float s[BVH_EDGES], more[BVH_EDGES];
        for (int k = 0; k < BVH_EDGES; k++) {
            s[k] = m[0][k] * dx[i] + m[1][k] * dy[i] + m[2][k] * dz[i];
            if (both && k != 2 && k != 4) more[k] = e[0][k] * ux[i] + e[1][k] * uy[i] + e[2][k] * uz[i];
        }
        if (both) {
            s[0] += more[0];
            s[1] += more[1];
            s[2] -= more[0] + more[1];
            s[3] += more[3];
            s[4] += more[1] - more[3];
        }
        wide[i] = judge(s[0], s[1], s[2], doubt) | judge(s[3], s[4], -s[1], doubt) << SECOND;
    }
    for (uint32_t i = 0; i < LANES; i++)
        found->of[i] = asked->of[i] & (uint8_t)wide[i];
}

/* The fate of a ray that is inside of a triangle for certain. */
enum { BEHIND, NEARER, SAME };

/* Finds the ranges of one triangle's plane, and the fate of each ray. */
VEC_INLINE void find_ranges(const struct bvh_query *query, const struct bvh_plane *plane, double *range_m,
                            int64_t *becomes)
{
    const double *dx = query->dir[0], *dy = query->dir[1], *dz = query->dir[2], *o = query->at_local;
    const double *px = query->local[0], *py = query->local[1], *pz = query->local[2], *nearest_m = query->range_m;
    const double nx = plane->n[0], ny = plane->n[1], nz = plane->n[2], d = plane->d;
    const double off = nx * o[0] + ny * o[1] + nz * o[2];
    const double begin_m = query->at_origin_m;
    const int own = query->has_own;
    VEC_LOOP
    for (uint32_t i = 0; i < LANES; i++) {
        const double along = nx * dx[i] + ny * dy[i] + nz * dz[i];
        const double here = own ? nx * px[i] + ny * py[i] + nz * pz[i] : off, range = (d - here) / along;
        const double more = range + BVH_SAME * range, most = nearest_m[i] + BVH_SAME * nearest_m[i];
        const int64_t ahead = range > begin_m, nearer = more < nearest_m[i], as_near = range <= most;
        range_m[i] = range;
        becomes[i] = (ahead & as_near) << (1 - nearer);
    }
}

/* Takes the triangle as the hit of rays for which it is the nearest so far. */
VEC_INLINE void take_nearer(struct bvh_query *query, float *tfar, uint32_t triangle, const double *range_m,
                            const uint32_t *takes)
{
    float above[LANES];
    VEC_LOOP
    for (uint32_t i = 0; i < LANES; i++) {
        const int64_t take = takes[i];
        query->range_m[i] = take ? range_m[i] : query->range_m[i];
        query->hit_m[i] = take ? range_m[i] : query->hit_m[i];
        above[i] = tfar_of(range_m[i], query->start_m[i]);
    }
    VEC_LOOP
    for (uint32_t i = 0; i < LANES; i++)
        query->triangle[i] = takes[i] ? triangle : query->triangle[i];
    for (uint32_t i = 0; i < query->width; i++)
        tfar[i] = takes[i] ? above[i] : tfar[i];
}

VEC_INLINE void meet_triangle(struct bvh_query *query, float *tfar, const struct bvh_leaf *leaf, int which,
                              const struct lanes *found)
{
    const int shift = which * SECOND, may_pass = query->may_pass;
    const uint32_t triangle = bvh_leaf_triangle(leaf, which);
    double range_m[LANES];
    int64_t becomes[LANES];
    uint32_t takes[LANES], others = 0;
    if (any(found, (uint8_t)(INSIDE << shift))) {
        find_ranges(query, &leaf->plane[which], range_m, becomes);
        for (uint32_t i = 0; i < LANES; i++) {
            const uint32_t in = (uint32_t)found->of[i] >> shift & INSIDE;
            takes[i] = in & (becomes[i] == NEARER) & !may_pass;
            others |= in & (becomes[i] != BEHIND) & !takes[i];
        }
        take_nearer(query, tfar, triangle, range_m, takes);
    }
    if (others == 0 && !any(found, (uint8_t)(DOUBT << shift))) return;
    for (uint32_t i = 0; i < LANES; i++) {
        const unsigned it = (unsigned)found->of[i] >> shift & EITHER;
        if (it == DOUBT)
            bvh_try_one(query, tfar + i, i, leaf, which);
        else if (it == INSIDE && !takes[i] && becomes[i] != BEHIND)
            bvh_note_hit(query, tfar + i, i, triangle, range_m[i]);
    }
}

/* Judges a packet whose rays begin at points of their own, with the second term of each side where it may matter. */
VEC_INLINE void judge_own(struct bvh_query *query, const struct bvh_edges *edges, const struct lanes *asked,
                          struct lanes *found)
{
    if (!query->is_turned) {
        judge_packet(query, edges, 1, 0, asked, found);
        if (!any(found, DOUBT | DOUBT << SECOND)) return;
        bvh_turn_origins(query);
    }
    judge_packet(query, edges, 1, 1, asked, found);
}

VEC_CLONES
static void meet(struct bvh_query *query, float *tfar, const struct bvh_leaf *leaf, const struct lanes *asked)
{
    struct bvh_edges edges;
    struct lanes found;
    query->counters.leaves++;
    bvh_find_edges(query, leaf, &edges);
    if (query->has_own)
        judge_own(query, &edges, asked, &found);
    else
        judge_packet(query, &edges, 0, 0, asked, &found);
    if (any(&found, EITHER)) meet_triangle(query, tfar, leaf, 0, &found);
    if (bvh_leaf_ahead(bvh_leaf_rest(leaf)) != 0 && any(&found, EITHER << SECOND))
        meet_triangle(query, tfar, leaf, 1, &found);
}

/* Rays that meet a leaf mostly meet the leaves next to it. So this many more are fetched into the cache, since waiting
 * for them costs most. A fetch after the last leaf does nothing. */
enum { AHEAD = 5 };

void bvh_meet_leaf(const struct RTCIntersectFunctionNArguments *args)
{
    struct bvh_query *query = (struct bvh_query *)(void *)args->context;
    const struct bvh_leaf *leaf = &query->first_leaf[args->primID];
    float *tfar = bvh_field(args->rayhit, args->N, tfar);
    struct lanes asked = {{0}};
    for (int i = 0; i <= AHEAD; i++) {
        __builtin_prefetch(&leaf[i]);
        __builtin_prefetch(leaf[i].plane);
    }
    if (args->N == BVH_PACKET) {
        bvh_meet_wide(query, tfar, leaf, args->valid);
        return;
    }
    for (uint32_t i = 0; i < LANES && i < args->N; i++)
        asked.of[i] = args->valid[i] != 0 ? 0xff : 0;
    meet(query, tfar, leaf, &asked);
}
