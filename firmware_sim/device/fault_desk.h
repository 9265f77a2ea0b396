/* SPDX-License-Identifier: MIT */
/* FAULt commands: carries them out on the run's board of injected faults.
 *
 * In: a board, the configuration, which decides the possible faults, and device time. Out: struct command_faults for
 * the command set. The owner's lock protects it. */
#ifndef FIRMWARE_SIM_DEVICE_FAULT_DESK_H
#define FIRMWARE_SIM_DEVICE_FAULT_DESK_H

#include "firmware_sim/command/command.h"
#include "firmware_sim/fault/board.h"

struct config;

struct fault_desk {
    const struct config *cfg;
    struct fault_board *board;
    int64_t now_ns; /* a fault that is added now counts from this device time; set before each command */
    int no_head;    /* no head computes, so faults in the head are refused */
};

extern const struct command_faults fault_desk_commands; /* their owner is a struct fault_desk */
/* The same where the caller refuses all changes: adding and taking out do nothing. */
extern const struct command_faults fault_desk_queries;

/* Why a fault is not possible without a head that computes; NULL: it is. */
const char *fault_desk_why_not(const struct fault *fault);

#endif
