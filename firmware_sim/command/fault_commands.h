/* SPDX-License-Identifier: MIT */
/* `FAULt`: adds, lists and clears injected faults, and says how often they have struck. */
#ifndef FIRMWARE_SIM_COMMAND_FAULT_COMMANDS_H
#define FIRMWARE_SIM_COMMAND_FAULT_COMMANDS_H

struct command_call;

int command_fault_add(struct command_call *call);
int command_fault_clear(struct command_call *call);
int command_fault_injected(struct command_call *call);
int command_fault_list(struct command_call *call);

#endif
