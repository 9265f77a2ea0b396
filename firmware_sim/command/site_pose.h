/* SPDX-License-Identifier: MIT */
/* `SITE:POSE`: a station and its place; and the pose that `TIME:STEP` may carry. */
#ifndef FIRMWARE_SIM_COMMAND_SITE_POSE_H
#define FIRMWARE_SIM_COMMAND_SITE_POSE_H

struct command_call;

/* Reads the six numbers of the text call->pose into call->out. Returns -1 when it failed. */
int command_take_pose(struct command_call *call);

int command_place_query(struct command_call *call);
int command_place_change(struct command_call *call);

#endif
