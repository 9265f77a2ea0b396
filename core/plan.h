/* SPDX-License-Identifier: MIT */
/* The plan: which method each stage uses. In: a tolerance, the options of a stage, and what is known of head and scene.
 * Out: the method, and a row with its error bound (m), its cost (ns per pulse), the options that were left out, and the
 * reasons.
 *
 * Each stage takes the cheapest option whose bounds hold the tolerance. Where none does, it takes the one with the
 * least error, and the row says so. The configuration can force an option, whatever its bounds are. Bounds are proven
 * (georeferencing) or found by sampling: some thousands of the head's own pulses, drawn with a fixed key, are cast with
 * the option and with the reference. Costs are rounded figures (core/plan/cost.h). They are not measured while
 * planning, so that the same scene, head and tolerance always have the same plan. No clock, no files. */
#ifndef CORE_PLAN_H
#define CORE_PLAN_H

#include <stdint.h>

#include "core/cast.h"
#include "core/detect.h"
#include "core/georef.h"

struct plan_tolerance {
    double range_m;    /* RMS error of the echo ranges */
    double echo_share; /* share of the pulses that have another number of echoes */
};

/* A way to do a stage. */
struct plan_option {
    char method[32];
    double error_m;    /* bound; NaN: not known */
    double echo_share; /* bound; NaN: not known */
    double cost_ns;    /* per pulse, added to the cost of a single ray; < 0 where it saves; NaN: depends on the scene */
    char why_not[96];  /* why it is not possible; empty: it is */
    enum beam_mode mode; /* of a beam: plan_beam_option sets both */
    uint32_t rings;
};

enum { PLAN_MAX_OPTIONS = 12 };

struct plan_row {
    char stage[16], method[32];
    double error_m, echo_share, cost_ns; /* as in struct plan_option */
    char why[224];
    int forced; /* the configuration says so, not the plan */
    uint32_t n_left;
    struct plan_option left[PLAN_MAX_OPTIONS]; /* the options left out; why_not says why */
};

/* A choice to be made. */
struct plan_choice {
    const char *stage;
    const struct plan_option *option; /* [n], the most exact one last */
    uint32_t n;
    int forced;      /* number of the option that the configuration names; -1: none */
    const char *key; /* the configuration's key for this choice */
    struct plan_tolerance tolerance;
};

/* Chooses, fills row (stage, method, figures, forced, left, why) and returns the number of the option. */
uint32_t plan_choose(const struct plan_choice *choice, struct plan_row *row);
/* Whether an option's bounds hold. */
int plan_holds(const struct plan_option *option, const struct plan_tolerance *tolerance);

/* ---- georeferencing */

/* The demands on a georeferencing. */
struct plan_georef_need {
    double radius_m, height_m; /* of the points from the centre: horizontally, and up or down */
    double tolerance_m;
    enum georef_method forced; /* GEOREF_AUTO: the cheapest one whose bound meets the tolerance, else exact */
};

/* Chooses the method and fills row. SH_EINPUT: the forced method has no bound here. The georef is not changed. */
int plan_georef(const struct georef *georef, const struct plan_georef_need *need, enum georef_method *method,
                struct plan_row *row, struct sh_err *err);
/* Fills the row where points are sent as range and angles. */
void plan_georef_polar(struct plan_row *row);

/* ---- sampling */

/* A place that the head fires from, with its setup and the pulses of a scan there. */
struct plan_place {
    struct cast_setup setup; /* as the run's */
    struct cast_beam *beam;  /* its footprint; NULL: none. Sampling leaves another mode and pattern in it. */
    struct schedule_segment segment;
    uint64_t pulses; /* the number to draw from; it includes pulses outside the field of view */
    /* Sets the poses of head and bodies at a time of the scan; NULL: nothing moves. */
    void (*enter)(void *ctx, int64_t t_ns, struct cast_setup *setup);
    void *ctx;
};

struct plan_places {
    struct plan_place *place; /* [n] */
    uint32_t n;
};

struct plan_sample;

/* Makes a sample without pulses: the functions below draw them, from one place after the other in turn. A pulse outside
 * the field of view is drawn anew, from the next place. 61 sub-rays show which footprints lie on one smooth surface.
 * Such footprints are many and alike: only some of them are cast with the reference. The places must outlive the
 * sample. Where report asks to stop, sampling ends at once, and its figures mean nothing. */
int plan_sample_create(const struct plan_places *places, const struct sh_report *report, struct plan_sample **out,
                       struct sh_err *err);
void plan_sample_free(struct plan_sample *sample);

/* Finds the error of the option's beam against BEAM_MAX_RINGS rings (1,027 sub-rays): sets error_m and echo_share,
 * and for BEAM_ADAPTIVE, whose places have outlines, cost_ns. BEAM_SINGLE: one ray. Both figures have margins: error_m
 * is the root of the mean square plus three standard errors of that mean. For footprints that do not lie on one smooth
 * surface, echo_share has the 95 % limit of Poisson's distribution. For the other footprints it has the share that was
 * found, without a margin. The first call casts the reference. */
void plan_sample_beam(struct plan_sample *sample, struct plan_option *option);

/* Finds the error of following pulses through only `depth` surfaces of glass or mirrors, against CAST_MAX_DEPTH. A
 * pulse whose way goes on after CAST_MAX_DEPTH surfaces counts as wrong: the rest of its way is not known. Sets
 * error_m, echo_share and cost_ns of option. */
void plan_sample_optics(struct plan_sample *sample, uint32_t depth, struct plan_option *option);

/* ---- sight */

/* The figures that decide whether a map of the directions from a station (core/sight.h) pays. */
struct plan_sight_need {
    double pulses;         /* cast from a station in a scan */
    double share;          /* the part of all directions that the map shows, 0..1 */
    double n_triangles;    /* of the scene */
    uint32_t packet;       /* rays per Embree call */
    uint64_t memory_bytes; /* that a map may take */
    int forced;            /* cast.sight asks for a map: 1; for none: 0; for neither: -1 */
    const char *why_not;   /* why no map is possible; NULL: one is */
};

/* Shares of the pulses, by the cell of the map that they lie in. The cell shows one triangle, nothing, a few triangles,
 * or more than a few: then the BVH is asked (ask). About half of the last kind get a list of candidates after all, so
 * half of their share counts as few. small: the map leaves the cell to the BVH, since few rays hit its triangles. */
struct plan_sight_found {
    double one, nothing, few, ask, small;
    double per_pulse; /* triangles that are seen and not small, per pulse */
    double examined;  /* triangles of the scene that making the map examines one by one (sight_examined) */
};

/* Sets *map to 1 where a map is worth its cost, and fills row. plan_sight casts some pulses of the places to find out,
 * unless there are too few pulses for any map. */
int plan_sight(const struct plan_sight_need *need, const struct plan_places *places, const struct sh_report *report,
               int *map, struct plan_row *row, struct sh_err *err);

/* The steps of plan_sight. plan_sight_may_pay returns 0 where so few pulses don't pay for a map, whatever they hit. */
int plan_sight_may_pay(const struct plan_sight_need *need);
/* Casts rays to pulses of the head, and to the corners of a cell around each, cell_rad across. rays: as in struct
 * sight_spec. */
void plan_sample_sight(struct plan_sample *sample, double cell_rad, double rays, struct plan_sight_found *found);
/* Returns whether a map is made. found NULL: nothing was sampled. */
int plan_sight_choose(const struct plan_sight_need *need, const struct plan_sight_found *found, struct plan_row *row);

/* ---- the other stages */

/* The methods that a scan uses. */
struct plan_methods {
    enum beam_mode beam; /* BEAM_SINGLE, BEAM_RINGS, BEAM_ADAPTIVE */
    uint32_t rings;      /* of sub-rays; adaptive: for those footprints that are cast as rings (struct cast_beam) */
    uint32_t depth;      /* of glass and mirrors */
    int sight;           /* first hits are looked up in the station's map */
};

/* Sets a beam, its name, and its cost where that does not depend on the scene. The beam's error is not known yet. */
void plan_beam_option(enum beam_mode mode, uint32_t rings, struct plan_option *option);

/* Fills the row of the mesh: the error of its vertices, see struct scene. */
void plan_mesh(double error_m, struct plan_row *row);
/* Fills the row of the cast, which leaves no choice. packet: rays per Embree call. */
void plan_cast(uint32_t packet, struct plan_row *row);

/* The settings of the head that the remaining rows depend on. */
struct plan_head {
    uint32_t n_movers;
    int noise_on;
    double range_sigma_m, range_sigma_ppm;
    double range_sigma_at_m; /* the range at which that sigma holds; 0: noise does not depend on the signal */
    double ball_radius_m;    /* 0: no ball-shaped noise */
    int signal, sharp;       /* there is a signal model; its signal has no noise (struct detect_signal_spec) */
    double reach_m;          /* where a white target vanishes */
    enum detect_ambiguity ambiguity;
    int instrument, angle_noise; /* errors of geometry; noise of the angles */
};
enum { PLAN_HEAD_ROWS = 6 };

/* Stages that are left out have the method "none" and say why. Only ball-shaped noise has no row then. Returns how many
 * rows. */
size_t plan_head(const struct plan_head *head, struct plan_row rows[PLAN_HEAD_ROWS]);
/* Returns the processor time of a pulse, ns: one ray into a scene of n_triangles, in packets of that many rays, and
 * the rest of the work for each pulse. Rows have the cost of methods beyond that. */
double plan_pulse_ns(double n_triangles, uint32_t packet);
/* Fills a row with these figures. */
void plan_say(struct plan_row *row, const char *stage, const char *method, double error_m, double cost_ns,
              const char *why);

#endif
