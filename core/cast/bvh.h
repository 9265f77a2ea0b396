/* Private to core/cast: the BVH that proposes, and the exact triangles that decide.
 *
 * Embree works in float: vertices, origin and direction are rounded, and so is its edge test. Near the edge of a
 * triangle it may therefore call a hit a miss, and a ray may slip through a closed mesh or past a silhouette. Here the
 * float triangles are wider than the real ones: in its own plane each is stretched so that, seen from the BVH's origin,
 * its edges lie further out by more than all of that rounding (BVH_WIDEN). Whatever a ray really hits, Embree proposes.
 * Proposals well inside a triangle stand. Those near its border are decided again in double (decide.c). Rays from
 * elsewhere (stations that share a BVH) find the same guarantee except at borders seen at a grazing angle.
 *
 * The budget, in units of 2^-24 of the farthest coordinate in play (vertex of the triangle from the BVH's origin, plus
 * the ray's origin from it): rounding of a vertex 1, of the ray's origin 1, of its direction 1, Pluecker edge functions
 * in float (a difference, a cross and a dot product of three terms) at most 5. Sum 8.
 *
 * What float still decides is the order of two surfaces that lie within its resolution behind each other, about 5e-7 of
 * the range over the cosine of the incidence, away from their borders; unless bvh_order_exactly was called: then such
 * rivals are known from the start (rivals.c), and a hit on one compares its plane with those of the others. */
#ifndef CORE_CAST_BVH_H
#define CORE_CAST_BVH_H

#include <string.h>

#include "core/cast.h"
#include "core/embree.h"

#define BVH_WIDEN (8.0 * 0x1p-24)
enum {
    BVH_MAX_MITER = 4096, /* a sharp corner moves out by at most this many widths */
    BVH_MAX_SLIDE = 8192, /* and along the line of sight, to stay in a grazed plane, by at most this many */
};

/* The exact plane of a triangle, two to a cache line; gathered as doubles (kernels.c).
 * The lowest 12 bits of each component of n carry something else: of n[0] the guard (8 bits of a double's exponent, 4
 * of its mantissa, rounded up), of n[1] and n[2] the label and whether it has rivals. They are part of n, and d goes
 * with that n, so the plane still passes exactly through the triangle; it is tilted by less than 2^-40, which at the
 * far end of a triangle of 100 m is 0.1 nm. */
struct bvh_triangle {
    double n[3]; /* e1 x e2, local frame: length is twice the area */
    double d;    /* n . p = d */
} __attribute__((aligned(32)));
_Static_assert(sizeof(struct bvh_triangle) == 32, "half a cache line");
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

static inline uint16_t bvh_label(const struct bvh_triangle *tri)
{
    return (uint16_t)(bvh_spare(tri->n[1]) | (bvh_spare(tri->n[2]) & 15) << BVH_SPARE_BITS);
}

/* The last spare bit of n[2]: the triangle has rivals. */
enum { BVH_RIVAL_BIT = 1 << (BVH_SPARE_BITS - 1) };

struct bvh {
    RTCDevice device;
    RTCScene rtc;
    const struct scene *scene;
    struct bvh_triangle *triangle; /* one more than there are: the last stands for a miss, all NaN */
    double origin_m[3];
    uint32_t *rival_first,
        *rival; /* rivals of triangle i: rival[rival_first[i] .. rival_first[i + 1]); NULL: there are none */
    double station_reach_m; /* rays begin at most this far from the origin */
    struct bvh_info info;
    int64_t bytes; /* as Embree reports */
};

/* Rays of one chunk in arrays, padded to whole packets; prim is RTC_INVALID_GEOMETRY_ID for a miss. t, u, v are
 * Embree's own, of the widened triangle. */
struct bvh_rays {
    float org[3], t_min, t_max;
    const float *dx, *dy, *dz;
    uint32_t *prim;
    float *t, *u, *v;
};

/* Casts n rays from one origin, in packets of the native width, ragged ends masked. */
void bvh_intersect(const struct bvh *bvh, const struct bvh_rays *rays, uint32_t n);
/* One ray from t_min on. */
struct bvh_one {
    float t_min, t_max; /* in */
    uint32_t prim;      /* out */
    float t, u, v;
};
void bvh_intersect_one(const struct bvh *bvh, const float org[3], const float dir[3], struct bvh_one *one);

/* Corners of a triangle in the local frame; returns the largest distance from its origin. */
double bvh_corners(const struct bvh *bvh, uint32_t prim, double v[3][3]);
/* How far the edges of a triangle were moved outward, as seen from the origin. */
double bvh_width_m(const struct bvh *bvh, uint32_t prim);

/* Fills the float buffers of a geometry with widened triangles, and bvh->triangle. */
int bvh_fill(struct bvh *bvh, RTCGeometry geometry, struct sh_err *err);

/* twins.c: of faces with the same three corners, however they are written, only the first stays in the float buffer. */
int bvh_drop_twins(const struct bvh *bvh, float *vertex, struct sh_err *err);

/* Marks a triangle as having rivals; its plane is made anew to go with that. */
void bvh_mark_rival(struct bvh *bvh, uint32_t prim);
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
/* What Embree proposed near a border, decided in double: the nearest triangle that the ray really meets.
 * Every triangle near the proposed point is tried with edge functions that two triangles of an edge share bit by bit,
 * so that no ray passes between them; of those that are hit at the same range (to 1e-12) the lowest number wins. When
 * none is hit the ray goes on behind them. */
void decide_hit(const struct decide_ray *ray, uint32_t prim, float t, struct cast_counters *counters,
                struct decide_hit *hit);

#endif
