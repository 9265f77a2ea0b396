/* SPDX-License-Identifier: MIT */
/* The thread that plans a station's new place (SITE:POSE), so that no link stands still meanwhile.
 *
 * In: a move that the device has begun (COMMAND_MOVE). Out: its reply, in the box of the session that commanded it, and
 * a write to the eventfd of the session's link. The device allows one move at a time. */
#ifndef FIRMWARE_SIM_LOOP_MOVER_H
#define FIRMWARE_SIM_LOOP_MOVER_H

#include <pthread.h>

#include "firmware_sim/loop/stream.h"

/* A session finds the reply here. All zero: it waits for none. The mover's lock protects it. */
struct move_box {
    uint64_t ticket; /* of the move it waits for */
    int done;
    char reply[COMMAND_MAX_REPLY];
};

struct mover {
    struct device *device;
    struct stream *stream;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    pthread_t thread;
    int running, ending;
    uint64_t ticket; /* of the last move */
    int asked;       /* 1: job is that move, and waits for the thread */
    struct move_job {
        uint64_t ticket;
        struct move_box *box;
        int wake_fd;
    } job;
};

void mover_create(struct mover *mover, struct device *device, struct stream *stream);
/* Plans the move that the device has begun. The box must stay until mover_join; wake_fd, an eventfd, is written once
 * the reply is there. Where no thread can be started, the caller's thread plans. After mover_join moves are refused. */
void mover_ask(struct mover *mover, struct move_box *box, int wake_fd);
/* Takes the reply. 0: it is not there yet. */
int mover_take(struct mover *mover, struct move_box *box, char reply[COMMAND_MAX_REPLY]);
/* Ends the thread. A move that is under way is refused, and so are later moves. To be called after the casters are
 * joined. */
void mover_join(struct mover *mover);

#endif
