/* SPDX-License-Identifier: MIT */
/* A verdict's run, alone: the head, the client's process, what is seen of both and the checks are the test's. They
 * write each call to `trace`, with the time in ms. Words in capitals stand for a call that is not as it should be. */
#ifndef TESTS_UNIT_VERDICT_RUN_RIG_H
#define TESTS_UNIT_VERDICT_RUN_RIG_H

#include <stdint.h>

#include "firmware_sim/app/studio/verdict/checks.h"
#include "firmware_sim/app/studio/verdict/match.h"
#include "firmware_sim/app/studio/verdict/verdict.h"
#include "firmware_sim/config/config.h"
#include "tests/unit/trace_rig.h"

#define MS INT64_C(1000000)

enum { NOT_EVER = 1000000000 };

/* The times at which things happen, in ms after the start: NOT_EVER where a test does not say otherwise. */
struct plan_of_run {
    int up, connects, first_points, last_points; /* points come evenly with device time */
    int ends;                                    /* the client ends by itself */
    int whole;                                   /* all are back */
    int over;                                    /* of the last disturbance; 0: there was none */
    int stop;                                    /* a signal comes */
};

extern struct config cfg;
extern struct verdict_options options;
extern struct verdict verdict;
extern struct plan_of_run plan;
extern char warned[512];
extern const char *protocol; /* of the client's link */
extern struct checks seen;   /* as the checks got it */
extern uint32_t must_ask;
extern double match_m;            /* the limit with which points are compared */
extern void (*client_does)(void); /* once it was started */
extern const char *short_of;
extern int is_short;
extern size_t n_matched, first_unknown;

/* For cmocka: a client of link 2, which is one of native over TCP. The time is 1000 ms. */
int make_run(void **state);
int run_it(struct sh_err *err);

#endif
