/* SPDX-License-Identifier: MIT */
/* Whole commands in this process, in a folder of their own, which is the current one. Sanitizers see what they leave
 * behind. A test that uses this rig runs from the top of the source tree. */
#ifndef TESTS_UNIT_COMMANDS_RIG_H
#define TESTS_UNIT_COMMANDS_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "firmware_sim/app/app.h"

/* These hold what the last command printed: on_out its standard output, on_err its standard error without progress. */
extern char *on_out, *on_err;

/* Makes the folder, and goes there. Returns 0, or -1. */
int commands_begin(void);
/* Removes the folder, and goes back. */
int commands_end(void **state);

void write_text(const char *name, const char *text);
/* Returns the text of a file of less than 2 MiB; free it. */
char *contents(const char *name);

/* Runs a command with these words, apart by blanks, and expects this exit status. */
void does(const struct app_command *command, const char *words, int want);
void has(const char *text, const char *what);

#endif
