/* SPDX-License-Identifier: MIT */
/* The clean stream: a thread reads it within this process, where faults of links don't reach. Frames of links are
 * compared with it. */
#ifndef FIRMWARE_SIM_APP_STUDIO_SOAK_CLEAN_H
#define FIRMWARE_SIM_APP_STUDIO_SOAK_CLEAN_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>

#include "core/err.h"
#include "drivers/host/scanhead.h"
#include "drivers/link/link.h"
#include "firmware_sim/app/studio/soak/frame.h"

struct soak;

struct soak_clean {
    pthread_mutex_t lock;
    struct soak_clean_frame *ring;
    soak_seq top; /* the last one */
    uint64_t frames, points_frames, bytes;
    /* the thread's own */
    struct link_spec link;
    struct scanhead *sh;
    pthread_t thread;
    int running;
    atomic_int want_health;   /* 1: the thread is to ask for identity and state; 2: it has asked */
    char idn[256], state[64]; /* the answers; empty: none came */
    char sha256[65];
    uint64_t reader_lost;
    int64_t first_points_ns, last_t_ns; /* device time; 0: none so far */
    char failed[256];                   /* why it ended before the head did; empty: it did not */
};

int soak_clean_open(struct soak *soak, struct sh_err *err);
int soak_clean_start(struct soak *soak, struct sh_err *err);
/* To be called after the head has ended. */
void soak_clean_join(struct soak *soak);
void soak_clean_close(struct soak *soak);
/* 0: the frame is not known (any more, or not yet). */
int soak_clean_get(struct soak *soak, soak_seq seq, struct soak_clean_frame *out);
soak_seq soak_clean_top(struct soak *soak);
/* Device time of the last frame. Frames that are marked LOCAL count nowhere here. */
int64_t soak_clean_t_ns(struct soak *soak);
uint64_t soak_digest(const struct scanhead_frame *frame);
/* A number on the wire, as 64 bits. */
soak_seq soak_seq_of(struct soak *soak, uint32_t seq);

#endif
