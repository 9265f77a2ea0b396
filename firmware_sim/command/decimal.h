/* SPDX-License-Identifier: MIT */
/* Decimal numbers, read and written exactly. */
#ifndef FIRMWARE_SIM_COMMAND_DECIMAL_H
#define FIRMWARE_SIM_COMMAND_DECIMAL_H

#include <stddef.h>
#include <stdint.h>

#include "firmware_sim/command/command.h"

/* A decimal number as it was written: +-digits * 10^exponent. Digits have no zeros at either end; 0 has no
 * digits. */
struct command_decimal {
    char digits[COMMAND_MAX_LINE + 1];
    int n_digits, exponent, negative;
};

/* NRf of IEEE 488.2, 7.7.2. Returns what follows the number and its blanks, or NULL when text is not a
 * number. */
const char *command_parse_decimal(const char *text, struct command_decimal *decimal);

enum command_fit { COMMAND_FIT_EXACT, COMMAND_FIT_FINE, COMMAND_FIT_BIG };
/* number * 10^shift as an integer. FINE: it has a fraction; BIG: it needs more than 20 digits. */
enum command_fit command_decimal_to_wide(const struct command_decimal *decimal, int shift, __int128 *value);
/* The same; BIG: it needs more than 63 bits. */
enum command_fit command_decimal_to_int(const struct command_decimal *decimal, int shift, int64_t *value);
/* Returns the nearest double. (strtod of the text would end at a blank within the number, as in "1 E2".) */
double command_decimal_to_double(const struct command_decimal *decimal);

enum { COMMAND_DOUBLE_LEN = 32 };
/* Prints the fewest digits from 15 on that read back as the same number, as printf's %g does. Returns their length. */
int command_print_double(char *text, size_t room, double value);

#endif
