/* SPDX-License-Identifier: MIT */
/* This computes a beam by brute force. Each pulse has 1,000 sub-rays on a spiral (Vogel 1979) in place of rings, and
 * each is cast by itself to its exact range. Echoes follow from a plain reading of core/footprint.h. */
#ifndef TESTS_COMMON_BEAM_REFERENCE_H
#define TESTS_COMMON_BEAM_REFERENCE_H

#include "core/cast.h"

enum { BEAM_REF_RAYS = 1000, BEAM_REF_ECHOES = 32 };

struct beam_ref_echo {
    double range_m, energy;
    uint32_t label; /* of its strongest surface */
};

struct beam_ref {
    uint32_t n; /* echoes */
    struct beam_ref_echo echo[BEAM_REF_ECHOES];
    int partial;     /* some sub-rays met nothing, or an echo was too weak */
    double spread_m; /* of all ranges */
};

void beam_ref_pulse(struct caster *caster, const struct bvh *bvh, const struct beam *beam, const double station_m[3],
                    const double dir[3], double range_max_m, struct beam_ref *out);

/* Returns the mean range over the footprint on the plane n . p = d, seen from the origin. The value follows from the
 * definition: sub-rays are straight lines of the hyperboloid, and their weights are their Gaussian. The integral is
 * Simpson's rule over t = rho^2, with equal steps over phi. */
double beam_ref_plane_mean(const struct beam *beam, const double dir[3], const double n[3], double d);

/* Counts of echoes that were compared with the reference's. */
struct beam_tally {
    uint64_t pulses, mixed, wrong, wrong_mixed, echoes; /* wrong: pulses with another number of echoes */
    uint64_t off;                                       /* of `echoes`: those off by more than the resolution */
    double range2, near2;                               /* sums of squared differences: of `echoes`; of those not off */
};
/* Compares the pulse whose entries begin at *at, and moves *at to the next pulse. */
void beam_compare(struct beam_tally *tally, const struct line_block *block, uint32_t *at, const struct beam_ref *ref);

/* This is a scan cast with a beam, with the directions of its pulses. */
struct beam_rig {
    struct scene *scene;
    struct bvh *bvh;
    struct georef *georef;
    struct caster *caster;
    struct beam_outlines *outlines;
    struct cast_beam beam;
    struct cast_setup setup;
    struct schedule_segment segment;
    struct line_block block;
};
/* The rig takes the scene over. The beam has a divergence of 0.35 mrad, 7 mm at the exit, and pulses of 4 ns. The view
 * has lines of `pulses`, from line_start to line_stop, and spreads them over the pan's range in `lines`. */
struct beam_view {
    double line_start_deg, line_stop_deg, pan_start_deg, pan_stop_deg;
    uint32_t lines, pulses;
};
int beam_rig_open(struct beam_rig *rig, struct scene *scene, const double station_m[3], const struct beam_view *view,
                  struct sh_err *err);
void beam_rig_close(struct beam_rig *rig);
/* Casts 128 sub-rays for a pulse, in place of 1,000. Where they hit nothing but one smooth surface, with ranges within
 * 5 mm, they are the reference, and this returns 1. 48 of them run around the rim. A cap with 1 % of the energy
 * that an edge cuts off begins at 0.87 of the radius at most, so several lie in it. The others are 0.2 radii apart.
 * Bodies that fit between those, such as wires, need the 1,000. */
int beam_ref_plain(const struct beam_rig *rig, const double dir[3], struct beam_ref *out);
/* The mode SINGLE has no beam. */
void beam_rig_mode(struct beam_rig *rig, enum beam_mode mode, uint32_t rings);
uint32_t beam_rig_line(struct beam_rig *rig, uint32_t line);
/* Writes the directions of the line's pulses. */
void beam_rig_directions(struct beam_rig *rig, uint32_t line, double *dx, double *dy, double *dz);

#endif
