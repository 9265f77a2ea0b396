/* SPDX-License-Identifier: MIT */
/* Tests a packet of 16 rays against a leaf, with AVX-512. The hits are those of meet.c; the rays are bits of masks.
 * The loops of meet.c, as compilers translate them, would take 1.4 times as long. */
#include "core/bvh/meet.h"

#if defined(__x86_64__) && !defined(VEC_ONE) /* measuring one instruction set: core/vecmath.h */
#include <immintrin.h>

#define WIDE __attribute__((target("avx512f,avx512vl"), always_inline)) static inline

/* Rays of a packet, a bit each: those that are inside of a triangle for certain, and those for which this is in
 * doubt. */
struct judged {
    unsigned in, doubt;
};

/* Judges the rays in `valid` by a, b and c, which say on which side of each of the triangle's edges they pass. With
 * `same` greater than the doubt, all three certainly have the same sign: the ray is inside. With -same greater than the
 * doubt, two certainly have different signs: it is outside. */
WIDE struct judged judge(__m512 a, __m512 b, __m512 c, __m512 doubt, unsigned valid)
{
    const __m512 zero = _mm512_setzero_ps(), least = _mm512_min_ps(_mm512_min_ps(a, b), c),
                 most = _mm512_max_ps(_mm512_max_ps(a, b), c), same = _mm512_max_ps(least, _mm512_sub_ps(zero, most));
    const unsigned in = _mm512_cmp_ps_mask(same, doubt, _CMP_GT_OQ),
                   out = _mm512_cmp_ps_mask(same, _mm512_sub_ps(zero, doubt), _CMP_LT_OQ);
    return (struct judged){in & valid, ~(in | out) & valid};
}

WIDE __m512 dot(float x, float y, float z, const __m512 v[3])
{
    const __m512 xy = _mm512_add_ps(_mm512_mul_ps(_mm512_set1_ps(x), v[0]), _mm512_mul_ps(_mm512_set1_ps(y), v[1]));
    return _mm512_add_ps(xy, _mm512_mul_ps(_mm512_set1_ps(z), v[2]));
}

WIDE __m512d dot_8(const double n[3], const double *const v[3], int at)
{
    const __m512d xy = _mm512_add_pd(_mm512_mul_pd(_mm512_set1_pd(n[0]), _mm512_loadu_pd(v[0] + at)),
                                     _mm512_mul_pd(_mm512_set1_pd(n[1]), _mm512_loadu_pd(v[1] + at)));
    return _mm512_add_pd(xy, _mm512_mul_pd(_mm512_set1_pd(n[2]), _mm512_loadu_pd(v[2] + at)));
}

WIDE __m512d and_same(__m512d range_m)
{
    return _mm512_add_pd(range_m, _mm512_mul_pd(_mm512_set1_pd(BVH_SAME), range_m));
}

/* tfar_of (nearest.h) of eight rays. */
WIDE __m256 tfar_of_8(__m512d range_m, __m512d start_m)
{
    const __m512d x = _mm512_sub_pd(and_same(range_m), start_m);
    const __m256 f = _mm512_cvtpd_ps(x);
    const __mmask8 up = _mm512_cmp_pd_mask(_mm512_cvtps_pd(f), x, _CMP_LE_OQ);
    const __m256i bits = _mm256_castps_si256(f);
    return _mm256_castsi256_ps(_mm256_mask_add_epi32(bits, up, bits, _mm256_set1_epi32(1)));
}

/* The plane of a triangle for a packet. */
struct plane {
    const struct bvh_plane *of;
    double off;
    uint32_t triangle;
};

/* Takes the triangle as the hit of those rays for which it is clearly the nearest so far, among the eight from `at` on.
 * `in` has the rays that are inside of it for certain. Returns the rays that bvh_note_hit has to decide: for them the
 * triangle is as near as another one. With may_pass the triangle may have holes, so no ray is decided here. */
WIDE __mmask8 take_8(struct bvh_query *query, float *tfar, const struct plane *p, int at, __mmask8 in,
                     double range_m[8], int own)
{
    const __m512d along = dot_8(p->of->n, query->dir, at);
    const __m512d here = own ? dot_8(p->of->n, query->local, at) : _mm512_set1_pd(p->off);
    const __m512d range = _mm512_div_pd(_mm512_sub_pd(_mm512_set1_pd(p->of->d), here), along);
    const __m512d nearest = _mm512_loadu_pd(query->range_m + at);
    const __mmask8 ahead = _mm512_cmp_pd_mask(range, _mm512_set1_pd(query->at_origin_m), _CMP_GT_OQ),
                   as_near = _mm512_cmp_pd_mask(range, and_same(nearest), _CMP_LE_OQ),
                   nearer = _mm512_cmp_pd_mask(and_same(range), nearest, _CMP_LT_OQ);
    const __mmask8 counts = in & ahead & as_near, takes = query->may_pass ? 0 : counts & nearer;
    _mm512_mask_storeu_pd(query->range_m + at, takes, range);
    _mm512_mask_storeu_pd(query->hit_m + at, takes, range);
    _mm256_mask_storeu_epi32(query->triangle + at, takes, _mm256_set1_epi32((int)p->triangle));
    _mm256_mask_storeu_ps(tfar + at, takes, tfar_of_8(range, _mm512_loadu_pd(query->start_m + at)));
    _mm512_storeu_pd(range_m, range);
    return counts & (__mmask8)~takes;
}

/* Decides rays one by one. The rays in `doubt` may hit the triangle or miss it. The rays in `others` hit it, but
 * another triangle may be as near. */
static __attribute__((noinline)) void look_closer(struct bvh_query *query, float *tfar, const struct bvh_leaf *leaf,
                                                  int which, unsigned others, unsigned doubt, const double *range_m)
{
    for (others |= doubt; others != 0; others &= others - 1) {
        const uint32_t lane = (uint32_t)__builtin_ctz(others);
        if ((doubt >> lane & 1) != 0)
            bvh_try_one(query, tfar + lane, lane, leaf, which);
        else
            bvh_note_hit(query, tfar + lane, lane, bvh_leaf_triangle(leaf, which), range_m[lane]);
    }
}

WIDE void meet_triangle(struct bvh_query *query, float *tfar, const struct bvh_leaf *leaf, int which,
                        struct judged judged, int own)
{
    const double *n = leaf->plane[which].n, *o = query->at_local;
    const struct plane plane = {.of = &leaf->plane[which],
                                .off = n[0] * o[0] + n[1] * o[1] + n[2] * o[2],
                                .triangle = bvh_leaf_triangle(leaf, which)};
    double range_m[BVH_PACKET];
    unsigned others = 0;
    for (int at = 0; at < BVH_PACKET; at += 8) {
        const __mmask8 in = (__mmask8)(judged.in >> at);
        if (in != 0) others |= (unsigned)take_8(query, tfar, &plane, at, in, range_m + at, own) << at;
    }
    if ((others | judged.doubt) != 0) look_closer(query, tfar, leaf, which, others, judged.doubt, range_m);
}

/* Rays that begin at points of their own: adds the second term of each edge's side (meet.h). */
WIDE void add_own(const struct bvh_query *query, const struct bvh_edges *edges, __m512 side[BVH_EDGES])
{
    __m512 turned[3], more[BVH_EDGES];
    for (int j = 0; j < 3; j++)
        turned[j] = _mm512_loadu_ps(query->turned[j]);
    for (int k = 0; k < 4; k++)
        if (k != 2) more[k] = dot(edges->e[0][k], edges->e[1][k], edges->e[2][k], turned);
    side[0] = _mm512_add_ps(side[0], more[0]);
    side[1] = _mm512_add_ps(side[1], more[1]);
    side[2] = _mm512_sub_ps(side[2], _mm512_add_ps(more[0], more[1]));
    side[3] = _mm512_add_ps(side[3], more[3]);
    side[4] = _mm512_add_ps(side[4], _mm512_sub_ps(more[1], more[3]));
}

/* Judges the rays in `valid` by the sides of both triangles' edges. */
WIDE void judge_both(const __m512 side[BVH_EDGES], __m512 doubt, unsigned valid, struct judged judged[2])
{
    const __m512 reversed = _mm512_sub_ps(_mm512_setzero_ps(), side[1]);
    judged[0] = judge(side[0], side[1], side[2], doubt, valid);
    judged[1] = judge(side[3], side[4], reversed, doubt, valid);
}

/* Returns the doubt of rays from points of their own. more: BVH_FIRST_DOUBT or BVH_BOTH_DOUBT. */
WIDE __m512 own_doubt(const struct bvh_query *query, const struct bvh_edges *edges, float more)
{
    const __m512 more_m = _mm512_mul_ps(_mm512_set1_ps(more * edges->size_m), _mm512_loadu_ps(query->apart_m));
    return _mm512_add_ps(_mm512_set1_ps(edges->doubt), more_m);
}

/* Judges rays that begin at points of their own, with the second term of each side where it may matter. */
WIDE void judge_own(struct bvh_query *query, const struct bvh_edges *edges, __m512 side[BVH_EDGES], unsigned valid,
                    struct judged judged[2])
{
    if (!query->is_turned) {
        judge_both(side, own_doubt(query, edges, BVH_FIRST_DOUBT), valid, judged);
        if ((judged[0].doubt | judged[1].doubt) == 0) return;
        bvh_turn_origins(query);
    }
    add_own(query, edges, side);
    judge_both(side, own_doubt(query, edges, BVH_BOTH_DOUBT), valid, judged);
}

WIDE void meet(struct bvh_query *query, float *tfar, const struct bvh_leaf *leaf, const int *valid, int own)
{
    const __m512i asked = _mm512_loadu_si512(valid);
    const unsigned all = _mm512_test_epi32_mask(asked, asked);
    struct bvh_edges edges;
    struct judged judged[2];
    __m512 dir[3], side[BVH_EDGES];
    bvh_find_edges(query, leaf, &edges);
    /* Each number of the edges fills a vector. Loads from memory cost less for this than shuffles. The next line makes
     * the compiler use loads. */
    __asm__ volatile("" ::: "memory");
    for (int j = 0; j < 3; j++)
        dir[j] = _mm512_loadu_ps(query->dir_float + j * BVH_PACKET);
    for (int k = 0; k < BVH_EDGES; k++)
        side[k] = dot(edges.m[0][k], edges.m[1][k], edges.m[2][k], dir);
    if (own)
        judge_own(query, &edges, side, all, judged);
    else
        judge_both(side, _mm512_set1_ps(edges.doubt), all, judged);
    if ((judged[0].in | judged[0].doubt) != 0) meet_triangle(query, tfar, leaf, 0, judged[0], own);
    if ((judged[1].in | judged[1].doubt) != 0 && bvh_leaf_ahead(bvh_leaf_rest(leaf)) != 0)
        meet_triangle(query, tfar, leaf, 1, judged[1], own);
}

__attribute__((target("avx512f,avx512vl"))) void bvh_meet_wide(struct bvh_query *query, float *tfar,
                                                               const struct bvh_leaf *leaf, const int *valid)
{
    query->counters.leaves++;
    if (query->has_own)
        meet(query, tfar, leaf, valid, 1);
    else
        meet(query, tfar, leaf, valid, 0);
}

int bvh_has_wide(void)
{
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl");
}

#else

int bvh_has_wide(void)
{
    return 0;
}

void bvh_meet_wide(struct bvh_query *query, float *tfar, const struct bvh_leaf *leaf, const int *valid)
{
    (void)query;
    (void)tfar;
    (void)leaf;
    (void)valid;
}

#endif
