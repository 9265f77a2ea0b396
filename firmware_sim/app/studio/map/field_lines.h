/* SPDX-License-Identifier: MIT */
/* The monitored fields of a configuration as lines in the scene. In: fields in the head's frame, and the place of a
 * station. Out: ends of lines, prcs, metres. */
#ifndef FIRMWARE_SIM_APP_STUDIO_MAP_FIELD_LINES_H
#define FIRMWARE_SIM_APP_STUDIO_MAP_FIELD_LINES_H

#include "core/err.h"

struct config;
struct placement;

/* Takes a line from a to b. A result other than SH_OK ends the walk. */
typedef int field_line(void *ctx, const double a_prcs[3], const double b_prcs[3], struct sh_err *err);

int field_lines_each(const struct config *cfg, const struct placement *at, field_line *take, void *ctx,
                     struct sh_err *err);

#endif
