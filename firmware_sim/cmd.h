/* The commands behind `scanhead NAME ...`, one file each, and what they share. Only these print; only main exits.
 *
 * Exit status: 0 done, 1 failed, 2 wrong usage, configuration or input. An error is one line on stderr. */
#ifndef FIRMWARE_SIM_CMD_H
#define FIRMWARE_SIM_CMD_H

#include <getopt.h>
#include <signal.h>

#include "core/err.h"
#include "firmware_sim/config.h"
#include "firmware_sim/loop.h"

enum { CMD_OK = 0, CMD_FAILED = 1, CMD_USAGE = 2, CMD_MAX_SETS = 256 };

struct cmd {
    const char *name;
    const char *arguments; /* for the usage line */
    const char *summary;
    int (*run)(int argc, char **argv); /* argv[0] is the command's name; returns the exit status */
};

/* The only list of commands, ends with a NULL name. */
extern const struct cmd cmd_table[];

int cmd_run(int argc, char **argv);
int cmd_record(int argc, char **argv);
int cmd_plan(int argc, char **argv);
int cmd_map(int argc, char **argv);
int cmd_report(int argc, char **argv);
int cmd_check(int argc, char **argv);
int cmd_list(int argc, char **argv);
int cmd_bench(int argc, char **argv);

/* Settings collected from --set and the options that stand for one. */
struct cmd_sets {
    const char *set[CMD_MAX_SETS];
    int n;
    char text[16][64]; /* of the options that stand for a key */
    int n_text;
};
/* 0, or CMD_USAGE with the reason printed. */
int cmd_add_set(struct cmd_sets *sets, const char *set);
int cmd_add_key(struct cmd_sets *sets, const char *key, const char *value);

/* Prints "scanhead: TEXT" and gives the exit status for the error. */
int cmd_fail(const struct sh_err *err);
/* Prints a usage error: one line that ends with a pointer to --help. Returns CMD_USAGE. */
int cmd_usage(const char *command, const char *fmt, ...) __attribute__((format(printf, 2, 3)));
/* getopt_long's '?' and ':' told in our words. Returns CMD_USAGE. */
int cmd_bad_option(const char *command, int opt, char **argv);

/* Whole text as a number within [min, max]; 0, or CMD_USAGE with the reason printed. */
int cmd_parse_double(const char *command, const char *option, const char *text, double min, double max, double *out);
int cmd_parse_long(const char *command, const char *option, const char *text, long min, long max, long *out);

/* Warnings and progress to stderr, each with the program's name; progress only for what takes longer than a second. */
extern const struct sh_report cmd_report_stderr;

/* Loads the configuration (allocated; free() it). NULL and *status when it failed, with the reason printed. */
struct config *cmd_load_config(const char *path, const struct cmd_sets *sets, int *status);

/* Set by SIGINT and SIGTERM once cmd_catch_signals was called; a second signal ends the process at once. */
extern volatile sig_atomic_t cmd_interrupted;
void cmd_catch_signals(void);

/* Writes the design's statistics as JSON; path "-" is standard output. */
struct cmd_stats {
    struct loop_stats loop;
    double cpu_s;
};
/* One line on standard error for each kind of echoes that are not in the points. */
void cmd_warn_left_out(uint64_t crowded, uint64_t unfit);
int cmd_write_stats(const char *path, const struct cmd_stats *stats, struct sh_err *err);

#endif
