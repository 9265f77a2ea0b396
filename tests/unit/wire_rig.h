/* SPDX-License-Identifier: MIT */
/* For tests of faults on the wire. Frames and replies go in, with a clock of the test's own, and the output is kept
 * with its times. The expected output, by the notes of the faults alone, is beside it. */
#ifndef TESTS_UNIT_WIRE_RIG_H
#define TESTS_UNIT_WIRE_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/bytes.h"
#include "core/err.h"
#include "drivers/protocol/crc32c.h"
#include "drivers/protocol/native_encode.h"
#include "firmware_sim/fault/wire.h"

#define MS INT64_C(1000000)

enum { RIG_ITEMS = 400, RIG_NOTES = 4000, RIG_WRITES = 20000, RIG_UNIT = 200, RIG_OUT = 1 << 21 };

struct rig_item {
    int of;
    uint64_t number; /* among the items of the same `of`, from 1 */
    size_t len;
    uint8_t bytes[RIG_UNIT];
    uint32_t notes_from; /* the notes of the last put begin here */
};

struct rig_write {
    int64_t at_ns;
    enum wire_piece_kind kind;
    uint32_t act;
    size_t at, len; /* in rig.out */
    uint32_t n;     /* n and for_ms are those of an act */
    double for_ms;
};

struct rig {
    struct fault_list list;
    int native;
    struct fault_board *board;
    struct wire *wire;
    struct wire_heard heard;
    int64_t now_ns;
    struct rig_item item[RIG_ITEMS];
    uint32_t n_items;
    uint64_t count[FAULT_N_OF], seq;
    struct fault_note note[RIG_NOTES];
    uint32_t n_notes;
    struct rig_write *write; /* [RIG_WRITES] */
    uint32_t n_writes;
    uint8_t *out; /* [RIG_OUT] */
    size_t n_out;
};
extern struct rig rig;

/* Returns a fault that strikes at each frame. */
struct fault fault_of_kind(enum fault_kind kind);
/* Opens a session of link 1. The session is native, or of a protocol whose units have a byte that is their sum at the
 * end. */
void rig_open(const struct fault *fault, uint32_t n, int native);
void rig_close(void);
/* Closes the session of a test that failed before it did so. */
int rig_teardown(void **state);
/* rig_run puts so many frames into a session with one fault. rig_end ends it: `whole` of them must have come right. */
void rig_run(const struct fault *fault, uint32_t n_frames);
void rig_end(uint32_t whole);

/* Puts a frame at now_ns; the clock goes on by 1 us. Bytes are random and different each time. */
enum rig_frame { RIG_STREAM, RIG_POINTS, RIG_NOTICE, RIG_LOCAL };
/* t_ns: device time in its header. pulse0: for points, which have 100 pulses. */
struct rig_item *rig_frame_at(enum rig_frame kind, size_t payload_len, int64_t t_ns, uint64_t pulse0);
struct rig_item *rig_frame(enum rig_frame kind);
struct rig_item *rig_reply(const char *line); /* without CR LF */
struct rig_item *rig_unit(size_t len, int is_reply);

/* Takes the pieces that may go out now. Returns how many writes there were. last: there is no more input. */
uint32_t rig_take(int last);
/* Does so until the end, with the clock going to each time at which a piece may go out. The call fails when such times
 * do not end. */
void rig_drain(void);

/* The sent bytes are those of the items of these numbers (from 0), one after the other; ends with -1. */
void rig_expect(const int *items);
/* The output is that of the notes, item by item; bytes of garbage are any. Returns how many frames or units came whole
 * and right. */
uint32_t rig_check_notes(void);

#endif
