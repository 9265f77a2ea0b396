/* SPDX-License-Identifier: MIT */
/* Private to core/cast: the working memory of one thread, and the stages of a pulse, which share it. */
#ifndef CORE_CAST_CASTER_PRIVATE_H
#define CORE_CAST_CASTER_PRIVATE_H

#include "core/cast/kernels.h"

/* Pulses worked on at a time: the arrays fit into the second-level cache while the hits' planes are fetched. */
enum { CHUNK = BVH_CHUNK, CAST_FOUND = CHUNK * CAST_MAX_DEPTH };
/* Arrays whose distance is a power of two, or a page, would collide in a cache. */
enum { CHUNK_ROOM = CHUNK + 48, CAST_LIST = CHUNK * LINE_MAX_ECHOES + 80 };
enum { CAST_NO_PATH = 0xffffffff };

struct chunk_vectors {
    double x[CHUNK_ROOM], y[CHUNK_ROOM], z[CHUNK_ROOM];
};
struct list_vectors {
    double x[CAST_LIST], y[CAST_LIST], z[CAST_LIST];
};

/* A chunk: consecutive pulses of a run, and where they go in the block. */
struct chunk {
    const struct cast_setup *s;
    const struct schedule_run *run;
    struct line_block *block;
    const uint32_t *dt_ns; /* of its pulses */
    uint64_t pulse0;       /* number of its first pulse in the scan */
    uint32_t first, n;     /* pulses first .. first + n of the run */
    uint32_t at;           /* the block's entry that comes next */
    struct bvh_origins from;
    int linear;     /* the directions that the encoders read are turned into the CRS already */
    int attributes; /* the block has room for them */
    int colours;    /* likewise */
    int texels;     /* colours are those of textures: hits carry them */
};

/* Rays, and their first hits among scene and bodies. */
struct met {
    struct bvh_rays rays; /* a triangle's number is that in the body that was hit */
    /* only where surfaces are modelled or bodies move, else NULL: */
    double *cosine; /* of the incidence */
    uint8_t *body;  /* 0: what stands still; k + 1: mover k */
    /* only where colours are those of textures, else NULL: */
    uint32_t *colour; /* packed as surface_colour has it */
};

/* Echoes of a pulse after its first one: entries at .. at + n of the list. */
struct further {
    uint32_t pulse, at, n;
};

/* The echoes of a chunk. Entry i < pulses is the first of pulse i, or says that it has none (range NaN):
 * single rays are in their places without being moved. Further ones follow, those of a pulse together, by
 * range. */
struct echo_list {
    uint32_t n;
    uint32_t n_further; /* pulses with further echoes, in order */
    struct further further[CHUNK];
    double range_m[CAST_LIST]; /* NaN: no echo */
    uint32_t label[CAST_LIST];
    double mirror_turn[CAST_LIST], pan_turn[CAST_LIST]; /* as the encoders read them */
    struct list_vectors e; /* direction as the encoders read it, then the position; geo layout */
    struct list_vectors p; /* where the head is, prcs; touched only where it moves */
    /* touched only where something asks for it: */
    uint8_t number[CAST_LIST]; /* among the pulse's echoes, from 0, left-out ones included */
    uint64_t key[CAST_LIST];   /* for random numbers */
    double cosine[CAST_LIST];
    double energy[CAST_LIST]; /* share of the pulse's energy that took this way */
    double rho[CAST_LIST];    /* what comes back of it; the energy itself where surfaces are not modelled */
    uint8_t ghost[CAST_LIST];
    double amplitude[CAST_LIST];
    int16_t refl_cdb[CAST_LIST], amplitude_cdb[CAST_LIST];
    float width_m[CAST_LIST];
    uint32_t colour[CAST_LIST]; /* packed */
};

/* The hit of a ray after it passed glass or left a mirror. */
struct path_hit {
    double range_m, cosine, energy; /* along the folded way; the share of the ray's energy */
    uint32_t label, next;           /* the ray's next one, or CAST_NO_PATH */
    uint32_t triangle, colour;
    uint8_t ghost, body;
};

/* Rays that go on through glass or off a mirror: their origins, directions, and hits before. */
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

struct sub_ray_work;

struct caster {
    struct bvh_work *bvh;
    struct sight_work *sight;
    struct sub_ray_work *sub_rays; /* touched only where pulses have a footprint */
    struct bvh_profile *profile;
    struct cast_counters counters;
    struct kernel_steps steps; /* of the run at hand */
    struct chunk_vectors d;    /* direction of the beam, prcs */
    uint32_t hit[CHUNK_ROOM];
    uint8_t body[CHUNK];
    struct echo_list list;
    /* touched only where something moves: */
    struct chunk_vectors mover_d, mover_p; /* rays in the frame of a moving body */
    double mover_range_m[CHUNK];
    uint32_t mover_hit[CHUNK], mover_label[CHUNK];
    /* touched only where the head moves, or is not ideal: */
    struct chunk_vectors socs, read; /* directions, socs: of the beam; as the encoders read it, or its origin */
    struct chunk_vectors origin;     /* of beams that don't begin where the head is, prcs */
    struct path_rays paths;          /* touched only where there is glass or a mirror */
    uint32_t further_a[CAST_LIST], further_b[CAST_LIST], further_c[CAST_LIST]; /* on their way into the block */
};

/* ---- aim.c: angles, beam directions and origins; directions as the encoders read them. */
void caster_aim(struct caster *c, struct chunk *k);
/* Computes e of the list again, after the encoders' angles have changed. */
void caster_aim_read(struct caster *c, struct chunk *k);

/* ---- upset.c: disturbances of the head; each is called only where the setup has it. */
/* Adds wobbles to the angles of a chunk. */
void caster_wobble(struct caster *c, const struct chunk *k);
/* socs -> socs: directions as the encoders read them become those of a beam whose pan has slipped. */
void caster_slip(const struct cast_upset *upset, double slip[9]);
/* Makes all shots empty, as of a laser that does not fire. */
void caster_darken(struct caster *c, const struct chunk *k);
/* Weakens the returns by a soiled window. */
void caster_weaken(const struct cast_upset *upset, uint32_t n, double *rho);

/* ---- nearest.c */
void caster_nearest(struct caster *c, const struct cast_setup *s, const struct met *met);
/* Number of the tripod's legs among the bodies, as in struct met. */
enum { CAST_LEGS = CAST_MAX_MOVERS + 1 };
/* Body k > 0 of those that a ray may meet. */
static inline const struct cast_mover *caster_body(const struct cast_setup *s, uint8_t body)
{
    return body == CAST_LEGS ? &s->tripod->legs : &s->mover[body - 1];
}
static inline int caster_has_bodies(const struct cast_setup *s)
{
    return s->n_movers != 0 || (s->tripod != NULL && s->tripod->has_legs);
}
/* ---- tripod.c: pulses into the tripod's cone lose their echoes. Called before optics for single rays, so that
 * nothing is followed; for footprints once these have become echoes. */
void caster_hide(struct caster *c, const struct chunk *k);
/* ---- texels.c: labels of hits get the reflectance there, as surface_texel has it, and met->colour gets the
 * colour. Does nothing where surfaces have no textures and no colours are asked for. */
void caster_texels(const struct cast_setup *s, const struct met *met);

/* ---- optics.c */
/* True for glass and mirrors, where detection has a depth. */
int caster_goes_on(const struct cast_setup *s, uint32_t label);
/* A bare pane or mirror sends nothing back: no echo, whether there is a signal model or not. */
int caster_is_bare(const struct cast_setup *s, uint32_t label, double rho);
/* Follows up to CHUNK rays through glass and off mirrors. Their hits are chains in c->paths. */
void caster_follow(struct caster *c, const struct cast_setup *s, const struct met *met);

/* ---- sub_rays.c */
/* The pulses of a chunk as footprints -> the list, with rho where something asks for it. */
void caster_sub_rays(struct caster *c, const struct chunk *k);

/* ---- echoes.c: from hits to the echoes that the head reports; the list has a place for each pulse. */
/* Further echoes of a pulse: room for n at the end of the list. Returns the first. */
uint32_t echoes_further(struct echo_list *list, uint32_t pulse, uint32_t n);
void caster_echoes(struct caster *c, const struct chunk *k);
/* How many echoes a pulse may send. */
uint32_t caster_max_echoes(const struct cast_setup *s);

/* ---- colours.c: the colours of all echoes in the list that is to be sent. */
void caster_colours(struct caster *c, const struct chunk *k);

/* ---- points.c: entries of the block from k->at on. Returns the number of echoes. */
uint32_t caster_points(struct caster *c, struct chunk *k);

#endif
