/* SPDX-License-Identifier: MIT */
/* The clients as the head sees them: their sessions and requests, and the faults that disturbed them. In: calls of the
 * links and of the board of faults, from any thread. Out: how long each client was away after a disturbance; which
 * frames each session was given. */
#ifndef FIRMWARE_SIM_APP_STUDIO_VERDICT_WATCH_H
#define FIRMWARE_SIM_APP_STUDIO_VERDICT_WATCH_H

#include <pthread.h>
#include <stdint.h>

#include "firmware_sim/config/limits.h"
#include "firmware_sim/fault/board.h"
#include "firmware_sim/loop/links.h"

/* A fault ended a session, made its client end it, or kept a client out. Times of clock_now_ns(); 0: not yet. */
struct watch_break {
    uint32_t link; /* from 1 */
    enum fault_kind kind;
    int64_t over_ns; /* the earliest time at which a client can come back */
    int64_t back_ns; /* when one did */
    char peer[64];   /* of the session that ended */
};

/* Device time of the stream that a session was given. */
struct watch_span {
    uint32_t session;
    int64_t from_ns, to_ns; /* to_ns INT64_MAX: it is open */
};

/* A native frame that a drop or a truncation has destroyed for a session. */
struct watch_spoiled {
    uint32_t session, seq;
};

struct watch_link {
    uint32_t open; /* sessions */
    int acted;     /* a fault ends its sessions or silences them, now or soon: */
    enum fault_kind kind;
    int64_t over_ns;
};

enum { WATCH_REFUSED = 3, WATCH_LINE = 80 };

struct watch {
    pthread_mutex_t lock;
    struct links_observer observer;
    uint32_t n_links, chosen; /* chosen: the client's, from 1 */
    uint32_t must_ask;        /* bit per link: a client there is back with its first request, not with its connection */
    int64_t limit_ns; /* a fault that leaves sessions open counts as the cause of their end up to this long after it */
    int is_over;      /* 1: the run ends, so that sessions that end now are no client's doing */
    int is_short;     /* 1: there was no memory for something */
    struct watch_link link[CONFIG_MAX_LINKS];
    struct watch_break *broken;
    struct watch_span *span; /* of the chosen link */
    struct watch_spoiled *spoiled;
    size_t n_broken, room_broken, n_span, room_span, n_spoiled, room_spoiled;
    int64_t first_open_ns; /* of the chosen link */
    uint64_t injected, stalls, heard_bytes, wrong, wrong_state;
    char refused[WATCH_REFUSED][2 * WATCH_LINE]; /* the first wrong requests */
    char last[WATCH_LINE];                       /* what was heard last, printable */
};

/* Links after the first n_links are not watched. limit_s: the time that a client has to come back. */
void watch_begin(struct watch *watch, uint32_t n_links, uint32_t chosen, double limit_s);
void watch_end(struct watch *watch);
void watch_free(struct watch *watch);
/* The board of faults calls this for each fault. */
void watch_note(void *watch, const struct fault_note *note);
/* Whether all clients that a disturbance sent away are back, and the chosen link has a session. */
int watch_is_whole(struct watch *watch);
/* When the last disturbance so far is over. */
int64_t watch_over_ns(struct watch *watch);
int64_t watch_first_open_ns(struct watch *watch);

#endif
