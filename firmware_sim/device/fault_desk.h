/* SPDX-License-Identifier: MIT */
/* FAULt commands: what a client says of faults on request, carried out on the board of the run.
 *
 * In: a board, the configuration that says which faults there can be, and device time. Out: struct command_faults for the
 * command set. The owner's lock protects it. */
#ifndef FIRMWARE_SIM_DEVICE_FAULT_DESK_H
#define FIRMWARE_SIM_DEVICE_FAULT_DESK_H

#include "firmware_sim/command/command.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/fault/board.h"

struct fault_desk {
    const struct config *cfg;
    struct fault_board *board;
    int64_t now_ns; /* from which a fault counts that is added now; set before each command */
    int no_head;    /* nothing computes: faults in the head are refused */
};

extern const struct command_faults fault_desk_commands; /* their owner is a struct fault_desk */

/* Why a fault can't be, where nothing computes; NULL: it can. */
const char *fault_desk_why_not(const struct fault *fault);

#endif
