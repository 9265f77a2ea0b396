/* SPDX-License-Identifier: MIT */
/* For tests of the PLY and raw recorders: a stream is recorded, and the file's bytes are read. */
#ifndef TESTS_UNIT_PLY_RIG_H
#define TESTS_UNIT_PLY_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/record/recorder.h"
#include "drivers/protocol/native_encode.h"

enum { N = 5, RECORD = 50 }; /* points of a stream frame; bytes of a vertex with all columns */

extern char dir[];
extern char shs_path[64], out_path[64], part_path[64];
extern uint8_t out[1 << 18];
extern FILE *shs;

extern const int32_t xyz[N][3];
extern uint32_t a[N], b[N], c[N], dt[N];
extern int16_t refl[N];
extern uint16_t label[N];
extern uint8_t echo[N];

/* Adds the frame in `out`, with the next number where it has none. */
void put(size_t len);

void put_descriptor(int geo, uint32_t scan, uint32_t n_surfaces);

void put_anchor(uint32_t crs, uint32_t epsg, uint32_t station);

void put_points(uint64_t pulse0);

void put_surfaces(uint32_t first, uint32_t n, char *name);

void begin_stream(void);

/* Records the stream at shs_path. Returns the code of the call that failed, or of close. */
int record(const char *path, struct recorder_options options, int keep, struct sh_err *err);

extern char *text;
extern size_t text_len;

void slurp(const char *path);

int set_up(void **state);

int tear_down(void **state);

#endif
