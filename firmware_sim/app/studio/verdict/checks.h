/* SPDX-License-Identifier: MIT */
/* The checks of a verdict, from what was seen. */
#ifndef FIRMWARE_SIM_APP_STUDIO_VERDICT_CHECKS_H
#define FIRMWARE_SIM_APP_STUDIO_VERDICT_CHECKS_H

#include "firmware_sim/app/studio/verdict/client.h"
#include "firmware_sim/app/studio/verdict/match.h"
#include "firmware_sim/app/studio/verdict/verdict.h"
#include "firmware_sim/app/studio/verdict/watch.h"

struct checks {
    const struct verdict_options *options;
    struct watch *watch;
    const struct client *client;
    int has_sessions;           /* clients of the link connect to it; 0: it sends to whoever is there */
    int is_open;                /* the client has a session at the end, before it is ended */
    int scans, holds;           /* points came for 0.1 s after the faults; the client keeps a dead connection */
    int64_t start_ns, ended_ns; /* when the client was started, and when it was asked to end */
    int was_there;              /* the client had not ended by itself until then */
};

void checks_judge(const struct checks *checks, struct verdict *verdict);
/* The points were not compared; `why` says why. */
void checks_no_points(struct verdict *verdict, enum verdict_state state, const char *why);
/* The points were compared. unknown: the first unknown point. */
void checks_points(struct verdict *verdict, const struct verdict_points *match, const double unknown[3]);

#endif
