/* SPDX-License-Identifier: MIT */
/* Private to core/cast: this stage follows rays through glass and off mirrors. */
#ifndef CORE_CAST_OPTICS_H
#define CORE_CAST_OPTICS_H

#include "core/cast/chunk_arrays.h"

enum { CAST_NO_PATH = 0xffffffff };

/* The hit of a ray after it passed glass or left a mirror. */
struct path_hit {
    double range_m, cosine, energy; /* along the folded way; the share of the ray's energy */
    uint32_t label, next;           /* the ray's next one, or CAST_NO_PATH */
    uint32_t triangle, colour;
    uint8_t ghost, body;
};

/* Rays that go on through glass or off a mirror: their origins and directions, and the hits that they come from. */
struct path_rays {
    uint32_t n;
    uint32_t ray[CHUNK]; /* number of the ray that each goes on from */
    struct chunk_vectors p, d;
    double length_m[CHUNK]; /* of the way so far */
    double energy[CHUNK];
    uint8_t ghost[CHUNK];
    double range_m[CHUNK], cosine[CHUNK];
    uint32_t label[CHUNK], hit[CHUNK], colour[CHUNK];
    uint8_t body[CHUNK];
    /* hits on the paths, chained per ray: first[i] .. last[i] */
    uint32_t first[CHUNK], last[CHUNK];
    uint32_t n_found;
    struct path_hit found[CAST_FOUND];
};

struct nearest;
struct ray_hits;

/* Returns 1 for glass and mirrors. To be called only with s->detect->depth above 0. */
int caster_goes_on(const struct cast_setup *s, uint32_t label);
/* Sets n to the unit normal of a triangle of the scene (body 0) or of a body, prcs. */
void caster_normal(const struct cast_setup *s, uint8_t body, uint32_t triangle, double n[3]);
/* Returns 1 for a bare pane or mirror, which sends nothing back: it has no echo, with or without a signal model. */
int caster_is_bare(const struct cast_setup *s, uint32_t label, double rho);
/* Returns the signal that a head models, or NULL. */
static inline const struct detect_signal *caster_signal(const struct cast_setup *s)
{
    return s->detect != NULL ? s->detect->signal : NULL;
}
/* Follows up to CHUNK rays through glass and off mirrors. The rays' hits are chains in p. */
void caster_follow(struct nearest *w, const struct cast_setup *s, const struct ray_hits *first, struct path_rays *p);

#endif
