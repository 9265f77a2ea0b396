/* SPDX-License-Identifier: MIT */
/* For tests of libscanhead: frames of a head are written to a descriptor, and a handle is at its other end. */
#ifndef TESTS_UNIT_HOST_RIG_H
#define TESTS_UNIT_HOST_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/host/scanhead.h"
#include "drivers/protocol/native_encode.h"

/* WAIT_MS is when a test gives up, far beyond the time of a busy machine. */
enum { MAX_POINTS = NATIVE_MAX_POINTS, WAIT_MS = 120000 };

extern uint8_t out[1 << 18];
extern uint32_t a[MAX_POINTS], b[MAX_POINTS], c[MAX_POINTS], dt[MAX_POINTS];
extern int16_t refl[MAX_POINTS];
extern uint16_t label[MAX_POINTS];
extern uint8_t echo[MAX_POINTS];

struct native_descriptor make_descriptor(int geo, uint32_t scan);

struct native_anchor make_anchor(void);

struct line_block make_block(uint32_t n, uint64_t pulse0);

void put_all(int fd, const void *data, size_t len);

/* Returns the number of the next frame: from 0 on after open_pair. Frames of put_... below have it, LOCAL ones 0. */
uint32_t rig_next_seq(void);

void put_descriptor(int fd, int geo, uint32_t scan, int flags);

void put_anchor(int fd, int flags);

void put_points(int fd, uint32_t n, uint64_t pulse0);

void put_event(int fd, uint32_t code, uint64_t va, uint64_t vb, uint64_t vc, int flags);

/* The next frame begins another sequence: it has number 0. */
void rig_begin_sequence(void);

/* Opens an empty recording for frames from number 0 on; then a handle that reads it from its begin. */
int rig_write_recording(void);
struct scanhead *rig_read_recording(int fd);

/* Opens a handle, and writes the head's end of its socket pair. */
struct scanhead *open_pair(int *head);

/* The frames that have come give one refusal, and nothing is handed out. Returns its reason. */
const char *expect_refused_frame(struct scanhead *sh);

void expect_frame(struct scanhead *sh, int type, struct scanhead_frame *frame);

#endif
