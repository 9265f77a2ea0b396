/* SPDX-License-Identifier: MIT */
/* Warns, once, where casting takes more than ten times the processor time that the plan has for a pulse.
 *
 * In: the casters' processor time, the pulses that they claimed, and the ticks that were released. A thread of its own
 * reads these figures once a second, so the casters and the pacing thread spend nothing on that. Out: one line, through
 * the report of the loop. Only processor time counts, so a busy machine gives no warning. */
#ifndef FIRMWARE_SIM_LOOP_COST_WATCH_H
#define FIRMWARE_SIM_LOOP_COST_WATCH_H

#include <stdint.h>

/* Sums since the start. */
struct cost_sample {
    int64_t cast_ns; /* of all casters */
    uint64_t pulses, ticks;
};

struct cost_figures {
    double planned_ns;    /* for a pulse */
    uint64_t open_pulses; /* the most that can be claimed before the first sample and cast after it */
    struct cost_sample last, sum;
};

#define COST_LEAST_NS INT64_C(1000000000) /* of casting, before its cost is judged */

/* Adds a sample. Returns the ns that a pulse took since the last verdict where these exceed ten times planned_ns, else
 * 0. Pure. */
double cost_add(struct cost_figures *figures, const struct cost_sample *now);

/* A thread that takes a sample every second. The loop starts and joins it. */
struct cost_watch;
struct loop;
/* Call it after the casters were started. NULL: nobody is to be warned, or no thread could be started. */
struct cost_watch *cost_watch_start(struct loop *loop);
void cost_watch_join(struct cost_watch *watch);

#endif
