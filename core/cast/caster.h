/* SPDX-License-Identifier: MIT */
/* Private to core/cast: a thread has this working memory. Each stage of a pulse finds there what earlier stages have
 * left. */
#ifndef CORE_CAST_CASTER_H
#define CORE_CAST_CASTER_H

#include "core/cast/chunk.h"
#include "core/cast/echoes.h"
#include "core/cast/kernels_sweep.h"
#include "core/cast/nearest.h"
#include "core/cast/optics.h"

struct cast_ahead;
struct sub_ray_work;
struct wave_work;

struct caster {
    struct nearest nearest;
    struct sub_ray_work *sub_rays; /* touched only where pulses have a footprint */
    struct wave_work *waves;       /* NULL: without caster_add_waves */
    struct cast_ahead *ahead;      /* NULL: without caster_add_ahead */
    struct bvh_profile *profile;
    struct cast_counters counters;
    struct kernel_steps steps; /* of the run at hand */
    struct chunk_vectors d;    /* direction of the beam, prcs */
    uint32_t hit[CHUNK_ROOM];
    uint8_t body[CHUNK];
    struct echo_list list;
    /* touched only where the head moves, or is not ideal: */
    struct chunk_vectors socs;   /* directions of beams in the head's frame */
    struct chunk_vectors read;   /* directions that the encoders read; with an instrument's offsets, origins of beams */
    struct chunk_vectors origin; /* of beams that don't begin where the head is, prcs */
    struct path_rays paths;      /* touched only where there is glass or a mirror */
    uint32_t secondary_a[CAST_LIST], secondary_b[CAST_LIST], secondary_c[CAST_LIST]; /* echoes for the block */
};

/* Returns the rays of the pulses' centres, and the places for their hits. bodies: cosines and bodies are asked for. */
struct ray_hits caster_centres(struct caster *c, const struct chunk *k, int bodies);

#endif
