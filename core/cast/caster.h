/* Private to core/cast: the working memory of one thread, and what caster.c and beam.c share. */
#ifndef CORE_CAST_CASTER_H
#define CORE_CAST_CASTER_H

#include "core/cast/kernels.h"

/* Pulses worked on at a time: the arrays stay in the second-level cache, the hits' planes are on their way. */
enum { CHUNK = BVH_CHUNK };

struct mover_rays {
    double dx[CHUNK], dy[CHUNK], dz[CHUNK], range_m[CHUNK], cosine[CHUNK];
    uint32_t hit[CHUNK];
};

/* Of a moving head only. */
struct moving_rays {
    double sx[CHUNK], sy[CHUNK], sz[CHUNK]; /* direction, socs */
    double rx[CHUNK], ry[CHUNK], rz[CHUNK]; /* as the encoders read it, socs; geo layout */
    double px[CHUNK], py[CHUNK], pz[CHUNK]; /* origin, prcs */
    double ox[CHUNK], oy[CHUNK], oz[CHUNK]; /* origin, local frame of the BVH at hand */
    float fx[CHUNK], fy[CHUNK], fz[CHUNK];  /* likewise, as Embree gets it */
    double qx[CHUNK], qy[CHUNK], qz[CHUNK]; /* origin in a moving body's frame */
};

/* Where rays begin: all at one point (px NULL), or each at its own; prcs. */
struct origins {
    double at_m[3];
    const double *px, *py, *pz;
};

struct beam_work;

struct caster {
    struct bvh_packets packets, placed; /* of rays from one point; each from its own */
    double mirror_turn[CHUNK], pan_turn[CHUNK];
    double dx[CHUNK], dy[CHUNK], dz[CHUNK]; /* direction of the beam, prcs */
    double ex[CHUNK], ey[CHUNK], ez[CHUNK]; /* direction as the encoders read it, then the position; geo layout */
    double range_m[CHUNK];
    float fx[CHUNK], fy[CHUNK], fz[CHUNK]; /* the direction as Embree gets it */
    uint32_t prim[CHUNK], hit[CHUNK];      /* as proposed; as decided */
    float t[CHUNK], u[CHUNK], v[CHUNK];
    uint32_t doubt[CHUNK];              /* the proposal has to be decided in double */
    uint32_t seen[CHUNK], label[CHUNK]; /* labels of the last hits; of what counts in the end */
    struct mover_rays mover;            /* touched only where something moves */
    struct moving_rays moving;          /* touched only where the head moves */
    float *steep;                       /* where 1 / cos^2 of the incidence goes; NULL: not asked for */
    int scattered;                      /* of the rays at hand, neighbours have nothing in common */
    struct beam_work *beam;             /* touched only where pulses have a footprint */
    struct cast_counters counters;
    struct cast_profile *profile;
};

/* What has passed since the stage before belongs to this one. */
static inline void caster_ends(struct caster *c, enum cast_stage stage)
{
    if (c->profile == NULL) return;
    uint64_t now = c->profile->now();
    c->profile->spent[stage] += now - c->profile->last;
    c->profile->last = now;
}

/* Exact hits of n rays from one point, or (n <= CHUNK) each from its own; labels of the last chunk in c->seen. */
void caster_hits_from(struct caster *c, const struct bvh *bvh, const struct origins *from, double range_max_m,
                      uint32_t n, const double *dx, const double *dy, const double *dz, double *range_m,
                      uint32_t *triangle);

/* n <= CHUNK rays in prcs, with what they have met so far. */
struct caster_rays {
    const double *dx, *dy, *dz;
    double *range_m;
    double *cosine; /* of the incidence; NULL: not asked for */
    uint32_t *label;
    uint32_t *triangle; /* CAST_NO_TRIANGLE where a moving body is met; NULL: not asked for */
};
/* What moves: where it hides what was met, that gives way. */
void caster_movers(struct caster *c, const struct cast_setup *s, const struct origins *from,
                   const struct caster_rays *rays, uint32_t n);

/* Wire numbers of n points whose ranges and directions stand in c, from the block's entry `at` on. Returns how many
 * coordinates did not fit; they are LINE_XYZ_NONE. */
uint32_t caster_wire(struct caster *c, const struct cast_setup *s, int linear, struct line_block *block, uint32_t at,
                     uint32_t n);

/* ---- beam.c */
int beam_work_create(struct beam_work **out, struct sh_err *err);
void beam_work_free(struct beam_work *work);
/* Where the incidences of central rays are to go. */
float *beam_steep(struct caster *c);
/* n pulses are aimed, and (adaptive) their central rays have been cast: finds their echoes and writes them into the
 * block from entry *at on. dt_ns: of these pulses. Returns the number of echoes. */
uint32_t beam_chunk(struct caster *c, const struct cast_setup *s, const struct origins *from, int linear,
                    uint64_t pulse0, const uint32_t *dt_ns, uint32_t n, struct line_block *block, uint32_t *at);

#endif
