/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/batch/batch.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/bvh.h"
#include "core/grow.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/site/site.h"

/* ---- a job as a line of `record` */

static void plan_add(struct batch_line *line, const char *fmt, ...) __attribute__((format(printf, 2, 3)));
static void plan_add(struct batch_line *line, const char *fmt, ...)
{
    va_list args;
    va_start(args, fmt);
    if (vasprintf(&line->word[line->n], fmt, args) < 0) line->word[line->n] = NULL;
    line->n += line->word[line->n] != NULL;
    va_end(args);
}

int batch_line_make(const struct batch *b, uint32_t combination, uint32_t station, const char *name,
                    struct batch_line **out)
{
    const char *set[BATCH_MAX_SWEEPS];
    struct batch_line *line = *out = calloc(1, sizeof *line);
    if (line == NULL) return app_fail(&(struct sh_err){SH_ENOMEM, "no memory"});
    plan_add(line, "record");
    plan_add(line, "%s", b->in.operand[0]);
    plan_add(line, "--station=%u", station);
    for (int i = 0; i < b->n_endings; i++)
        plan_add(line, "--output=%s%s%s.%s", b->dir != NULL ? b->dir : "", b->dir != NULL ? "/" : "", name,
                 b->ending[i]);
    if (b->surfaces)
        plan_add(line, "--surfaces=%s%s%s.surfaces.csv", b->dir != NULL ? b->dir : "", b->dir != NULL ? "/" : "", name);
    for (int i = 0; i < b->in.sets.n; i++)
        plan_add(line, "--set=%s", b->in.sets.set[i]);
    batch_sweeps_at(&b->sweeps, combination, set);
    for (uint32_t i = 0; i < b->sweeps.n; i++)
        plan_add(line, "--set=%s", set[i]);
    for (int i = 0; i < b->options.n; i++)
        plan_add(line, "%s", b->options.word[i]);
    if (b->in.scenario != NULL) plan_add(line, "--scenario=%s", b->in.scenario);
    if (b->threads != NULL) plan_add(line, "--threads=%s", b->threads);
    const int status = record_line_read(&line->line, line->n, line->word);
    line->line.job.only_whole = line->line.job.hash = line->line.job.brief = 1;
    line->line.job.recording.progress = !b->quiet;
    return status;
}

void batch_line_free(struct batch_line *line)
{
    if (line == NULL) return;
    for (int i = 0; i < line->n; i++)
        free(line->word[i]);
    free(line);
}

/* ---- what a job is */

void batch_job_name(const struct batch *b, uint32_t job, char name[BATCH_NAME_LEN])
{
    const char *set[BATCH_MAX_SWEEPS];
    batch_sweeps_at(&b->sweeps, b->job[job].combination, set);
    batch_name(job + 1, b->digits, b->job[job].station, set, b->sweeps.n, name);
}

int batch_is_of_speed(const char *set)
{
    static const char *const keys[] = {
        "loop.threads=", "loop.ahead_ms=", "loop.queue_ms=", "loop.late_ms=", "loop.pace="};
    for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++)
        if (strncmp(set, keys[i], strlen(keys[i])) == 0) return 1;
    return 0;
}

void batch_job_provenance(const struct batch *b, uint32_t job, struct batch_provenance *made)
{
    const char *set[BATCH_MAX_SWEEPS],
        *text[APP_MAX_SETS + BATCH_MAX_SWEEPS + 2 * APP_MAX_OPTIONS + RECORD_MAX_FILES + 3];
    char name[BATCH_NAME_LEN], station[16];
    uint32_t n = 0;
    batch_job_name(b, job, name);
    snprintf(station, sizeof station, "%u", b->job[job].station);
    text[n++] = name;
    text[n++] = station;
    for (int i = 0; i < b->in.sets.n; i++)
        if (!batch_is_of_speed(b->in.sets.set[i])) text[n++] = b->in.sets.set[i];
    batch_sweeps_at(&b->sweeps, b->job[job].combination, set);
    for (uint32_t i = 0; i < b->sweeps.n; i++)
        if (!batch_is_of_speed(set[i])) text[n++] = set[i];
    for (int i = 0; i < b->options.n; i++)
        text[n++] = b->options.word[i];
    for (int i = 0; i < b->n_endings; i++)
        text[n++] = b->ending[i];
    if (b->surfaces) text[n++] = "surfaces.csv";
    *made = b->made[b->job[job].combination];
    batch_provenance_job(made, text, n);
}

/* ---- all combinations */

/* Names the values of the combination after an error, whose text may not name them. */
static void print_values(const struct batch *b, uint32_t combination)
{
    const char *set[BATCH_MAX_SWEEPS];
    batch_sweeps_at(&b->sweeps, combination, set);
    for (uint32_t i = 0; i < b->sweeps.n; i++)
        fprintf(stderr, "%s%s", i == 0 ? "scanhead: no job was begun; the values are " : ", ", set[i]);
    if (b->sweeps.n > 0) fputc('\n', stderr);
}

static int check_epoch(const struct config *cfg, struct sh_err *err)
{
    if (strcmp(cfg->time.epoch, "utc") != 0 && strcmp(cfg->time.epoch, "tai") != 0) return SH_OK;
    return sh_fail(
        err, SH_EINPUT,
        "%s: time.epoch: %s is the clock of the machine, but a campaign's files must not depend on when they are "
        "made; allowed none, or a date such as 2026-01-01T00:00:00Z",
        cfg->file, cfg->time.epoch);
}

/* Whether each combination has as many jobs as the first one. Values of these keys may change the number of stations
 * or stops. */
static int jobs_are_even(const struct batch *b)
{
    for (uint32_t i = 0; i < b->sweeps.n && b->stations.all; i++)
        if (strncmp(b->sweeps.sweep[i].key, "stations", 8) == 0 || strncmp(b->sweeps.sweep[i].key, "platform", 8) == 0)
            return 0;
    return 1;
}

static int add_jobs(struct batch *b, uint32_t combination, uint32_t n_stations, struct sh_err *err)
{
    const struct batch_stations *s = &b->stations;
    const uint32_t n = s->all ? n_stations : s->n, last = s->all ? n : s->number[s->n - 1];
    if (last > n_stations)
        return sh_fail(err, SH_EINPUT, "--stations %s: there is no station %u; allowed 1 to %u", b->stations_text, last,
                       n_stations);
    if (b->n_jobs + (uint64_t)n > BATCH_MAX_JOBS) return sh_fail(err, SH_EINPUT, "more than %d jobs", BATCH_MAX_JOBS);
    if (!grow(&b->job, &b->job_room, b->n_jobs + n, sizeof *b->job))
        return sh_fail(err, SH_ENOMEM, "no memory for %u jobs", b->n_jobs + n);
    for (uint32_t i = 0; i < n; i++)
        b->job[b->n_jobs++] = (struct batch_job){.combination = combination, .station = s->all ? i + 1 : s->number[i]};
    return SH_OK;
}

static int is_chosen(const struct batch *b, uint32_t station)
{
    for (uint32_t i = 0; i < b->stations.n; i++)
        if (b->stations.number[i] == station) return 1;
    return b->stations.all;
}

/* Checks the other scanners that chosen stations have, since those record there. */
static int check_other_heads(const struct batch *b, struct record_job *job, const struct config *cfg,
                             struct sh_err *err)
{
    struct config *own = calloc(1, sizeof *own);
    int rc = own != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for a scanner");
    for (uint32_t i = 0; i < cfg->n_stations && rc == SH_OK; i++) {
        if (config_serves(cfg, i) || !is_chosen(b, i + 1)) continue;
        rc = config_load_scanner(cfg, i + 1, own, err);
        if (rc == SH_OK) rc = record_job_check(job, own, err);
    }
    free(own);
    return rc;
}

struct planned {
    struct batch *b;
    struct record_job *job;
    uint32_t combination;
};

static int plan_config(struct config *cfg, void *ctx, struct sh_err *err)
{
    const struct planned *p = ctx;
    struct batch *b = p->b;
    struct batch_provenance *made = &b->made[p->combination];
    uint32_t n_stations = 0;
    if (p->combination == 0) app_warn_settings_file(cfg, "jobs of a batch have the settings of the configuration");
    int rc = record_job_check(p->job, cfg, err);
    if (rc == SH_OK && !config_is_alone(cfg)) rc = check_other_heads(b, p->job, cfg, err);
    if (rc == SH_OK) rc = check_epoch(cfg, err);
    if (rc == SH_OK) rc = site_count_stations(cfg, &app_report_stderr, &n_stations, err);
    if (rc == SH_OK) rc = batch_provenance_of(cfg, &b->cache, made, &app_report_stderr, err);
    if (rc != SH_OK) return rc;
    snprintf(made->program, sizeof made->program, "%s", scanhead_version());
    snprintf(made->engine, sizeof made->engine, "%s", b->engine);
    return add_jobs(b, p->combination, n_stations, err);
}

static int plan_combination(struct batch *b, uint32_t combination)
{
    struct batch_line *line;
    int status = batch_line_make(b, combination, 1, "x", &line);
    if (status == APP_GO_ON) {
        struct planned planned = {b, &line->line.job, combination};
        line->line.in.n_files = 0; /* no job has this name; run_job makes the lines with the real ones */
        status = app_with_config(&line->line.in, plan_config, &planned);
        if (status != APP_OK) print_values(b, combination);
    }
    batch_line_free(line);
    return status;
}

/* Refuses too many jobs after the first combination. It is about all combinations, so no values belong to it. */
static int check_total(const struct batch *b, struct sh_err *err)
{
    const uint64_t total = b->n_combinations * (uint64_t)b->n_jobs;
    if (!jobs_are_even(b) || total <= BATCH_MAX_JOBS) return SH_OK;
    return sh_fail(err, SH_EINPUT,
                   "%u combinations of --sweep at %u stations are %" PRIu64 " jobs; allowed are %d: "
                   "give fewer values, or some of the --stations",
                   b->n_combinations, b->n_jobs, total, BATCH_MAX_JOBS);
}

int batch_plan(struct batch *b)
{
    struct sh_err err = {0};
    if (batch_sweeps_count(&b->sweeps, &b->n_combinations, &err) != SH_OK) return app_fail(&err);
    b->made = calloc(b->n_combinations, sizeof *b->made);
    if (b->made == NULL) return app_fail(&(struct sh_err){SH_ENOMEM, "no memory for the combinations"});
    if (bvh_engine(b->engine, sizeof b->engine, &err) != SH_OK) return app_fail(&err);
    for (uint32_t i = 0; i < b->n_combinations; i++) {
        const int status = plan_combination(b, i);
        if (status != APP_OK) return status;
        if (i == 0 && check_total(b, &err) != SH_OK) return app_fail(&err);
        if (sh_check_stop(&app_report_stderr, &err) != SH_OK) return app_fail(&err);
        if (!b->quiet) sh_progress(&app_report_seconds, "checking the configurations", (double)i / b->n_combinations);
    }
    b->digits = 4;
    for (uint32_t n = b->n_jobs; n >= 10000; n /= 10)
        b->digits++;
    return APP_OK;
}

void batch_free(struct batch *b)
{
    for (uint32_t i = 0; i < b->n_jobs; i++)
        batch_entry_free(&b->job[i].entry);
    free(b->job);
    free(b->made);
    free(b->endings);
    batch_cache_free(&b->cache);
    batch_sweeps_free(&b->sweeps);
}
