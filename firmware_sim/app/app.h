/* SPDX-License-Identifier: MIT */
/* The commands of the command line share this: exit status, messages, loading, signals, files of figures.
 *
 * Each command is one file and one struct app_command. Only commands print, and only main exits. An error is one line
 * on standard error; each error of a configuration is a line of its own. */
#ifndef FIRMWARE_SIM_APP_APP_H
#define FIRMWARE_SIM_APP_APP_H

#include <signal.h>
#include <stdint.h>

#include "core/err.h"
#include "firmware_sim/app/options.h"
#include "firmware_sim/base/json.h"

struct config;
struct config_diagnostics;

/* The only list of commands, in the order of `scanhead --help`. scanheadd has those of HEAD, scanhead has all of
 * them. */
#define APP_COMMANDS(HEAD, STUDIO) \
    HEAD(run)                      \
    STUDIO(record)                 \
    STUDIO(batch)                  \
    HEAD(plan)                     \
    STUDIO(map)                    \
    STUDIO(report)                 \
    STUDIO(coverage)               \
    HEAD(check)                    \
    HEAD(list)                     \
    STUDIO(init)                   \
    STUDIO(view)                   \
    STUDIO(soak)
#define APP_DECLARE(name) extern const struct app_command app_##name;
APP_COMMANDS(APP_DECLARE, APP_DECLARE)

/* Prints a line to standard error, with the program's name before it. Control characters become question marks. */
void app_say(const char *fmt, ...) __attribute__((format(printf, 1, 2)));
/* Prints an error as such a line, and returns the exit status for it. */
int app_fail(const struct sh_err *err);
/* The same for the first CONFIG_MAX_DIAGNOSTICS errors of a configuration; a last line counts the others. */
int app_fail_config(const struct config_diagnostics *diagnostics);

/* Loads the configuration that the first operand names, or in->links, with settings and scenario, and gives it to
 * `work`. `work` may change the configuration, which is freed afterwards. Returns the exit status. The reason of a
 * failure is printed, errors of a configuration as by app_fail_config. */
int app_with_config(const struct app_input *in, int (*work)(struct config *cfg, void *ctx, struct sh_err *err),
                    void *ctx);
/* Takes the results of two pieces of work: `rc` of the first, whose reason is in err, and `more` of the second, whose
 * reason is in `why`. Returns the first failure, with its text in err. If both failed, the second text is printed as a
 * warning, unless it is the same. */
int app_and_also(int rc, int more, const struct sh_err *why, struct sh_err *err);

/* Warns of a head.settings_file that is there and not empty, but has no effect on the work. why is the reason, a clause
 * such as "a soak has the settings of the configuration". */
void app_warn_settings_file(const struct config *cfg, const char *why);

/* To be called before any file is opened. Checks that the command writes no file twice, and none that it reads. Files
 * are those of the command line, those of cfg (NULL: there is none), with its links where the command opens them, and
 * what meshes name. app_with_config calls it; commands without a configuration call it themselves. */
int app_check_files(const struct app_input *in, const struct config *cfg, struct sh_err *err);
/* Returns whether `file` is STEM.ENDING and `name` is STEM-N.ENDING, where N is a number: the file of one scan of many.
 * n_ending: bytes of .ENDING; 0: no file of scans. */
int app_is_name_of_scan(const char *file, size_t n_ending, const char *name);

/* From here on a thread writes all lines of app_say to standard error. So no thread of a head waits for standard
 * error's reader, and the end of the run does not, either. Messages that find no room in 64 KiB are dropped, and their
 * number is printed. app_end_messages, which main calls last, waits at most 2 s for a reader that has stopped. */
int app_begin_messages(struct sh_err *err);
void app_end_messages(void);

/* Prints warnings and progress to standard error, each line with the program's name before it. Asks the work to stop
 * after SIGINT, SIGTERM or SIGHUP (app_interrupted). */
extern const struct sh_report app_report_stderr;

/* The same, but a line of progress a second at most: for work that reports every piece. */
extern const struct sh_report app_report_seconds;

/* Warnings alone. */
extern const struct sh_report app_report_quiet;

/* 1: app_report_stderr and app_report_seconds print no progress either. app_parse calls it, for --quiet. */
void app_set_quiet(int quiet);

/* From now on warnings begin with the text `what`, the name of a part of the work. The text is not copied. A warning
 * that several parts give is printed once, while no more than 256 texts have come. NULL, as at first: warnings have no
 * name, and each is printed. */
void app_warn_of(const char *what);

/* 1 after SIGINT, SIGTERM or SIGHUP, once app_catch_signals was called: the command ends in good order. A second SIGINT
 * or SIGTERM within a second counts as the same one. A third, or one that comes later, ends the process at once. SIGHUP
 * never does. SIGHUP stays ignored where the command was started so (`nohup`). */
int app_interrupted(void);
void app_catch_signals(void);

/* Prints a warning for each kind of echoes that the head left out of the stream, and one for samples of waveforms. */
void app_warn_left_out(uint64_t crowded, uint64_t unfit, uint64_t lost_samples);

/* Whether a path has that ending, and something before it; case doesn't count. */
int app_ends_in(const char *path, const char *ending);

/* Whether a path has the ending of a recorded stream: .shs or .pcapng. */
int app_is_recording(const char *path);

/* Prints a warning where fewer than one pulse in twenty has an echo. */
void app_warn_empty(uint64_t pulses, uint64_t empty, uint64_t faint);

/* Returns why writing to a stream of a descriptor failed; NULL: it did not. Where an earlier write failed, its errno is
 * gone. So one more byte is written, which fails for the same reason. */
const char *app_write_failure(FILE *out);

/* Writes the file that a user names for output anew, by `put`; path "-" is standard output, which stays open. Returns
 * the first error in writing; its text begins with the path, or with "standard output". */
int app_write_file(const char *path, void (*put)(FILE *out, const void *ctx), const void *ctx, struct sh_err *err);
/* The same for one JSON value. */
int app_write_json(const char *path, void (*put)(struct json *json, const void *ctx), const void *ctx,
                   struct sh_err *err);

/* Makes a folder in TMPDIR, /tmp where that is not set. what: for its name. After an error `folder` is empty. */
int app_make_folder(const char *what, char *folder, size_t cap, struct sh_err *err);

/* --ready-fd: writes one JSON value, by `put`, as a line to descriptor fd, and closes fd; standard output and standard
 * error stay open. fd 0: the option was not given, and nothing is done. */
int app_say_ready(long fd, void (*put)(struct json *json, const void *ctx), const void *ctx, struct sh_err *err);

#endif
