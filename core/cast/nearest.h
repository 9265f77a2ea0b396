/* SPDX-License-Identifier: MIT */
/* Private to core/cast: this stage finds the first hits of rays, on what stands still, on bodies that move, and on the
 * legs of a tripod. */
#ifndef CORE_CAST_NEAREST_H
#define CORE_CAST_NEAREST_H

#include "core/cast/chunk_arrays.h"

/* Rays, and their first hits among scene and bodies. */
struct ray_hits {
    struct bvh_rays rays; /* a triangle's number is that in the body that was hit */
    int known;            /* 1: the rays have their first hits on what stands still already */
    /* cosine and body are NULL where no later stage needs them: */
    double *cosine; /* of the incidence */
    uint8_t *body;  /* 0: what stands still; k + 1: mover k */
    /* only where colours are those of textures, else NULL: */
    uint32_t *colour; /* packed as surface_colour has it */
};

/* The working memory of one thread. */
struct nearest {
    struct bvh_work *bvh;
    struct sight_work *sight;
    /* touched only where bodies are cast by themselves (a mover, a tripod's legs): */
    struct chunk_vectors mover_d, mover_p; /* rays in the frame of that body */
    double mover_range_m[CHUNK];
    uint32_t mover_hit[CHUNK], mover_label[CHUNK];
};
void caster_nearest(struct nearest *w, const struct cast_setup *s, const struct ray_hits *hits);

/* Number of the tripod's legs among the bodies, as in struct ray_hits. */
enum { CAST_LEGS = CAST_MAX_MOVERS + 1 };
/* Returns body k > 0 of those that a ray may hit. */
static inline const struct cast_mover *caster_body(const struct cast_setup *s, uint8_t body)
{
    return body == CAST_LEGS ? &s->tripod->legs : &s->mover[body - 1];
}
static inline int caster_has_bodies(const struct cast_setup *s)
{
    return s->n_movers != 0 || (s->tripod != NULL && s->tripod->has_legs);
}

#endif
