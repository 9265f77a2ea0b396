/* SPDX-License-Identifier: MIT */
/* A job of `record`, alone: the source, the heads, the recording and the files are the test's. They write each call to
 * `trace`, with the time in ms where it matters. Words in capitals stand for a call that is not as it should be. */
#ifndef TESTS_UNIT_RECORD_JOB_RIG_H
#define TESTS_UNIT_RECORD_JOB_RIG_H

#include "firmware_sim/app/studio/record/job.h"
#include "firmware_sim/config/config.h"
#include "tests/unit/trace_rig.h"

extern struct record_job job;
extern struct config *cfg;
extern struct sh_err err;
extern char warned[512];
extern struct recording_result gets; /* what the recording has in the end */
extern int recording_rc, is_complete;
extern int open_rc, appears_ms; /* of the source, before it appears */
extern int stop_ms;             /* a signal comes; 0: never */
extern int is_stopped;          /* somebody else stops the job */
extern int is_recording;        /* the source is a file */
extern const char *stations;    /* the head's reply; NULL: none comes */
extern const char *order;       /* what is wrong with the order of the stream; NULL: nothing */
extern int gave_up;             /* what the files were told as they were closed */
extern int gave_up_early;       /* what they were told as a frame came */

int make_job(void **state);
int end_job(void **state);
/* Runs it, and expects this result. What it prints to standard error is in `said`. */
void run_job(int (*run)(void), int rc);
extern char *said;

extern int asks_fit;      /* heads ask whether a scan fits, also without a duration */
extern double fits_shots; /* how many shots the files were told then */

#endif
