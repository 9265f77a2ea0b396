/* SPDX-License-Identifier: MIT */
/* The jobs of one shard (batch.h). */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/grow.h"
#include "firmware_sim/app/sidecars.h"
#include "firmware_sim/app/studio/batch/load.h"
#include "firmware_sim/base/clock.h"

struct runner {
    struct batch *b;
    int manifest;
    struct batch_loaded loaded; /* what the jobs at hand share */
    /* progress */
    uint32_t n_mine, n_todo, n_did, n_failed;
    int64_t start_ns, said_ns;
};

/* ---- a job */

struct listing {
    const struct batch *b;
    struct batch_entry *entry;
    char name[BATCH_NAME_LEN + 1]; /* of the job, and a dot */
    struct sh_err *err;
};

static int add_file(struct listing *l, const char *path)
{
    const char *name = path + strlen(l->b->dir) + 1;
    struct batch_entry *entry = l->entry;
    for (uint32_t i = 0; i < entry->n_files; i++)
        if (strcmp(entry->file[i].name, name) == 0) return SH_OK;
    if (!resize(&entry->file, entry->n_files + (size_t)1, sizeof *entry->file))
        return sh_fail(l->err, SH_ENOMEM, "no memory for a job's files");
    struct batch_file *file = &entry->file[entry->n_files++];
    snprintf(file->name, sizeof file->name, "%s", name);
    return batch_sha_file(path, file->sha, &file->bytes, NULL, l->err);
}

/* Lists a file that a mesh names (material, buffer, image), if its name begins with that of the job. Other files were
 * not written with the mesh. */
static int add_sidecar(void *ctx, const char *name, const char *path)
{
    struct listing *l = ctx;
    return strncmp(name, l->name, strlen(l->name)) == 0 && strchr(name, '/') == NULL ? add_file(l, path) : SH_OK;
}

static int list_files(const struct batch *b, uint32_t job, const struct record_job *done, struct batch_entry *entry,
                      struct sh_err *err)
{
    const struct record_files *files = &done->files;
    struct listing l = {.b = b, .entry = entry, .err = err};
    int rc = SH_OK;
    batch_job_name(b, job, l.name);
    strcat(l.name, ".");
    for (int i = 0; i < files->n && rc == SH_OK; i++) {
        const char *path = files->file[i].path;
        rc = add_file(&l, path);
        if (rc == SH_OK && files->file[i].ops->is_mesh) rc = app_sidecars(path, add_sidecar, &l, err);
    }
    if (rc == SH_OK && done->surfaces != NULL) rc = add_file(&l, done->surfaces);
    return rc;
}

/* Adds the job's line to the manifest last, so that all files that the manifest names are complete. */
static int note_done(struct runner *r, uint32_t job, const struct record_job *done, int64_t start_ns,
                     struct sh_err *err)
{
    const struct recording_result *result = &done->result;
    struct batch_entry entry = {.job = job + 1, .pulses = result->counts.pulses, .points = result->points};
    entry.seconds = 1e-3 * round(1e-6 * (double)(clock_now_ns() - start_ns));
    snprintf(entry.stream_sha, sizeof entry.stream_sha, "%s", result->sha256);
    batch_job_provenance(r->b, job, &entry.made);
    int rc = list_files(r->b, job, done, &entry, err);
    if (rc == SH_OK) rc = batch_manifest_add(r->manifest, &entry, err);
    batch_entry_free(&entry);
    return rc;
}

/* Prints at most a line a second, and one for the first job. */
static void say_progress(struct runner *r, uint32_t job, const char *name)
{
    const int64_t now_ns = clock_now_ns();
    const double done_s = 1e-9 * (double)(now_ns - r->start_ns);
    char left[48] = "";
    if (r->b->quiet || (r->said_ns != 0 && now_ns - r->said_ns < 1000000000)) return;
    r->said_ns = now_ns;
    if (r->n_did > 0) {
        const double left_s = done_s / r->n_did * (r->n_todo - r->n_did);
        snprintf(left, sizeof left, left_s < 120.0 ? ", %.0f s left" : ", %.0f min left",
                 ceil(left_s < 120.0 ? left_s : left_s / 60.0));
    }
    fprintf(stderr, "scanhead: job %u of %u, %s: %u of %u here done%s\n", job + 1, r->b->n_jobs, name,
            r->n_mine - r->n_todo + r->n_did, r->n_mine, left);
}

/* Returns 0 when the job is done, else the exit status with the reason printed. */
static int run_job(struct runner *r, uint32_t job)
{
    const struct batch_job *what = &r->b->job[job];
    struct sh_err err = {0};
    struct batch_line *line;
    char name[BATCH_NAME_LEN];
    batch_job_name(r->b, job, name);
    int status = batch_line_make(r->b, what->combination, what->station, name, &line);
    const int64_t start_ns = clock_now_ns();
    app_warn_of(name);
    if (status == APP_GO_ON) say_progress(r, job, name);
    if (status == APP_GO_ON) status = batch_load(r->b, what->combination, &r->loaded);
    if (status == APP_GO_ON) {
        line->line.job.site = r->loaded.site;
        int rc = record_job_off_line(&line->line.job, r->loaded.cfg, &err);
        if (rc == SH_OK) rc = note_done(r, job, &line->line.job, start_ns, &err);
        status = rc == SH_OK ? APP_OK : app_interrupted() ? APP_FAILED : app_fail(&err);
    }
    if (status != APP_OK && !app_interrupted()) fprintf(stderr, "scanhead: job %u failed: %s\n", job + 1, name);
    app_warn_of(NULL);
    batch_line_free(line);
    return status;
}

/* ---- the shard */

static int make_folder(const struct batch *b, struct sh_err *err)
{
    struct stat st;
    if (mkdir(b->dir, 0777) == 0 || (errno == EEXIST && stat(b->dir, &st) == 0 && S_ISDIR(st.st_mode))) return SH_OK;
    return sh_fail(err, errno == EACCES || errno == EPERM || errno == EROFS ? SH_EPERM : SH_EINPUT,
                   "-o %s: the folder cannot be made: %s", b->dir, strerror(errno == EEXIST ? ENOTDIR : errno));
}

/* Inputs of the campaign may lie in its folder. Fails where one of them has the name of a job's file. */
static int check_inputs(const struct batch *b, struct sh_err *err)
{
    struct stat folder, here;
    for (size_t i = 0; i < b->cache.n; i++) {
        const char *path = b->cache.known[i].path, *file = basename(path);
        char dir[PATH_MAX] = ".", name[BATCH_NAME_LEN];
        if (file != path) snprintf(dir, sizeof dir, "%.*s", (int)(file - path), path);
        const unsigned long job = strtoul(file, NULL, 10);
        if (job == 0 || job > b->n_jobs || stat(b->dir, &folder) != 0 || stat(dir, &here) != 0) continue;
        if (folder.st_dev != here.st_dev || folder.st_ino != here.st_ino) continue;
        batch_job_name(b, (uint32_t)job - 1, name);
        if (strncmp(file, name, strlen(name)) == 0 && file[strlen(name)] == '.')
            return sh_fail(
                err, SH_EINPUT,
                "--output %s: %s, a file of job %lu, is also read as an input, and would be overwritten; name "
                "another folder",
                b->dir, file, job);
    }
    return SH_OK;
}

/* Jobs whose files aren't whole any more are done again. */
static int check_done(struct runner *r, struct sh_err *err)
{
    struct batch *b = r->b;
    for (uint32_t i = 0; i < b->n_jobs; i++) {
        struct sh_err why = {0};
        if (!batch_is_mine(b, i)) continue;
        r->n_mine++;
        const int rc = b->job[i].is_done ? batch_check_files(b, i, &why) : SH_OK;
        if (rc == SH_ESTOPPED) return sh_fail_stopped(err);
        if (rc != SH_OK) sh_warn(&app_report_stderr, "%s; job %u is done again", why.text, i + 1);
        if (rc != SH_OK) b->job[i].is_done = 0;
        r->n_todo += !b->job[i].is_done;
        if (!b->quiet) sh_progress(&app_report_seconds, "checking what is done", (double)i / b->n_jobs);
    }
    return SH_OK;
}

/* Removes the manifest of the whole campaign, which is out of date once a job is done again. */
static void drop_whole(const struct runner *r)
{
    char path[PATH_MAX];
    if (r->n_todo == 0) return;
    snprintf(path, sizeof path, "%s/manifest.json", r->b->dir);
    unlink(path);
}

static int say_end(const struct runner *r)
{
    const struct batch *b = r->b;
    const uint32_t done = r->n_mine - r->n_todo + r->n_did;
    if (app_interrupted() && done < r->n_mine) /* a signal may come after the last job */
        fprintf(stderr,
                "scanhead: interrupted: %u of %u jobs of shard %u/%u are done; the same command does the rest\n", done,
                r->n_mine, b->shard, b->n_shards);
    else if (r->n_failed != 0)
        fprintf(stderr, "scanhead: %u of %u jobs of shard %u/%u failed; the same command tries them again\n",
                r->n_failed, r->n_mine, b->shard, b->n_shards);
    else if (!b->quiet)
        fprintf(stderr, "scanhead: shard %u/%u: %u jobs done, %u of them now; meshes read %u time%s\n", b->shard,
                b->n_shards, done, r->n_did, r->loaded.n_reads, r->loaded.n_reads == 1 ? "" : "s");
    return done == r->n_mine ? APP_OK : APP_FAILED;
}

static int run_jobs(struct runner *r)
{
    drop_whole(r);
    r->start_ns = clock_now_ns();
    for (uint32_t i = 0; i < r->b->n_jobs && !app_interrupted(); i++) {
        if (!batch_is_mine(r->b, i) || r->b->job[i].is_done) continue;
        if (run_job(r, i) == APP_OK)
            r->n_did++;
        else if (!app_interrupted())
            r->n_failed++;
    }
    batch_unload(&r->loaded);
    return say_end(r);
}

int batch_run(struct batch *b)
{
    struct runner r = {.b = b};
    struct sh_err err = {0};
    int rc = check_inputs(b, &err);
    if (rc == SH_OK) rc = make_folder(b, &err);
    if (rc == SH_OK) rc = batch_find_done(b, 0, &err);
    if (rc == SH_OK) rc = batch_manifest_open(b->dir, b->shard, b->n_shards, &r.manifest, &err);
    if (rc != SH_OK) return app_fail(&err);
    rc = check_done(&r, &err);
    const int status = rc == SH_OK ? run_jobs(&r) : app_fail(&err);
    close(r.manifest);
    return status;
}
