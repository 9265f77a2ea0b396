/* SPDX-License-Identifier: MIT */
/* Computes a colour per point from the stream, for recordings whose colours the head does not send, or whose limits are
 * known only at the end. In: the points of a track. Out: sRGB. A shot without echo is grey. Pure; any thread. */
#ifndef DRIVERS_RECORD_COLOUR_H
#define DRIVERS_RECORD_COLOUR_H

#include <stdint.h>

#include "core/colour.h"
#include "core/err.h"

struct track;

/* Where a recording's colours come from. */
struct colour_choice {
    int given;                 /* 0: as the head sends them, if it does; 1: computed here from scale */
    struct colour_scale scale; /* not texture, which only the head knows */
};

/* Checks the scan that begins. SH_EFORMAT where its points have no such figure: frame without trajectory or stops;
 * with a moving head also ranges in the geo layout, and heights in ECEF. */
int colour_check(enum colour_mode mode, const struct track *track, struct sh_err *err);

/* Returns the figure that range, height or frame shows for point i of the track's batch: metres, metres above the
 * scene's zero, frame scalar. NaN: lost, or a shot without echo. Heights of geo points are converted to those of the
 * scene by the tangent at the station and the Earth's curvature. For a head that moves through a CRS on the Earth they
 * are the CRS's heights. */
double colour_figure(enum colour_mode mode, const struct track *track, int i);

/* Writes the colour of point i. */
void colour_of_point(const struct colour_scale *scale, const struct track *track, int i, uint8_t rgb[3]);

#endif
