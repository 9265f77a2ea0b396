/* Private to core/cast: the working memory of one thread, and what its parts share. */
#ifndef CORE_CAST_CASTER_PRIVATE_H
#define CORE_CAST_CASTER_PRIVATE_H

#include "core/cast/kernels.h"

/* Pulses worked on at a time: the arrays stay in the second-level cache, the hits' planes are on their way. */
enum { CHUNK = BVH_CHUNK, CAST_LIST = CHUNK * LINE_MAX_ECHOES, CAST_FOUND = CHUNK * CAST_MAX_DEPTH };
enum { CAST_NO_PATH = 0xffffffff };

struct mover_rays {
    double dx[CHUNK], dy[CHUNK], dz[CHUNK], range_m[CHUNK];
    uint32_t hit[CHUNK];
};

/* Of a moving head, or one whose beams do not begin at its origin. */
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

/* Rays of a chunk, prcs, and what they meet first. */
struct ray_set {
    const double *dx, *dy, *dz;
    double *range_m;
    uint32_t *label;
    uint32_t *hit; /* triangle of the body that was met */
    /* only where detection asks for it, else NULL: */
    double *cosine; /* of the incidence */
    uint8_t *body;  /* 0: what stands still; k + 1: mover k */
};

/* Echoes of a chunk, in order of pulse, then of range; those of a pulse follow each other. */
struct echo_list {
    uint32_t n;
    uint32_t pulse[CAST_LIST]; /* index in the chunk */
    uint8_t number[CAST_LIST]; /* among the pulse's, from 0: for random numbers */
    double range_m[CAST_LIST]; /* NaN: not detected */
    double cosine[CAST_LIST];
    double energy[CAST_LIST]; /* share of the pulse's energy that took this way */
    double rho[CAST_LIST];    /* what comes back of it; the energy itself where surfaces are not modelled */
    uint32_t label[CAST_LIST];
    uint8_t ghost[CAST_LIST];
    /* of detection */
    uint64_t key[CAST_LIST];
    double amplitude[CAST_LIST];
    int16_t refl_cdb[CAST_LIST];
    uint8_t echo[CAST_LIST];
    double mirror_turn[CAST_LIST], pan_turn[CAST_LIST];
    uint32_t dt_ns[CAST_LIST];
    /* touched only where the block has room for attributes: */
    float width_m[CAST_LIST];
    int16_t amplitude_cdb[CAST_LIST];
    uint32_t from[CAST_LIST]; /* once the list is what is sent: where an entry's width and amplitude are */
};

/* Rays behind glass or off a mirror: where they begin, where they go, what they met before. */
struct path_rays {
    uint32_t n;
    uint32_t ray[CHUNK]; /* of those that they go on from */
    double px[CHUNK], py[CHUNK], pz[CHUNK], dx[CHUNK], dy[CHUNK], dz[CHUNK];
    double length_m[CHUNK]; /* of the way so far */
    double energy[CHUNK];
    uint8_t ghost[CHUNK];
    double range_m[CHUNK], cosine[CHUNK];
    uint32_t label[CHUNK], hit[CHUNK];
    uint8_t body[CHUNK];
    /* what was found on the ways, chained per ray: first[i], next[..] up to CAST_NO_PATH */
    uint32_t first[CHUNK], last[CHUNK];
    uint32_t n_found, next[CAST_FOUND];
    uint32_t found_label[CAST_FOUND];
    double found_m[CAST_FOUND], found_cosine[CAST_FOUND], found_energy[CAST_FOUND];
    uint8_t found_ghost[CAST_FOUND];
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
    struct moving_rays moving;          /* touched only where the head moves, or is not ideal */
    float *steep;                       /* where 1 / cos^2 of the incidence goes; NULL: not asked for */
    const uint8_t *begins;              /* of the rays at hand, where packets begin (bvh.h) */
    int scattered;                      /* of the rays at hand, neighbours have nothing in common */
    struct beam_work *beam;             /* touched only where pulses have a footprint */
    struct cast_counters counters;
    struct cast_profile *profile;
    int attributes; /* the block at hand has room for them */
    /* touched only where detection is modelled: */
    struct echo_list list;
    double cosine[CHUNK];
    uint8_t body[CHUNK];
    struct path_rays paths; /* touched only where there is glass or a mirror */
};

/* What has passed since the stage before belongs to this one. */
static inline void caster_ends(struct caster *c, enum cast_stage stage)
{
    if (c->profile == NULL) return;
    uint64_t now = c->profile->now();
    c->profile->spent[stage] += now - c->profile->last;
    c->profile->last = now;
}

/* ---- caster.c */
/* Exact hits of n rays from one point, or (n <= CHUNK) each from its own; labels of the last chunk in c->seen. */
void caster_hits_from(struct caster *c, const struct bvh *bvh, const struct origins *from, double range_max_m,
                      uint32_t n, const double *dx, const double *dy, const double *dz, double *range_m,
                      uint32_t *triangle);
/* What the rays of a chunk meet first, of all there is. */
void caster_nearest(struct caster *c, const struct cast_setup *s, const struct origins *from, const struct ray_set *set,
                    uint32_t n);
/* n entries from `at` on without a reflectance: nothing is known of it. (By a pointer of its own the loop is vectors.)
 */
static inline void caster_no_reflectance(const struct line_block *block, uint32_t at, uint32_t n)
{
    int16_t *refl_cdb = block->refl_cdb + at;
    for (uint32_t i = 0; i < n; i++)
        refl_cdb[i] = LINE_REFL_NONE;
}

/* Positions as a head computes them, from range_m and what its encoders read (c->e, or the turns): entries at .. at + n
 * of the block. Returns how many coordinates did not fit; they are LINE_XYZ_NONE. */
uint32_t caster_wire(struct caster *c, const struct cast_setup *s, int linear, const double *range_m,
                     struct line_block *block, uint32_t at, uint32_t n);
/* Where some did not: these are no echoes, and counted; the pulse's other echoes are numbered anew, but one entry of a
 * pulse stays. Returns how many entries are left of n; *echoes: how many echoes are among them. */
uint32_t caster_drop_unfit(struct caster *c, struct line_block *block, uint32_t at, uint32_t n, uint32_t *echoes);

/* ---- attributes.c: only for a block that has room for them. */
/* A width as it is told. */
uint16_t caster_width(float width_m);
/* Of entries at .. at + n, whose echo numbers are set. */
void caster_widths(const struct line_block *block, uint32_t at, const float *width_m, uint32_t n);
void caster_no_amplitudes(const struct line_block *block, uint32_t at, uint32_t n);
/* Likewise, of single rays where detection is not modelled. */
void caster_pulse_attributes(const struct cast_setup *s, const struct line_block *block, uint32_t at, uint32_t n);
/* Widths of echoes of footprints that one ray stands for. steep: 1 / cos^2 of the incidences. */
void caster_plane_widths(const struct beam *beam, const float *steep, const double *range_m, uint32_t n,
                         float *width_m);
/* Of the list, whose entries go to `out`. */
void caster_list_attributes(const struct echo_list *list, const struct line_block *block, uint32_t out);

/* ---- texels.c: labels of what has been met get the reflectance there, as surface_texel has it. Nothing where the
 * surfaces have no textures. */
void caster_texels(const struct cast_setup *s, const struct origins *from, const struct ray_set *set, uint32_t n);

/* ---- aim.c */
/* Poses of a moving head: s (and, with geo, r) of c->moving -> d (and e), and the origins p. */
void caster_move(struct caster *c, const struct cast_setup *s, int64_t t0_ns, const uint32_t *dt_ns, uint32_t n,
                 int geo);
/* Socs to where positions go: straight to the CRS where that is a rotation, else to prcs. Returns 1 in the first case.
 */
int caster_reading_rotation(const struct cast_setup *s, double to_crs[9]);
/* Where the beams of an ideal head go and begin: pulses at .. at + n of a run. dt_ns: of the run's pulses. Returns
 * whether c->e, for geo layout, is in the CRS already. */
int caster_aim(struct caster *c, const struct cast_setup *s, const struct schedule_run *run, const uint32_t *dt_ns,
               uint32_t at, uint32_t n, struct origins *from);
/* The same, as the mechanics are; c->mirror_turn and pan_turn become what the encoders say. dt_ns: of these pulses. */
void caster_aim_bent(struct caster *c, const struct cast_setup *s, const struct schedule_run *run,
                     const uint32_t *dt_ns, uint32_t at, uint32_t n, struct origins *from);

/* ---- optics.c */
/* True for glass and mirrors, where detection has a depth. */
int caster_goes_on(const struct cast_setup *s, uint32_t label);
/* What n <= CHUNK rays, which have met `met` with body and cosine, come to behind glass and off mirrors -> chains of
 * c->paths. */
void caster_follow_rays(struct caster *c, const struct cast_setup *s, const struct origins *from,
                        const struct ray_set *met, uint32_t n);
/* The rays are pulses: their hits and chains -> c->list, without rho. */
void caster_list_paths(struct caster *c, const struct ray_set *met, uint32_t n);

/* ---- detected.c: a chunk with everything that cast_detect asks for. first: its first pulse in the run; entries from
 * *at on. dt_ns: times of the chunk's pulses. Returns the number of echoes. */
uint32_t caster_detected(struct caster *c, const struct cast_setup *s, const struct schedule_run *run,
                         const uint32_t *dt_ns, uint32_t first, uint32_t n, struct line_block *block, uint32_t *at);
/* A bare pane or mirror sends nothing back: no echo, whether there is a signal model or not. */
int caster_is_bare(const struct cast_setup *s, uint32_t label, double rho);

/* ---- report.c: what was detected (c->list; each pulse of the chunk has at least one entry, with a range of NaN where
 * it is no echo) -> entries of the block from `out` on. c->mirror_turn and pan_turn: what the encoders said. Returns
 * the number of echoes; *entries: how many were written. */
uint32_t caster_report(struct caster *c, const struct cast_setup *s, const struct schedule_run *run,
                       const uint32_t *dt_ns, struct line_block *block, uint32_t out, uint32_t *entries);

/* ---- beam.c */
int beam_work_create(struct beam_work **out, struct sh_err *err);
void beam_work_free(struct beam_work *work);
/* n pulses are aimed: casts them, with sub-rays where they are needed. */
void beam_cast(struct caster *c, const struct cast_setup *s, const struct origins *from, uint32_t n);
/* ---- what was cast, beam_points.c: into the block from entry *at on, where there is no cast_detect. dt_ns: of these
 * pulses. Returns the number of echoes. */
uint32_t beam_write_points(struct caster *c, const struct cast_setup *s, int linear, uint64_t pulse0,
                           const uint32_t *dt_ns, uint32_t n, struct line_block *block, uint32_t *at);
/* ---- beam_list.c: -> c->list, with rho. */
void beam_list(struct caster *c, const struct cast_setup *s, uint32_t n);

#endif
