/* SPDX-License-Identifier: MIT */
/* One recording: which scans of which source go to which files, with its messages and statistics. `record` makes
 * one from its options, `batch` one for each job. In: a struct record_job, zeroed and filled. Out: the files. */
#ifndef FIRMWARE_SIM_APP_STUDIO_RECORD_JOB_H
#define FIRMWARE_SIM_APP_STUDIO_RECORD_JOB_H

#include "firmware_sim/app/studio/record/files.h"
#include "firmware_sim/app/studio/record/recording.h"

struct heads;
struct site;
struct config;

struct record_job {
    const char *source;   /* of record_job_stream, as libscanhead opens it */
    const char *truth;    /* of record_job_off_line: file for the faults that are injected; NULL: none */
    const char *surfaces; /* of record_job_off_line: CSV file for what labels mean; NULL: none */
    const char *stats;    /* where to write what was received, as JSON; NULL: nowhere */
    struct record_files files;
    int each;                     /* files of each scan, too, as files.split makes them */
    int crs_given, no_hash, hash; /* hash: keep stream_sha256 without stats, too */
    int texture;                  /* of record_job_off_line: the head is to send colours of textures */
    long station;                 /* 0: as the head is set; APP_WORD: all */
    struct site *site; /* of record_job_off_line: loaded by offline_load, of cfg; NULL: it loads one itself */
    int only_whole;    /* 1: an incomplete recording leaves no files */
    int brief;         /* 1: prints no line about the result */
    int silent;        /* 1: prints no warnings either */
    int may_end;       /* of record_job_stream: the stream may end within a scan, and what came until then is all */
    /* Asked often, by the thread of the job: 1 ends it, and it leaves no files. NULL: never. */
    int (*stop)(void *ctx);
    void *stop_ctx;
    double wait_s;                      /* of record_job_stream: how long the source may take to be there */
    struct recording_options recording; /* how long, and progress; the rest is filled in here */
    struct recording_result result;     /* out */
    /* inner state */
    struct sh_report notes; /* of the recorders */
    struct heads *heads;    /* of a configuration */
    struct record_files parts;
    struct recorder_scan first; /* the first scan, as the configuration describes it */
    int has_silent;             /* objects that give no echo (scene.target) */
    int is_completing;          /* all frames have come, and the files are completed */
    int interrupted;            /* a signal came before the files were completed; they are completed all the same */
};

/* Checks a recording off line before the scene is loaded: SH_EINPUT where it is not possible. cfg is changed. */
int record_job_check(struct record_job *job, struct config *cfg, struct sh_err *err);
/* The head of cfg runs off line in this process, and so do those of other scanners that the stations have. cfg is
 * changed. The texts of --set that cfg was loaded with must still be in memory. SH_EINPUT: an option that such a
 * recording can't have. SH_ELOST and others as of recording_check_complete: the files keep the points that came,
 * unless only_whole is 1. */
int record_job_off_line(struct record_job *job, struct config *cfg, struct sh_err *err);
/* Records a head on a wire, or a raw stream in a file. */
int record_job_stream(struct record_job *job, struct sh_err *err);

#endif
