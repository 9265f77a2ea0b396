/* Near a border: which triangle does the ray really meet? In double. */
#include <math.h>
#include <stdbool.h>

#include "core/bvh/bvh_inside.h"
#include "core/bvh/edges.h"
#include "core/vec3.h"

enum { MOST_TIED = 8 };

/* A hit, and how far float may misjudge the order of other planes there. */
struct rivalry {
    uint32_t prim;
    double range_m, width_m, steep; /* 1 / the cosine of the incidence */
    double reach;                   /* how far around the hit a rival is tried, against the larger width of the two */
};

struct search {
    const struct decide_ray *ray;
    double point_m[3], radius_m; /* of the query, local frame */
    const struct rivalry *only;  /* try only rivals; NULL: all */
    uint32_t proposed, rivals;   /* rivals: how many were tried */
    uint32_t prim;               /* best so far */
    double range_m, border_m;    /* its range, and how far the ray passes from its nearest edge */
    /* All that were met within 1e-12 of the nearest: of them the lowest number is the best, in whatever order they
     * came. Of more than there is room for the highest numbers are left out. */
    struct {
        uint32_t prim;
        double range_m, border_m;
    } tied[MOST_TIED];
    uint32_t n_tied;
    double first_m;      /* the nearest; INFINITY: none */
    uint32_t near_prim;  /* missed by less than double precision can decide; of those the nearest */
    double near_range_m; /* INFINITY: none */
    int holes;           /* the ray passed through one */
};

static void forget(struct search *s)
{
    s->prim = s->near_prim = RTC_INVALID_GEOMETRY_ID;
    s->range_m = s->first_m = s->near_range_m = INFINITY;
    s->n_tied = 0;
}

static struct search search_for(const struct decide_ray *ray)
{
    struct search s = {.ray = ray, .proposed = RTC_INVALID_GEOMETRY_ID};
    forget(&s);
    return s;
}

static double plane_range(const struct decide_ray *ray, uint32_t prim)
{
    const struct bvh_plane *tri = &ray->bvh->triangle[prim];
    return (tri->d - vec3_dot(tri->n, ray->o_local)) / vec3_dot(tri->n, ray->dir);
}

/* Range to a triangle that the ray does meet, or misses by less than can be told. Where the ray lies almost in its
 * plane the plane's range runs away: it is kept between the edges that the ray passes. NaN: it passes none, and meets
 * nothing. */
static double held_range(const struct decide_ray *ray, uint32_t prim, double v[3][3])
{
    const double *n = ray->bvh->triangle[prim].n;
    double range = plane_range(ray, prim), lo = INFINITY, hi = -INFINITY, longest = 0.0;
    if (fabs(vec3_dot(n, ray->dir)) > 1e-6 * sqrt(vec3_dot(n, n))) return range;
    for (int i = 0; i < 3; i++)
        longest = fmax(longest, vec3_distance(v[i], v[(i + 1) % 3]));
    for (int i = 0; i < 3; i++) {
        const double *a = v[i], *b = v[(i + 1) % 3];
        double t = edge_range(a, b, ray->dir), blur = 0x1p-40 * vec3_distance(a, b) + 0x1p-46 * fabs(t);
        if (edge_gap(a, b, ray->dir, t) > blur + 1e-6 * longest) continue; /* the ray does not pass here */
        lo = fmin(lo, t);
        hi = fmax(hi, t);
    }
    if (!(lo <= hi)) return NAN; /* it only seemed to be inside: what is seen so flat is left at an edge */
    return range < lo || isnan(range) ? lo : range > hi ? hi : range;
}

/* Corners relative to the ray's origin, and on which side of each edge the ray passes. */
static void look_at(const struct decide_ray *ray, uint32_t prim, double v[3][3], double side[3])
{
    const struct scene *scene = ray->bvh->scene;
    for (int i = 0; i < 3; i++)
        vec3_sub(scene->vertex_m[scene->triangle[prim][i]], ray->station_m, v[i]);
    for (int i = 0; i < 3; i++)
        side[i] = edge_side(v[i], v[(i + 1) % 3], ray->dir);
}

/* Whether the triangle has a hole where the ray is at that range. */
static int is_hole(struct search *s, uint32_t prim, double v[3][3], double range_m)
{
    const struct scene *scene = s->ray->bvh->scene;
    if (scene->cutout == NULL || scene_cutout(scene, prim) == NULL) return 0;
    const double *const corner[3] = {v[0], v[1], v[2]};
    const double *dir = s->ray->dir, p[3] = {range_m * dir[0], range_m * dir[1], range_m * dir[2]};
    double uv[2];
    scene_uv_at(scene, prim, corner, p, uv);
    if (!texture_is_hole(scene_cutout(scene, prim), uv)) return 0;
    s->holes = 1;
    return 1;
}

/* Remembers a triangle that the ray misses by less than double precision resolves at its edges. Of several the
 * frontmost: what else is tried further away makes no difference. */
static void note_miss(struct search *s, uint32_t prim, double v[3][3], const double side[3])
{
    double sign = side[0] + side[1] + side[2] < 0.0 ? -1.0 : 1.0; /* of n . dir */
    for (int i = 0; i < 3; i++)
        if (-sign * side[i] / blur(v[i], v[(i + 1) % 3]) > 1.0) return;
    const double range = held_range(s->ray, prim, v);
    if (!(range > BVH_AT_ORIGIN_M) || range > s->near_range_m || is_hole(s, prim, v, range)) return;
    if (range == s->near_range_m && prim > s->near_prim) return;
    s->near_prim = prim;
    s->near_range_m = range;
}

static void note_hit(struct search *s, uint32_t prim, double range_m, double border_m)
{
    uint32_t n = 0, last = 0;
    if (range_m > s->first_m + 1e-12 * s->first_m) return;
    s->first_m = fmin(s->first_m, range_m);
    for (uint32_t i = 0; i < s->n_tied; i++) {
        if (s->tied[i].range_m > s->first_m + 1e-12 * s->first_m || s->tied[i].prim == prim) continue;
        s->tied[n] = s->tied[i];
        if (s->tied[n].prim > s->tied[last].prim) last = n;
        n++;
    }
    s->n_tied = n;
    const uint32_t at = n < MOST_TIED ? s->n_tied++ : last;
    if (n < MOST_TIED || prim < s->tied[last].prim) {
        s->tied[at].prim = prim;
        s->tied[at].range_m = range_m;
        s->tied[at].border_m = border_m;
    }
    for (uint32_t i = 0; i < s->n_tied; i++) {
        if (i != 0 && s->tied[i].prim >= s->prim) continue;
        s->prim = s->tied[i].prim;
        s->range_m = s->tied[i].range_m;
        s->border_m = s->tied[i].border_m;
    }
}

/* A ray from a corner begins on the surface, and meets it nowhere else. The sides of two edges are 0 there, whatever
 * way it goes, and the plane's range is what rounding leaves. */
static int begins_at_corner(double v[3][3])
{
    for (int i = 0; i < 3; i++)
        if (v[i][0] == 0.0 && v[i][1] == 0.0 && v[i][2] == 0.0) return 1;
    return 0;
}

/* Returns whether the ray meets it. */
static int try_triangle(struct search *s, uint32_t prim)
{
    double v[3][3], side[3];
    look_at(s->ray, prim, v, side);
    if (is_edge_on(v, side) || begins_at_corner(v)) return 0;
    if (!is_inside(side)) {
        note_miss(s, prim, v, side);
        return 0;
    }
    double range = held_range(s->ray, prim, v);
    if (!(range > BVH_AT_ORIGIN_M) || is_hole(s, prim, v, range)) return 0;
    note_hit(s, prim, range, edge_distance(v, side));
    return 1;
}

/* How far from the proposed point along the ray an edge's neighbours may be met, and the plane itself: the
 * width, stretched by the incidence. */
static double slack_m(const struct decide_ray *ray, uint32_t prim, double width_m)
{
    const struct bvh_plane *tri = &ray->bvh->triangle[prim];
    double cosine = fabs(vec3_dot(tri->n, ray->dir)) / sqrt(vec3_dot(tri->n, tri->n));
    return 4.0 * width_m * (1.0 + 1.0 / fmax(cosine, 1e-6));
}

/* How far around a hit its rivals are tried, in slacks. */
enum { WIDE = 16 };

static struct rivalry rivalry_of(const struct decide_ray *ray, uint32_t prim, double range_m)
{
    const double *n = ray->bvh->triangle[prim].n;
    return (struct rivalry){prim, range_m, bvh_width_m(ray->bvh, prim),
                            sqrt(vec3_dot(n, n)) / fabs(vec3_dot(n, ray->dir)), WIDE * slack_m(ray, prim, 1.0)};
}

/* The larger width of a hit and its rival. */
static double wider_m(const struct bvh *bvh, const struct rivalry *own, uint32_t prim)
{
    return fmax(own->width_m, bvh_width_m(bvh, prim));
}

/* False where the ray meets a plane clearly before or after the hit. */
static int may_be_rival(const struct decide_ray *ray, const struct rivalry *own, uint32_t prim)
{
    const struct bvh_plane *tri = &ray->bvh->triangle[prim];
    double along = fabs(vec3_dot(tri->n, ray->dir)), length = sqrt(vec3_dot(tri->n, tri->n));
    double gap = fabs((tri->d - vec3_dot(tri->n, ray->o_local)) / vec3_dot(tri->n, ray->dir) - own->range_m);
    double width_m = 4.0 * wider_m(ray->bvh, own, prim);
    return !(gap * along > width_m * (own->steep * along + length));
}

/* By its plane. */
static int is_near(const struct search *s, uint32_t prim)
{
    const struct bvh_plane *tri = &s->ray->bvh->triangle[prim];
    double off = vec3_dot(tri->n, s->point_m) - tri->d, reach = s->radius_m;
    return off * off <= reach * reach * vec3_dot(tri->n, tri->n);
}

/* By its box. */
static int is_close(const struct search *s, uint32_t prim)
{
    double v[3][3], off2 = 0.0;
    bvh_corners(s->ray->bvh, prim, v);
    for (int i = 0; i < 3; i++) {
        double lo = fmin(v[0][i], fmin(v[1][i], v[2][i])), hi = fmax(v[0][i], fmax(v[1][i], v[2][i]));
        double off = fmax(0.0, fmax(lo - s->point_m[i], s->point_m[i] - hi));
        off2 += off * off;
    }
    return off2 <= s->radius_m * s->radius_m;
}

/* What is large or far off, float may misjudge by more than the hit: the ball is that of the two together. */
static int is_rival_here(struct search *s, const struct rivalry *own, uint32_t prim)
{
    s->radius_m = own->reach * wider_m(s->ray->bvh, own, prim);
    return is_near(s, prim) && may_be_rival(s->ray, own, prim) && is_close(s, prim);
}

/* Embree names all triangles whose boxes, or those of their leaf, are near. What lies further than the
 * query's radius is left out by its plane. */
static bool visit(struct RTCPointQueryFunctionArguments *args)
{
    struct search *s = args->userPtr;
    const uint32_t prim = args->primID;
    if (prim == s->proposed) return false;
    if (s->only != NULL) {
        if (!is_rival_here(s, s->only, prim) || !bvh_are_rivals(s->ray->bvh, s->only->prim, prim)) return false;
        s->rivals++;
    } else if (!is_near(s, prim)) {
        return false;
    }
    try_triangle(s, prim);
    return false;
}

/* The ball that is searched. */
static void set_ball(struct search *s, double range_m, double radius_m)
{
    for (int i = 0; i < 3; i++)
        s->point_m[i] = s->ray->o_local[i] + range_m * s->ray->dir[i];
    s->radius_m = radius_m;
}

/* All triangles near the point at range_m on the ray. */
static void try_around(struct search *s, double range_m, double radius_m)
{
    struct RTCPointQueryContext context;
    struct RTCPointQuery query = {.radius = (float)(1.001 * radius_m)};
    rtcInitPointQueryContext(&context);
    set_ball(s, range_m, radius_m);
    query.x = (float)s->point_m[0];
    query.y = (float)s->point_m[1];
    query.z = (float)s->point_m[2];
    rtcPointQuery(s->ray->bvh->rtc, &query, &context, visit, s);
}

/* So near to an edge that double precision can't separate its sides: the edge is hit, nothing passes. */
static int is_near_miss(const struct search *s)
{
    return s->near_prim != RTC_INVALID_GEOMETRY_ID && !(s->range_m <= s->near_range_m);
}

static struct decide_hit best_of(const struct search *s)
{
    return is_near_miss(s) ? (struct decide_hit){s->near_prim, s->near_range_m}
                           : (struct decide_hit){s->prim, s->range_m};
}

/* What meets the best one at its border. */
static void try_neighbours(struct search *s)
{
    if (s->prim == RTC_INVALID_GEOMETRY_ID) return;
    s->only = NULL;
    s->proposed = s->prim;
    try_around(s, s->range_m, slack_m(s->ray, s->prim, bvh_width_m(s->ray->bvh, s->prim)));
}

/* Rivals whose planes the ray meets within what float can't order, and that are near the hit, are tried. */
static struct rivalry begin_rivals(struct search *s, const struct decide_hit *hit)
{
    const struct rivalry own = rivalry_of(s->ray, hit->prim, hit->range_m);
    s->proposed = hit->prim;
    try_triangle(s, hit->prim);
    set_ball(s, hit->range_m, own.reach * own.width_m);
    return own;
}

static void end_rivals(struct search *s, const struct rivalry *own, struct decide_hit *hit)
{
    if (s->rivals == 0) return;
    if (s->prim != hit->prim || !(s->border_m > own->width_m)) try_neighbours(s);
    const struct decide_hit found = best_of(s);
    if (found.prim != RTC_INVALID_GEOMETRY_ID) *hit = found;
}

static void try_listed(struct search *s, const struct rivalry *own, const uint32_t *prim, uint32_t n)
{
    for (uint32_t k = 0; k < n; k++) {
        if (prim[k] == own->prim || !is_rival_here(s, own, prim[k])) continue;
        s->rivals++;
        try_triangle(s, prim[k]);
    }
}

/* Those that are known, or else what the BVH has there: the same ones. */
void decide_again(const struct decide_ray *ray, struct decide_hit *hit)
{
    const struct bvh *bvh = ray->bvh;
    struct search s = search_for(ray);
    const struct rivalry own = begin_rivals(&s, hit);
    if (!bvh->ordered) {
        s.only = &own;
        try_around(&s, hit->range_m, own.reach * fmax(own.width_m, bvh->widest_m));
    } else if (bvh->rival_first != NULL) {
        const uint32_t first = bvh->rival_first[hit->prim];
        try_listed(&s, &own, bvh->rival + first, bvh->rival_first[hit->prim + 1] - first);
    }
    end_rivals(&s, &own, hit);
}

static int has_rivals(const struct bvh *bvh, uint32_t prim)
{
    return bvh->rival_first != NULL && bvh->rival_first[prim] != bvh->rival_first[prim + 1];
}

void decide_prefetch(const struct bvh *bvh, const uint32_t *prim, const uint32_t *ray, uint32_t n)
{
    const struct scene *scene = bvh->scene;
    for (uint32_t k = 0; k < n; k++)
        __builtin_prefetch(scene->triangle[prim[ray[k]]], 0, 3);
    for (uint32_t k = 0; k < n; k++)
        for (int j = 0; j < 3; j++)
            __builtin_prefetch(scene->vertex_m[scene->triangle[prim[ray[k]]][j]], 0, 3);
}

static void to_floats(const struct decide_ray *ray, float org[3], float dir[3])
{
    for (int i = 0; i < 3; i++) {
        org[i] = (float)ray->o_local[i];
        dir[i] = (float)ray->dir[i];
    }
}

/* What was tried may lie anywhere on the ray. Up to limit_m everything was tried; a hit beyond is one, but something
 * may lie before it. */
static int is_found(const struct search *s, double limit_m)
{
    return s->range_m <= limit_m || s->near_range_m <= limit_m;
}

static int is_met(void *search, uint32_t prim)
{
    return try_triangle(search, prim);
}

/* The ray passed through a hole: all that Embree proposes along it is tried, from its origin on. What was
 * tried so far is tried again, which changes nothing. */
static void look_through(struct search *s)
{
    float org[3], dir[3];
    const struct bvh_walk walk = {is_met, s};
    to_floats(s->ray, org, dir);
    bvh_walk_along(s->ray->bvh, org, dir, s->ray->t_max, &walk);
}

static void finish(const struct search *s, struct bvh_counters *counters, struct decide_hit *hit)
{
    counters->undecided += (uint64_t)is_near_miss(s);
    *hit = best_of(s);
}

void decide_hit(const struct decide_ray *ray, uint32_t prim, float t, struct bvh_counters *counters,
                struct decide_hit *hit)
{
    struct search s = search_for(ray);
    counters->near_border++;
    /* Each round begins further along the ray, so they end. A ray that passes many wide triangles needs many:
     * none may be given up, for what lies behind would be lost. */
    while (prim != RTC_INVALID_GEOMETRY_ID) {
        s.proposed = prim;
        try_triangle(&s, prim);
        /* Inside in double as well, and further from the border than float can blur: the common case. Nearer,
         * another triangle of the edge may lie in front of it by less than float resolves. */
        double width_m = bvh_width_m(ray->bvh, prim);
        if (s.prim == prim && s.border_m > width_m) break;
        counters->decided++;
        if (s.holes) break;
        double range_m = (double)t, slack = slack_m(ray, prim, width_m);
        double radius_m = fmin(slack, 0.01 * range_m + 4.0 * width_m);
        try_around(&s, range_m, radius_m);
        if (s.holes) break;
        if (is_found(&s, range_m + radius_m)) break;
        counters->went_on++;
        float org[3], dir[3];
        to_floats(ray, org, dir);
        /* No further: of what is much larger than this, float may be wrong by more than the radius. */
        struct bvh_one one = {.t_min = nextafterf(t, INFINITY), .t_max = ray->t_max};
        bvh_intersect_one(ray->bvh, org, dir, &one);
        prim = one.prim;
        t = one.t;
    }
    if (s.holes) look_through(&s);
    finish(&s, counters, hit);
    if (hit->prim != RTC_INVALID_GEOMETRY_ID && has_rivals(ray->bvh, hit->prim)) decide_again(ray, hit);
}
