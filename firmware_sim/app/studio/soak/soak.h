/* SPDX-License-Identifier: MIT */
/* A soak: the head, its clean stream and its links. */
#ifndef FIRMWARE_SIM_APP_STUDIO_SOAK_SOAK_H
#define FIRMWARE_SIM_APP_STUDIO_SOAK_SOAK_H

#include <stdatomic.h>
#include <stdint.h>

#include "firmware_sim/app/studio/soak/clean.h"
#include "firmware_sim/app/studio/soak/link.h"
#include "firmware_sim/fault/board.h"
#include "firmware_sim/fault/fault.h"
#include "firmware_sim/loop/loop.h"

struct config;

enum soak_phase { SOAK_RUNS, SOAK_DRAINS, SOAK_ENDS };

struct soak {
    const struct config *cfg;
    struct fault_board *board;
    struct soak_clean clean;
    struct soak_link link[CONFIG_MAX_LINKS];
    struct soak_datagrams *datagrams[CONFIG_MAX_LINKS]; /* [n_links] NULL: its datagrams are not compared */
    uint32_t n_links;
    int realtime;
    atomic_int phase;         /* enum soak_phase */
    _Atomic uint64_t until;   /* SOAK_DRAINS: clients go on up to this frame */
    _Atomic uint64_t base;    /* a recent soak_seq; soak_seq_of counts others from it; 0: no frame came so far */
    struct fault_list faults; /* as configured */
    struct loop_stats stats;
    double wall_s;
    int healthy, hash_is_same;
    const char *failures[16];
    uint32_t n_failures;
};

#endif
