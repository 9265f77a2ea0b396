/* SPDX-License-Identifier: MIT */
/* Private to this folder: where to stand next, for `scanhead coverage --next`. */
#ifndef FIRMWARE_SIM_APP_STUDIO_COVERAGE_NEXT_H
#define FIRMWARE_SIM_APP_STUDIO_COVERAGE_NEXT_H

#include "firmware_sim/app/studio/coverage/coverage.h"

enum { COVERAGE_MOST_NEXT = 100, COVERAGE_MOST_SCANS = 20 };

struct coverage_next_options {
    long stations;       /* how many to find; 0: none */
    double grid_m;       /* 0: no grid */
    double height_m;     /* above the floor */
    double area_m[2][3]; /* limits of the grid: [least, most][x, y, floor]; NaN: those of the scene, none for floors */
    const char *candidates; /* a file of places instead; NULL: none */
    double step_deg;        /* between rays */
    int step_given;         /* --step-deg is there, which is an error where rays are pulses of the head */
    long scans;             /* how many of the best places are scanned in each round */
    int of_page;            /* errors name keys of the page's query, and no options of a command */
};

enum coverage_place { COVERAGE_PLACE_OPEN, COVERAGE_PLACE_WITHIN, COVERAGE_PLACE_CHOSEN };

struct coverage_next_place {
    double position_m[3], heading_deg;
    double floor_m; /* z; NaN: not known */
    double front;   /* share of the hits that are on the front of a face */
    /* Only OPEN places are compared. A place WITHIN a body sees mostly backs of faces. */
    enum coverage_place state;
};

/* A place that a round has tried with a whole scan, not with an estimate. */
struct coverage_next_tried {
    uint32_t place;
    double seen_m2, gain_m2;
};
/* A round of choosing one place. The tried places are in order of gain, so the first one is the best, and is chosen. */
struct coverage_next_round {
    uint32_t n_tried;
    struct coverage_next_tried tried[COVERAGE_MOST_SCANS];
    double none_m2; /* area that neither the stations nor the best place see */
};

struct coverage_next {
    struct coverage_next_place *place;
    uint32_t n, within; /* places; those that are left out, since they lie within bodies */
    uint32_t directions;
    double step_deg;
    int whole_cells;     /* rays are pulses of the head: a cell that one hits counts as a whole */
    double *estimate_m2; /* [rounds][n] */
    struct coverage_next_round *round;
    uint32_t n_asked;
    uint32_t n_rounds; /* fewer than asked for where nothing is left to gain */
};

/* Places, and the rays that they are compared by (places.c). */
struct coverage_finder {
    const struct coverage_next_options *o;
    const struct coverage_result *result;
    const struct site *site;
    const struct sh_report *report;
    struct coverage_next *next;
    size_t room; /* of its places */
    /* Rays of a level head with heading 0, and the solid angle of each, as for coverage_gains. */
    double (*dir)[3], *each_sr;
    uint32_t n_dir;
};

/* Finds the places, or says why there are none. To be called before the stations scan; result needs its site and base.
 * coverage_next_free is due in any case. */
int coverage_next_open(const struct coverage_next_options *options, const struct coverage_result *result,
                       const struct sh_report *report, struct coverage_next *next, struct coverage_finder *finder,
                       struct sh_err *err);
/* Compares the places. Figures of the stations must be in result; the coverage gets further stations, one for each
 * round. */
int coverage_next_find(struct coverage_finder *finder, struct coverage *coverage, struct sh_err *err);
void coverage_next_free(struct coverage_next *next, struct coverage_finder *finder);

void coverage_next_print(const struct coverage_next *next, const struct coverage_result *result);
void coverage_next_put(struct json *json, const struct coverage_next *next, const struct coverage_result *result);

/* Reads X0,Y0,X1,Y1, or these and the floors' Z0,Z1. Returns 0 where the text is neither. */
int coverage_next_area(const char *text, double area_m[2][3]);

#endif
