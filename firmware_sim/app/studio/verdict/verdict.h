/* SPDX-License-Identifier: MIT */
/* A verdict on somebody else's client, from the head's side alone. In: a configuration with faults, and the command
 * that runs the client. Out: for each check whether it is passed, and figures. Findings have the names of checks. */
#ifndef FIRMWARE_SIM_APP_STUDIO_VERDICT_VERDICT_H
#define FIRMWARE_SIM_APP_STUDIO_VERDICT_VERDICT_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "core/err.h"
#include "firmware_sim/base/json.h"

struct config;

/* The only list of checks, in the order of the sheet: name, and what is asked for. */
#define VERDICT_CHECKS(X)                                                                               \
    X(CONNECTS, "connects", "a first connection within the limit")                                      \
    X(COMES_BACK, "comes-back", "a new connection within the limit, each time that the head ended one") \
    X(LETS_GO, "lets-go", "no connection is kept that the head has ended")                              \
    X(ASKS_RIGHT, "asks-right", "no request is refused as wrong")                                       \
    X(SCANS, "scans", "the head scans at the end")                                                      \
    X(KEEPS_UP, "keeps-up", "the client reads as fast as the head sends")                               \
    X(LIVES, "lives", "the client does not end by itself")                                              \
    X(ENDS, "ends", "the client ends when it is asked to")                                              \
    X(POINTS_READ, "points-read", "the client's points can be read")                                    \
    X(POINTS_KNOWN, "points-known", "each point is one that a pulse had")                               \
    X(POINTS_ONCE, "points-once", "no point is there more often than it was sent")

#define VERDICT_ENUM(id, name, asks) VERDICT_##id,
enum verdict_check { VERDICT_CHECKS(VERDICT_ENUM) VERDICT_N_CHECKS };
extern const char *const verdict_names[VERDICT_N_CHECKS], *const verdict_asks[VERDICT_N_CHECKS]; /* by check */

/* ALLOWED: found, but --allow names the check. */
enum verdict_state { VERDICT_NOT_JUDGED, VERDICT_PASSED, VERDICT_FOUND, VERDICT_ALLOWED };

struct verdict_result {
    enum verdict_state state;
    char text[320]; /* the finding, the figures of a pass, or why it is not judged */
};

/* A client's points, compared with those of the head (match.h). */
struct verdict_points {
    size_t empty;            /* shots without echo: NaN three times, or 0 three times */
    size_t n;                /* other points */
    size_t unknown;          /* no pulse had them */
    size_t repeated;         /* the client has them more often than they were sent */
    size_t sent;             /* points that the head sent; a point that went to two sessions counts twice */
    size_t again;            /* points in `sent` that agree with an earlier one; a repetition of these may go unseen */
    size_t first_unknown;    /* index in the cloud */
    const char *frame;       /* the coordinate frame in which they agree best; NULL: they were not compared */
    double unit_m, within_m; /* the rounding of the file; how far a coordinate may differ */
};

/* A connection that a fault ended, or did not let begin. */
struct verdict_break {
    const char *kind;
    uint32_t link;
    double back_s; /* from the fault's end until the client was back; NaN: it was not */
};
enum { VERDICT_MAX_BREAKS = 64 };

struct verdict_figures {
    double wall_s, connected_s, back_mean_s, back_max_s; /* NaN: none */
    uint64_t sessions, breaks, injected, heard_bytes, refused, refused_by_state, left_out, lost_pulses;
    char exit[96];            /* how the client ended */
    char wrong_lines[3][160]; /* the first wrong requests, with their replies; empty: there were not as many */
};

struct verdict {
    char scenario[64], log[512];
    struct verdict_result check[VERDICT_N_CHECKS];
    struct verdict_points points;
    struct verdict_figures figures;
    struct verdict_break broken[VERDICT_MAX_BREAKS]; /* the first of figures.breaks, which may be more */
};

struct verdict_options {
    const char *command; /* for sh -c, with placeholders */
    const char *file;    /* of points, with placeholders; "-": the client prints them; NULL: none */
    const char *folder;  /* for logs and what the client writes; it exists */
    const char *truth;   /* as device_options has it */
    double duration_s;   /* from the first points on */
    double limit_s;      /* for the first connection, for each that follows a disturbance, and for points at the end */
    double grace_s;      /* from SIGTERM to SIGKILL */
    double match_m;      /* in addition to the rounding of the file; negative: by the link's protocol */
    uint32_t link;       /* from 1 */
    uint32_t allowed;    /* bit per check */
};

/* A soak compares frames, not speed. So this gives the head of a busy machine time to deliver all of them, even
 * late. */
void verdict_be_patient(struct config *cfg);
/* Runs the client once. `verdict` begins with the scenario's name. On failure there is no verdict. */
int verdict_run(struct config *cfg, const struct verdict_options *options, struct verdict *verdict, struct sh_err *err);

uint32_t verdict_count(const struct verdict *verdict, enum verdict_state state);
void verdict_print(const struct verdict *verdict, FILE *out);
void verdict_put(const struct verdict *verdict, struct json *json);
/* JUnit XML: a test suite for each of the n scenarios, and in it a test case for each check. */
void verdict_put_junit(const struct verdict *verdict, uint32_t n, FILE *out);

#endif
