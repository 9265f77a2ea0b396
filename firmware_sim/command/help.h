/* SPDX-License-Identifier: MIT */
/* `HELP?` and `HELP:SETtings?` list the headers of the table of commands. `HELP? HEADER` describes one command, for
 * people and for programs. */
#ifndef FIRMWARE_SIM_COMMAND_HELP_H
#define FIRMWARE_SIM_COMMAND_HELP_H

struct command_call;

int command_help(struct command_call *call);
int command_help_settings(struct command_call *call);

#endif
