/* Private to core/cast/beam.c and beam_points.c: working memory for pulses with a footprint. */
#ifndef CORE_CAST_BEAM_PRIVATE_H
#define CORE_CAST_BEAM_PRIVATE_H

#include "core/cast/caster_private.h"

enum {
    POOL = 8 * CHUNK, /* sub-rays worked on at a time */
    MAX_JOBS = 256,   /* pulses with sub-rays, likewise */
};

/* Sub-rays; those of a job lie together. */
struct pool {
    double px[POOL], py[POOL], pz[POOL], dx[POOL], dy[POOL], dz[POOL];
    double range_m[POOL], cosine[POOL], energy[POOL];
    uint32_t triangle[POOL], label[POOL];
    uint8_t body[POOL];
    uint32_t n;
};

/* A pulse that one ray does not do for. */
struct job {
    uint32_t pulse, first, n;  /* its sub-rays */
    uint32_t lines;            /* outlines that cut it */
    double next_m;             /* from where on outlines were left out */
    struct beam_return centre; /* known without a ray; energy 0: none */
    double e1[3], e2[3];       /* across the beam */
};

/* A pulse of several points: its echoes in the list. */
struct several {
    uint32_t pulse, first, n;
};

struct beam_work {
    float steep[CHUNK];
    uint32_t cell[CHUNK]; /* of outlines */
    uint32_t near[CHUNK]; /* pulses with sub-rays */
    struct job job[MAX_JOBS];
    uint32_t n_jobs;
    struct pool pool;
    struct beam_return returns[BEAM_MAX_SUBRAYS + 1];
    struct beam_echoes some; /* of pulses with sub-rays */
    /* per pulse, while c holds what is per point */
    double range_m[CHUNK], mirror_turn[CHUNK], pan_turn[CHUNK];
    double ex[CHUNK], ey[CHUNK], ez[CHUNK], px[CHUNK], py[CHUNK], pz[CHUNK];
    uint32_t label[CHUNK];
    struct several several[CHUNK];
    uint64_t counter[CHUNK]; /* of the points' random numbers */
};

/* A chunk whose pulses with sub-rays are work->near[0 .. cut - 1], their echoes in work->some, its other pulses' ranges
 * and labels in c: into the block from entry *at on. Returns the number of echoes. */
uint32_t beam_write_points(struct caster *c, const struct cast_setup *s, int linear, uint64_t pulse0,
                           const uint32_t *dt_ns, uint32_t n, uint32_t cut, struct line_block *block, uint32_t *at);

#endif
