/* Private to core/cast/beam*.c: working memory for pulses with a footprint. */
#ifndef CORE_CAST_BEAM_WORK_H
#define CORE_CAST_BEAM_WORK_H

#include "core/cast/caster_private.h"

enum {
    POOL = 24 * CHUNK,     /* sub-rays worked on at a time */
    POOL_ROOM = POOL + 16, /* arrays of a power of two would get into each other's way in a cache */
    MAX_JOBS = 256,        /* pulses with sub-rays, likewise */
    MAX_PASSES = 4,        /* over their outlines */
};

/* Sub-rays; those of a job lie together. */
struct pool {
    double px[POOL_ROOM], py[POOL_ROOM], pz[POOL_ROOM], dx[POOL_ROOM], dy[POOL_ROOM], dz[POOL_ROOM];
    double range_m[POOL_ROOM], cosine[POOL_ROOM], energy[POOL_ROOM];
    double rho[POOL_ROOM]; /* of the surface; touched only where surfaces are modelled */
    uint32_t triangle[POOL_ROOM], label[POOL_ROOM];
    uint8_t body[POOL_ROOM];
    uint8_t begins[POOL_ROOM]; /* a packet */
    uint32_t n;
    /* of the part that a sub-ray stands for: variances and covariance of x and y; touched only where attributes are
     * asked for */
    float xx[POOL_ROOM], xy[POOL_ROOM], yy[POOL_ROOM];
};

/* What sub-rays come to behind glass and off mirrors; touched only where there is such. */
struct behind {
    uint32_t first[POOL_ROOM], count[POOL_ROOM]; /* of a sub-ray */
    uint32_t n;
    double range_m[POOL_ROOM * CAST_MAX_DEPTH], cosine[POOL_ROOM * CAST_MAX_DEPTH];
    double share[POOL_ROOM * CAST_MAX_DEPTH]; /* of the sub-ray's energy */
    double rho[POOL_ROOM * CAST_MAX_DEPTH];
    uint32_t label[POOL_ROOM * CAST_MAX_DEPTH];
    uint8_t ghost[POOL_ROOM * CAST_MAX_DEPTH];
};

/* A pulse that one ray does not do for. */
struct job {
    uint32_t pulse, first, n;     /* its sub-rays */
    uint32_t lines, passes;       /* outlines that cut it; how often they were looked at */
    const struct beam_near *near; /* the outlines */
    double next_m;                /* from where on outlines were left out */
    struct beam_return centre;    /* known without a ray; energy 0: none */
    double e1[3], e2[3];          /* across the beam */
    int whole;                    /* sub-rays all over the footprint, whatever its outlines */
};

/* Echoes of a pulse in the list. */
struct several {
    uint32_t pulse, first, n;
};

struct beam_work {
    float steep[CHUNK];
    struct beam_near candidate[CHUNK]; /* pulses to look at */
    struct beam_near reach[CHUNK];     /* with glass or mirrors: those near outlines */
    uint32_t near[CHUNK], n_near;      /* those with sub-rays */
    uint32_t again[CHUNK], n_again;    /* glass or a mirror was met beside the centre */
    struct job job[MAX_JOBS];
    uint32_t n_jobs;
    int scattered; /* the pool's rays have nothing in common */
    struct pool pool;
    struct beam_return returns[(BEAM_MAX_SUBRAYS + 1) * (1 + CAST_MAX_DEPTH)];
    uint32_t n_returns;
    struct beam_echoes some; /* of pulses with sub-rays */
    /* of pulses of several points, as c has it: */
    double mirror_turn[CHUNK], pan_turn[CHUNK];
    double ex[CHUNK], ey[CHUNK], ez[CHUNK], px[CHUNK], py[CHUNK], pz[CHUNK];
    uint32_t a[CAST_LIST], b[CAST_LIST], c[CAST_LIST]; /* of their points but the first, as in a block */
    struct several several[CHUNK]; /* by pulse; for beam_points.c, in order of pulse, those of several points */
    uint64_t counter[CHUNK];       /* of the points' random numbers */
    uint8_t number[CHUNK];         /* of a pulse's only or first echo */
    struct behind behind;
    float width_m[CHUNK]; /* of a pulse's only or first echo; touched only where attributes are asked for */
};

/* ---- attributes.c: standard deviation of the ranges within a part of a job's footprint that spreads so about its
 * middle and lies on the plane with normal n, which is range_m away there. */
float beam_part_sigma(const struct beam *beam, const double dir[3], const struct job *job, const double n[3],
                      double range_m, double xx, double xy, double yy);
/* Likewise of a part that spreads the same all around, where only the incidence is known. */
float beam_round_sigma(const struct beam *beam, double range_m, double cosine, double variance);

/* ---- beam_plan.c: jobs, their sub-rays at the end of the pool. */
/* Sub-rays all over the footprint. */
void beam_plan_whole(struct caster *c, const struct cast_beam *b, const struct origins *from, struct job *job);
/* The rays that a pulse needs, given the outlines up to limit_m. Returns 0 where those of `known` outlines will do, or
 * (0) the central one. */
int beam_plan_job(struct caster *c, const struct cast_setup *s, const struct origins *from, struct job *job,
                  double limit_m, uint32_t known);

#endif
