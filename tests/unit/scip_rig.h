/* SPDX-License-Identifier: MIT */
/* For tests of SCIP: a head that spins, the answers of its session, and a decoder of scans written from the protocol's
 * description alone. */
#ifndef TESTS_UNIT_SCIP_RIG_H
#define TESTS_UNIT_SCIP_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "tests/common/protocol_rig.h"

enum { SCIP_STEPS = 1500 };

extern struct protocol_rig rig;
extern struct protocol_rig_shot shot[SCIP_STEPS]; /* of the steps first..last */

/* Opens a session of that model, and closes the one before. The model's head is described: 0.02 to 5.6 m for URG-04LX,
 * 0.1 to 30 m else. */
void scip_open(const char *model);
/* Does the same with a chosen head. */
void scip_open_head(const char *model, uint32_t steps, int first, int last, int front, int turn, uint32_t lines_hz);
/* Closes the last session, after all tests. */
int scip_teardown(void **state);

/* Sends lines of the client. Exactly `answer` must have come since the last call. */
void scip_ask(const char *lines, const char *answer);
void scip_expect(const char *answer);
/* The reply to `line` has these pieces. The last one is NULL. */
void scip_expect_in(const char *line, const char *const *pieces);
#define EXPECT_IN(line, ...) scip_expect_in(line, (const char *const[]){__VA_ARGS__, NULL})

/* Sets all shots to one range. */
void scip_flat(double range_m);
/* Feeds turn number `line`, and time up to its end. */
void scip_turn(uint32_t line);
/* Feeds parts of a turn: the points of shots from..to, both included; its end, and time up to it. */
void scip_part(uint32_t line, int from, int to);
void scip_line_end(uint32_t line, uint32_t status);

/* Decodes a scan at *at, and moves *at behind it. Asserts that sums, line lengths and the empty line are right. */
struct scip_decoded {
    char echo[80], status[3];
    uint32_t time_ms, n_steps;
    uint32_t n[SCIP_STEPS], range_mm[SCIP_STEPS][3], intensity[SCIP_STEPS][3];
};
void scip_decode(struct scip_decoded *scan, const char **at, int n_chars, int intensity);
/* Decodes all bytes so far as one scan; no byte may be left. */
void scip_decode_only(struct scip_decoded *scan, int n_chars, int intensity);

#endif
