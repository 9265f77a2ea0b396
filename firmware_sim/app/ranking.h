/* SPDX-License-Identifier: MIT */
/* Ranks things by a figure, the largest first; equal ones by their numbers. In: how many there are, and the figure of
 * each. Out: their numbers in that order. Pure. */
#ifndef FIRMWARE_SIM_APP_RANKING_H
#define FIRMWARE_SIM_APP_RANKING_H

#include <stdint.h>

/* Returns [n], to be freed; NULL: no memory. No figure is NaN. */
uint32_t *ranking_make(uint32_t n, double (*figure)(const void *ctx, uint32_t i), const void *ctx);

#endif
