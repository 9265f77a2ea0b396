/* SPDX-License-Identifier: MIT */
/* A verdict on somebody else's client, from the head's side alone. In: a configuration with faults, and the command that
 * runs the client. Out: for each check whether it is passed, and figures. Findings have the names of checks. */
#ifndef FIRMWARE_SIM_APP_STUDIO_VERDICT_VERDICT_H
#define FIRMWARE_SIM_APP_STUDIO_VERDICT_VERDICT_H

#include <stdint.h>
#include <stdio.h>

#include "core/err.h"
#include "firmware_sim/base/json.h"

struct config;

/* In the order of the sheet. */
enum verdict_check {
    VERDICT_CONNECTS,
    VERDICT_COMES_BACK,
    VERDICT_LETS_GO,
    VERDICT_ASKS_RIGHT,
    VERDICT_SCANS,
    VERDICT_KEEPS_UP,
    VERDICT_LIVES,
    VERDICT_ENDS,
    VERDICT_POINTS_READ,
    VERDICT_POINTS_KNOWN,
    VERDICT_POINTS_ONCE,
    VERDICT_N_CHECKS
};
/* By check: its name, and what it asks for. */
extern const char *const verdict_names[VERDICT_N_CHECKS], *const verdict_asks[VERDICT_N_CHECKS];

enum verdict_state { VERDICT_NOT_JUDGED, VERDICT_PASSED, VERDICT_FOUND };

struct verdict_result {
    enum verdict_state state;
    char text[320]; /* the finding, the figures of a pass, or why it is not judged */
};

struct verdict_points {
    uint64_t n, empty, unknown, repeated, sent;
    double unit_m, match_m; /* what the file rounds to; how far coordinates may differ in all */
    const char *frame;      /* in which they were compared; NULL: they were not */
};

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
};

struct verdict_options {
    const char *command; /* for sh -c, with placeholders */
    const char *file;    /* of points, with placeholders; "-": the client prints them; NULL: none */
    const char *folder;  /* for logs and what the client writes; it exists */
    const char *truth;   /* as device_options has it */
    double duration_s;   /* from the first points on */
    double limit_s;      /* for the first connection, for each that follows a disturbance, and for points at the end */
    double grace_s;      /* from SIGTERM to SIGKILL */
    double match_m;      /* beside what the file rounds to; negative: by the link's protocol */
    uint32_t link;       /* from 1 */
    int quiet;
};

/* Runs the client once. `verdict` begins with the scenario's name. On failure there is no verdict. */
int verdict_run(struct config *cfg, const struct verdict_options *options, struct verdict *verdict, struct sh_err *err);

uint32_t verdict_count(const struct verdict *verdict, enum verdict_state state);
void verdict_print(const struct verdict *verdict, FILE *out);
void verdict_put(const struct verdict *verdict, struct json *json);
/* JUnit XML: a test suite for each of the n scenarios, and in it a test case for each check. */
int verdict_write_junit(const char *path, const struct verdict *verdict, uint32_t n, struct sh_err *err);

#endif
