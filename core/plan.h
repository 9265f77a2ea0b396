/* The plan: which method each stage uses, how far off it can be, what it costs, what was left out, and why. No clock,
 * no files: the same scene, head and tolerance have the same plan; what runs is what is planned.
 *
 * Each stage has options. Chosen is the cheapest one whose bound holds; where none holds, the one that is least off,
 * and the row says so. Bounds are proven (order, georeferencing) or found by sampling: some thousands of the head's own
 * pulses, drawn by a fixed key, cast both with the option and with the reference. Costs are not measured here, which
 * would let the same configuration have another plan on another day: they are rounded figures, see core/plan/cost.h. */
#ifndef CORE_PLAN_H
#define CORE_PLAN_H

#include <stdint.h>

#include "core/cast.h"
#include "core/detect.h"
#include "core/georef.h"

struct plan_tolerance {
    double range_m;    /* root mean square of what echo ranges are off */
    double echo_share; /* of the pulses: those with another number of echoes */
};

/* A way to do a stage. */
struct plan_option {
    char method[32];
    double error_m;    /* bound; not-a-number: nothing is known */
    double echo_share; /* bound, likewise */
    double cost_ns;    /* per pulse, more than a single ray; not-a-number: hangs on the scene */
    char why_not[96];  /* it can't be had; empty: it can */
};

enum { PLAN_MAX_OPTIONS = 12 };

struct plan_row {
    char stage[16], method[32];
    double error_m, echo_share, cost_ns; /* as above */
    char why[192];
    int forced; /* the configuration says so, not the plan */
    uint32_t n_left;
    struct plan_option left[PLAN_MAX_OPTIONS]; /* what was left out; why_not says why */
};

/* Chooses, of n options, and fills row (stage, method, figures, forced, left, why). forced: the option
 * that the configuration names, by `key`; -1: none. Returns the number of the option. */
uint32_t plan_choose(struct plan_row *row, const char *stage, const struct plan_option *option, uint32_t n, int forced,
                     const char *key, const struct plan_tolerance *tolerance);
/* Whether an option's bounds hold. */
int plan_holds(const struct plan_option *option, const struct plan_tolerance *tolerance);

/* ---- georeferencing */

/* What a georeferencing has to hold. */
struct plan_georef_need {
    double radius_m, height_m; /* of the points from the centre: horizontally, and up or down */
    double tolerance_m;
    enum georef_method forced; /* GEOREF_AUTO: the cheapest one whose bound meets the tolerance, else exact */
};

/* Chooses the method and tells it in row. SH_EINPUT: what is forced has no bound here. The georef is not changed. */
int plan_georef(const struct georef *georef, const struct plan_georef_need *need, enum georef_method *method,
                struct plan_row *row, struct sh_err *err);
/* Georeferencing where points leave as range and angles. */
void plan_georef_polar(struct plan_row *row);

const char *plan_method_name(enum georef_method method);

/* ---- sampling */

/* Where the head fires from, and what. */
struct plan_place {
    struct cast_setup setup; /* as the run's */
    struct cast_beam *beam;  /* its footprint; NULL: none. Mode and pattern are changed. outlines NULL: not adaptive */
    struct schedule_segment segment;
    uint64_t pulses; /* to draw from, those behind the field of view included */
    /* Poses of what moves at a time of the scan; NULL: nothing does. */
    void (*enter)(void *ctx, int64_t t_ns, struct cast_setup *setup);
    void *ctx;
};

struct plan_sample;

/* Draws pulses of all places alike. Those that meet one smooth surface are many and alike, so that only some of them
 * are cast with the reference: which they are, 61 sub-rays tell. The places must outlive it. */
int plan_sample_create(struct plan_place *place, uint32_t n_places, struct plan_sample **out, struct sh_err *err);
void plan_sample_free(struct plan_sample *sample);

/* What a beam is off against BEAM_MAX_RINGS rings (1,027 sub-rays): error_m and echo_share of option; for
 * BEAM_ADAPTIVE, whose place has outlines, its cost_ns, too. BEAM_SINGLE: one ray. Both are upper limits: three
 * standard errors above the mean square, and the limit of 95 % of Poisson's distribution of what is found among the
 * pulses that do not meet one smooth surface; the others count as they are found. The first call casts the reference.
 */
void plan_sample_beam(struct plan_sample *sample, enum beam_mode mode, uint32_t rings, struct plan_option *option);

/* What following pulses through only `depth` surfaces of glass or mirrors is off against CAST_MAX_DEPTH. A pulse that
 * meets yet another one there counts as off, too: nothing is known of what is behind. */
void plan_sample_optics(struct plan_sample *sample, uint32_t depth, struct plan_option *option);

/* ---- the other stages */

/* What of beam and optics a scan uses. */
struct plan_methods {
    enum beam_mode beam; /* BEAM_SINGLE, BEAM_RINGS, BEAM_ADAPTIVE */
    uint32_t rings;      /* of sub-rays; adaptive: where there is too much to tell apart */
    int order_exactly;   /* bvh_order_exactly */
    uint32_t depth;      /* of glass and mirrors */
};

/* A beam's name, and its cost where that does not hang on the scene; nothing is known yet of what it is off. */
void plan_beam_option(enum beam_mode mode, uint32_t rings, struct plan_option *option);
/* Fills options, in order of cost, for surfaces in a scene that lies within far_m of the head. */
void plan_order_options(double far_m, struct plan_option option[2]);

/* The row of the cast: what is always done. packet: rays per Embree call. */
void plan_cast(uint32_t packet, struct plan_row *row);

/* What the rows of the remaining stages hang on. */
struct plan_head {
    uint32_t n_movers;
    int noise_on;
    double range_sigma_m, range_sigma_ppm;
    double range_sigma_at_m; /* noise by the signal: where that sigma holds; 0: whatever the signal */
    double ball_radius_m;    /* 0: no ball-shaped noise */
    int signal, sharp;       /* there is a signal model; without noise of its own */
    double reach_m;          /* where a white target vanishes */
    enum detect_ambiguity ambiguity;
    int instrument, angle_noise; /* errors of geometry; noise of the angles */
};
enum { PLAN_HEAD_ROWS = 6 };

/* Stages that are left out have the method "none" and say why. Returns how many rows. */
size_t plan_head(const struct plan_head *head, struct plan_row rows[PLAN_HEAD_ROWS]);
/* A row about which there is nothing to choose. */
void plan_say(struct plan_row *row, const char *stage, const char *method, double error_m, double cost_ns,
              const char *why);

#endif
