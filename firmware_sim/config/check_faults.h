/* SPDX-License-Identifier: MIT */
/* Checks of injected faults: their keys, the links, the head. */
#ifndef FIRMWARE_SIM_CONFIG_CHECK_FAULTS_H
#define FIRMWARE_SIM_CONFIG_CHECK_FAULTS_H

struct cfg_reader;
struct config;
struct fault_list;

/* Checks the keys of each injected fault against each other. */
void cfg_check_faults(struct cfg_reader *rd, struct fault_list *list);
/* Checks the faults against the links of cfg, its time and its time server. */
void cfg_check_fault_links(struct cfg_reader *rd, const struct config *cfg, const struct fault_list *list);
/* Checks the faults against the head, its noise and its signal. */
void cfg_check_fault_beams(struct cfg_reader *rd, const struct config *cfg, const struct fault_list *list);

#endif
