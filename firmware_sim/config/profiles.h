/* SPDX-License-Identifier: MIT */
/* Finds, reads and prints head profiles. */
#ifndef FIRMWARE_SIM_CONFIG_PROFILES_H
#define FIRMWARE_SIM_CONFIG_PROFILES_H

#include <stdio.h>

struct cfg_reader;
struct config;
struct config_profile;

/* Finds and reads the profile that head.profile names (cfg->profile_file holds the name, then the path). */
void cfg_load_profile(struct cfg_reader *rd, struct config *cfg);
/* Prints one profile for config_list_profiles. */
void cfg_list_profile(const struct cfg_reader *rd, const struct config_profile *profile, FILE *out);
/* The words of enum config_from. */
extern const char *const cfg_from_names[];

#endif
