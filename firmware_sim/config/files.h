/* SPDX-License-Identifier: MIT */
/* The files that a configuration names, by its table of keys. In: a loaded configuration. Out: each key that has a
 * path, with it. */
#ifndef FIRMWARE_SIM_CONFIG_FILES_H
#define FIRMWARE_SIM_CONFIG_FILES_H

#include "firmware_sim/config/config.h"

/* One file; `key` and `path` are good during the call. What is not SH_OK ends the walk. */
typedef int config_take_file(void *ctx, const char *key, const char *path, int is_written);

/* The head profile, its files, and all keys of paths: of the table's rows, so that a new one can't be forgotten. The
 * configuration itself is not among them. Written are the paths of links. Returns what `take` does. */
int config_each_file(const struct config *cfg, config_take_file *take, void *ctx);

#endif
