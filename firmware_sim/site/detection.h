/* SPDX-License-Identifier: MIT */
/* The steps of scans from a hit to a point: signal, surfaces, instrument, noise. They are made once from the
 * configuration and the loaded scene. */
#ifndef FIRMWARE_SIM_SITE_DETECTION_H
#define FIRMWARE_SIM_SITE_DETECTION_H

#include <stdint.h>

struct sh_err;
struct sh_report;
struct site;

/* After the scene and its movers are loaded. With mirrors, site->n_surfaces grows by the labels of
 * ghosts. Warns of entries of `surfaces` that fit no surface. */
int site_set_up_detect(struct site *site, const struct sh_report *report, struct sh_err *err);
void site_free_detect(struct site *site);
/* Makes the parts of detection again that depend on ranges and noise. site is a copy of one that is set up, with
 * another cfg; what it points to stays that of the original. */
int site_vary_detect(struct site *site, struct sh_err *err);

/* Sets the number of surfaces of glass or mirrors that pulses are followed through. */
void site_set_depth(struct site *site, uint32_t depth);

/* site_noise_m: how far noise may take a point, whether noise is on or not. site_ball_m: the part of it that is ball
 * noise. site_range_noise_m: ten sigma of the range noise; 0 while that is off. */
double site_noise_m(const struct site *site);
double site_ball_m(const struct site *site);
double site_range_noise_m(const struct site *site);

#endif
