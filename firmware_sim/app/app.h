/* The commands behind `scanhead NAME ...`, one file each, and what they share. Only these print; only main exits.
 *
 * Exit status: 0 done, 1 failed, 2 wrong usage, configuration or input. An error is one line on stderr. */
#ifndef FIRMWARE_SIM_APP_APP_H
#define FIRMWARE_SIM_APP_APP_H

#include <getopt.h>
#include <signal.h>

#include "core/err.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/loop/loop.h"

enum { APP_OK = 0, APP_FAILED = 1, APP_USAGE = 2, APP_MAX_SETS = 256 };

struct app_command {
    const char *name;
    const char *arguments; /* for the usage line */
    const char *summary;
    int (*run)(int argc, char **argv); /* argv[0] is the command's name; returns the exit status */
};

/* The only list of commands, ends with a NULL name. */
extern const struct app_command app_table[];

int app_run(int argc, char **argv);
int app_record(int argc, char **argv);
int app_plan(int argc, char **argv);
int app_map(int argc, char **argv);
int app_report(int argc, char **argv);
int app_check(int argc, char **argv);
int app_list(int argc, char **argv);

/* Settings collected from --set and the options that stand for one. */
struct app_sets {
    const char *set[APP_MAX_SETS];
    int n;
    char text[16][64]; /* of the options that stand for a key */
    int n_text;
};
/* 0, or APP_USAGE with the reason printed. */
int app_add_set(struct app_sets *sets, const char *set);
int app_add_key(struct app_sets *sets, const char *key, const char *value);

/* Prints "scanhead: TEXT" and gives the exit status for the error. */
int app_fail(const struct sh_err *err);
/* Prints a usage error: one line that ends with a pointer to --help. Returns APP_USAGE. */
int app_usage(const char *command, const char *fmt, ...) __attribute__((format(printf, 2, 3)));
/* getopt_long's '?' and ':' told in our words. Returns APP_USAGE. */
int app_bad_option(const char *command, int opt, char **argv);

/* Whole text as a number within [min, max]; 0, or APP_USAGE with the reason printed. */
int app_parse_double(const char *command, const char *option, const char *text, double min, double max, double *out);
int app_parse_long(const char *command, const char *option, const char *text, long min, long max, long *out);

/* Warnings and progress to stderr, each with the program's name; progress only for what takes longer than a second. */
extern const struct sh_report app_report_stderr;

/* Loads the configuration (allocated; free() it). NULL and *status when it failed, with the reason printed. */
struct config *app_load_config(const char *path, const struct app_sets *sets, int *status);

/* Set by SIGINT and SIGTERM once app_catch_signals was called; a second signal ends the process at once. */
extern volatile sig_atomic_t app_interrupted;
void app_catch_signals(void);

/* Writes the design's statistics as JSON; path "-" is standard output. */
struct app_stats {
    struct loop_stats loop;
    double cpu_s;
};
/* One line on standard error for each kind of echoes that are not in the points. */
void app_warn_left_out(uint64_t crowded, uint64_t unfit);
int app_write_stats(const char *path, const struct app_stats *stats, struct sh_err *err);

#endif
