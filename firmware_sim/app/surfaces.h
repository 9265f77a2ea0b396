/* SPDX-License-Identifier: MIT */
/* The surfaces of a site as CSV, beside recordings: what each label of a point means. */
#ifndef FIRMWARE_SIM_APP_SURFACES_H
#define FIRMWARE_SIM_APP_SURFACES_H

#include "firmware_sim/site/site.h"

/* Writes a line for each label, also those of bodies that move, of tripods' legs and of ghosts. path -: standard
 * output. */
int surfaces_write(const char *path, const struct site *site, struct sh_err *err);

#endif
