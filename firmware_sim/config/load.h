/* SPDX-License-Identifier: MIT */
/* Loads configurations. In: a YAML file and --set. Out: struct config, checked, or all diagnostics; each is one line:
 *   FILE:LINE: KEY: what is wrong; what is allowed */
#ifndef FIRMWARE_SIM_CONFIG_LOAD_H
#define FIRMWARE_SIM_CONFIG_LOAD_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"
#include "firmware_sim/fault/fault.h"

struct config;
struct link_spec;

/* The diagnostics of a configuration, in the order of the file; then those of --set and of the head profile. */
enum { CONFIG_MAX_DIAGNOSTICS = 20 };
struct config_diagnostics {
    uint32_t n; /* all diagnostics that were found; err[] has the first CONFIG_MAX_DIAGNOSTICS */
    struct sh_err err[CONFIG_MAX_DIAGNOSTICS];
    uint64_t place[CONFIG_MAX_DIAGNOSTICS]; /* err[] is sorted by it: file, --set or profile, then the line there */
};

/* Reads path, then the `key=value` settings of --set, in order, then the profile that they name. The settings are
 * checked as the file's keys are, and errors name them `--set KEY`. On failure cfg is unspecified, and err has the
 * first diagnostic. cfg is large: allocate it. */
int config_load(const char *path, const char *const *sets, int n_sets, struct config *cfg, struct sh_err *err);

/* Does the same, and gives all diagnostics. Returns SH_OK or the code of the first. */
int config_load_all(const char *path, const char *const *sets, int n_sets, struct config *cfg,
                    struct config_diagnostics *diagnostics);

/* Does the same for a text that has only links, loop and faults. Errors call it `name`. cfg->file becomes this name,
 * and cfg->has_no_head 1; the rest of cfg is zero. */
int config_load_links(const char *text, const char *name, const char *const *sets, int n_sets, struct config *cfg,
                      struct config_diagnostics *diagnostics);

/* Adds the injected faults of a scenario, a file that has nothing but a list `faults`. name: a path, or the name of a
 * scenario that comes with the program. The caller adds one scenario at most. With diagnostics nothing is added, and
 * the code of the first is returned. */
int config_add_scenario(struct config *cfg, const char *name, struct config_diagnostics *diagnostics);
/* Writes the names of the scenarios that come with the program, "a, b, c", as many as buf holds; "none found" where
 * their folder is missing. */
void config_name_scenarios(char *buf, size_t len);
/* Reads a fault from one line of YAML, "{kind: drop, every: 10}", for a head with this configuration. Takes 270 KiB of
 * stack. */
int config_read_fault(const struct config *cfg, const char *text, struct fault *out, struct sh_err *err);

/* Loads the configuration of a station's scanner into `out`. Stations count from 1. head.station of `out` is this
 * station, and `out` has no links. Output, loop and scenario are those of cfg as it is now, but output.tolerance_m is
 * the scanner's own. The texts of --set that cfg was loaded with must still be there. */
int config_load_scanner(const struct config *cfg, uint32_t station, struct config *out, struct sh_err *err);

#endif
