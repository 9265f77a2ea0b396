/* SPDX-License-Identifier: MIT */
/* scanhead help: what the program says of itself, for people, for man and for a shell.
 *
 * In: the list of commands (app.h) and their tables, the table of configuration keys. Out: the help's text, manual
 * pages as roff, a completion for bash. Pages and completion are made from the tables that --help prints, so
 * nothing here names a command. One exception is in man.c: `record --raw --help` has a help of its own. */
#ifndef FIRMWARE_SIM_APP_HELP_HELP_H
#define FIRMWARE_SIM_APP_HELP_HELP_H

#include <stdio.h>

#include "firmware_sim/app/options.h"

/* The help of the program as a whole. commands ends with NULL. */
void help_print(const struct app_command *const *commands, FILE *out);

/* Finds the command that a wrong word may have meant. NULL: none is near. */
const char *help_nearest(const struct app_command *const *commands, const char *word);

/* The command itself. Returns the exit status. */
int help_run(const struct app_command *const *commands, int argc, char **argv);

/* ---- what the files of this folder share */

extern const char help_title[], help_status[]; /* what the program is; what its exit status says */
extern const struct app_command help_command;

/* Calls the command with --help, and has its table given to `print`. second: an option before --help, as in
 * `record --raw --help`; NULL: none. */
void help_of(const struct app_command *command, const char *second, void (*print)(const struct app_command *command));

/* man.c. name: that of a page, such as "scanhead-run.1"; NULL: prints the names of all pages. APP_OK, or APP_USAGE with
 * the reason printed. */
int man_print(const struct app_command *const *commands, const char *name);

/* completion.c */
void completion_print(const struct app_command *const *commands);

/* ---- roff.c: text for man. Nothing in it is taken for a request or an escape. */
void roff_put(const char *text, size_t n);
/* Writes the words of a paragraph, which man breaks into lines. */
void roff_text(const char *text);
/* Notes as --help prints them: paragraphs are filled, lists of words and tables stay as they are. */
void roff_notes(const char *notes);
void roff_head(const char *name, const char *section, const char *summary);

#endif
