/* SPDX-License-Identifier: MIT */
/* Casting: a run of pulses -> echoes, as entries of a block.
 *
 * In: a setup (the settings that are the same for all pulses of a scan) and a run (angles and times of consecutive
 * pulses). Out: a block of line.h. The main stages are aim, nearest, optics, sub-rays, echoes, points;
 * core/cast/caster.c has all stages in their order.
 *
 * Coordinate frames: the station is a point in prcs (m). Beams are directions in socs that are turned to prcs. On a
 * moving platform each pulse has its own origin and rotation, from its firing time alone; a head that stands still
 * pays nothing for that. The hits of a pulse depend on that pulse alone: runs may be cut anywhere. */
#ifndef CORE_CAST_H
#define CORE_CAST_H

#include <stdint.h>

#include "core/bvh.h"
#include "core/colour.h"
#include "core/detect.h"
#include "core/err.h"
#include "core/footprint.h"
#include "core/georef.h"
#include "core/instrument.h"
#include "core/line.h"
#include "core/pose.h"
#include "core/scene.h"
#include "core/schedule.h"
#include "core/sight.h"
#include "core/waveform.h"

enum { CAST_MAX_MOVERS = 16, CAST_MAX_WOBBLES = 32 };

/* A rigid body that moves, with a BVH of its own, built at rest: p_prcs = rotation * p_rest + shift_m. The
 * pose holds for the runs that are cast with it. Pulses are cast in chunks of BVH_CHUNK: where all rays of a chunk
 * miss the sphere around the body, the body costs one test. */
struct cast_mover {
    const struct bvh *bvh;
    double centre_m[3], radius_m; /* sphere around the body at rest */
    double rotation[9], shift_m[3];
};

/* The tripod under the head: a cone without echoes, and maybe legs. The cone hides only a pulse's first path;
 * mirrors show the legs, if there are any. */
struct cast_tripod {
    double down[3]; /* unit, prcs: along the plumb line, however the head is tilted */
    /* Where the centre of a pulse's beam has a larger cosine with `down`, the shot has no echo. 2: there is no cone. */
    double cos_opening;
    int has_legs;
    struct cast_mover legs; /* a body that stands still */
};

/* The most panes and mirrors that a pulse is followed through. */
enum { CAST_MAX_DEPTH = 4 };

/* The steps between a hit and a point that a configuration asks for. A part that is NULL or 0 is left out.
 * Where all parts are left out, cast_setup.detect is NULL.
 *
 * A pulse has an echo of each pane that it passes, and of the surface beyond. A mirror has one only where
 * its reflectance says so. A surface seen in a mirror gives a ghost: its range is the length of the folded
 * path, along the beam, and its label is ghost_label more than the surface's. Only pulses that hit glass
 * or a mirror are cast again; a path does not branch. Panes don't refract, and are as thick as their mesh. */
struct cast_detect {
    const struct instrument *instrument;
    const struct surface_table *surfaces; /* for signal and depth; must outlive the scan */
    const struct detect_signal *signal;   /* NULL: every hit is an echo */
    int noise_by_signal;                  /* range noise from the amplitude, in place of cast_setup's sigma */
    uint32_t depth;                       /* up to CAST_MAX_DEPTH; 0: no glass, no mirrors */
    uint32_t ghost_label;
    uint32_t max_echoes;
    double separation_m; /* returns of glass and mirrors that are nearer to each other make one echo; 0: none do */
    enum detect_ambiguity ambiguity;
    uint32_t zones;
    const struct detect_ball *ball;
};

/* A beam with a footprint (core/footprint.h). Constant; any thread. With cast_detect, echoes are weighted by the power
 * that comes back, with a signal by the power received. Each is detected, and has noise, by itself. Where any part of
 * an adaptive beam's footprint lies on glass or a mirror, the footprint is cast as rings: the outlines of what is seen
 * there are not known. */
struct cast_beam {
    struct beam beam;
    enum beam_mode mode; /* BEAM_RINGS or BEAM_ADAPTIVE. Adaptive needs outlines, a head and a scene that stand still, a
                          * tripod without legs, and beams that begin at station_m (no instrument_has_offset). */
    uint32_t max_echoes; /* of a pulse; up to LINE_MAX_ECHOES */
    struct beam_pattern pattern, fine; /* sub-rays of a whole footprint; places for beam_cut */
    struct beam_outlines *outlines;    /* NULL: it has none; its maker frees them */
};

/* Colours of points. Colours by range go by the range that is sent. Height is that of the true beam, also where
 * encoders err. The frame scalar, a number that a trajectory has at each time, is that of the pulse's firing time. */
struct cast_colour {
    struct colour_scale scale;
    double frame;                           /* the frame scalar of a head that stands; that of others is in the knots */
    const struct surface_colours *surfaces; /* texture; must outlive the scan */
};

/* Disturbances of a head. They hold for the runs that are cast with this struct. The head's encoders read the wobbles;
 * the head doesn't notice the other disturbances. All 0, with a share of 1: there are none. */
struct cast_disturbance {
    int dark;         /* the laser does not fire: shots are empty, except for echoes that noise makes in waveforms */
    double slip_turn; /* the beam's pan is this much more than the encoder reads */
    /* The optical power that a soiled window lets through, both ways together, as a share of that of a clean one. With
     * a signal model each return is weaker by this factor, and detect.h has the rest. Without a signal model the fixed
     * part of the range noise is divided by this share. So the fixed part counts as the jitter of detect.h: rise time
     * over the ratio of signal and noise as voltages (Skolnik). The voltage is proportional to the optical power, and
     * thermal noise does not depend on it. */
    double share;
    uint32_t n_wobbles; /* each adds turn * sin(2 pi hz (t - begin)) to the axes, t since the scan's start */
    struct cast_wobble {
        double mirror_turn, pan_turn, hz;
        int64_t begin_ns;
    } wobble[CAST_MAX_WOBBLES];
};

/* Waveforms: the samples of a pulse go into blocks that have room for them. A single ray counts as a footprint that
 * lies on the plane it hits. Waveforms need cast_detect with a signal. */
struct cast_waves {
    const struct waveform *waveform;
    const struct beam *beam; /* the head's beam, also where cast_setup.beam is NULL */
    /* The echoes of a pulse are those that the detector finds in its samples, in place of merged returns. The echoes'
     * noise is that of the samples: cast_setup's range noise is not added. */
    int finds;
    enum waveform_detector detector;
};

/* Adds the wobbles at t_ns to scheduled angles. */
void cast_wobble(const struct cast_disturbance *disturbance, int64_t t_ns, double *mirror_turn, double *pan_turn);

/* The settings that are the same for all pulses of a scan. Only movers' poses and disturbances may change from run to
 * run. */
struct cast_setup {
    const struct bvh *bvh;
    /* The station's visibility map; NULL: none. The map is made for `bvh` and `station_m`. Rays that begin at the
     * station are looked up in it, with the same hits. All other rays are cast into the BVH: beams that begin beside
     * the station, sub-rays, rays beyond glass and mirrors, and rays to moving bodies. A head that moves has no
     * sight. */
    const struct sight *sight;
    const struct georef *georef; /* geo layout */
    double station_m[3];         /* the head's origin, prcs */
    double rotation[9];          /* socs -> prcs, row by row */
    double range_min_m, range_max_m;
    int noise_on;
    double range_sigma_m, range_sigma_ppm;
    uint64_t noise_key;               /* rng_key(seed, RNG_RANGE) */
    uint64_t scan_key;                /* rng_scan: of all noise */
    double mirror_counts, pan_counts; /* encoder counts per turn; 2^32: ideal, positions take the true angle */
    enum line_layout layout;
    double range_scale_m;
    double xyz_scale[3]; /* units of the CRS per count, see georef_scale */
    /* NULL: pulses are single rays. Else blocks have room for beam->max_echoes entries a pulse. */
    const struct cast_beam *beam;
    enum beam_select echoes; /* which echoes of a pulse are sent */
    uint32_t max_echoes;     /* of a pulse, no more than detect or beam allow; 0: as many as they allow */
    double pulse_m;          /* c tau / 2, as a beam's resolution_m; for the widths of echoes, where a block has room */
    uint32_t n_movers;
    struct cast_mover mover[CAST_MAX_MOVERS];
    const struct cast_tripod *tripod; /* NULL: none. For a head that stands still */
    /* The poses of a moving head (socs -> prcs), in order of time; between two of them pose_between holds. Before the
     * first and after the last the head stands. With knots, geo positions are relative to station_m, and rotation is
     * not used. n_knots 0: the head stands still at station_m. */
    uint32_t n_knots;
    const struct pose_knot *knot;
    const uint8_t *silent; /* by label: surfaces that hide what is behind them and give no echo; NULL: none */
    /* NULL: the head is ideal, and every hit within the limits is one echo. Else detect->max_echoes replaces
     * beam->max_echoes. */
    const struct cast_detect *detect;
    const struct cast_colour *colour; /* for blocks with room for colours; NULL: none, and nothing is spent on them */
    const struct cast_disturbance *disturbance; /* NULL: no disturbance. Not for caster_meet */
    const struct cast_waves *waves; /* NULL: none, and nothing is spent on them. For casters with caster_add_waves */
};

/* Counts of what became of pulses. */
struct cast_counters {
    uint64_t decided;      /* struct bvh_counters */
    uint64_t few, asked;   /* with a sight: struct sight_counters */
    uint64_t unfit;        /* echoes whose position did not fit into 32 bits: shots without echo, or fewer echoes */
    uint64_t faint;        /* hits that a head doesn't detect: shots without echo, or fewer echoes. They are below the
                            * threshold, in a blind time, on a surface without echo, or at a range of 0 or less */
    uint64_t crowded;      /* echoes beyond max_echoes: the weakest, left out */
    uint64_t hidden;       /* pulses into the tripod's cone: shots without echo */
    uint64_t lost_samples; /* of waveforms, for which a block had no room */
    /* with a beam */
    uint64_t outlined; /* adaptive: pulses whose footprint an outline cuts, or that see glass or a mirror */
    uint64_t sub_rays; /* cast beyond the central ones */
    uint64_t ragged;   /* adaptive: pulses with more outlines than BEAM_MAX_LINES, more parts than BEAM_MAX_PARTS, or
                        * outlines that are not all known after a few passes: cast as rings */
};

struct caster;

/* Makes the working memory of one thread. */
int caster_create(struct caster **out, struct sh_err *err);
void caster_free(struct caster *caster);
/* Makes memory for waveforms. Without it a caster casts as if its setups had none. */
int caster_add_waves(struct caster *caster, struct sh_err *err);

/* ---- lines ahead: their first hits are found together, in less time than line by line */

enum { CAST_AHEAD_RUNS = 8 };
struct emitter;
/* Makes memory for the hits of so many pulses. Without it a caster does not look ahead. */
int caster_add_ahead(struct caster *caster, uint32_t pulses, struct sh_err *err);
/* Returns the number of pulses, in consecutive lines, whose hits a head of this setup can find ahead. It is 0 with a
 * sight, on a head that moves or has a disturbance, with beams of rings, with beams that begin beside the station, and
 * for all heads but line heads. A head that moves has its knots in the setup. emitter: the schedule's. */
uint32_t caster_room_ahead(const struct caster *caster, const struct cast_setup *setup, const struct emitter *emitter);
/* Finds the first hits of runs, each a line or a part of one. Later casts of the same pulses take these hits, until the
 * next call or caster_forget. Such casts must have the same setup, but for movers. Where the runs have more pulses than
 * there is room for, the last runs are left out. n_runs is at most CAST_AHEAD_RUNS. Call it only for a setup for
 * which caster_room_ahead is not 0. Allocates nothing. */
void caster_look_ahead(struct caster *caster, const struct cast_setup *setup, const struct schedule_run *run,
                       uint32_t n_runs);
/* Later casts find all their hits themselves. */
void caster_forget(struct caster *caster);

/* Fills block from the run, with attributes where it has room for them. Returns the number of echoes. Allocates
 * nothing. The echo of a single ray has the width of the pulse. The echo of a footprint, or of returns merged from
 * glass and mirrors, has the width that core/footprint.h defines. An echo that is found in a waveform has the width
 * that the detector finds. An amplitude needs a signal model. Range noise moves echoes, and doesn't widen them. The
 * block has capacity for run->n times the echoes that a pulse may have: 1 + depth with a single ray, beam->max_echoes
 * with a beam, and max_echoes with either where echoes are found in waveforms. */
uint32_t caster_cast(struct caster *caster, const struct cast_setup *setup, const struct schedule_run *run,
                     struct line_block *block);

/* The hit of a pulse's centre, with its triangle. */
struct cast_hit {
    double p_m[3], range_m; /* prcs; along the beam */
    double cosine;          /* of the incidence, 0..1 */
    uint32_t pulse;         /* of the run, from 0 */
    uint32_t triangle;      /* of the scene, or of the body */
    uint8_t body;           /* 0: what stands still; k + 1: mover k; CAST_MAX_MOVERS + 1: the legs of the tripod */
    uint8_t front;          /* the triangle's corners go counter-clockwise as seen from the head */
};

/* Casts a run's pulses as single rays without noise, and fills `hit` with the hits that the head can report. These hits
 * lie within the head's ranges and zones, and are at or above the detection threshold. A pane that is passed is a hit,
 * and so is the surface beyond it. A surface seen in a mirror is no hit: nothing is there. The head stands still. hit
 * has room for (1 + depth) run->n. Returns the number of hits. The hits are in order of pulse, then of range.
 * Allocates nothing. */
uint32_t caster_meet(struct caster *caster, const struct cast_setup *setup, const struct schedule_run *run,
                     struct cast_hit *hit);

/* Finds exact hits (bvh.h) with the caster's working memory. */
void caster_hits(struct caster *caster, const struct bvh *bvh, const struct bvh_rays *rays);

/* Calls beam_outlines_create with a probe that casts its rays into bvh. So outlines are left out that are hidden from
 * the station, or on whose two sides range and kind of surface are the same. Where detection models surfaces, the
 * caller lets surface_kinds fill spec->kind; else spec->kind is NULL. The function allocates: call it before the
 * scan. */
int cast_outlines(const struct beam_outlines_spec *spec, const struct bvh *bvh, struct beam_outlines **out,
                  struct sh_err *err);

/* Cost by stage, for measuring. */
enum cast_stage {
    CAST_DIRECTIONS = BVH_STAGE_PREPARE,
    CAST_EMBREE = BVH_STAGE_EMBREE,
    CAST_REFINE = BVH_STAGE_REFINE,
    CAST_DETECT = BVH_STAGES,
    CAST_NOISE,
    CAST_POSITIONS,
    CAST_STAGES
};
/* Measures the cost of each stage. NULL: off, which costs nothing that could be measured. The profile stays the
 * caller's. */
void caster_set_profile(struct caster *caster, struct bvh_profile *profile);

void caster_get_counters(const struct caster *caster, struct cast_counters *counters);

#endif
