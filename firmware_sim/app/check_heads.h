/* SPDX-License-Identifier: MIT */
/* `scanhead check` prints this about heads. In: the sites of a configuration. Out: lines about the scanner of
 * head.station, then about those of other stations, with rates in Hz and ranges in metres. */
#ifndef FIRMWARE_SIM_APP_CHECK_HEADS_H
#define FIRMWARE_SIM_APP_CHECK_HEADS_H

#include <stdio.h>

#include "firmware_sim/app/sites.h"

void check_print_heads(const struct sites *sites, FILE *out);

#endif
