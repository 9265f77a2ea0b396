/* SPDX-License-Identifier: MIT */
/* A campaign: many recordings off line, each for one station and one combination of values of keys. In: the command
 * line of `batch`. Out: the list of jobs in its fixed order, which of them are done, their files, and the manifests.
 *
 * Jobs are numbered from 1: all stations of the first combination of values, then all of the next one. A job is a head
 * of its own from power-up on, so that its files don't depend on which jobs ran before it in the same process. One
 * thread. */
#ifndef FIRMWARE_SIM_APP_STUDIO_BATCH_BATCH_H
#define FIRMWARE_SIM_APP_STUDIO_BATCH_BATCH_H

#include "firmware_sim/app/studio/batch/manifest.h"
#include "firmware_sim/app/studio/record/line.h"

struct batch_job {
    uint32_t combination, station; /* from 0; from 1 */
    int is_done;                   /* 1: `entry` has the files that it must have */
    struct batch_entry entry;
    const char *other; /* what an entry of this job was made with that differs, in words; NULL: none differs */
};

struct batch {
    /* as given */
    struct app_input in; /* CONFIG, --set and --scenario */
    const char *dir, *shard_text, *stations_text, *format, *threads;
    int list, json, merge, force, quiet, surfaces;
    struct batch_sweeps sweeps;
    struct app_words options; /* of record, which each job gets as they are */
    /* as read */
    struct batch_stations stations;
    uint32_t shard, n_shards;
    char *endings; /* --format, with NULs in place of commas */
    const char *ending[RECORD_MAX_FILES];
    int n_endings;
    /* as planned */
    uint32_t n_combinations;
    struct batch_provenance *made; /* [n_combinations]; job is empty */
    struct batch_job *job;         /* [n_jobs] */
    size_t job_room;
    uint32_t n_jobs;
    int digits; /* of a job's number in names */
    struct batch_cache cache;
    char engine[sizeof((struct batch_provenance *)0)->engine];
};

/* ---- plan.c */

/* Checks every combination of values, and lists the jobs. Prints what is wrong, and returns the exit status. */
int batch_plan(struct batch *b);
void batch_free(struct batch *b);

static inline int batch_is_mine(const struct batch *b, uint32_t job)
{
    return job % b->n_shards == b->shard - 1;
}

/* Name and provenance of a job; jobs count from 0 here. */
void batch_job_name(const struct batch *b, uint32_t job, char name[BATCH_NAME_LEN]);
void batch_job_provenance(const struct batch *b, uint32_t job, struct batch_provenance *made);
/* Whether no byte of a recording depends on this setting. */
int batch_is_of_speed(const char *set);

/* The command line of `record` for a job. */
struct batch_line {
    struct record_line line;
    char *word[2 * APP_MAX_OPTIONS + APP_MAX_SETS + BATCH_MAX_SWEEPS + RECORD_MAX_FILES + 8];
    int n;
};
/* APP_GO_ON, or the exit status with the reason printed. *line is to be freed in any case. */
int batch_line_make(const struct batch *b, uint32_t combination, uint32_t station, const char *name,
                    struct batch_line **line);
void batch_line_free(struct batch_line *line);

/* ---- done.c */

/* Finds out which jobs are done, by the manifests in the folder: job->is_done, entry, other. any_engine: jobs of other
 * kinds of machines count, too. SH_ESTATE, without --force: a job there has another provenance, or a number
 * beyond the last job. */
int batch_find_done(struct batch *b, int any_engine, struct sh_err *err);
/* Whether a done job's files are as its entry says; else why not. SH_ESTOPPED after a signal. */
int batch_check_files(const struct batch *b, uint32_t job, struct sh_err *err);
/* The same by the files' sizes alone, which takes no time. */
int batch_check_sizes(const struct batch *b, uint32_t job, struct sh_err *err);

/* ---- run.c: the jobs of a shard that aren't done. Returns the exit status, with what failed printed. */
int batch_run(struct batch *b);

/* ---- merge.c: checks all jobs, and writes manifest.json where all are whole. Returns the exit status, with what
 * failed printed. */
int batch_merge(struct batch *b);

/* Writes number, name, station and settings of job i as members of the open object. */
void batch_put_job(struct json *json, const struct batch *b, uint32_t i);
/* The list of jobs as text or as JSON (list.c); with a folder, which of them have a line in a manifest and
 * files of that line's sizes. */
int batch_list(struct batch *b);

#endif
