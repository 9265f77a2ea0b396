/* SPDX-License-Identifier: MIT */
/* Texts of errors, as `SYSTem:ERRor?` gives them. */
#ifndef FIRMWARE_SIM_COMMAND_ERROR_QUEUE_H
#define FIRMWARE_SIM_COMMAND_ERROR_QUEUE_H

#include <stddef.h>

#include "firmware_sim/command/command.h"

enum { COMMAND_TEXT_LEN = sizeof(((struct command_queue *)0)->entry[0].text) };

/* Composes `standard text; text`. Bytes that are not printable ASCII become '~', and '"' becomes '\''. A text that does
 * not fit is cut, and ends with "...". len is 4 at least. */
void command_error_compose(char *buf, size_t len, int number, const char *text);

#endif
