/* SPDX-License-Identifier: MIT */
#include "tests/unit/commands_rig.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "tests/common/free_fd.h"
#include "tests/unit/output_rig.h"

static char folder[64], back[512];
static int fd_before;
char *on_out, *on_err;

int commands_begin(void)
{
    char heads[600];
    fd_before = free_fd();
    if (getcwd(back, sizeof back) == NULL) return -1;
    snprintf(heads, sizeof heads, "%s/config/heads", back);
    setenv("SCANHEAD_HEADS", heads, 1);
    strcpy(folder, "/tmp/scanhead-commands-XXXXXX");
    return mkdtemp(folder) == NULL || chdir(folder) != 0 ? -1 : 0;
}

int commands_end(void **state)
{
    (void)state;
    char command[80];
    free(on_out);
    free(on_err);
    snprintf(command, sizeof command, "rm -r '%s'", folder);
    return chdir(back) != 0 || system(command) != 0 ? -1 : free_fd_check(fd_before);
}

void write_text(const char *name, const char *text)
{
    FILE *out = fopen(name, "w");
    assert_non_null(out);
    fputs(text, out);
    assert_int_equal(fclose(out), 0);
}

char *contents(const char *name)
{
    char *text = calloc(1, 1 << 21);
    FILE *in = fopen(name, "r");
    assert_true(in != NULL && text != NULL);
    assert_true(fread(text, 1, (1 << 21) - 1, in) > 0);
    fclose(in);
    return text;
}

void does(const struct app_command *command, const char *words, int want)
{
    char text[512], *argv[40] = {0}, *at = text;
    struct output out, err;
    int argc = 0;
    snprintf(text, sizeof text, "%s %s", command->name, words);
    for (char *word; (word = strsep(&at, " ")) != NULL;)
        if (*word != '\0') argv[argc++] = word;
    free(on_out);
    free(on_err);
    output_take(&out, stdout);
    output_take(&err, stderr);
    const int status = command->run(argc, argv);
    app_end_messages(); /* as main does */
    on_err = output_give_said(&err);
    on_out = output_give(&out);
    if (status != want) fail_msg("%s %s: status %d: %s", command->name, words, status, on_err);
}

void has(const char *text, const char *what)
{
    if (strstr(text, what) == NULL) fail_msg("no %s in %s", what, text);
}
