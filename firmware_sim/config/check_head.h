/* SPDX-License-Identifier: MIT */
/* Checks of the head and its profile: emitter, geometries, programs, range; and the values that follow from them. */
#ifndef FIRMWARE_SIM_CONFIG_CHECK_HEAD_H
#define FIRMWARE_SIM_CONFIG_CHECK_HEAD_H

#include <stddef.h>

struct cfg_key;
struct cfg_reader;
struct config;
struct config_profile;

/* Converts widths of the beam to this project's definition; completes the programs of a profile; checks that
 * head.prr_hz is the rate of one. */
void cfg_convert_widths(struct cfg_reader *rd, struct config_profile *profile);
void cfg_check_programs(struct cfg_reader *rd, struct config_profile *profile);
void cfg_check_rate(struct cfg_reader *rd, const struct config *cfg);
/* Returns the share of a sweep that the field of view takes. */
double cfg_used_share(const struct config_profile *profile);

/* Checks which keys of a profile belong to its emitter, and derives values from them. */
void cfg_check_emitter(struct cfg_reader *rd, struct config_profile *profile);
/* Returns whether profiles of some emitters need the key; then `words` gets the names of these emitters. */
int cfg_needed_by_emitter(const struct cfg_key *key, char *words, size_t len);
/* Returns whether line_start and line_stop enclose an angle: start must be below stop. On a sphere any two different
 * angles do, as the line may cross azimuth 0. */
int cfg_line_has_width(const struct config *cfg);
/* Checks the settings that only some emitters have, and sets the rates that follow from others. */
void cfg_check_emitter_settings(struct cfg_reader *rd, struct config *cfg);

/* Checks the geometries of a planar head's profile; chooses the one that the configuration asks for. */
void cfg_check_geometries(struct cfg_reader *rd, struct config_profile *profile);
void cfg_choose_geometry(struct cfg_reader *rd, struct config *cfg);

/* Checks head.range_min_m and range_max_m, and limits the profile in cfg and its programs to them. */
void cfg_limit_range(struct cfg_reader *rd, struct config *cfg);
/* Copies ranges, noise and step into the scan's settings, which commands may change. To be called after all checks. */
void cfg_take_scan_settings(struct config *cfg);

#endif
