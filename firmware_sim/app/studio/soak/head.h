/* SPDX-License-Identifier: MIT */
/* Faults in the head, and what the client saw of them: by states, times and encoders. */
#ifndef FIRMWARE_SIM_APP_STUDIO_SOAK_HEAD_H
#define FIRMWARE_SIM_APP_STUDIO_SOAK_HEAD_H

#include <stdint.h>

#include "drivers/host/scanhead.h"
#include "firmware_sim/fault/board.h"

struct soak_link;

enum { SOAK_MAX_MOMENTS = 64 };

/* A fault in the head that the client has not noticed yet. */
struct soak_moment {
    enum fault_kind kind;
    uint32_t fault;         /* its number */
    struct fault what;      /* as configured */
    int64_t from_ns, to_ns; /* device time; to_ns INT64_MAX: it has not ended */
    double for_ms;
};

/* The head's clock, as its last events reported it. */
struct soak_times {
    int have;
    int64_t at_ns, gps_ns; /* device time, GPS time */
    int have_pps;
    int64_t pps_ns, leap_s; /* device time of the last PPS; GPS time less UTC then */
    int64_t pps_gps_s;      /* GPS second of that PPS */
};

/* The caller of the first three has the link's lock. */
void soak_heard_head(struct soak_link *link, const struct fault_note *note);
/* The link's client got its first frame: hides power cycles and slow boots from before it. */
void soak_head_begins(struct soak_link *link, const struct scanhead_frame *frame);
/* Notes as noticed a power cycle that began before that device time. Returns 0 where there is none. */
int soak_saw_power_go(struct soak_link *link, int64_t before_ns);
/* Looks for faults of the head in a frame that the client got. */
void soak_saw_inside(struct soak_link *link, const struct scanhead_frame *frame);
void soak_saw_state(struct soak_link *link, const char *state);
/* Whether the client has noticed all faults of the head that it must notice. */
int soak_is_head_seen(struct soak_link *link);
/* To be called at the end: faults that were not noticed are missed, or hidden with a reason. */
void soak_judge_head(struct soak_link *link);

#endif
