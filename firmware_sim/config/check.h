/* SPDX-License-Identifier: MIT */
/* Checks everything that concerns more than one key. Keys that already have a diagnostic are left out. */
#ifndef FIRMWARE_SIM_CONFIG_CHECK_H
#define FIRMWARE_SIM_CONFIG_CHECK_H

struct cfg_reader;
struct config;

void cfg_check(struct cfg_reader *rd, struct config *cfg);
/* Checks the section `loop` alone. */
void cfg_check_loop(struct cfg_reader *rd, const struct config *cfg);
/* Checks the section `ntp`: its address, its time zone, and what the role client needs. */
void cfg_check_ntp(struct cfg_reader *rd, const struct config *cfg);

#endif
