/* Commands and their options as tables. The rows alone give parsing, errors and --help.
 *
 * In: argv and the command's table. Out: the operands, the settings of configuration keys, and the values of
 * the options in a struct of the command's own. A row says what it sets by the offset in that struct. */
#ifndef FIRMWARE_SIM_APP_OPTIONS_H
#define FIRMWARE_SIM_APP_OPTIONS_H

#include <stddef.h>
#include <stdio.h>

/* The exit status of a command. APP_GO_ON is none: the command line was read, the command can begin. */
enum { APP_GO_ON = -1, APP_OK = 0, APP_FAILED = 1, APP_USAGE = 2 };

enum { APP_MAX_SETS = 256, APP_MAX_KEYS = 16, APP_MAX_OPERANDS = 2, APP_MAX_OPTIONS = 32 };

enum app_option_kind {
    APP_LAST, /* the row after the last */
    APP_FLAG,
    APP_TEXT,
    APP_NUMBER,
    APP_WHOLE,
    APP_KEY,
    APP_SET,
    APP_CALL
};

struct app_option {
    const char *name;     /* without the dashes */
    char letter;          /* the short form; 0: none */
    const char *argument; /* as --help shows it; NULL: the option takes none */
    enum app_option_kind kind;
    size_t at;       /* FLAG: of an int, set to 1. TEXT: of a const char *. NUMBER: of a double. WHOLE: of a long */
    double min, max; /* NUMBER, WHOLE: what is allowed */
    const char *key; /* KEY: the configuration key that the option stands for */
    int (*apply)(void *values, const char *text); /* CALL: returns APP_OK, or APP_USAGE with the reason printed */
    const char *help;
};

/* One row each. */
#define OPTION_FLAG(n, where, h)                            \
    {                                                       \
        .name = n, .kind = APP_FLAG, .at = where, .help = h \
    }
#define OPTION_TEXT(n, a, where, h)                                        \
    {                                                                      \
        .name = n, .argument = a, .kind = APP_TEXT, .at = where, .help = h \
    }
#define OPTION_NUMBER(n, a, lo, hi, where, h)                                                      \
    {                                                                                              \
        .name = n, .argument = a, .kind = APP_NUMBER, .min = lo, .max = hi, .at = where, .help = h \
    }
#define OPTION_WHOLE(n, a, lo, hi, where, h)                                                      \
    {                                                                                             \
        .name = n, .argument = a, .kind = APP_WHOLE, .min = lo, .max = hi, .at = where, .help = h \
    }
#define OPTION_KEY(n, a, k, h)                                         \
    {                                                                  \
        .name = n, .argument = a, .kind = APP_KEY, .key = k, .help = h \
    }
#define OPTION_CALL(n, a, f, h)                                           \
    {                                                                     \
        .name = n, .argument = a, .kind = APP_CALL, .apply = f, .help = h \
    }
#define OPTION_SET                                                      \
    {                                                                   \
        .name = "set", .argument = "KEY=VALUE", .kind = APP_SET,        \
        .help = "another value of a configuration key; may be repeated" \
    }
#define OPTION_END       \
    {                    \
        .kind = APP_LAST \
    }

struct app_command {
    const char *name;
    int is_program;                        /* 1: a program of its own, no command of scanhead */
    const char *operand[APP_MAX_OPERANDS]; /* all are needed; NULL after the last */
    const char *needs;                     /* options that must be given, as the usage line shows them; NULL: none */
    const char *summary;                   /* one line: what it does */
    const struct app_option *options;      /* ends with OPTION_END; -h and --help are in no table */
    const char *notes;                     /* printed after the options; NULL: none */
    void (*print_more)(FILE *out);         /* printed last; NULL: nothing */
    int (*run)(int argc, char **argv);     /* argv[0] is the command's name; returns the exit status */
};

/* Settings of configuration keys, as KEY=VALUE: of --set, and of options that stand for a key. */
struct app_sets {
    const char *set[APP_MAX_SETS];
    int n;
    char text[APP_MAX_KEYS][64]; /* of the options that stand for a key */
    int n_text;
};

/* What a command line says, but for the command's own options. */
struct app_input {
    const char *operand[APP_MAX_OPERANDS];
    struct app_sets sets;
};

/* APP_GO_ON with `in` and `values` filled, or the exit status: of a printed help, or of an error with its one
 * line. The strings are argv's own. */
int app_parse(const struct app_command *command, int argc, char **argv, struct app_input *in, void *values);

/* APP_OK, or APP_USAGE with the reason printed. `set` is kept, `value` copied. */
int app_add_set(struct app_sets *sets, const char *set);
int app_add_key(struct app_sets *sets, const char *key, const char *value);

/* The whole text as a number from min to max: APP_OK, or APP_USAGE with the reason printed. */
int app_parse_long(const struct app_command *command, const char *option, const char *text, long min, long max,
                   long *out);

/* Prints a usage error: one line that ends with where the help is. Returns APP_USAGE. */
int app_usage(const struct app_command *command, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

/* What follows the command's name in its usage line: operands, needed options, [options]. */
void app_arguments(const struct app_command *command, char *buf, size_t len);

#endif
