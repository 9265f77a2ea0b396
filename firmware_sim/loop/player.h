/* SPDX-License-Identifier: MIT */
/* The thread that puts ticks into the stream where the source makes them itself (source.h). The player stands in for
 * the casters of a head that computes.
 *
 * The player is ahead of the release by loop.ahead_ms at most. A head loses a tick that comes too late; a player does
 * not: the tick's frames go out with the next one, and the tick counts as late. */
#ifndef FIRMWARE_SIM_LOOP_PLAYER_H
#define FIRMWARE_SIM_LOOP_PLAYER_H

#include <pthread.h>
#include <stdint.h>

#include "core/err.h"

struct loop;

struct player {
    pthread_t thread;
    int running;
    uint64_t next_tick;
};

int player_start(struct loop *loop, struct sh_err *err);
void player_join(struct loop *loop);

#endif
