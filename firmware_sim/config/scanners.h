/* SPDX-License-Identifier: MIT */
/* Loads the configuration of one scanner, and checks those of all. */
#ifndef FIRMWARE_SIM_CONFIG_SCANNERS_H
#define FIRMWARE_SIM_CONFIG_SCANNERS_H

#include <stdint.h>

struct config;
struct config_diagnostics;

/* Loads the configuration of a station's scanner. station: from 1; 0: head.station. The list of diagnostics begins
 * anew. */
int cfg_load_for(const char *path, const char *const *sets, int n_sets, uint32_t station, struct config *cfg,
                 struct config_diagnostics *diagnostics);
/* Returns the station, from 0, that head.station's number (from 1) names; n_stations and more: there is none. */
uint32_t cfg_station_at(const struct config *cfg, uint32_t number);
/* Loads the scanners of the other stations, adds their diagnostics, and notes in cfg which station has which. */
void cfg_check_scanners(struct config *cfg, struct config_diagnostics *diagnostics);

#endif
