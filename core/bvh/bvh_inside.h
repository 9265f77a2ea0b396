/* Private to core/bvh: the BVH that proposes, and the exact triangles that decide.
 *
 * Embree works in float: vertices, origin and direction are rounded, and so is its edge test. Near the
 * edge of a triangle it may therefore call a hit a miss, and a ray may slip through a closed mesh or past
 * a silhouette. Here the float triangles are wider than the real ones: in its own plane each has its edges
 * further out by more than all of that rounding, a distance across the ray, over the cosine of the
 * incidence as seen from the BVH's origin. (Also for edges seen end-on: the error of their test is larger,
 * across the ray, but for the same reason they move further.) Whatever a ray really hits, Embree proposes.
 * Proposals well inside a triangle stand. Those near its border are decided again in double (decide.c).
 * Rays from elsewhere (stations that share a BVH) find the same guarantee except at borders that they see
 * at a far smaller angle than the origin does.
 *
 * Edges are moved by moving corners. Where a corner is so sharp that it would have to move too far (below about
 * 6e-5 rad), another triangle in the same plane takes the float triangle's place: twice as long as the longest edge,
 * and as wide as it takes (widen.c). All its hits are decided in double.
 *
 * So Embree need not be robust, and its faster test (Moeller and Trumbore 1997) will do. The budget, in
 * units of 2^-24 of the farthest coordinate in play, R (vertex of the triangle from the BVH's origin, plus
 * the ray's origin from it): rounding of a vertex 1, of the ray's direction 1, of its origin 1 (none where
 * it is the BVH's). U = (C x D) . e, with C = v0 - o and e an edge at v0, against |e|: the cross product
 * 2.2 (its products 1.2, its differences 1), C itself 1.2 (none where o = 0), the dot product of three
 * terms 3, e 1. Sum 6.2, or 7.4; 6.5 and 8 are used. The third edge is tested by what is left of the
 * denominator, (e1 x e2) . D - U - V: the errors of U and V, and 9 |e1| |e2|, all against the length of
 * that edge, L: 6.5 (|e1| + |e2|) / L R + 9 |e1| |e2| / L. It is therefore always the longest one, so that
 * it is at most twice as bad as the others. The weights, u = U / |den| with a reciprocal good to 3 units,
 * add an error of 6 |e1| |e2| / L. The boxes: the error of a slab's distance is at most 6 units, and a ray
 * through a point m inside of all edges of a triangle spends at least 2 m within its box; m >= 6.5.
 *
 * What float still decides is the order of two surfaces that lie within its resolution one after the
 * other, about 5e-7 of the range over the cosine of the incidence; unless bvh_order_exactly was called:
 * then such rivals are known from the start (rivals.c), and a hit on one compares its plane with those of
 * the others.
 *
 * Triangles with holes (scene->cutout) are marked, so that all their hits are decided in double. A hit in a
 * hole is none. The ray is then cast once more, alone, past every triangle that Embree proposes on its way,
 * and each of them is decided in double: there is no place where the ray
 * sets out again, nothing that it could meet twice or step over, and no limit to the number of layers. */
#ifndef CORE_BVH_BVH_INSIDE_H
#define CORE_BVH_BVH_INSIDE_H

#include <string.h>

#include "core/bvh.h"
#include "core/embree.h"

enum {
    BVH_MAX_SLANT = 65536, /* a plane is taken to be seen at no smaller angle than 1 / this */
    BVH_MAX_MOVE = 32768,  /* a corner moves by at most this many widths: a few percent of R */
};

/* The planes lie two to a cache line, and are gathered as doubles (refine.c).
 * The lowest 12 bits of each component of n carry something else: of n[0] the guard (8 bits of a double's
 * exponent, 4 of its mantissa, rounded up), of n[1] and n[2] the label and whether it has holes. They are
 * part of n, and d goes with that n, so the plane still passes exactly through the triangle; it is tilted by
 * less than 2^-40, which at the far end of a triangle of 100 m is 0.1 nm. */
_Static_assert(sizeof(struct bvh_plane) == 4 * sizeof(double), "gathered as doubles");
enum {
    BVH_SPARE_BITS = 12,
    BVH_GUARD_SHIFT = 48,               /* of a double that keeps 4 bits of its mantissa */
    BVH_GUARD_BASE = (1023 - 100) << 4, /* guards from 2^-100; 2^156 stands for always */
};

static inline uint32_t bvh_spare(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return (uint32_t)(bits & ((1U << BVH_SPARE_BITS) - 1));
}

static inline uint16_t bvh_label(const struct bvh_plane *tri)
{
    return (uint16_t)(bvh_spare(tri->n[1]) | (bvh_spare(tri->n[2]) & 15) << BVH_SPARE_BITS);
}

/* The last spare bit of n[2]: the triangle has a texture with holes; each hit is decided. */
enum { BVH_HOLES_BIT = 1 << (BVH_SPARE_BITS - 1) };

struct bvh {
    RTCDevice device;
    RTCScene rtc;
    const struct scene *scene;
    struct bvh_plane *triangle; /* one more than there are: the last stands for a miss, all NaN */
    double origin_m[3];
    /* Rivals of triangle i: rival[rival_first[i] .. rival_first[i + 1]), none of a miss. NULL: there are none. */
    int ordered; /* bvh_order_exactly was called */
    uint32_t *rival_first, *rival;
    uint64_t *twin;         /* bits: a face of the same corners stands for this one; NULL: for none */
    double widest_m;        /* the largest bvh_width_m */
    double station_reach_m; /* rays begin at most this far from the origin */
    struct bvh_info info;
    int64_t bytes; /* as Embree reports */
};

/* Rays are cast a chunk at a time, from one origin. Their packets lie side by side: what Embree has just
 * written with a mask is slow to read, a few packets later it isn't. What a cast leaves unchanged is set
 * once, until the origin, the near end or the width change. */
struct bvh_packets {
    union {
        struct RTCRayHit4 by4[BVH_CHUNK / 4];
        struct RTCRayHit8 by8[BVH_CHUNK / 8];
        struct RTCRayHit16 by16[BVH_CHUNK / 16];
    } at __attribute__((aligned(64)));
    float org[3], t_min; /* as set */
    uint32_t width;      /* 0: not yet */
};

/* Rays of one chunk as Embree gets them, padded to whole packets; prim is RTC_INVALID_GEOMETRY_ID for a miss.
 * t, u, v are Embree's own, of the widened triangle. */
struct bvh_batch {
    float org[3], t_min, t_max;
    struct vec3_floats own; /* origins of their own instead of org; x NULL: none */
    int scattered;
    const uint8_t *begins;
    struct vec3_floats dir;
    uint32_t *prim;
    float *t, *u, *v;
};

/* Casts n <= BVH_CHUNK rays, in packets of the native width, ragged ends masked. */
void bvh_intersect(const struct bvh *bvh, struct bvh_packets *packets, const struct bvh_batch *rays, uint32_t n);
/* One ray from t_min on. */
struct bvh_one {
    float t_min, t_max; /* in */
    uint32_t prim;      /* out */
    float t, u, v;
};
void bvh_intersect_one(const struct bvh *bvh, const float org[3], const float dir[3], struct bvh_one *one);

/* What a ray meets no further than this from where it begins is no hit: there it begins on the surface, and
 * goes on. Half of the wire's finest count, and far more than rounding leaves of zero. */
#define BVH_AT_ORIGIN_M 5e-7

/* One ray through all that Embree proposes on its way, in no order. is_met: whether the ray really meets that
 * triangle; what lies behind by the float distance is then left out. Only where the scene has cutouts. */
struct bvh_walk {
    int (*is_met)(void *ctx, uint32_t prim);
    void *ctx;
};
void bvh_walk_along(const struct bvh *bvh, const float org[3], const float dir[3], float t_max,
                    const struct bvh_walk *walk);

/* Corners of a triangle in the local frame; returns the largest distance from its origin. */
double bvh_corners(const struct bvh *bvh, uint32_t prim, double v[3][3]);
/* How far the edges of a triangle were moved outward, as seen from the origin (those of the very smallest
 * further). */
double bvh_width_m(const struct bvh *bvh, uint32_t prim);

/* Fills the float buffers of a geometry with widened triangles, and bvh->triangle. */
int bvh_fill(struct bvh *bvh, RTCGeometry geometry, const struct sh_report *report, struct sh_err *err);
/* Builds the BVH of a scene of Embree's, unless report asks to stop. */
int bvh_commit(struct bvh *bvh, RTCScene scene, const struct sh_report *report, struct sh_err *err);

/* twins.c: of faces with the same three corners, however they are written, only the first stays in the float
 * buffer. */
int bvh_drop_twins(struct bvh *bvh, float *vertex, const struct sh_report *report, struct sh_err *err);

/* rivals.c: whether float can't order two triangles somewhere. */
int bvh_are_rivals(const struct bvh *bvh, uint32_t i, uint32_t j);

/* ---- refine.c */
enum bvh_doubt {
    BVH_DOUBT_BORDER = 1, /* the hit is so near to the border, across the ray, that the proposal is in doubt */
    BVH_DOUBT_ORDER = 2,  /* the triangle has rivals */
};
/* What Embree proposed, and what double precision makes of it. */
struct bvh_proposals {
    const struct bvh *bvh;
    uint32_t n;
    struct vec3_in dir, own; /* origins in the local frame; x NULL: all at o */
    double o[3];
    const uint32_t *prim;
    const float *u, *v;
    double *range_m; /* out: (d - n . o) / (n . dir) of the proposed triangle's plane; NaN for none */
    uint32_t *label; /* out: of the proposed triangle; BVH_NO_LABEL for none */
    float *steep;    /* out: 1 / cos^2 of the incidence, for rays from one point; NULL: not asked for */
    uint32_t *doubt; /* out: enum bvh_doubt */
};
/* Returns how many are in doubt. */
uint32_t bvh_refine(const struct bvh_proposals *proposals);
/* 1 / cos^2 for one; RTC_INVALID_GEOMETRY_ID: NaN. */
float bvh_steep(const struct bvh *bvh, uint32_t prim, const double dir[3]);

/* ---- decide.c */
struct decide_ray {
    const struct bvh *bvh;
    double station_m[3]; /* origin of the ray, prcs: vertices minus this is exact arithmetic's starting point */
    double o_local[3];   /* the same in the local frame */
    double dir[3];
    float t_max;
};
struct decide_hit {
    uint32_t prim; /* RTC_INVALID_GEOMETRY_ID: the ray hits nothing */
    double range_m;
};
/* Brings what deciding prim[ray[0 .. n-1]] is going to read, step by step for all of them at once. */
void decide_prefetch(const struct bvh *bvh, const uint32_t *prim, const uint32_t *ray, uint32_t n);

/* What Embree proposed near a border, decided in double: the nearest triangle that the ray really meets.
 * Every triangle near the proposed point is tried with edge functions that two triangles of an edge share bit
 * by bit, so that no ray passes between them; of those that are hit at the same range (to 1e-12 of the nearest)
 * the lowest number wins. When none is hit the ray goes on. In which order they are tried makes no difference,
 * nor what else is tried that lies behind. */
void decide_hit(const struct decide_ray *ray, uint32_t prim, float t, struct bvh_counters *counters,
                struct decide_hit *hit);
/* Whether a rival is met before a hit. Rivals need not be known. */
void decide_again(const struct decide_ray *ray, struct decide_hit *hit);

#endif
