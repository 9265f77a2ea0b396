/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/app.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/newfile.h"
#include "firmware_sim/app/progress.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/base/line_writer.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"

static atomic_int interrupted; /* lock-free, as a signal handler needs; other threads read it, too */

/* Signals that come together are one wish to end: `timeout` sends two, one to the process and one to its
 * group. A third signal ends the process at once, and so does a second one after more than a second. */
enum { SIGNALS_TOGETHER = 2 };
static const int64_t TOGETHER_NS = 1000000000;

static void on_signal(int number)
{
    static _Atomic int64_t first_ns;
    static atomic_int n;
    const int saved = errno;
    int64_t since_ns = 0;
    const int64_t now_ns = clock_now_ns();
    if (!atomic_compare_exchange_strong(&first_ns, &since_ns, now_ns) && now_ns - since_ns > TOGETHER_NS)
        atomic_store(&n, SIGNALS_TOGETHER);
    atomic_store(&interrupted, 1);
    if (atomic_fetch_add(&n, 1) >= SIGNALS_TOGETHER) {
        signal(number, SIG_DFL);
        raise(number); /* comes when this function returns */
    }
    errno = saved;
}

/* A terminal that closes sends the signal up to three times, and nobody waits who would want an end at once. */
static void on_hangup(int number)
{
    (void)number;
    atomic_store(&interrupted, 1);
}

int app_interrupted(void)
{
    return atomic_load(&interrupted);
}

void app_catch_signals(void)
{
    struct sigaction action, was;
    memset(&action, 0, sizeof action);
    action.sa_handler = on_signal; /* no SA_RESTART: waits end at once */
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    action.sa_handler = on_hangup;
    if (sigaction(SIGHUP, NULL, &was) == 0 && was.sa_handler != SIG_IGN) /* `nohup` ignores it */
        sigaction(SIGHUP, &action, NULL);
    signal(SIGPIPE, SIG_IGN);
    signal(SIGXFSZ, SIG_IGN); /* write() fails at a limit of file size, and the program goes on */
}

int app_fail(const struct sh_err *err)
{
    app_say("%s", err->text);
    return err->code == SH_EINPUT ? APP_USAGE : APP_FAILED;
}

int app_fail_config(const struct config_diagnostics *diagnostics)
{
    int status = APP_USAGE;
    for (uint32_t i = 0; i < diagnostics->n && i < CONFIG_MAX_DIAGNOSTICS; i++)
        status = app_fail(&diagnostics->err[i]);
    if (diagnostics->n > CONFIG_MAX_DIAGNOSTICS)
        fprintf(stderr, "%s: and %u more\n", app_program, diagnostics->n - CONFIG_MAX_DIAGNOSTICS);
    return status;
}

int app_with_config(const struct app_input *in, int (*work)(struct config *cfg, void *ctx, struct sh_err *err),
                    void *ctx)
{
    struct sh_err err = {0};
    struct config_diagnostics diagnostics;
    struct config *cfg = calloc(1, sizeof *cfg);
    if (cfg == NULL) return app_fail(&(struct sh_err){SH_ENOMEM, "no memory"});
    int rc = in->links != NULL ? config_load_links(in->links, "--link", in->sets.set, in->sets.n, cfg, &diagnostics)
                               : config_load_all(in->operand[0], in->sets.set, in->sets.n, cfg, &diagnostics);
    if (rc != SH_OK || (in->scenario != NULL && config_add_scenario(cfg, in->scenario, &diagnostics) != SH_OK)) {
        free(cfg);
        return app_fail_config(&diagnostics);
    }
    rc = app_check_files(in, cfg, &err);
    if (rc == SH_OK) rc = work(cfg, ctx, &err);
    free(cfg);
    return rc == SH_OK ? APP_OK : app_fail(&err);
}

void app_warn_settings_file(const struct config *cfg, const char *why)
{
    struct stat st;
    const char *path = cfg->head.settings_file;
    if (path[0] != '\0' && stat(path, &st) == 0 && st.st_size > 0)
        sh_warn(&app_report_stderr, "head.settings_file %s: is not used: %s", path, why);
}

static pthread_mutex_t messages_lock = PTHREAD_MUTEX_INITIALIZER;
static const char *warned_of; /* the part of the work that warnings name; NULL: it has no parts */

void app_warn_of(const char *what)
{
    warned_of = what;
}

/* Whether no warning had this text before. Up to MOST texts are kept, so that the memory of endless work stays bounded.
 * Any other text counts as new each time. Threads of a head warn, too. */
static int is_new(const char *text)
{
    enum { MOST = 256 };
    static char *known[MOST];
    static int n;
    int i = 0;
    pthread_mutex_lock(&messages_lock);
    while (i < n && strcmp(known[i], text) != 0)
        i++;
    const int is_known = i < n;
    if (!is_known && n < MOST && (known[n] = strdup(text)) != NULL) n++;
    pthread_mutex_unlock(&messages_lock);
    return !is_known;
}

static struct line_writer *messages; /* NULL: messages are printed at once */

static void say_gap(char text[LINE_GAP_BYTES], const uint64_t lost[LINE_KINDS])
{
    snprintf(text, LINE_GAP_BYTES, "%s: %llu messages were dropped here: standard error was not read in time\n",
             app_program, (unsigned long long)lost[LINE_PLAIN]);
}

int app_begin_messages(struct sh_err *err)
{
    const int fd = dup(STDERR_FILENO);
    if (fd < 0) return SH_OK; /* there is no standard error, and nothing to wait for */
    const struct line_writer_spec spec = {
        .fd = fd, .what = "messages", .path = "standard error", .room = 65536, .gap = say_gap};
    return line_writer_open(&spec, &messages, err);
}

void app_end_messages(void)
{
    pthread_mutex_lock(&messages_lock);
    struct line_writer *writer = messages;
    messages = NULL;
    pthread_mutex_unlock(&messages_lock);
    line_writer_close(writer, NULL, NULL); /* there is nobody to tell */
}

void app_say(const char *fmt, ...)
{
    char text[LINE_MOST_BYTES];
    const int begin = snprintf(text, sizeof text, "%s: ", app_program);
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(text + begin, sizeof text - (size_t)begin - 1, fmt, ap); /* the line's end has room, too */
    va_end(ap);
    sh_keep_line(text); /* a path may have any bytes, and so may texts of files */
    strcat(text, "\n");
    pthread_mutex_lock(&messages_lock);
    const int is_put = messages != NULL;
    if (is_put) line_writer_put(messages, LINE_PLAIN, text, strlen(text));
    pthread_mutex_unlock(&messages_lock);
    if (!is_put) fputs(text, stderr);
}

static void print_warning(void *ctx, const char *text)
{
    (void)ctx;
    if (warned_of == NULL)
        app_say("warning: %s", text);
    else if (is_new(text))
        app_say("warning: %s: %s", warned_of, text);
}

static int is_quiet;

void app_set_quiet(int quiet)
{
    is_quiet = quiet;
}

static void print_progress(void *ctx, const char *what, double fraction)
{
    static struct progress_pace pace;
    if (is_quiet) return;
    const double left_s = progress_left_s(&pace, what, fraction, clock_now_ns());
    char left[48] = "";
    (void)ctx;
    if (left_s >= 0.0 && left_s < 120.0) snprintf(left, sizeof left, ", %.0f s left", ceil(left_s));
    if (left_s >= 120.0) snprintf(left, sizeof left, ", %.0f min left", ceil(left_s / 60.0));
    if (fraction < 0.0)
        app_say("%s ...", what);
    else
        app_say("%s: %.0f %%%s", what, 100.0 * fraction, left);
}

static void print_each_second(void *ctx, const char *what, double fraction)
{
    static int64_t printed_ns;
    const int64_t now_ns = clock_now_ns();
    if (printed_ns == 0) printed_ns = now_ns; /* a short command prints none */
    if (now_ns - printed_ns < 1000000000) return;
    printed_ns = now_ns;
    print_progress(ctx, what, fraction);
}

static int asked_to_stop(void *ctx)
{
    (void)ctx;
    return app_interrupted();
}

const struct sh_report app_report_stderr = {NULL, print_warning, print_progress, asked_to_stop, NULL};
const struct sh_report app_report_seconds = {NULL, print_warning, print_each_second, asked_to_stop, NULL};
const struct sh_report app_report_quiet = {NULL, print_warning, NULL, asked_to_stop, NULL};

void app_warn_left_out(uint64_t crowded, uint64_t unfit, uint64_t lost_samples)
{
    if (crowded != 0)
        sh_warn(&app_report_stderr,
                "%llu echoes left out, the weakest ones: their pulses had more echoes than the head's max_echoes",
                (unsigned long long)crowded);
    if (unfit != 0)
        sh_warn(&app_report_stderr, "%llu echoes left out, too far from the anchor for the stream's integers",
                (unsigned long long)unfit);
    if (lost_samples != 0)
        sh_warn(&app_report_stderr, "%llu samples of waveforms left out: their pulses had more than there is room for",
                (unsigned long long)lost_samples);
}

int app_and_also(int rc, int more, const struct sh_err *why, struct sh_err *err)
{
    if (rc == SH_OK && more != SH_OK) return sh_fail(err, more, "%s", why->text);
    if (more != SH_OK && strcmp(why->text, err->text) != 0) sh_warn(&app_report_stderr, "%s", why->text);
    return rc;
}

int app_ends_in(const char *path, const char *ending)
{
    const size_t n = strlen(path), m = strlen(ending);
    return n > m && strcasecmp(path + n - m, ending) == 0;
}

int app_is_recording(const char *path)
{
    return app_ends_in(path, ".shs") || app_ends_in(path, ".pcapng");
}

void app_warn_empty(uint64_t pulses, uint64_t empty, uint64_t faint)
{
    if (empty > pulses) return; /* a stream may be damaged */
    const uint64_t with_echo = pulses - empty;
    if (with_echo >= pulses / 20) return;
    sh_warn(&app_report_stderr, "mostly empty: %llu of %llu pulses have an echo, %.2g %%; %llu hits were not detected",
            (unsigned long long)with_echo, (unsigned long long)pulses, 100.0 * (double)with_echo / (double)pulses,
            (unsigned long long)faint);
}

static int open_new(const char *path, FILE **out, struct sh_err *err)
{
    const int to_stdout = strcmp(path, "-") == 0;
    int fd = -1, rc = to_stdout ? SH_OK : newfile_open(path, &fd, err);
    if (rc != SH_OK) return rc;
    *out = to_stdout ? stdout : fdopen(fd, "w");
    if (*out != NULL) return SH_OK;
    rc = sh_fail(err, SH_EIO, "%s: %s", path, strerror(errno));
    close(fd);
    return rc;
}

static const char *name_of(const char *path)
{
    return strcmp(path, "-") == 0 ? "standard output" : path;
}

const char *app_write_failure(FILE *out)
{
    errno = 0;
    if (fflush(out) == 0 && !ferror(out)) return NULL;
    if (errno == 0 && write(fileno(out), "\n", 1) == 1) errno = 0;
    return errno != 0 ? strerror(errno) : "writing failed";
}

static int close_new(const char *path, FILE *out, struct sh_err *err)
{
    const char *why = app_write_failure(out);
    if (out != stdout && fclose(out) != 0 && why == NULL) why = strerror(errno);
    return why == NULL ? SH_OK : sh_fail(err, SH_EIO, "%s: %s", name_of(path), why);
}

int app_write_file(const char *path, void (*put)(FILE *out, const void *ctx), const void *ctx, struct sh_err *err)
{
    FILE *out;
    const int rc = open_new(path, &out, err);
    if (rc != SH_OK) return rc;
    put(out, ctx);
    return close_new(path, out, err);
}

int app_write_json(const char *path, void (*put)(struct json *json, const void *ctx), const void *ctx,
                   struct sh_err *err)
{
    struct sh_err why = {0};
    struct json json;
    FILE *out;
    int rc = open_new(path, &out, err);
    if (rc != SH_OK) return rc;
    json_begin(&json, out);
    put(&json, ctx);
    const int ended = json_end(&json, &why);
    rc = close_new(path, out, err); /* the reason, where writing has failed */
    return rc == SH_OK && ended != SH_OK ? sh_fail(err, ended, "%s: %s", name_of(path), why.text) : rc;
}

int app_make_folder(const char *what, char *folder, size_t cap, struct sh_err *err)
{
    const char *temporary = getenv("TMPDIR");
    if (temporary == NULL || temporary[0] == '\0') temporary = "/tmp";
    const size_t n = (size_t)snprintf(folder, cap, "%s/scanhead-%s-XXXXXX", temporary, what);
    if (n < cap && mkdtemp(folder) != NULL) return SH_OK;
    const int rc = n < cap ? sh_fail(err, SH_EIO, "%s: %s", folder, strerror(errno))
                           : sh_fail(err, SH_EIO, "TMPDIR has %zu bytes; allowed are up to %zu: %.100s...",
                                     strlen(temporary), cap - 1 - (n - strlen(temporary)), temporary);
    folder[0] = '\0';
    return rc;
}

int app_say_ready(long fd, void (*put)(struct json *json, const void *ctx), const void *ctx, struct sh_err *err)
{
    if (fd == 0) return SH_OK;
    /* Standard streams stay open: else the next file or session would get their numbers and the messages. */
    FILE *out = fd > STDERR_FILENO ? fdopen((int)fd, "w") : newfile_stream((int)fd, "w");
    if (out == NULL) {
        const int is_theirs = errno == EBADF || errno == EINVAL; /* not open, or not for writing */
        return sh_fail(err, is_theirs ? SH_EINPUT : SH_EIO, "--ready-fd %ld: %s", fd, strerror(errno));
    }
    struct json json;
    json_begin_one_line(&json, out);
    put(&json, ctx);
    struct sh_err wrong = {0};
    const int ended = json_end(&json, &wrong);
    const char *why = app_write_failure(out);
    if (fclose(out) != 0 && why == NULL) why = strerror(errno);
    if (why == NULL && ended == SH_OK) return SH_OK;
    return sh_fail(err, SH_EIO, "--ready-fd %ld: %s", fd, why != NULL ? why : wrong.text);
}
