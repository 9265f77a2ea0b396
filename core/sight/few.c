/* Rays decided among a few triangles, by rules that sight_inside.h explains. */
#include <math.h>

#include "core/sight/hits_inside.h"
#include "core/vec3.h"
#include "core/vecmath.h"

enum {
    /* Rays ahead whose list, and whose records, are asked for: consecutive rays rarely have the same. */
    LIST_AHEAD = 12,
    RECORDS_AHEAD = 6,
};

/* What a ray makes of the records of its list. No branches where the next ray may well go another way. */
struct looks {
    double q[SIGHT_MAX_LIST]; /* 1 / range, of those that are met */
    uint32_t inside;          /* bits: met for certain */
    uint32_t met;             /* met for certain, or perhaps */
    uint32_t first;           /* of those that are met for certain the nearest */
    double first_q;           /* 0: there is none */
    int open;                 /* one can't be decided here */
};

VEC_INLINE double least(double a, double b)
{
    return a < b ? a : b;
}

VEC_INLINE void look(const struct sight_record *record, const double d[3], const uint32_t *list, struct looks *l)
{
    const uint32_t n = list[0];
    uint32_t inside = 0, met = 0, open = 0, first = 0;
    double most = 0.0;
    for (uint32_t i = 0; i < n; i++) {
        const struct sight_record *r = &record[list[1 + i]];
        const double a = vec3_dot(r->edge[0], d), b = vec3_dot(r->edge[1], d), c = vec3_dot(r->edge[2], d);
        const double side = least(a, least(b, c)), q = vec3_dot(r->plane, d);
        const uint32_t out = side <= -1.0, in = side >= 1.0;
        const double in_q = in ? q : 0.0;
        open |= (out ^ 1) & (uint32_t) !((q >= r->graze) & (q <= SIGHT_NEAR));
        inside |= in << i;
        met |= (out ^ 1) << i;
        first = in_q > most ? i : first;
        most = in_q > most ? in_q : most;
        l->q[i] = q;
    }
    l->inside = inside;
    l->met = met;
    l->first = first;
    l->first_q = most;
    l->open = open != 0;
}

/* Bits: those that may be met before the nearest, or at the same range. */
VEC_INLINE uint32_t find_close(const struct sight_record *record, const uint32_t *list, const struct looks *l)
{
    const struct sight_record *best = &record[list[1 + l->first]];
    const double q = l->first_q, least_q = q - best->slack - (best->rel + SIGHT_SAME) * q;
    uint32_t close = 0;
    for (uint32_t i = 0; i < list[0]; i++) {
        const struct sight_record *r = &record[list[1 + i]];
        close |= (uint32_t) !(l->q[i] + (r->slack + r->rel * q) < least_q) << i;
    }
    return close & l->met & ~(1U << l->first);
}

/* Where surfaces lie in one place the lowest number wins, as in core/bvh/decide.c; what the ranges themselves leave in
 * doubt is less than what is left up to 1e-12. BVH_NO_TRIANGLE: they don't for certain. */
static uint32_t decide_tie(const struct sight *s, const uint32_t *list, const struct looks *l, uint32_t close)
{
    const struct sight_record *best = &s->record[list[1 + l->first]];
    uint32_t lowest = best->triangle;
    if (!s->exact || (close & ~l->inside) != 0) return BVH_NO_TRIANGLE;
    for (uint32_t i = 0; i < list[0]; i++) {
        const struct sight_record *r = &s->record[list[1 + i]];
        const double same = SIGHT_SURE_SAME * l->first_q;
        if ((close >> i & 1) == 0) continue;
        if (l->first_q - l->q[i] > same || best->slack + r->slack > same) return BVH_NO_TRIANGLE;
        if (r->triangle < lowest) lowest = r->triangle;
    }
    return lowest;
}

/* Returns 0 where the records can't decide the ray. */
VEC_INLINE int decide(const struct sight *s, const double d[3], const uint32_t *list, uint32_t *triangle)
{
    struct looks l;
    look(s->record, d, list, &l);
    *triangle = BVH_NO_TRIANGLE;
    if (l.open) return 0;
    if (!(l.first_q > 0.0)) return l.met == 0;
    const uint32_t close = find_close(s->record, list, &l);
    *triangle = close == 0 ? s->record[list[1 + l.first]].triangle : decide_tie(s, list, &l, close);
    return *triangle != BVH_NO_TRIANGLE;
}

VEC_INLINE void prefetch(const struct sight *s, const uint32_t *leaf, const uint32_t *ray, uint32_t k, uint32_t n)
{
    const uint32_t *list = s->list + (leaf[ray[k + LIST_AHEAD < n ? k + LIST_AHEAD : n - 1]] & SIGHT_NUMBER);
    __builtin_prefetch(list, 0, 3);
    list = s->list + (leaf[ray[k + RECORDS_AHEAD < n ? k + RECORDS_AHEAD : n - 1]] & SIGHT_NUMBER);
    for (uint32_t i = 0; i < 4; i++) { /* of more, the first ones; of fewer, what comes after them, which is harmless */
        const struct sight_record *r = &s->record[list[1 + (i < list[0] ? i : 0)]];
        __builtin_prefetch(r, 0, 3);
        __builtin_prefetch((const char *)r + 64, 0, 3);
    }
}

VEC_CLONES
uint32_t few_decide(const struct sight *s, const struct vec3_in *dir, const uint32_t *leaf, uint32_t *ray, uint32_t n,
                    uint32_t *triangle)
{
    uint32_t open = 0;
    for (uint32_t k = 0; k < n; k++) {
        const uint32_t i = ray[k];
        const double d[3] = VEC3_AT(*dir, i);
        prefetch(s, leaf, ray, k, n);
        if (!decide(s, d, s->list + (leaf[i] & SIGHT_NUMBER), &triangle[i])) ray[open++] = i;
    }
    return open;
}
