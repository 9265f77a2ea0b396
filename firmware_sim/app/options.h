/* SPDX-License-Identifier: MIT */
/* Commands and their options as tables. The rows alone give parsing, errors and --help.
 *
 * In: argv and the command's table. Out: the operands, the settings of configuration keys, and the values of
 * the options in a struct of the command's own. A row says what it sets by the offset in that struct. */
#ifndef FIRMWARE_SIM_APP_OPTIONS_H
#define FIRMWARE_SIM_APP_OPTIONS_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

struct sh_err;

/* The name of the program, as messages, help and manual pages have it: scanhead; main sets another. */
extern const char *app_program;

/* The exit status of a command. APP_GO_ON is none: the command line was read, the command can begin. */
enum { APP_GO_ON = -1, APP_OK = 0, APP_FAILED = 1, APP_USAGE = 2 };

enum { APP_WORD = -1, APP_MAX_SETS = 256, APP_MAX_OPERANDS = 2, APP_MAX_OPTIONS = 64, APP_MAX_FILES = 512 };

/* clang-format off */
enum app_option_kind {
    APP_LAST,      /* the row after the last */
    APP_FLAG,      /* sets an int to 1 */
    APP_TEXT,      /* sets a const char * */
    APP_NUMBER,    /* sets a double, from min to max */
    APP_WHOLE,     /* sets a long, from min to max */
    APP_OUTPUT,    /* sets a long: a descriptor that the program was started with and can write to */
    APP_KEY,       /* stands for a configuration key */
    APP_SET,       /* any configuration key */
    APP_CHOICE,    /* sets an int, or an enum, to the number of one of `choices`, from 0 */
    APP_CALL,      /* calls apply */
    APP_PASS,      /* adds --NAME, and its value, to a struct app_words */
    APP_ALONE,     /* calls apply; the command then takes no operands */
    APP_PRINT      /* calls apply, which prints what was asked for: as with --help, the command does nothing else */
};

/* How the command uses the file that an option or an operand names. Pipes, devices and - count as no file. APP_FILLS:
 * it is written in place, maybe at the end of long work (newfile_open); so app_check_files tries before the work
 * whether it can be opened. APP_WRITES: it is replaced by another one. */
enum app_use { APP_NO_FILE, APP_READS, APP_WRITES, APP_FILLS };

/* A row begins with kind, name and argument; the rest goes by name. */
struct app_option {
    enum app_option_kind kind;
    const char *name;     /* without the dashes */
    const char *argument; /* as --help shows it; NULL: the option takes none */
    char letter;          /* the short form; 0: none */
    size_t at;            /* where in the command's struct the option sets its value */
    double min, max;
    const char *word;     /* WHOLE: a word that is allowed, too, and gives APP_WORD; NULL: none */
    const char *key;
    const char *const *choices; /* words that it takes, which a shell completes; NULL: any, or the key's words */
    size_t n_choices;
    enum app_use file;          /* of each option that names a file (outputs.c) */
    int (*apply)(void *values, const char *text); /* APP_OK, or APP_USAGE with the reason printed */
    const char *help;
};

/* Rows that are the same in every table. */
#define OPTION_SET \
    {APP_SET, "set", "KEY=VALUE", \
     .help = "another value of a configuration key; the value of a list or a section is YAML, as in " \
             "'links=[{type: tcp}]', and replaces the whole list or section; may be repeated"}
#define OPTION_NO_HASH(offset) \
    {APP_FLAG, "no-hash", NULL, .at = offset, \
     .help = "leave stream_sha256 out of --stats (null); it takes 10 to 20 ns of processor time a pulse"}
#define OPTION_CHOICES(words) .choices = words, .n_choices = sizeof(words) / sizeof((words)[0])
#define OPTION_END {.kind = APP_LAST}
/* clang-format on */

struct app_command {
    const char *name;
    const char *operand[APP_MAX_OPERANDS]; /* all are needed; NULL after the last */
    const char *needs;                     /* options that must be given, as the usage line shows them; NULL: none */
    const char *summary;                   /* one line: what it does */
    const struct app_option *options;      /* ends with OPTION_END; -h and --help are in no table */
    const char *notes;                     /* printed after the options; NULL: none */
    void (*print_more)(FILE *out);         /* printed last; NULL: nothing */
    const char *part;                      /* what may follow --help; NULL: nothing */
    int opens_links;                       /* of the configuration: their files are written */
    int (*print_part)(const char *part);   /* prints only this part of the help; returns the exit status */
    int (*run)(int argc, char **argv);     /* argv[0] is the command's name; returns the exit status */
};

/* Settings of configuration keys, as KEY=VALUE: of --set, and of options that stand for a key. */
struct app_sets {
    const char *set[APP_MAX_SETS];
    int n;
    char text[1024]; /* of the options that stand for a key, one after the other */
    size_t used;
};

/* Options that go to another command as they are. */
struct app_words {
    const char *word[2 * APP_MAX_OPTIONS];
    char name[APP_MAX_OPTIONS][32]; /* --NAME */
    int n, n_names;
};

/* A file that the command line names. */
struct app_file {
    const char *option; /* without the dashes; NULL: an operand */
    const char *path;
    enum app_use use;
    int is_given; /* by the user, as an option's value: its folder must be there */
    /* Files that are written, as the command knows them: */
    size_t n_ending; /* bytes of the path's ending, as in .ply */
    /* The file is a sidecar of `path`, with this ending in place of its own; NULL: `path` itself. */
    const char *ending;
    const char *added; /* the file is a sidecar of `path`, with this after its whole name; NULL: nothing */
    int each;          /* 1: files STEM-N.ENDING are written, too, for N from 1 on */
};

/* All that a command line says, except for the command's own options. */
struct app_input {
    const char *operand[APP_MAX_OPERANDS];
    const struct app_option *options; /* those of the command */
    uint64_t given;                   /* a bit for each of their rows */
    int n_options;                    /* that were given, --help aside */
    int alone;                        /* 1: an APP_ALONE option was given: there are no operands */
    struct app_sets sets;
    struct app_file file[APP_MAX_FILES];
    int n_files;
    int opens_links;      /* as the command says */
    const char *links;    /* YAML that --link gives in place of a configuration; NULL: none */
    const char *scenario; /* a file whose faults are added to those of the configuration; NULL: none */
};

/* APP_GO_ON with `in` and `values` filled, or the exit status: of a printed help, or of an error with its one
 * line. The strings are argv's own, or lie in `in`, which must stay where it is. */
int app_parse(const struct app_command *command, int argc, char **argv, struct app_input *in, void *values);

/* Whether an option of the command was given, by its name without the dashes. */
int app_is_given(const struct app_input *in, const char *option);

/* Adds a file to those of the command line: one that the command chooses itself. APP_OK, or APP_USAGE with the reason
 * printed. */
int app_add_file(struct app_input *in, const struct app_file *file);

/* From now on --help of a command calls `print` with its table; NULL: it prints the text. --help PART stays text. */
void app_set_help(void (*print)(const struct app_command *command));

/* Adds KEY=VALUE, which must live on. APP_OK, or APP_USAGE with the reason printed. */
int app_add_set(struct app_sets *sets, const char *set);

/* Adds rows of another command's table to `rows`: those in `names`, which ends with NULL. The added rows become
 * APP_PASS, with the struct app_words at `at`. `rows` has APP_MAX_OPTIONS + 1 rows; those that are not used are
 * OPTION_END, which is zeros. A table that has such rows already stays as it is. */
void app_pass_options(struct app_option *rows, const struct app_command *other, const char *const *names, size_t at);

/* Returns the number of a word among n. Negative: it is none of them, and err names those that are allowed. option: the
 * name of the word's option, without the dashes. */
int app_find_word(const char *option, const char *word, const char *const *words, size_t n, struct sh_err *err);

/* Reads n finite decimal numbers with `between` between them, and nothing else. 0: the text is not that. */
int app_read_numbers(const char *text, char between, double *out, int n);

/* Prints a usage error: one line that ends with where the help is. Returns APP_USAGE. */
int app_usage(const struct app_command *command, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

/* Finds the one of `n` words that may have been meant. NULL: none is near. */
const char *app_nearest(const char *word, const char *const *known, size_t n);

/* Writes the usage line from after the command's name into buf: operands, needed options, [options]. */
void app_arguments(const struct app_command *command, char *buf, size_t len);

#endif
