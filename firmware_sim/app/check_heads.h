/* SPDX-License-Identifier: MIT */
/* What `scanhead check` says about heads: of one configuration the scanner of head.station, then those of other
 * stations. Out: lines, with rates in Hz and ranges in metres. */
#ifndef FIRMWARE_SIM_APP_CHECK_HEADS_H
#define FIRMWARE_SIM_APP_CHECK_HEADS_H

#include <stdio.h>

#include "firmware_sim/app/sites.h"

void check_print_heads(const struct sites *sites, FILE *out);

#endif
