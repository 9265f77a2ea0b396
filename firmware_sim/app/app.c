#include "firmware_sim/app/app.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/base/json.h"

volatile sig_atomic_t app_interrupted;

static void on_signal(int number)
{
    (void)number;
    app_interrupted = 1;
}

void app_catch_signals(void)
{
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = on_signal;
    action.sa_flags = (int)SA_RESETHAND; /* no SA_RESTART: waits end at once */
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    signal(SIGPIPE, SIG_IGN);
    signal(SIGXFSZ, SIG_IGN); /* a file at its limit is an error of write, not the end */
}

int app_fail(const struct sh_err *err)
{
    fprintf(stderr, "scanhead: %s\n", err->text);
    return err->code == SH_EINPUT ? APP_USAGE : APP_FAILED;
}

int app_usage(const char *command, const char *fmt, ...)
{
    char text[512];
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(text, sizeof text, fmt, ap);
    va_end(ap);
    fprintf(stderr, "scanhead %s: %s; see scanhead %s --help\n", command, text, command);
    return APP_USAGE;
}

int app_bad_option(const char *command, int opt, char **argv)
{
    const char *word = argv[optind - 1];
    if (opt == ':') return app_usage(command, "option %s needs a value", word);
    return app_usage(command, "unknown option %s", word);
}

int app_add_set(struct app_sets *sets, const char *set)
{
    if (sets->n == APP_MAX_SETS) {
        fprintf(stderr, "scanhead: too many settings; at most %d\n", APP_MAX_SETS);
        return APP_USAGE;
    }
    sets->set[sets->n++] = set;
    return APP_OK;
}

int app_add_key(struct app_sets *sets, const char *key, const char *value)
{
    if (sets->n_text == (int)(sizeof sets->text / sizeof sets->text[0])) {
        fprintf(stderr, "scanhead: option given too often: %s\n", key);
        return APP_USAGE;
    }
    char *text = sets->text[sets->n_text++];
    int n = snprintf(text, sizeof sets->text[0], "%s=%s", key, value);
    if (n < 0 || (size_t)n >= sizeof sets->text[0]) {
        fprintf(stderr, "scanhead: value of %s is too long\n", key);
        return APP_USAGE;
    }
    return app_add_set(sets, text);
}

int app_parse_double(const char *command, const char *option, const char *text, double min, double max, double *out)
{
    char *end;
    errno = 0;
    double value = strtod(text, &end);
    if (end == text || *end != '\0' || isspace((unsigned char)text[0]) || !isfinite(value) || value < min ||
        value > max)
        return app_usage(command, "%s %s: not a number from %g to %g", option, text, min, max);
    *out = value;
    return APP_OK;
}

int app_parse_long(const char *command, const char *option, const char *text, long min, long max, long *out)
{
    char *end;
    errno = 0;
    long value = strtol(text, &end, 10);
    if (end == text || *end != '\0' || isspace((unsigned char)text[0]) || errno != 0 || value < min || value > max)
        return app_usage(command, "%s %s: not a whole number from %ld to %ld", option, text, min, max);
    *out = value;
    return APP_OK;
}

static void print_warning(void *ctx, const char *text)
{
    (void)ctx;
    fprintf(stderr, "scanhead: warning: %s\n", text);
}

static void print_progress(void *ctx, const char *what, double fraction)
{
    (void)ctx;
    if (fraction < 0.0)
        fprintf(stderr, "scanhead: %s ...\n", what);
    else
        fprintf(stderr, "scanhead: %s: %.0f %%\n", what, 100.0 * fraction);
}

const struct sh_report app_report_stderr = {NULL, print_warning, print_progress};

struct config *app_load_config(const char *path, const struct app_sets *sets, int *status)
{
    struct sh_err err = {0};
    struct config *cfg = calloc(1, sizeof *cfg);
    if (cfg == NULL) {
        sh_fail(&err, SH_ENOMEM, "no memory");
        *status = app_fail(&err);
        return NULL;
    }
    if (config_load(path, sets->set, sets->n, cfg, &err) != SH_OK) {
        free(cfg);
        *status = app_fail(&err);
        return NULL;
    }
    return cfg;
}

static void put_stats(struct json *json, const struct app_stats *stats)
{
    const struct loop_stats *s = &stats->loop;
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    json_open_object(json, NULL);
    json_uint(json, "pulses", s->pulses);
    json_uint(json, "fired_pulses", s->fired_pulses);
    json_uint(json, "echoes", s->echoes);
    json_uint(json, "lines", s->lines);
    json_uint(json, "scans", s->scans);
    json_double(json, "wall_s", s->wall_s);
    json_double(json, "cpu_s", stats->cpu_s);
    json_double(json, "pulses_per_s", s->wall_s > 0.0 ? (double)s->pulses / s->wall_s : 0.0);
    json_uint(json, "lost_pulses", s->lost_pulses);
    json_uint(json, "lost_ticks", s->lost_ticks);
    json_uint(json, "crowded_echoes", s->crowded);
    json_uint(json, "faint_hits", s->faint);
    json_uint(json, "unfit_echoes", s->unfit);
    json_uint(json, "reader_lost_frames", s->reader_lost_frames);
    json_uint(json, "late_blocks", s->late_blocks);
    json_uint(json, "late_poses", s->late_poses);
    json_uint(json, "bad_poses", s->bad_poses);
    json_double(json, "late_p50_us", s->late_p50_us);
    json_double(json, "late_p999_us", s->late_p999_us);
    json_double(json, "late_max_us", s->late_max_us);
    json_int(json, "rss_peak_kib", usage.ru_maxrss);
    json_string(json, "stream_sha256", s->have_hash ? s->sha256 : NULL);
    json_close_object(json);
}

void app_warn_left_out(uint64_t crowded, uint64_t unfit)
{
    if (crowded != 0)
        fprintf(stderr, "scanhead: warning: %llu echoes left out, the weakest: the head tells max_echoes of a pulse\n",
                (unsigned long long)crowded);
    if (unfit != 0)
        fprintf(stderr, "scanhead: warning: %llu echoes left out, too far from the anchor for the stream's integers\n",
                (unsigned long long)unfit);
}

int app_write_stats(const char *path, const struct app_stats *stats, struct sh_err *err)
{
    FILE *out = strcmp(path, "-") == 0 ? stdout : fopen(path, "w");
    if (out == NULL) return sh_fail(err, SH_EIO, "%s: %s", path, strerror(errno));
    struct json json;
    json_begin(&json, out);
    put_stats(&json, stats);
    int rc = json_end(&json, err);
    if (out != stdout && fclose(out) != 0 && rc == SH_OK) rc = sh_fail(err, SH_EIO, "%s: %s", path, strerror(errno));
    return rc;
}
