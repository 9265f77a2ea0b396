/* SPDX-License-Identifier: MIT */
/* Checks the section `ntp`: its address, its time zone, and what the role client needs. */
#ifndef FIRMWARE_SIM_CONFIG_CHECK_NTP_H
#define FIRMWARE_SIM_CONFIG_CHECK_NTP_H

struct cfg_reader;
struct config;

void cfg_check_ntp(struct cfg_reader *rd, const struct config *cfg);

#endif
