/* SPDX-License-Identifier: MIT */
/* Checks of what is measured: noise, signal, surfaces. */
#ifndef FIRMWARE_SIM_CONFIG_CHECK_SIGNAL_H
#define FIRMWARE_SIM_CONFIG_CHECK_SIGNAL_H

struct cfg_reader;
struct config;
struct config_profile;

/* Noise, signal, surfaces, and the keys of a profile that concern them. */
void cfg_check_signal(struct cfg_reader *rd, struct config *cfg);
/* Checks waveforms: their keys together, and their needs of signal, noise and profile. */
void cfg_check_waveform(struct cfg_reader *rd, const struct config *cfg);
void cfg_check_reaches(struct cfg_reader *rd, struct config_profile *profile);

#endif
