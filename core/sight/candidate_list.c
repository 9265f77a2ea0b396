/* SPDX-License-Identifier: MIT */
/* Decides rays among a few triangles, by the rules of sight_inside.h: four rays of a list at a time. */
#include <string.h>

#include "core/sight/hits_inside.h"
#include "core/sight/quad.h"

enum { LANES = QUAD_LANES };

/* Four rays, and what the records of a list say of them. */
struct looks {
    quad x, y, z;
    quad_mask first; /* the record that comes first; negative: none is certainly hit */
    quad_mask any;   /* something may be hit */
    quad_mask open;  /* the records can't decide */
};

/* Finds for each record on which side of its edges the rays pass, and where they hit its plane. Then the function finds
 * the nearest of the triangles that are certainly hit. If a ray hits or may hit another triangle, and that triangle's
 * plane is not certainly behind, the ray is left to the BVH. Rays at planes that coincide are left to the BVH, too: to
 * compare their ranges here takes longer. */
VEC_INLINE void look_at(const struct sight *s, const uint32_t *list, struct looks *w)
{
    const quad x = w->x, y = w->y, z = w->z;
    quad first_q = {0.0, 0.0, 0.0, 0.0}, slack = first_q, its_q[SIGHT_MAX_LIST];
    quad_mask first = {-1, -1, -1, -1}, any = {0, 0, 0, 0}, open = any, its_may[SIGHT_MAX_LIST];
    const uint32_t n = list[0];
    for (uint32_t k = 0; k < n; k++) {
        const struct sight_record *r = &s->record[list[1 + k]];
        const quad a = r->edge[0][0] * x + r->edge[0][1] * y + r->edge[0][2] * z;
        const quad b = r->edge[1][0] * x + r->edge[1][1] * y + r->edge[1][2] * z;
        const quad c = r->edge[2][0] * x + r->edge[2][1] * y + r->edge[2][2] * z;
        const quad q = r->plane[0] * x + r->plane[1] * y + r->plane[2] * z;
        const quad_mask may = ~((quad_mask)(a <= -1.0) | (quad_mask)(b <= -1.0) | (quad_mask)(c <= -1.0));
        const quad_mask sure = (quad_mask)(q >= r->graze) & (quad_mask)(q <= SIGHT_NEAR);
        const quad_mask inside = (quad_mask)(a >= 1.0) & (quad_mask)(b >= 1.0) & (quad_mask)(c >= 1.0);
        const quad_mask better = inside & (quad_mask)(q > first_q);
        const quad its_slack = {r->slack, r->slack, r->slack, r->slack};
        const quad_mask number = {k, k, k, k};
        its_may[k] = may;
        its_q[k] = q;
        any |= may;
        open |= may & ~sure;
        first = (number & better) | (first & ~better);
        quad_choose(&better, &q, &first_q);
        quad_choose(&better, &its_slack, &slack);
    }
    for (uint32_t k = 0; k < n; k++) {
        const struct sight_record *r = &s->record[list[1 + k]];
        const quad_mask number = {k, k, k, k};
        const quad_mask behind = (quad_mask)(first_q - its_q[k] > slack + r->slack + SIGHT_SAME * first_q);
        open |= ~behind & its_may[k] & (quad_mask)(number != first);
    }
    w->first = first;
    w->any = any;
    w->open = open | (any & (first >> 63));
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
            triangle[at - from + i] = !w.any[i]   ? (uint32_t)BVH_NO_TRIANGLE
                                      : w.open[i] ? (uint32_t)FEW_OPEN
                                                  : s->record[list[1 + w.first[i]]].triangle;
            open |= triangle[at - from + i] == FEW_OPEN;
        }
    }
    return open != 0;
}
