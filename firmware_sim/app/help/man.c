/* SPDX-License-Identifier: MIT */
/* Manual pages: one for the program, one for each command, one for the configuration. */
#include <string.h>

#include "firmware_sim/app/app.h"
#include "firmware_sim/app/help/help.h"
#include "firmware_sim/config/reference.h"

enum { NAME_MAX_LEN = 64 };
static const char KEYS[] = "scanhead.yaml.5";

/* This command has a second help, by an option. */
static const char SECOND[] = "record", SECOND_OPTION[] = "--raw", SECOND_PAGE[] = "record-raw";

/* Writes the name of a command's page. */
static const char *page_name(const char *command, char *name)
{
    snprintf(name, NAME_MAX_LEN, "%s-%s", app_program, command);
    return name;
}

static void in_font(char font, const char *text)
{
    printf("\\f%c", font);
    roff_put(text, strlen(text));
    fputs("\\fR", stdout);
}

static void bold(const char *text)
{
    in_font('B', text);
}

static void put_option(char letter, const char *name, const char *argument, const char *help)
{
    const char dash[] = {'-', letter, '\0'};
    char word[64];
    snprintf(word, sizeof word, "--%s", name);
    puts(".TP");
    if (letter != '\0') bold(dash), fputs(", ", stdout);
    bold(word);
    if (argument != NULL) putchar(' '), in_font('I', argument);
    putchar('\n');
    roff_text(help);
}

static void refer(const char *name, const char *section)
{
    bold(name);
    printf("(%s)", section);
}

static void put_ends(const char *first, const char *section)
{
    puts(".SH EXIT STATUS");
    roff_text(help_status);
    puts(".SH SEE ALSO");
    refer(first, section);
    fputs(",\n", stdout);
    refer("scanhead.yaml", "5");
    putchar('\n');
}

static char this_page[NAME_MAX_LEN]; /* the page that is being printed */

static void put_command(const struct app_command *command)
{
    char arguments[128], usage[192];
    app_arguments(command, arguments, sizeof arguments);
    snprintf(usage, sizeof usage, "%s %s", app_program, command->name);
    roff_head(this_page, "1", command->summary);
    puts(".SH SYNOPSIS");
    bold(usage);
    roff_text(arguments);
    puts(".SH OPTIONS");
    for (const struct app_option *row = command->options; row->kind != APP_LAST; row++)
        put_option(row->letter, row->name, row->argument, row->help);
    put_option('h', "help", command->part,
               command->part != NULL ? "a text as this one, or only that part" : "a text as this one");
    if (command->notes != NULL) {
        puts(".SH NOTES");
        roff_notes(command->notes);
    }
    put_ends(app_program, "1");
}

/* Names of the commands that scanheadd has. */
#define SPACED(name) " " #name
#define NOTHING(name)
static const char HEAD_ALONE[] = APP_COMMANDS(SPACED, NOTHING);

static void put_program(const struct app_command *const *commands)
{
    char arguments[128], name[NAME_MAX_LEN];
    roff_head(app_program, "1", help_title);
    printf(".SH SYNOPSIS\n.B %s\n\\fICOMMAND\\fR ...\n.PP\n.B %s \\-\\-version\n.SH COMMANDS\n", app_program,
           app_program);
    for (size_t i = 0;; i++) {
        const struct app_command *command = commands[i] != NULL ? commands[i] : &help_command;
        app_arguments(command, arguments, sizeof arguments);
        puts(".TP");
        bold(command->name);
        roff_text(arguments);
        roff_put(command->summary, strlen(command->summary));
        fputs(";\n", stdout);
        refer(page_name(command->name, name), "1");
        putchar('\n');
        if (commands[i] == NULL) break;
    }
    puts(".SH OPTIONS");
    put_option('h', "help", NULL, "all commands, in short");
    put_option('\0', "version", NULL, "which release this is");
    puts(".SH SCANHEADD");
    roff_text(
        "scanheadd is the head alone, for a board. It needs fewer libraries, and has the same help and these commands, "
        "with the same options:");
    roff_text(HEAD_ALONE + 1);
    puts(".SH ENVIRONMENT\n.TP\n.B SCANHEAD_HEADS");
    roff_text("the folder of head profiles, in place of the installed one");
    puts(".TP\n.B NOTIFY_SOCKET");
    roff_text("run reports there to the service manager when the links are open, and when its end begins (sd_notify)");
    put_ends("libscanhead", "3");
}

static void put_keys(enum config_keys keys, const char *title)
{
    static struct config_key_text key;
    printf(".SH %s\n", title);
    roff_notes(config_keys_intro(keys));
    for (size_t i = 0; config_describe_key(keys, i, &key); i++) {
        puts(".TP");
        bold(key.path);
        putchar('\n');
        roff_text(key.what);
        puts(".br");
        roff_text(key.help);
    }
}

static void put_configuration(void)
{
    char name[NAME_MAX_LEN];
    roff_head("scanhead.yaml", "5", "configurations and head profiles of scanhead");
    puts(".SH DESCRIPTION");
    roff_text(
        "A configuration names a head profile, a scene, stations and links. `scanhead check FILE` says what is wrong "
        "with one. `scanhead check --example` prints one with all keys.");
    put_keys(CONFIG_KEYS, "KEYS OF CONFIGURATIONS");
    put_keys(CONFIG_PROFILE_KEYS, "KEYS OF HEAD PROFILES");
    puts(".SH SEE ALSO");
    refer(page_name("check", name), "1");
    putchar('\n');
}

static void list_pages(const struct app_command *const *commands)
{
    char name[NAME_MAX_LEN];
    printf("%s.1\n", app_program);
    for (size_t i = 0; commands[i] != NULL; i++)
        printf("%s.1\n", page_name(commands[i]->name, name));
    printf("%s.1\n", page_name(help_command.name, name));
    for (size_t i = 0; commands[i] != NULL; i++)
        if (strcmp(SECOND, commands[i]->name) == 0) printf("%s.1\n", page_name(SECOND_PAGE, name));
    puts(KEYS);
}

/* Whether a page is the one that is wanted. The function also notes the page's name, which put_command prints. */
static int is_page(const char *page, const char *wanted)
{
    const size_t n = strlen(page);
    snprintf(this_page, sizeof this_page, "%s", page);
    return strncmp(page, wanted, n) == 0 && strcmp(wanted + n, ".1") == 0;
}

static int put_one(const struct app_command *command, const char *wanted)
{
    char name[NAME_MAX_LEN];
    if (is_page(page_name(command->name, name), wanted)) return help_of(command, NULL, put_command), 1;
    if (strcmp(SECOND, command->name) == 0 && is_page(page_name(SECOND_PAGE, name), wanted))
        return help_of(command, SECOND_OPTION, put_command), 1;
    return 0;
}

int man_print(const struct app_command *const *commands, const char *name)
{
    if (name == NULL) return list_pages(commands), APP_OK;
    if (is_page(app_program, name)) return put_program(commands), APP_OK;
    if (strcmp(name, KEYS) == 0) return put_configuration(), APP_OK;
    for (; *commands != NULL; commands++)
        if (put_one(*commands, name)) return APP_OK;
    if (put_one(&help_command, name)) return APP_OK;
    return app_usage(&help_command, "--man %s: no such page; --man list prints the names of all", name);
}
