/* SPDX-License-Identifier: MIT */
/* scanheadd is the head alone, for a board. It is linked with nothing of the studio. */
#include "firmware_sim/program.h"

#define COMMAND(name) &app_##name,
#define NAME(name)    #name,
#define NOTHING(name)
static const struct app_command *const COMMANDS[] = {APP_COMMANDS(COMMAND, NOTHING) NULL};
static const char *const ELSEWHERE[] = {APP_COMMANDS(NOTHING, NAME) NULL};

int main(int argc, char **argv)
{
    static const struct program program = {COMMANDS, ELSEWHERE};
    return program_main(&program, argc, argv);
}
