/* SPDX-License-Identifier: MIT */
/* Angular steps, which follow from the rates. */
#ifndef FIRMWARE_SIM_COMMAND_STEP_H
#define FIRMWARE_SIM_COMMAND_STEP_H

#include <stdint.h>

#include "firmware_sim/command/setting.h"

/* Returns the angle of a step in nano-degrees, for a number of steps per turn. */
int64_t command_step_ndeg(uint32_t steps);
extern const struct command_derived command_step_both, command_step_line, command_step_pan;

#endif
