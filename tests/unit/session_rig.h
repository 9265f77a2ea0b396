/* SPDX-License-Identifier: MIT */
/* A session of a protocol that is not native, without threads. Its protocol, its link and its source belong to the rig,
 * and write into a log what happens. */
#ifndef TESTS_UNIT_SESSION_RIG_H
#define TESTS_UNIT_SESSION_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/loop/pump_inside.h"

enum { QUEUE = 8, TICK_NS = 1000000 };

extern struct pump pump;
extern struct stream stream;
extern struct links links;
extern struct session *const s; /* number 2 of the link, number 3 of all */

/* ---- the protocol */
extern struct protocol_spec spec; /* what create() got */
extern struct doings {
    size_t takes;        /* bytes at once */
    int owes, n_answers; /* answers to each piece of input */
    int64_t next_ns;
} does;

/* ---- the link */
extern struct link_ops own_link;
extern size_t link_room;   /* bytes that it takes at once */
extern ssize_t link_fails; /* what a write returns; 0: it does not fail */

/* ---- the source */
extern struct loop_source_ops own_source;
extern char stored[SETTINGS_FILE_TEXT]; /* what it keeps for the protocol */
extern uint64_t n_refused;              /* requests, as the observer counts them */

/* ---- messages */
extern char logged[2048], warned[256];
extern int n_warned;
/* Checks the log since the last call. */
void expect_log(const char *text);

int session_setup(void **state);
int session_teardown(void **state);
void open_session(void);

extern uint32_t next_seq; /* of the next frame; a session begins with 10 */
/* Releases a tick with n events, whose device times are 100 and so on. */
void release(uint32_t n);
/* Does the same with the tick of a recording, whose times are to be shifted. */
void release_shifted(uint32_t n, int64_t shift_ns);
/* The client sends a text, and nothing else waits. */
void say(const char *text);

#endif
