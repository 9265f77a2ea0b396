/* SPDX-License-Identifier: MIT */
/* The files that a configuration names, found through its table of keys. In: a loaded configuration. Out: each key that
 * has a path, with the path. */
#ifndef FIRMWARE_SIM_CONFIG_FILES_H
#define FIRMWARE_SIM_CONFIG_FILES_H

struct config;

/* Called for one file; `key` and `path` are valid during the call. A result other than SH_OK ends the walk. */
typedef int config_take_file(void *ctx, const char *key, const char *path, int is_written);

/* Calls `take` for each path in the configuration's and the profile's keys, for the head profile and for the scenario.
 * The function goes through the rows of the tables, so a new key can't be forgotten. The configuration itself is not
 * among the paths. is_written: the program writes the file, as that of a `file` link. Returns the last result of
 * `take`. */
int config_each_file(const struct config *cfg, config_take_file *take, void *ctx);

#endif
