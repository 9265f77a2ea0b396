/* SPDX-License-Identifier: MIT */
/* Private to work.c and work_ahead.c: the working memory of a caster thread. */
#ifndef FIRMWARE_SIM_LOOP_WORK_INSIDE_H
#define FIRMWARE_SIM_LOOP_WORK_INSIDE_H

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/loop/work.h"

struct worker {
    const struct site *site; /* as it is for the tick at hand */
    struct ring_slot *slot;  /* of the tick at hand, which is written there */
    int no_memory;           /* the slot has no room for the rest of the tick */
    struct ring_mark mark[RING_MAX_MARKS];
    struct caster *caster;
    struct cast_counters counted; /* the caster's counters when count_hits last added them to a slot */
    struct line_block block;
    struct line_waves *waves; /* the block's; block.waves is NULL while they are not sent */
    struct cast_setup setup;
    uint32_t setup_station; /* 1 + the station that setup is for; 0: none yet */
    uint32_t setup_scan;    /* the scan that it is for */
    size_t stretch;         /* of a moving head's path, that setup is for */
    size_t anchored;        /* the one whose anchor went out last */
    /* a moving head: its poses for the pulses at hand, and as they go out */
    struct pose_knot knot[NATIVE_MAX_POSES];
    struct native_pose pose[NATIVE_MAX_POSES];
};

/* A part is consecutive pulses of one line. */
struct worker_part {
    struct schedule_line line;
    uint64_t end;             /* of the line or of the pulses asked for */
    uint64_t cast0, cast_end; /* the rest is in the blind part of the sweep */
};
/* Finds the part of k .. end - 1 that begins with pulse k. */
void worker_get_part(const struct schedule_segment *segment, uint64_t k, uint64_t end, struct worker_part *part);
/* Takes the site and the setup of a tick, without the poses of a moving head and of movers. */
void worker_take_setup(struct worker *worker, const struct device_work *work);

#endif
