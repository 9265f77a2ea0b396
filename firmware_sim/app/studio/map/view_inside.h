/* SPDX-License-Identifier: MIT */
/* Private to map --perspective: what scan and cloud share. */
#ifndef FIRMWARE_SIM_APP_STUDIO_MAP_VIEW_INSIDE_H
#define FIRMWARE_SIM_APP_STUDIO_MAP_VIEW_INSIDE_H

#include "firmware_sim/app/studio/map/view.h"
#include "firmware_sim/site/site.h"

enum { MAP_VIEW_BATCH = 1024, MAP_VIEW_NUMBERS = 65536 };

struct picturing {
    const struct map_view_plan *plan;
    const struct site *site; /* NULL: no configuration */
    struct view *view;
    uint64_t cut;                      /* points that --below and --above leave out */
    uint64_t number[MAP_VIEW_NUMBERS]; /* points by label, or by station */
    double limit[2];                   /* of the colours */
    /* points to be added, and their figures or colours */
    size_t n;
    double xyz_m[MAP_VIEW_BATCH][3];
    float value[MAP_VIEW_BATCH];
    uint8_t rgb[MAP_VIEW_BATCH][3];
};

int picturing_begin(const struct map_view_plan *plan, struct picturing **out, struct sh_err *err);
void picturing_end(struct picturing *p);

struct picturing_bounds {
    double min_m[3], max_m[3];
};
/* A point with a coordinate that is not finite is left out. */
void picturing_include(struct picturing_bounds *b, const double p_m[3]);

/* Chooses the eye, unless it is given, so that these bounds are seen. To be called before points
 * are added. */
int picturing_look(struct picturing *p, const struct picturing_bounds *bounds, struct sh_err *err);

struct picturing_figures {
    double range_m, refl_db;
    uint16_t label, station;
    const uint8_t *rgb; /* for MAP_VIEW_RGB */
};
void picturing_add(struct picturing *p, const double xyz_m[3], const struct picturing_figures *f);

/* Draws the points, and writes the picture to its file. */
int picturing_finish(struct picturing *p, struct sh_err *err);

#endif
