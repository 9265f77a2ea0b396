/* SPDX-License-Identifier: MIT */
/* scanhead help: the command, and the help of the program as a whole. */
#include "firmware_sim/app/help/help.h"

#include <string.h>

const char help_title[] = "a terrestrial laser scanner head in software, which clients see as a real one";
const char help_status[] = "0 done, 1 failed, 2 wrong usage, configuration or input.";

struct help_wish {
    const char *man;
    int shell; /* a number in `shells` */
};
#define AT(member) offsetof(struct help_wish, member)

static const char *const shells[] = {"bash"};

/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_TEXT, "man", "PAGE", .at = AT(man),
     .help = "print the manual page of that name as roff; --man list prints the names of all pages"},
    {APP_CHOICE, "completion", "SHELL", .at = AT(shell), OPTION_CHOICES(shells),
     .help = "print a completion for bash, to be sourced"},
    OPTION_END
};
/* clang-format on */

/* main.c calls help_run in place of a function `run`. */
const struct app_command help_command = {
    .name = "help",
    .needs = "[COMMAND]",
    .summary = "this text, that of a command, manual pages, a completion",
    .options = OPTIONS,
    .notes = "help --man PAGE | man -l - shows a page that is not installed.\n",
};

static void print_command(const struct app_command *command, FILE *out)
{
    char arguments[128];
    app_arguments(command, arguments, sizeof arguments);
    fprintf(out, "  %s %s%-*s %s\n", app_program, command->name, 38 - (int)strlen(command->name), arguments,
            command->summary);
}

void help_print(const struct app_command *const *commands, FILE *out)
{
    fprintf(out, "%s: %s\n\n", app_program, help_title);
    for (; *commands != NULL; commands++)
        print_command(*commands, out);
    print_command(&help_command, out);
    fprintf(out,
            "\nEach command has --help. `%s check --help` lists all configuration keys.\n"
            "%s --version says which release this is.\n"
            "Exit status: %s\n",
            app_program, app_program, help_status);
}

void help_of(const struct app_command *command, const char *second, void (*print)(const struct app_command *command))
{
    char name[32], more[32], help[] = "--help";
    char *with[] = {name, help, NULL}, *with_more[] = {name, more, help, NULL};
    snprintf(name, sizeof name, "%s", command->name);
    snprintf(more, sizeof more, "%s", second != NULL ? second : "");
    app_set_help(print);
    if (command == &help_command)
        app_parse(command, 2, with, &(struct app_input){0}, &(struct help_wish){0});
    else if (second == NULL)
        command->run(2, with);
    else
        command->run(3, with_more);
    app_set_help(NULL);
}

const char *help_nearest(const struct app_command *const *commands, const char *word)
{
    enum { MOST = 32 };
    const char *known[MOST] = {help_command.name};
    size_t n = 1;
    for (; *commands != NULL && n < MOST; commands++)
        known[n++] = (*commands)->name;
    return app_nearest(word, known, n);
}

static int print_one(const struct app_command *const *commands, const char *word)
{
    const char *meant = help_nearest(commands, word);
    if (strcmp(word, help_command.name) == 0) return help_of(&help_command, NULL, NULL), APP_OK;
    for (; *commands != NULL; commands++)
        if (strcmp(word, (*commands)->name) == 0) return help_of(*commands, NULL, NULL), APP_OK;
    if (meant != NULL) return app_usage(&help_command, "no command %s, did you mean %s?", word, meant);
    return app_usage(&help_command, "no command %s; %s --help lists all commands", word, app_program);
}

int help_run(const struct app_command *const *commands, int argc, char **argv)
{
    struct help_wish wish = {0};
    struct app_input in;
    if (argc == 1) return help_print(commands, stdout), APP_OK;
    if (argc == 2 && argv[1][0] != '-') return print_one(commands, argv[1]);
    if (argc > 2 && argv[1][0] != '-' && argv[2][0] != '-')
        return app_usage(&help_command, "one COMMAND is allowed; %s is one too many", argv[2]);
    const int status = app_parse(&help_command, argc, argv, &in, &wish);
    if (status != APP_GO_ON) return status;
    if (in.n_options > 1) return app_usage(&help_command, "--man and --completion: allowed is one of them");
    if (in.n_options == 0) return help_print(commands, stdout), APP_OK; /* as in `scanhead help --` */
    if (wish.man != NULL) return man_print(commands, strcmp(wish.man, "list") == 0 ? NULL : wish.man);
    completion_print(commands);
    return APP_OK;
}
