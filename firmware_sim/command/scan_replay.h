/* SPDX-License-Identifier: MIT */
/* `SCAN:REPLay` sets where a recording is played, how fast, and whether it begins anew at its end. */
#ifndef FIRMWARE_SIM_COMMAND_SCAN_REPLAY_H
#define FIRMWARE_SIM_COMMAND_SCAN_REPLAY_H

struct command_call;

int command_replay_query(struct command_call *call);
int command_replay_change(struct command_call *call);

#endif
