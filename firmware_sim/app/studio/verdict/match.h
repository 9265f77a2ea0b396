/* SPDX-License-Identifier: MIT */
/* Compares a client's points with those of the head. In: both, and which stream frames the head sent to each session.
 * Out: how many of the client's points agree with no point of the head, and how many points the client has more often
 * than the head sent them. */
#ifndef FIRMWARE_SIM_APP_STUDIO_VERDICT_MATCH_H
#define FIRMWARE_SIM_APP_STUDIO_VERDICT_MATCH_H

#include "core/studio/cloud.h"
#include "firmware_sim/app/studio/verdict/own_stream.h"
#include "firmware_sim/app/studio/verdict/verdict.h"
#include "firmware_sim/app/studio/verdict/watch.h"

struct match_input {
    const struct own_stream *stream;
    struct watch *watch;
    int64_t tick_ns; /* sessions begin and end with ticks */
    const struct cloud *cloud;
    double match_m; /* how far a coordinate may differ, in addition to the rounding of the file */
    const struct sh_report *report;
};

/* SH_ESTOPPED where report asks to stop. */
int match_points(const struct match_input *in, struct verdict_points *points, struct sh_err *err);

/* Returns the rounding of a file's coordinates: in text the unit of the last digit, in single precision two units in
 * the last place of the largest coordinate, else cloud->count_m. Points with a coordinate beyond limit_m do not
 * count. */
double match_unit_m(const struct cloud *cloud, double limit_m);

#endif
