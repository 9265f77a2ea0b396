/* SPDX-License-Identifier: MIT */
#include "tests/unit/lines_rig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/app/app.h"
#include "tests/unit/output_rig.h"

enum { MOST_WORDS = 40 };

#define COMMAND(name) &app_##name,
static const struct app_command *const COMMANDS[] = {APP_COMMANDS(COMMAND, COMMAND) NULL};

static int lines_rig_run(int argc, char **argv)
{
    for (const struct app_command *const *c = COMMANDS; *c != NULL; c++)
        if (strcmp((*c)->name, argv[0]) == 0) return (*c)->run(argc, argv);
    fail_msg("no command %s", argv[0]);
    return 0;
}

/* Writes the whole line: $ is filled in, and a command's error gets its name and the reference to the help. */
static void fill(const char *says, char *const *argv, char *out, size_t len)
{
    const int is_whole = strncmp(says, "scanhead: ", 10) == 0;
    size_t n = is_whole ? 0 : (size_t)snprintf(out, len, "scanhead %s: ", argv[0]);
    for (; *says != '\0'; says++)
        n += (size_t)(*says == '$' ? snprintf(out + n, len - n, "%s", argv[1])
                                   : snprintf(out + n, len - n, "%c", *says));
    if (!is_whole) n += (size_t)snprintf(out + n, len - n, "; see scanhead %s --help", argv[0]);
    snprintf(out + n, len - n, "\n");
}

static void expect_line(const char *says, const char *words)
{
    char text[512], want[1024], *argv[MOST_WORDS + 1] = {0}, *at = text;
    struct output output;
    int argc = 0;
    snprintf(text, sizeof text, "%s", words);
    for (char *word; argc < MOST_WORDS && (word = strsep(&at, " ")) != NULL;)
        argv[argc++] = word;
    fill(says, argv, want, sizeof want);
    output_take(&output, stderr);
    const int status = lines_rig_run(argc, argv);
    char *said = output_give(&output);
    if (status != APP_USAGE || strcmp(said, want) != 0)
        fail_msg("%s: status %d, said %snot %s", words, status, said, want);
    free(said);
}

void lines_expect(const struct lines_row *rows, size_t n)
{
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < sizeof rows[i].words / sizeof rows[i].words[0] && rows[i].words[k] != NULL; k++)
            expect_line(rows[i].says, rows[i].words[k]);
}
