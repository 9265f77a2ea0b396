/* SPDX-License-Identifier: MIT */
/* `scanhead check --scene` prints the objects of the scene as a table: the 50 largest, and the sum of all. After the
 * table it lists the names of open objects, of turned objects, and of transparent surfaces, up to 50 of each. In a
 * turned object neighbouring faces look to different sides (core/scene_objects.h). */
#ifndef FIRMWARE_SIM_APP_CHECK_SCENE_H
#define FIRMWARE_SIM_APP_CHECK_SCENE_H

#include <stdio.h>

#include "firmware_sim/site/site.h"

/* The objects of the scene come first, then those of each mesh that moves. n_warnings: so many were printed while the
 * site was loaded. out NULL: there is no table. csv: a file for all rows; NULL: none; -: standard output. */
int check_print_scene(const struct site *site, unsigned n_warnings, const char *csv, FILE *out, struct sh_err *err);

#endif
