/* SPDX-License-Identifier: MIT */
/* Finds out which jobs of a campaign are done (batch.h). */
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "firmware_sim/app/studio/batch/batch.h"

struct finding {
    struct batch *b;
    int any_engine;
    uint32_t beyond; /* the largest number of an entry for which there is no job; 0: none */
};

/* The later entry of a job counts, but an entry that was made differently never replaces one that fits. */
static int take_entry(void *ctx, struct batch_entry *entry, struct sh_err *err)
{
    struct finding *f = ctx;
    struct batch_provenance made;
    (void)err;
    if (entry->job > f->b->n_jobs) {
        if (entry->job > f->beyond) f->beyond = entry->job;
        batch_entry_free(entry);
        return SH_OK;
    }
    struct batch_job *job = &f->b->job[entry->job - 1];
    batch_job_provenance(f->b, entry->job - 1, &made);
    if (f->any_engine) memcpy(made.engine, entry->made.engine, sizeof made.engine);
    const char *differs = batch_provenance_differs(&made, &entry->made);
    if (differs != NULL) {
        job->other = differs;
        batch_entry_free(entry);
        return SH_OK;
    }
    batch_entry_free(&job->entry);
    job->entry = *entry;
    job->is_done = 1;
    return SH_OK;
}

int batch_find_done(struct batch *b, int any_engine, struct sh_err *err)
{
    struct finding f = {.b = b, .any_engine = any_engine};
    int rc = batch_manifest_read(b->dir, take_entry, &f, &app_report_stderr, err);
    if (rc != SH_OK || b->force) return rc;
    for (uint32_t i = 0; i < b->n_jobs; i++)
        if (b->job[i].other != NULL && !b->job[i].is_done)
            return sh_fail(
                err, SH_ESTATE,
                "%s: its job %u was made with %s; --force repeats such jobs, another -o begins another campaign",
                b->dir, i + 1, b->job[i].other);
    if (f.beyond != 0)
        return sh_fail(
            err, SH_ESTATE,
            "%s: has a job %u, but this campaign ends with job %u; --force leaves that one in place, another -o "
            "begins another campaign",
            b->dir, f.beyond, b->n_jobs);
    return SH_OK;
}

/* Returns the file's path in *path. */
static int check_size(const struct batch *b, const struct batch_file *file, char path[PATH_MAX], struct sh_err *err)
{
    struct stat st;
    snprintf(path, PATH_MAX, "%s/%s", b->dir, file->name);
    if (stat(path, &st) != 0) return sh_fail(err, SH_EIO, "%s: is missing", path);
    if ((uint64_t)st.st_size == file->bytes) return SH_OK;
    return sh_fail(err, SH_EIO, "%s: has %llu bytes, but had %llu", path, (unsigned long long)st.st_size,
                   (unsigned long long)file->bytes);
}

int batch_check_sizes(const struct batch *b, uint32_t job, struct sh_err *err)
{
    const struct batch_entry *entry = &b->job[job].entry;
    char path[PATH_MAX];
    int rc = SH_OK;
    for (uint32_t i = 0; i < entry->n_files && rc == SH_OK; i++)
        rc = check_size(b, &entry->file[i], path, err);
    return rc;
}

int batch_check_files(const struct batch *b, uint32_t job, struct sh_err *err)
{
    const struct batch_entry *entry = &b->job[job].entry;
    for (uint32_t i = 0; i < entry->n_files; i++) {
        const struct batch_file *file = &entry->file[i];
        char path[PATH_MAX], sha[BATCH_SHA_LEN];
        uint64_t bytes;
        int rc = check_size(b, file, path, err);
        if (rc == SH_OK) rc = batch_sha_file(path, sha, &bytes, &app_report_stderr, err);
        if (rc != SH_OK) return rc;
        if (strcmp(sha, file->sha) != 0) return sh_fail(err, SH_EIO, "%s: its contents have changed (sha256)", path);
    }
    return SH_OK;
}
