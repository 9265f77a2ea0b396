/* The plan: which method each stage uses, how far off it can be, what it costs, and why. Pure: no clock, no files; what
 * runs is what is planned.
 *
 * Costs are rounded figures of one core at 2 to 3 GHz with AVX2, to compare methods by; `make chart` and `make bench`
 * measure them. */
#ifndef CORE_PLAN_H
#define CORE_PLAN_H

#include <stdint.h>

#include "core/detect.h"
#include "core/georef.h"

struct plan_row {
    char stage[16], method[32];
    double error_m; /* bound; not-a-number: nothing is known */
    double cost_ns; /* per pulse; not-a-number: hangs on the scene */
    char why[192];
};

/* What a georeferencing has to hold. */
struct plan_georef_need {
    double radius_m, height_m; /* of the points from the centre: horizontally, and up or down */
    double tolerance_m;
    enum georef_method forced; /* GEOREF_AUTO: the cheapest one whose bound meets the tolerance, else exact */
};

/* Chooses the method and tells it in row. SH_EINPUT: what is forced has no bound here. The georef is not changed. */
int plan_georef(const struct georef *georef, const struct plan_georef_need *need, enum georef_method *method,
                struct plan_row *row, struct sh_err *err);

/* What decides on the cast, and on what is left out. */
struct plan_head {
    uint32_t packet;   /* rays per Embree call */
    int order_exactly; /* surfaces that overlap are ordered in double */
    double range_max_m;
    uint32_t n_movers;
    int beam_adaptive;  /* adaptive beam */
    uint32_t beam_rays; /* sub-rays of rings; 0: single rays */
    int noise_on;
    double range_sigma_m, range_sigma_ppm;
    double range_sigma_at_m; /* noise by the signal: where that sigma holds; 0: whatever the signal */
    double ball_radius_m;    /* 0: no ball-shaped noise */
    uint32_t n_glass, depth; /* surfaces of glass, or mirrors; how many a pulse is followed through */
    int signal, sharp;       /* there is a signal model; without noise of its own */
    double reach_m;          /* where a white target vanishes */
    enum detect_ambiguity ambiguity;
    int instrument, angle_noise; /* errors of geometry; noise of the angles */
};
enum { PLAN_HEAD_ROWS = 11 };

/* Everything but georeferencing. Stages that are left out have the method "none" and say why. Returns how many rows. */
size_t plan_head(const struct plan_head *head, struct plan_row rows[PLAN_HEAD_ROWS]);
/* Georeferencing where points leave as range and angles. */
void plan_georef_polar(struct plan_row *row);

const char *plan_method_name(enum georef_method method);

#endif
