/* SPDX-License-Identifier: MIT */
/* scanhead has head and studio, all commands. */
#include "firmware_sim/program.h"
#include "firmware_sim/app/studio/watch/watch.h"

#define COMMAND(name) &app_##name,
static const struct app_command *const COMMANDS[] = {APP_COMMANDS(COMMAND, COMMAND) NULL};
static const char *const ELSEWHERE[] = {NULL};

int main(int argc, char **argv)
{
    static const struct program program = {COMMANDS, ELSEWHERE};
    run_take_page(&watch_page);
    return program_main(&program, argc, argv);
}
