/* SPDX-License-Identifier: MIT */
/* Private to core/cast: working memory for pulses with a footprint. caster.c allocates it, sub_ray*.c use it. */
#ifndef CORE_CAST_SUB_RAYS_H
#define CORE_CAST_SUB_RAYS_H

#include "core/cast/caster.h"

enum {
    POOL = 24 * CHUNK,     /* sub-rays worked on at a time */
    POOL_ROOM = POOL + 16, /* arrays of a power of two would collide in a cache */
    MAX_JOBS = 256,        /* pulses with sub-rays worked on at a time */
    MAX_PASSES = 4,        /* times that the outlines of a pulse are searched */
};

/* Sub-rays; those of a job lie together. */
struct pool {
    struct {
        double x[POOL_ROOM], y[POOL_ROOM], z[POOL_ROOM];
    } p, d;
    double range_m[POOL_ROOM], cosine[POOL_ROOM], energy[POOL_ROOM];
    double rho[POOL_ROOM]; /* of the surface; touched only where surfaces are modelled */
    uint32_t triangle[POOL_ROOM], label[POOL_ROOM];
    uint32_t colour[POOL_ROOM]; /* touched only where colours are those of textures */
    uint8_t body[POOL_ROOM];
    uint32_t n;
    /* of the part that a sub-ray stands for: variances and covariance of x and y; touched only where
     * returns have a spread */
    float xx[POOL_ROOM], xy[POOL_ROOM], yy[POOL_ROOM];
};

/* Hits of sub-rays through glass and off mirrors; touched only where there are any. */
struct beyond {
    uint32_t first[POOL_ROOM], count[POOL_ROOM]; /* of a sub-ray */
    uint32_t n;
    double range_m[POOL_ROOM * CAST_MAX_DEPTH], cosine[POOL_ROOM * CAST_MAX_DEPTH];
    double share[POOL_ROOM * CAST_MAX_DEPTH]; /* of the sub-ray's energy */
    double rho[POOL_ROOM * CAST_MAX_DEPTH];
    uint32_t label[POOL_ROOM * CAST_MAX_DEPTH], colour[POOL_ROOM * CAST_MAX_DEPTH];
    uint8_t ghost[POOL_ROOM * CAST_MAX_DEPTH];
};

/* A pulse for which one ray is not enough. */
struct job {
    uint32_t pulse, first, n;  /* its sub-rays */
    uint32_t lines, passes;    /* outlines that cut it; how often they were searched */
    struct beam_near *near;    /* the outlines */
    double next_m;             /* the range from which outlines were left out */
    struct beam_return centre; /* known without a ray; energy 0: none */
    struct beam_sight sight;
    int whole; /* sub-rays over the whole footprint, whatever its outlines */
};

struct sub_ray_work {
    float steep[CHUNK];                /* 1 / cos^2 of the incidence of central rays (adaptive) */
    struct beam_near candidate[CHUNK]; /* pulses that may need sub-rays */
    struct beam_near reach[CHUNK];     /* pulses near outlines, where there is glass or a mirror */
    uint32_t near[CHUNK], n_near;      /* pulses with sub-rays, in order */
    uint32_t again[CHUNK], n_again;    /* pulses that hit glass or a mirror: whole footprints */
    struct job job[MAX_JOBS];
    uint32_t n_jobs;
    int scattered; /* the pool's rays have nothing in common */
    struct pool pool;
    struct beam_return returns[(BEAM_MAX_SUBRAYS + 1) * (1 + CAST_MAX_DEPTH)];
    uint32_t n_returns;
    int is_silenced; /* the job at hand hit a surface that gives no echo */
    struct {
        uint32_t first, n;
    } echoes_of[CHUNK]; /* by pulse */
    struct beam_echo echo[CHUNK * LINE_MAX_ECHOES + 1];
    uint32_t n_echoes;
    struct beyond beyond;
};

/* ---- sub_rays.c: puts the echoes of a chunk's footprints into the list, with rho where something asks for it. */
void caster_sub_rays(struct caster *c, const struct chunk *k);

/* ---- sub_ray_plan.c: plans jobs, and puts their sub-rays at the end of the pool. */
/* Adds sub-rays over the whole footprint. */
void plan_whole(struct caster *c, const struct chunk *k, struct job *job);
/* Adds the rays that a pulse needs, given the outlines up to limit_m. known: the number of outlines that its rays were
 * planned for so far; 0: it has only its central ray. Returns 0, and adds none, where no more outlines are found. */
int plan_parts(struct caster *c, const struct chunk *k, struct job *job, double limit_m, uint32_t known);

#endif
