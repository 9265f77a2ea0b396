/* Rays decided among a few triangles, by rules that sight_inside.h explains. */
#include <math.h>

#include "core/sight/hits_inside.h"
#include "core/vec3.h"

/* What one ray makes of one record. */
struct look {
    double side; /* the least of its edges' */
    double q;    /* 1 / range; 0: not met for certain */
};

static inline double least(double a, double b)
{
    return a < b ? a : b;
}

static inline struct look look_at(const struct sight_record *r, const double d[3])
{
    const double a = vec3_dot(r->edge[0], d), b = vec3_dot(r->edge[1], d), c = vec3_dot(r->edge[2], d);
    const double side = least(a, least(b, c)), q = vec3_dot(r->plane, d);
    return (struct look){side, side <= -1.0 ? 0.0 : q};
}

/* How the others of a list stand to the one that is met first. */
struct order {
    int open;          /* one of them may come first, or can't be decided */
    uint32_t triangle; /* the lowest number of those at the same range */
};

static struct order compare(const struct sight *s, const uint32_t *list, const struct look *look, uint32_t first)
{
    const struct sight_record *best = &s->record[list[1 + first]];
    const double q = look[first].q;
    struct order order = {0, best->triangle};
    for (uint32_t i = 0; i < list[0]; i++) {
        const struct sight_record *r = &s->record[list[1 + i]];
        if (i == first || look[i].q == 0.0) continue;
        const double gap = q - look[i].q, slack = best->slack + r->slack;
        if (gap > slack + (best->rel + r->rel + SIGHT_SAME) * q) continue;
        /* What the ranges themselves leave in doubt is less than what is left up to 1e-12. */
        const int same = s->exact && look[i].side >= 1.0 && gap <= SIGHT_SURE_SAME * q && slack <= SIGHT_SURE_SAME * q;
        order.open |= !same;
        if (r->triangle < order.triangle) order.triangle = r->triangle;
    }
    return order;
}

/* Returns 0 where the records can't decide the ray. */
static int decide(const struct sight *s, const double d[3], const uint32_t *list, uint32_t *triangle)
{
    struct look look[SIGHT_MAX_LIST];
    double q = 0.0;
    uint32_t first = BVH_NO_TRIANGLE;
    int open = 0, other = 0;
    for (uint32_t i = 0; i < list[0]; i++) {
        const struct sight_record *r = &s->record[list[1 + i]];
        look[i] = look_at(r, d);
        if (look[i].q == 0.0 && look[i].side <= -1.0) continue;
        open |= !(look[i].q >= r->graze && look[i].q <= SIGHT_NEAR);
        other++;
        if (!(look[i].side >= 1.0) || look[i].q <= q) continue;
        q = look[i].q;
        first = i;
    }
    *triangle = BVH_NO_TRIANGLE;
    if (open) return 0;
    if (other == 0) return 1;
    if (first == BVH_NO_TRIANGLE) return 0;
    if (other > 1) {
        const struct order order = compare(s, list, look, first);
        if (order.open) return 0;
        *triangle = order.triangle;
        return 1;
    }
    *triangle = s->record[list[1 + first]].triangle;
    return 1;
}

uint32_t few_decide(const struct sight *s, const struct vec3_in *dir, const uint32_t *leaf, uint32_t *ray, uint32_t n,
                    uint32_t *triangle)
{
    uint32_t open = 0;
    for (uint32_t k = 0; k < n; k++) {
        const uint32_t i = ray[k];
        const double d[3] = VEC3_AT(*dir, i);
        if (!decide(s, d, s->list + (leaf[i] & SIGHT_NUMBER), &triangle[i])) ray[open++] = i;
    }
    return open;
}
