/* SPDX-License-Identifier: MIT */
/* The directions that a station's rays may go to. */
#ifndef FIRMWARE_SIM_SITE_VIEW_H
#define FIRMWARE_SIM_SITE_VIEW_H

#include <stdint.h>

#include "core/emitter.h"

struct site;

enum { SITE_VIEW_BANDS = EMITTER_MAX_BEAMS };
struct site_view {
    double rotation[9]; /* socs -> prcs */
    double margin_rad;  /* how far beyond the bands rays may go */
    uint32_t n;
    struct site_band {
        double low_rad, high_rad;           /* elevation, socs */
        double azimuth_rad, azimuth_to_rad; /* middle, and how far to both sides; pi: all around */
    } band[SITE_VIEW_BANDS];
};

/* For the settings at power-up. */
void site_view_of(const struct site *site, uint32_t station, struct site_view *view);
/* This is the function `sees` of struct sight_spec; ctx is the view. */
int site_view_sees(const void *ctx, const double dir[3], double radius_rad);
/* The share of all directions that are within radius_rad of the view. */
double site_view_share(const struct site_view *view, double radius_rad);

#endif
