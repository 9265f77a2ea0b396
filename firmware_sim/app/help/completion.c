/* SPDX-License-Identifier: MIT */
/* A completion for bash: commands, options and the words that they take, configuration keys and the words that these
 * take, files and folders. */
#include <ctype.h>
#include <string.h>

#include "firmware_sim/app/help/help.h"
#include "firmware_sim/config/reference.h"

/* This part does not depend on the tables. bash takes words apart at '=', so KEY=VALUE comes as three. _scanhead_value
 * answers: words W..., keys, files, folders, or text, which nothing completes. */
static const char FUNCTION[] =
    "_scanhead_reply()\n"
    "{\n"
    "    local kind=${1%% *} key\n"
    "    case $kind in\n"
    "    words) COMPREPLY=($(compgen -W \"${1#words}\" -- \"$2\")) ;;\n"
    "    keys)\n"
    "        # the number of an element that was typed, [3] or .3, stands for [0]\n"
    "        key=$_scanhead_keys\n"
    "        [[ $2 =~ ^[a-z_.]*[a-z_](\\[[0-9]+\\]|\\.[0-9]+) ]] && key=${key//'[0]'/${BASH_REMATCH[1]}}\n"
    "        COMPREPLY=($(compgen -S = -W \"$key\" -- \"$2\"))\n"
    "        compopt -o nospace 2>/dev/null ;;\n"
    "    files) mapfile -t COMPREPLY < <(compgen -f -- \"$2\"); compopt -o filenames 2>/dev/null ;;\n"
    "    folders) mapfile -t COMPREPLY < <(compgen -d -- \"$2\"); compopt -o filenames 2>/dev/null ;;\n"
    "    esac\n"
    "    return 0\n"
    "}\n"
    "\n"
    "_scanhead()\n"
    "{\n"
    "    local current=${COMP_WORDS[COMP_CWORD]} command=${COMP_WORDS[1]} last before kind\n"
    "    local -a words=(\"${COMP_WORDS[@]:0:COMP_CWORD}\")\n"
    "    COMPREPLY=()\n"
    "    if ((COMP_CWORD == 1)); then\n"
    "        _scanhead_reply \"words $_scanhead_commands --help --version\" \"$current\"\n"
    "        return\n"
    "    fi\n"
    "    [[ $current != = ]] || { current=; words+=(=); }\n"
    "    last=${words[-1]} before=\n"
    "    if [[ $last == = ]]; then\n"
    "        unset 'words[-1]'\n"
    "        last=${words[-1]} before=${words[-2]}\n"
    "        [[ $before != = ]] || before=${words[-3]}\n"
    "        case $before in\n"
    "        --set | --sweep) _scanhead_reply \"words $(_scanhead_key \"$last\")\" \"$current\"; return ;;\n"
    "        esac\n"
    "    fi\n"
    "    kind=$(_scanhead_value \"$command\" \"$last\")\n"
    "    if [[ $kind ]]; then\n"
    "        _scanhead_reply \"$kind\" \"$current\"\n"
    "    elif [[ $current == -* ]]; then\n"
    "        _scanhead_reply \"words $(_scanhead_options \"$command\")\" \"$current\"\n"
    "    elif [[ $command == help ]]; then\n"
    "        _scanhead_reply \"words $_scanhead_commands\" \"$current\"\n"
    "    else\n"
    "        _scanhead_reply files \"$current\"\n"
    "    fi\n"
    "}\n"
    "complete -F _scanhead ";

/* Each program has functions of its own, so that a shell may have those of scanhead and scanheadd. */
static void put_script(const char *text)
{
    static const char name[] = "_scanhead";
    for (const char *at; (at = strstr(text, name)) != NULL; text = at + sizeof name - 1)
        printf("%.*s_%s", (int)(at - text), text, app_program);
    fputs(text, stdout);
}

/* "stations[].name" as it is typed: stations[0].name. */
static void put_path(const char *path)
{
    for (; *path != '\0'; path++)
        printf("%s%c", *path == ']' ? "0" : "", *path);
}

static void put_words(const char *const *words)
{
    for (; *words != NULL; words++)
        printf(" %s", *words);
}

static const char *const *words_of_key(const char *path)
{
    static struct config_key_text key;
    for (size_t i = 0; config_describe_key(CONFIG_KEYS, i, &key); i++)
        if (strcmp(key.path, path) == 0) return key.words;
    return NULL;
}

static void put_keys(void)
{
    static struct config_key_text key;
    put_script("_scanhead_keys='");
    for (size_t i = 0; config_describe_key(CONFIG_KEYS, i, &key); i++)
        if (key.has_value) put_path(key.path), putchar(' ');
    put_script("'\n\n_scanhead_key()\n{\n    local key=$1\n");
    puts("    [[ $key =~ (\\[[0-9]+\\]|\\.[0-9]+) ]] && key=${key/\"${BASH_REMATCH[1]}\"/'[0]'}");
    puts("    case $key in");
    for (size_t i = 0; config_describe_key(CONFIG_KEYS, i, &key); i++) {
        if (key.words == NULL) continue;
        fputs("    '", stdout);
        put_path(key.path);
        fputs("') echo", stdout);
        put_words(key.words);
        puts(" ;;");
    }
    puts("    esac\n}\n");
}

/* Prints the alternatives of an argument that are typed as they stand: "N|all" -> all. Capitals stand for a value. */
static int put_alternatives(const char *argument)
{
    int n = 0;
    for (size_t len; *argument != '\0'; argument += len + (argument[len] == '|')) {
        len = strcspn(argument, "|");
        if (!islower((unsigned char)argument[0]) && !isdigit((unsigned char)argument[0])) continue;
        printf("%s %.*s", n++ == 0 ? "words" : "", (int)len, argument);
    }
    return n;
}

static const char *completion_place_of(const struct app_option *row)
{
    static const struct {
        const char *begins, *kind;
    } places[] = {{"FILE", "files"}, {"CONFIG", "files"}, {"DIR", "folders"}, {"KEY=", "keys"}};
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++)
        if (strncmp(row->argument, places[i].begins, strlen(places[i].begins)) == 0 &&
            strcmp(row->argument, "DIRECTION") != 0)
            return places[i].kind;
    return "text";
}

static void put_value(const struct app_option *row)
{
    const char *const *words = row->key != NULL ? words_of_key(row->key) : NULL;
    if (row->n_choices > 0) {
        fputs("words", stdout);
        for (size_t i = 0; i < row->n_choices; i++)
            printf(" %s", row->choices[i]);
    } else if (words != NULL) {
        fputs("words", stdout);
        put_words(words);
    } else if (put_alternatives(row->argument) == 0) {
        fputs(completion_place_of(row), stdout);
    }
}

static void put_values(const struct app_command *command)
{
    for (const struct app_option *row = command->options; row->kind != APP_LAST; row++) {
        if (row->argument == NULL) continue;
        printf("    '%s --%s'", command->name, row->name);
        if (row->letter != '\0') printf(" | '%s -%c'", command->name, row->letter);
        fputs(") echo ", stdout);
        put_value(row);
        puts(" ;;");
    }
    if (command->part == NULL) return;
    static struct config_key_text key;
    printf("    '%s --help') echo words profile", command->name);
    for (size_t i = 0; config_describe_key(CONFIG_KEYS, i, &key); i++)
        if (strpbrk(key.path, ".[") == NULL) printf(" %s", key.path);
    puts(" ;;");
}

static void put_options(const struct app_command *command)
{
    printf("    %s) echo", command->name);
    for (const struct app_option *row = command->options; row->kind != APP_LAST; row++) {
        if (row->letter != '\0') printf(" -%c", row->letter);
        printf(" --%s", row->name);
    }
    puts(" -h --help ;;");
}

static void put_each(const struct app_command *const *commands, const char *head,
                     void (*put)(const struct app_command *command))
{
    put_script(head);
    for (; *commands != NULL; commands++)
        help_of(*commands, NULL, put);
    help_of(&help_command, NULL, put);
    puts("    esac\n}\n");
}

void completion_print(const struct app_command *const *commands)
{
    printf("# bash completion for %s, made by: %s help --completion bash\n", app_program, app_program);
    put_script("_scanhead_commands='");
    for (size_t i = 0; commands[i] != NULL; i++)
        printf("%s ", commands[i]->name);
    printf("%s'\n", help_command.name);
    put_keys();
    put_each(commands, "_scanhead_options()\n{\n    case $1 in\n", put_options);
    put_each(commands, "_scanhead_value()\n{\n    case \"$1 $2\" in\n", put_values);
    put_script(FUNCTION);
    puts(app_program);
}
