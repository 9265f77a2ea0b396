/* SPDX-License-Identifier: MIT */
/* scanhead and scanheadd share this: each is a main with a table of its commands. */
#ifndef FIRMWARE_SIM_PROGRAM_H
#define FIRMWARE_SIM_PROGRAM_H

#include "firmware_sim/app/app.h"

struct program {
    const struct app_command *const *command; /* up to NULL */
    const char *const *elsewhere;             /* names of commands that scanhead alone has, up to NULL */
};

/* Runs the command that the command line names. Returns the exit status. */
int program_main(const struct program *program, int argc, char **argv);

#endif
