/* SPDX-License-Identifier: MIT */
/* The settings that a head keeps without power, as commands. */
#ifndef FIRMWARE_SIM_COMMAND_STORED_H
#define FIRMWARE_SIM_COMMAND_STORED_H

#include <stddef.h>

#include "firmware_sim/command/command.h"

/* Writes a line for each setting whose value is not that of the configuration: "HEAD:LINes 10\n". Left out are the
 * station, which says where the head stands, the frames of a scan, and steps that follow from the rates. Returns 0; or
 * -1: cap is too small. */
int command_stored_text(struct command_device *dev, const struct head_settings *configured, char *text, size_t cap);

/* Carries out such lines: calls `set` for each. A setting's limits depend on others, so a line that is refused is tried
 * again after the others. A line whose value is set already is left out. Returns 0; or -1, with the reason in why: a
 * line is no such line or is refused in any order, there are too many lines, or there is no memory. */
int command_stored_apply(struct command_device *dev, const char *text, void (*set)(void *ctx, const char *line),
                         void *ctx, char *why, size_t len);

#endif
