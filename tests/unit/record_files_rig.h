/* SPDX-License-Identifier: MIT */
/* The files of a recording, alone: recorders and spools are the test's. Each call is written to `trace`. */
#ifndef TESTS_UNIT_RECORD_FILES_RIG_H
#define TESTS_UNIT_RECORD_FILES_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/app/studio/record/files.h"
#include "tests/unit/trace_rig.h"

enum { HEAD_A = 1, HEAD_B = 2 };

extern struct record_files files;
extern struct sh_err err;
extern char warned[1024];        /* all warnings, with a line end after each */
extern const char *left;         /* the file that an earlier recording left */
extern int spool_rc;             /* where frames can't be kept */
extern double lows[4], highs[4]; /* of the points of each spool */

int make(void **state);
void add(const char *path);
/* Compares the trace, and empties it. */
void expect(const char *expected);
int frame(int head, uint32_t seq, int type, uint32_t event, int flags);
void points(int head, uint32_t seq);
void open_all(void);
void close_all(int keep, int rc);

#endif
