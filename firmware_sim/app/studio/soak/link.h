/* SPDX-License-Identifier: MIT */
/* A link of a soak: its client, its ledger, and the rows of its sheet. */
#ifndef FIRMWARE_SIM_APP_STUDIO_SOAK_LINK_H
#define FIRMWARE_SIM_APP_STUDIO_SOAK_LINK_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>

#include "drivers/host/scanhead.h"
#include "firmware_sim/app/studio/soak/ask.h"
#include "firmware_sim/app/studio/soak/frame.h"
#include "firmware_sim/app/studio/soak/head.h"
#include "firmware_sim/app/studio/soak/ledger.h"
#include "firmware_sim/app/studio/soak/row.h"
#include "firmware_sim/app/studio/soak/usb.h"

struct soak;
struct soak_datagrams;

struct soak_link {
    struct soak *soak;
    uint32_t number; /* from 1 */
    char type[16], endpoint[512];
    char source[192];       /* what the client opens */
    const char *not_soaked; /* why the link has no client; NULL: it has one */
    int usable;             /* 1: it has a client */
    pthread_t thread;
    int running;
    atomic_int done; /* the client has seen the end */

    pthread_mutex_t lock; /* of all that follows */
    struct soak_row row[SOAK_N_ROWS];
    struct soak_fact *fact;
    int begun, in_session;
    int is_open;                       /* a connection is there, perhaps without a frame so far */
    soak_seq judged, first, last, top; /* next to be judged; first and last that were received; newest with an entry */
    soak_seq reached;     /* the client has read up to here, or it had no session until then; 0: not known so far */
    uint64_t too_far;     /* reports of frames that the client was too far behind */
    soak_seq held_at;     /* `reached` when the clean reader began to wait for the client */
    int64_t held_from_ns; /* clock, then; 0: it does not wait */
    uint64_t frames, bytes, refused_frames, sessions, closings;
    uint64_t lost_plain;        /* frames that are missing without a fault */
    uint64_t reader_lost;       /* frames that the head says it left out, since the client was too slow */
    uint64_t dropped;           /* frames that the client's library dropped while it waited for a reply */
    uint64_t wrong_plain;       /* differ from the clean frame without a fault, or came twice */
    uint64_t unknown;           /* the clean reader did not get them */
    uint64_t odd_closings;      /* the connection was closed without a fault */
    int64_t odd_ns, no_open_ns; /* last such closing, and last failed attempt to connect; 0: never */
    uint64_t away;              /* frames that came while there was no session */
    /* Bytes that belong to no frame: as the client counted them, and the least and the most that the faults explain.
     * The most includes frames that may not have arrived, and a reply that was destroyed with such bytes. */
    uint64_t bad_bytes, expected_bad_min, expected_bad_max;
    struct soak_run run[SOAK_MAX_RUNS];
    uint32_t n_runs;
    struct soak_act act[SOAK_MAX_ACTS], refusal[SOAK_MAX_ACTS];
    uint32_t n_acts, n_refusals;
    struct soak_plugs plugs;
    int was_cut; /* an act that keeps clients out for a while may still do so */
    struct soak_moment moment[SOAK_MAX_MOMENTS];
    uint32_t n_moments;
    struct soak_times times;
    int have_pulse;
    uint64_t pulse0;   /* of the last points frame */
    double usual_rate; /* of the mirror, rad/s; 0: not known */
    int64_t offset_ns; /* the smallest time from a frame's device time to its arrival */
    int have_offset;
    struct soak_ask ask;
    char failed[256];                 /* why the client gave up; empty: it did not */
    uint64_t bad_units;               /* datagrams that equal no clean one */
    struct soak_datagrams *datagrams; /* NULL: its datagrams are not compared */
    /* the client's own */
    struct scanhead *sh;
    char idn[256];
};

#endif
