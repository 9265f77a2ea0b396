/* SPDX-License-Identifier: MIT */
/* For tests of recorders: a stream is written shot by shot and recorded, and the file's bytes are read. */
#ifndef TESTS_UNIT_RECORDER_RIG_H
#define TESTS_UNIT_RECORDER_RIG_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/record/recorder.h"
#include "drivers/protocol/native_encode.h"

enum { RIG_MAX_POINTS = 4096 };

extern char rig_shs[64];
extern FILE *rig_stream;
extern char rig_notes[2048];       /* the recorder's notes, a line each */
extern int (*rig_stop)(void *ctx); /* asked while files are completed; NULL: never */

void rig_put(const uint8_t *frame, size_t len);

extern int64_t rig_scan_t0_ns; /* device time at which the scan of rig_points began; rig_begin makes it 0 */
extern uint32_t rig_sweep;     /* pan sweep of rig_points; rig_begin makes it 0 */

void rig_begin(void);

/* The rate is 1 kHz, so that a pulse is a millisecond. Polar: 3600 counts a turn, millimetres. */
void rig_descriptor(int geo, uint32_t scan);

struct native_anchor rig_anchor_of(uint32_t crs, uint32_t epsg, uint32_t station);

void rig_anchor(const struct native_anchor *anchor);

struct rig_point {
    int32_t a, b, c;
    int16_t refl_cdb;
    uint16_t label;
    uint8_t echo, count; /* 0, 0: shot without echo */
};

/* Adds points of one line, whose first pulse is line_pulse0, with a millisecond from pulse to pulse. */
void rig_points(uint32_t line, uint64_t line_pulse0, uint64_t pulse0, const struct rig_point *p, uint32_t n);

/* keep: RIG_KEEP_ALWAYS keeps the received points also after a failure, as `record` does. */
enum { RIG_KEEP = 1, RIG_KEEP_ALWAYS = 2 };

/* Records the stream. Returns the code of the call that failed, or of close. No descriptor is left open. */
int rig_record(const char *path, struct recorder_options options, int keep, struct sh_err *err);

const char *rig_path(const char *name);

/* Returns the whole file, NUL-terminated; free() it. len may be NULL. */
uint8_t *rig_read(const char *path, size_t *len);
/* Does the same with the file of a name (rig_path), and removes it. */
void *rig_take(const char *name, size_t *len);
/* Records the stream into the file of a name, and takes it. Where the recorder fails, the test fails. */
void *rig_record_bytes(const char *name, struct recorder_options options, size_t *len);

/* Returns how often `what` is in text. */
int rig_count(const char *text, const char *what);

uint64_t rig_uint(const uint8_t *p, int bytes);

int32_t rig_int32(const uint8_t *p);

double rig_double(const uint8_t *p);

/* A stream that fails for want of space leaves the bytes on the disk, if the format can be repaired, else nothing. A
 * limit on the file's size stands for the full disk. */
void rig_check_disk_full(const char *path, rlim_t size);
/* path has either PATH.part, which the recorder has reported and a repair takes, or nothing. The files are removed. */
void rig_check_left(const char *path);

int rig_set_up(void **state);

/* A file that a test did not remove makes it fail. */
int rig_tear_down(void **state);

#endif
