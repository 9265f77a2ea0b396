/* SPDX-License-Identifier: MIT */
/* The table of all keys of a configuration. */
#ifndef FIRMWARE_SIM_CONFIG_KEYS_H
#define FIRMWARE_SIM_CONFIG_KEYS_H

#include "firmware_sim/config/table/row.h"

extern const struct cfg_table cfg_config_table;

#endif
