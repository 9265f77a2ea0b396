/* SPDX-License-Identifier: MIT */
/* Checks of what is measured: noise, signal, surfaces. */
#ifndef FIRMWARE_SIM_CONFIG_CHECK_SIGNAL_H
#define FIRMWARE_SIM_CONFIG_CHECK_SIGNAL_H

struct cfg_reader;
struct config;
struct config_profile;

/* Checks noise, signal and surfaces, and completes them. */
void cfg_check_signal(struct cfg_reader *rd, struct config *cfg);
/* Checks the keys of waveforms against each other, and whether signal, noise and profile allow waveforms. */
void cfg_check_waveform(struct cfg_reader *rd, const struct config *cfg);
/* Checks the figures of a profile that its signal is computed from. */
void cfg_check_reaches(struct cfg_reader *rd, struct config_profile *profile);

#endif
