/* SPDX-License-Identifier: MIT */
/* Decides rays among a few triangles, by the rules of sight_inside.h: four rays of a list at a time. */
#include <math.h>
#include <string.h>

#include "core/sight/hits_inside.h"
#include "core/sight/quad.h"

enum { LANES = QUAD_LANES };

/* Results of rays against the records of a list, lane by lane. */
struct looks {
    quad x, y, z;
    quad q[SIGHT_MAX_LIST];                             /* of the records: 1 / range */
    quad_mask met[SIGHT_MAX_LIST], may[SIGHT_MAX_LIST]; /* the ray passes inside for certain; may do so */
    quad first_q;
    quad_mask first, any; /* the record that comes first; something may be hit */
    quad_mask open, asks; /* the ray is not decided; nor can decide_tie decide it */
};

/* Finds for each record on which side of its edges the rays pass, and where they hit its plane. Then it finds the
 * first of the triangles that are certainly hit. Another one may come before that, where it is or may be hit and its
 * plane is not certainly behind. */
VEC_INLINE void look_at(const struct sight *s, const uint32_t *list, struct looks *w)
{
    const quad x = w->x, y = w->y, z = w->z;
    quad first_q = {0.0, 0.0, 0.0, 0.0}, slack = first_q;
    quad_mask first = {-1, -1, -1, -1}, any = {0, 0, 0, 0}, asks = any, open = any;
    const uint32_t n = list[0];
    for (uint32_t k = 0; k < n; k++) {
        const struct sight_record *r = &s->record[list[1 + k]];
        const quad a = r->edge[0][0] * x + r->edge[0][1] * y + r->edge[0][2] * z;
        const quad b = r->edge[1][0] * x + r->edge[1][1] * y + r->edge[1][2] * z;
        const quad c = r->edge[2][0] * x + r->edge[2][1] * y + r->edge[2][2] * z;
        const quad q = r->plane[0] * x + r->plane[1] * y + r->plane[2] * z;
        const quad_mask may = ~((quad_mask)(a <= -1.0) | (quad_mask)(b <= -1.0) | (quad_mask)(c <= -1.0));
        const quad_mask sure = (quad_mask)(q >= r->graze) & (quad_mask)(q <= SIGHT_NEAR);
        const quad_mask met = (quad_mask)(a >= 1.0) & (quad_mask)(b >= 1.0) & (quad_mask)(c >= 1.0);
        const quad_mask better = met & (quad_mask)(q > first_q);
        const quad its_slack = {r->slack, r->slack, r->slack, r->slack};
        const quad_mask number = {k, k, k, k};
        w->met[k] = met;
        w->may[k] = may;
        w->q[k] = q;
        any |= may;
        asks |= may & ~sure;
        first = (number & better) | (first & ~better);
        quad_choose(&better, &q, &first_q);
        quad_choose(&better, &its_slack, &slack);
    }
    for (uint32_t k = 0; k < n; k++) {
        const struct sight_record *r = &s->record[list[1 + k]];
        const quad_mask number = {k, k, k, k};
        const quad_mask behind = (quad_mask)(first_q - w->q[k] > slack + r->slack + SIGHT_SAME * first_q);
        open |= ~behind & w->may[k] & (quad_mask)(number != first);
    }
    w->first_q = first_q;
    w->first = first;
    w->any = any;
    w->asks = asks;
    w->open = open | asks | (any & (first >> 63));
}

/* Decides rays that hit several planes at the same place, all within the borders: by the rule of core/bvh, and
 * by its ranges. */
static uint32_t decide_tie(const struct sight *s, const struct bvh_rays *rays, const uint32_t *list,
                           const struct looks *w, int i)
{
    const double dir[3] = {w->x[i], w->y[i], w->z[i]};
    const struct sight_record *first = &s->record[list[1 + w->first[i]]];
    double range_m[SIGHT_MAX_LIST], first_m = INFINITY;
    uint32_t lowest = FEW_OPEN;
    for (uint32_t k = 0; k < list[0]; k++) {
        const struct sight_record *r = &s->record[list[1 + k]];
        const double q = w->q[k][i];
        range_m[k] = INFINITY;
        if (!w->may[k][i]) continue;
        if (w->first_q[i] - q > first->slack + r->slack + SIGHT_SAME * w->first_q[i]) continue;
        if (!w->met[k][i]) return FEW_OPEN;
        range_m[k] = bvh_range_of(s->bvh, r->triangle, rays->from.at_m, dir);
        first_m = fmin(first_m, range_m[k]);
    }
    for (uint32_t k = 0; k < list[0]; k++)
        if (range_m[k] <= first_m + 1e-12 * first_m && s->record[list[1 + k]].triangle < lowest)
            lowest = s->record[list[1 + k]].triangle;
    return lowest;
}

static uint32_t of_lane(const struct sight *s, const struct bvh_rays *rays, const uint32_t *list, const struct looks *w,
                        int i)
{
    if (!w->any[i]) return BVH_NO_TRIANGLE;
    if (!w->open[i]) return s->record[list[1 + w->first[i]]].triangle;
    return w->first[i] >= 0 && !w->asks[i] ? decide_tie(s, rays, list, w, i) : (uint32_t)FEW_OPEN;
}

VEC_INLINE void take(struct looks *w, const struct vec3_in *dir, uint32_t at, uint32_t n)
{
    double d[3][LANES];
    if (n >= LANES) {
        memcpy(&w->x, dir->x + at, sizeof w->x);
        memcpy(&w->y, dir->y + at, sizeof w->y);
        memcpy(&w->z, dir->z + at, sizeof w->z);
        return;
    }
    for (uint32_t i = 0; i < LANES; i++) {
        const uint32_t from = at + (i < n ? i : 0);
        d[0][i] = dir->x[from];
        d[1][i] = dir->y[from];
        d[2][i] = dir->z[from];
    }
    memcpy(&w->x, d[0], sizeof w->x);
    memcpy(&w->y, d[1], sizeof w->y);
    memcpy(&w->z, d[2], sizeof w->z);
}

VEC_CLONES
int candidate_list_decide(const struct sight *s, const struct bvh_rays *rays, const uint32_t *list, uint32_t from,
                          uint32_t to, uint32_t *triangle)
{
    struct looks w;
    uint32_t open = 0;
    for (uint32_t at = from; at < to; at += LANES) {
        const uint32_t n = to - at < LANES ? to - at : LANES;
        take(&w, &rays->dir, at, rays->n - at);
        look_at(s, list, &w);
        for (uint32_t i = 0; i < n; i++) {
            const uint32_t it = of_lane(s, rays, list, &w, (int)i);
            triangle[at - from + i] = it;
            open |= it == FEW_OPEN;
        }
    }
    return open != 0;
}
