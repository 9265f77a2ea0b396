/* SPDX-License-Identifier: MIT */
/* A recording whose head is a script: the library, the counts and the clock are the test's. Each command is written to
 * `trace`, with its time in ms, and so are the calls of the recording's owner. */
#ifndef TESTS_UNIT_RECORDING_STEPS_RIG_H
#define TESTS_UNIT_RECORDING_STEPS_RIG_H

#include "firmware_sim/app/studio/record/recording.h"
#include "tests/unit/trace_rig.h"

/* The next wait for a frame takes ms, and gives rc and the frame. rc 2: the library refuses the frame, and waits on. */
struct turn {
    int rc, ms;
    struct scanhead_frame frame;
};
/* The reply to a command, in their order for each command; the last one stays. rc 0: SCANHEAD_OK. */
struct reply_is {
    const char *command, *text;
    int rc;
};

extern const struct turn *turns; /* ended by rc 1: from then on nothing comes, for 250 ms each */
extern const struct reply_is *replies;
extern struct recording_options options;
extern struct recording_result result;
extern struct sh_err err;
extern char warned[512], progress[512];
extern struct scanhead_stats stats;
extern struct scanhead_info info;
extern int stop_ms, back_ms; /* a signal comes; a head that is gone is back; 0: never */
extern int rings;            /* of a sphere; 0: it is none */
extern double scan_s;        /* by the descriptor */
extern int is_count_due;     /* a scan ends without its final counts, which the next telemetry brings */

int make_recording(void **state);
/* Runs it, and expects this result. */
void run_it(int rc);

#define MS       INT64_C(1000000)
#define AT(t_ms) (1000 * MS + (t_ms)*MS) /* device time, after the start of the scan */
#define START                                                                                          \
    {                                                                                                  \
        .frame = {.type = SCANHEAD_EVENT, .event = SCANHEAD_EV_SCAN_START, .event_value = {0, AT(0)} } \
    }
#define POINTS(wait_ms, t_ms)        \
    {                                \
        .ms = (wait_ms), .frame = {  \
            .type = SCANHEAD_POINTS, \
            .n_points = 10,          \
            .t_ns = AT(t_ms),        \
            .scan_t0_ns = (t_ms)*MS  \
        }                            \
    }
#define OVER(wait_ms)                                                                      \
    {                                                                                      \
        .ms = (wait_ms), .frame = {.type = SCANHEAD_EVENT, .event = SCANHEAD_EV_SCAN_END } \
    }
#define STATE(to, from)                                                                               \
    {                                                                                                 \
        .frame = {.type = SCANHEAD_EVENT, .event = SCANHEAD_EV_STATE, .event_value = {(to), (from)} } \
    }
#define NOTHING(wait_ms)                         \
    {                                            \
        .rc = SCANHEAD_ETIMEOUT, .ms = (wait_ms) \
    }
#define LAST    \
    {           \
        .rc = 1 \
    }

#endif
