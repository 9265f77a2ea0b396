/* SPDX-License-Identifier: MIT */
/* Checks the files of all shards of a campaign, and writes manifest.json (batch.h). */
#include <dirent.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "core/newfile.h"
#include "firmware_sim/app/studio/batch/batch.h"

enum { MOST_LINES = 20 };

/* Prints why a job is incomplete. */
static void print_incomplete(uint32_t *n_gaps, uint32_t job, const char *name, const char *why)
{
    if ((*n_gaps)++ < MOST_LINES) fprintf(stderr, "scanhead: job %u, %s: %s\n", job + 1, name, why);
}

static int check_job(struct batch *b, uint32_t job, uint32_t *n_gaps, struct sh_err *err)
{
    char name[BATCH_NAME_LEN];
    struct sh_err why = {0};
    batch_job_name(b, job, name);
    if (!b->job[job].is_done) {
        print_incomplete(n_gaps, job, name, b->job[job].other != NULL ? b->job[job].other : "missing");
        return SH_OK;
    }
    const int rc = batch_check_files(b, job, &why);
    if (rc == SH_ESTOPPED) return sh_fail_stopped(err);
    if (rc != SH_OK) print_incomplete(n_gaps, job, name, why.text);
    return SH_OK;
}

/* Files of one campaign come from one kind of machine. */
static int check_engines(const struct batch *b, struct sh_err *err)
{
    const struct batch_job *first = NULL;
    for (uint32_t i = 0; i < b->n_jobs; i++) {
        const struct batch_job *job = &b->job[i];
        if (!job->is_done) continue;
        if (first == NULL) first = job;
        if (strcmp(first->entry.made.engine, job->entry.made.engine) != 0)
            return sh_fail(
                err, SH_ESTATE,
                "%s: job %u was made by %s, job %u by %s; allowed is one kind of processor, since rays may hit other "
                "triangles on another kind",
                b->dir, first->entry.job, first->entry.made.engine, job->entry.job, job->entry.made.engine);
    }
    return SH_OK;
}

static int check_jobs(struct batch *b, uint32_t *n_gaps, struct sh_err *err)
{
    for (uint32_t i = 0; i < b->n_jobs; i++) {
        int rc = check_job(b, i, n_gaps, err);
        if (rc != SH_OK) return rc;
        if (!b->quiet) sh_progress(&app_report_seconds, "checking files", (double)i / b->n_jobs);
    }
    return SH_OK;
}

/* ---- files that have a job's number and belong to no job, such as old files of jobs that --force repeated */

static int is_of_job(const struct batch *b, const char *name)
{
    char *end;
    const unsigned long job = strtoul(name, &end, 10);
    if (name[0] < '0' || name[0] > '9' || end - name < 4 || *end != '_')
        return 1; /* its name is not that of a job's file */
    if (job == 0 || job > b->n_jobs) return 0;
    const struct batch_entry *entry = &b->job[job - 1].entry;
    for (uint32_t i = 0; i < entry->n_files; i++)
        if (strcmp(entry->file[i].name, name) == 0) return 1;
    return 0;
}

static void warn_of_strangers(const struct batch *b)
{
    char first[NAME_MAX + 1] = "";
    unsigned n = 0;
    DIR *dir = opendir(b->dir);
    for (struct dirent *file; dir != NULL && (file = readdir(dir)) != NULL;) {
        if (is_of_job(b, file->d_name)) continue;
        if (n++ == 0 || strcmp(file->d_name, first) < 0) snprintf(first, sizeof first, "%s", file->d_name);
    }
    if (dir != NULL) closedir(dir);
    if (n != 0)
        sh_warn(&app_report_stderr, "%s: %u files belong to no job of this campaign, the first: %s", b->dir, n, first);
}

/* ---- manifest.json: nothing in it depends on the shards, or on the time */

static void put_job(struct json *json, const struct batch *b, uint32_t i)
{
    const struct batch_entry *entry = &b->job[i].entry;
    json_open_object(json, NULL);
    batch_put_job(json, b, i);
    json_string(json, "inputs_sha256", entry->made.inputs);
    json_string(json, "job_sha256", entry->made.job);
    json_uint(json, "pulses", entry->pulses);
    json_uint(json, "points", entry->points);
    json_string(json, "stream_sha256", entry->stream_sha);
    batch_put_files(json, entry);
    json_close_object(json);
}

static void put_all(struct json *json, const struct batch *b)
{
    const struct batch_provenance *made = &b->job[0].entry.made;
    json_open_object(json, NULL);
    json_string(json, "program", made->program);
    json_string(json, "engine", made->engine);
    json_string(json, "configuration", basename(b->in.operand[0]));
    json_string(json, "configuration_sha256", made->configuration);
    json_open_array(json, "set");
    for (int i = 0; i < b->in.sets.n; i++)
        if (!batch_is_of_speed(b->in.sets.set[i])) json_string(json, NULL, b->in.sets.set[i]);
    json_close_array(json);
    json_open_array(json, "options");
    for (int i = 0; i < b->options.n; i++)
        json_string(json, NULL, b->options.word[i]);
    json_close_array(json);
    json_open_array(json, "jobs");
    for (uint32_t i = 0; i < b->n_jobs; i++)
        put_job(json, b, i);
    json_close_array(json);
    json_close_object(json);
}

static int put_whole(const void *batch, FILE *out, struct sh_err *err)
{
    struct json json;
    json_begin(&json, out);
    put_all(&json, batch);
    return json_end(&json, err);
}

static int write_whole(const struct batch *b, struct sh_err *err)
{
    char path[PATH_MAX];
    snprintf(path, sizeof path, "%s/manifest.json", b->dir);
    return newfile_write(path, put_whole, b, err);
}

static int check_folder(const struct batch *b, struct sh_err *err)
{
    struct stat st;
    if (stat(b->dir, &st) == 0 && S_ISDIR(st.st_mode)) return SH_OK;
    return sh_fail(err, SH_EINPUT, "-o %s: no such folder; allowed is the folder of a campaign", b->dir);
}

int batch_merge(struct batch *b)
{
    uint32_t n_gaps = 0;
    struct sh_err err = {0};
    int rc = check_folder(b, &err);
    if (rc == SH_OK) rc = batch_find_done(b, 1, &err);
    if (rc == SH_OK) rc = check_engines(b, &err);
    if (rc == SH_OK) rc = check_jobs(b, &n_gaps, &err);
    if (rc == SH_OK && n_gaps > MOST_LINES) fprintf(stderr, "scanhead: and %u more\n", n_gaps - MOST_LINES);
    if (rc == SH_OK && n_gaps != 0)
        rc = sh_fail(&err, SH_EIO, "%s: %u of %u jobs are incomplete; run their shards again", b->dir, n_gaps,
                     b->n_jobs);
    if (rc == SH_OK) warn_of_strangers(b);
    if (rc == SH_OK) rc = write_whole(b, &err);
    if (rc != SH_OK) return app_fail(&err);
    if (!b->quiet) fprintf(stderr, "scanhead: %u jobs are complete: %s/manifest.json\n", b->n_jobs, b->dir);
    return APP_OK;
}
