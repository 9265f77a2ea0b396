/* SPDX-License-Identifier: MIT */
/* Private to the files of the loop: struct loop. Each of its parts belongs to one of these files. */
#ifndef FIRMWARE_SIM_LOOP_LOOP_INSIDE_H
#define FIRMWARE_SIM_LOOP_LOOP_INSIDE_H

#include <pthread.h>

#include "firmware_sim/loop/cost_watch.h"
#include "firmware_sim/loop/hash.h"
#include "firmware_sim/loop/loop.h"
#include "firmware_sim/loop/pace.h"
#include "firmware_sim/loop/player.h"
#include "firmware_sim/loop/pose_feed.h"
#include "firmware_sim/loop/stream.h"
#include "firmware_sim/loop/time_client.h"
#include "firmware_sim/loop/work.h"

struct loop_caster {
    struct loop *loop;
    struct worker *worker;
    pthread_t thread;
    uint64_t unsaid; /* ticks made since the pacing thread was last notified */
    int64_t said_ns; /* when it was last notified, clock_now_ns() */
    /* ticks that it has claimed together; in other paces than `fast` there is room for one */
    struct device_work *work;
    struct ring_slot **slot; /* NULL: lost already */
    uint32_t room, wanted;   /* there is room for so many ticks, and so many are wanted together */
    int looks_ahead;         /* 1: the lines of the claimed ticks are cast together first */
};

/* casters.c */
struct casters {
    struct loop_caster caster[CONFIG_MAX_THREADS];
    uint32_t n, n_running;
    uint64_t ahead_ticks; /* most ticks that are claimed and not released */
    pthread_mutex_t claim_lock;
    uint64_t next_tick;            /* under claim_lock */
    _Atomic uint64_t most_claimed; /* pulses that one caster has claimed together, at most */
    _Atomic uint32_t n_computing;  /* claimed ticks that are neither ready nor reported lost yet */
    _Atomic uint64_t drop_until;   /* ticks before this one are not worth computing any more */
    _Atomic int in_vain;           /* the last tick that was computed came too late */
    _Atomic int no_memory;         /* the last tick had no room in its slot, which is reported */
};

/* pacer.c */
struct pacer {
    pthread_t thread;
    int running;
    struct pace pace; /* in real time; its epoch is device time 0 */
};

struct loop {
    const struct config *cfg;
    struct loop_source source;
    /* of a head that computes; else NULL */
    const struct site *site;
    struct device *device;
    struct loop_options options;
    struct stream stream;
    struct casters casters; /* none where the source makes its ticks itself */
    struct player player;
    struct pacer pacer;
    struct links links;
    struct hasher *hasher;       /* NULL: none is wanted */
    struct cost_watch *cost;     /* NULL: nobody is to be warned */
    struct pose_feed *feed;      /* of a live platform in real time; NULL: none */
    struct time_client *client;  /* of a time server; NULL: none is asked */
    _Atomic uint64_t final_tick; /* first tick after the run's end; UINT64_MAX while unknown */
    _Atomic int stopping;        /* give up waiting for anything */
};

int casters_create(struct loop *loop, uint32_t n, struct sh_err *err);
int casters_start(struct loop *loop, struct sh_err *err);
void casters_join(struct loop *loop);
void casters_free(struct loop *loop);

/* Starts device time, and the thread. In real time the thread has real-time priority; where that is not permitted,
 * there is a warning. */
int pacer_start(struct loop *loop, struct sh_err *err);
void pacer_join(struct loop *loop);

#endif
