/* SPDX-License-Identifier: MIT */
/* Checks of where things stand: copies of meshes, the anchor, stations, their tripods, the platform. */
#ifndef FIRMWARE_SIM_CONFIG_CHECK_PLACES_H
#define FIRMWARE_SIM_CONFIG_CHECK_PLACES_H

#include <stdint.h>

struct cfg_reader;
struct config;
struct config_platform;

/* Checks that the file at `path`, the value of a key, can be read. kind: "mesh". */
void cfg_check_readable(struct cfg_reader *rd, const char *key, uint32_t item, const char *path, const char *kind);
/* Checks the lists of copies, once all are read. */
void cfg_check_copies(struct cfg_reader *rd, const struct config *cfg);
/* Checks the anchor, and the forms of a station's place. */
void cfg_check_places(struct cfg_reader *rd, struct config *cfg);
/* Checks the tripods of stations. */
void cfg_check_tripods(struct cfg_reader *rd, struct config *cfg);
/* Checks keys that only some kinds of platform have. Returns whether all of them belong to this kind. */
int cfg_check_platform_keys(struct cfg_reader *rd, const struct config_platform *platform);
/* Checks the platform's keys against each other, and converts its stops from frames (platform.frames_per_s) to
 * seconds. */
void cfg_check_platform(struct cfg_reader *rd, struct config *cfg);

#endif
