/* SPDX-License-Identifier: MIT */
#include <stdlib.h>

#include "core/bytes.h"
#include "drivers/host/scanhead.h"
#include "drivers/link/link.h"
#include "firmware_sim/app/studio/soak/clean.h"
#include "firmware_sim/app/studio/record/offline.h"
#include "firmware_sim/app/studio/soak/frame.h"
#include "firmware_sim/app/studio/soak/hold.h"
#include "firmware_sim/app/studio/soak/soak.h"

enum { NEXT_MS = 50, REPLY_MS = 5000 };

uint64_t soak_digest(const struct scanhead_frame *frame)
{
    return (uint64_t)le_get32(frame->raw + 24) << 32 | le_get32(frame->raw + 12); /* the CRC of header and payload */
}

soak_seq soak_seq_of(struct soak *soak, uint32_t seq)
{
    uint64_t base = atomic_load(&soak->base), first = UINT64_C(1) << 32 | seq;
    if (base == 0) base = atomic_compare_exchange_strong(&soak->base, &base, first) ? first : base;
    return base + (uint64_t)(int64_t)(int32_t)(seq - (uint32_t)base);
}

static void clean_keep(struct soak *soak, const struct scanhead_frame *frame)
{
    struct soak_clean *c = &soak->clean;
    if ((frame->flags & SCANHEAD_LOCAL) != 0) return;
    const soak_seq seq = soak_seq_of(soak, frame->seq);
    atomic_store(&soak->base, seq);
    pthread_mutex_lock(&c->lock);
    c->bytes += frame->raw_len;
    c->ring[seq % SOAK_RING] = (struct soak_clean_frame){.seq = seq,
                                                         .digest = soak_digest(frame),
                                                         .t_ns = frame->t_ns,
                                                         .len = (uint32_t)frame->raw_len,
                                                         .end_byte = c->bytes,
                                                         .there = 1};
    c->top = seq;
    c->frames++;
    c->last_t_ns = frame->t_ns;
    if (frame->type == SCANHEAD_POINTS && c->points_frames++ == 0) c->first_points_ns = frame->t_ns;
    pthread_mutex_unlock(&c->lock);
}

int soak_clean_get(struct soak *soak, soak_seq seq, struct soak_clean_frame *out)
{
    struct soak_clean *c = &soak->clean;
    pthread_mutex_lock(&c->lock);
    *out = c->ring[seq % SOAK_RING];
    pthread_mutex_unlock(&c->lock);
    return out->there && out->seq == seq;
}

int64_t soak_clean_t_ns(struct soak *soak)
{
    pthread_mutex_lock(&soak->clean.lock);
    const int64_t t_ns = soak->clean.last_t_ns;
    pthread_mutex_unlock(&soak->clean.lock);
    return t_ns;
}

soak_seq soak_clean_top(struct soak *soak)
{
    pthread_mutex_lock(&soak->clean.lock);
    const soak_seq top = soak->clean.top;
    pthread_mutex_unlock(&soak->clean.lock);
    return top;
}

/* Asks for the head's identity and state. */
static void clean_ask(struct soak_clean *c)
{
    if (scanhead_command(c->sh, "*IDN?", c->idn, sizeof c->idn, REPLY_MS) != SCANHEAD_OK) c->idn[0] = '\0';
    if (scanhead_command(c->sh, "HEAD:STATe?", c->state, sizeof c->state, REPLY_MS) != SCANHEAD_OK) c->state[0] = '\0';
    atomic_store(&c->want_health, 2);
}

static void *read_clean(void *arg)
{
    struct soak *soak = arg;
    struct soak_clean *c = &soak->clean;
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    int rc;
    while ((rc = scanhead_next(c->sh, &frame, NEXT_MS)) == SCANHEAD_OK || rc == SCANHEAD_ETIMEOUT) {
        if (rc == SCANHEAD_OK) clean_keep(soak, &frame);
        do
            if (atomic_load(&c->want_health) == 1) clean_ask(c);
        while (soak_hold(soak));
    }
    if (atomic_load(&soak->phase) != SOAK_ENDS) snprintf(c->failed, sizeof c->failed, "%.255s", scanhead_error(c->sh));
    scanhead_hash_hex(c->sh, c->sha256);
    scanhead_get_stats(c->sh, &stats);
    c->reader_lost = stats.reader_lost;
    return NULL;
}

int soak_clean_open(struct soak *soak, struct sh_err *err)
{
    struct soak_clean *c = &soak->clean;
    pthread_mutex_init(&c->lock, NULL);
    c->ring = calloc(SOAK_RING, sizeof *c->ring);
    if (c->ring == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the clean stream");
    c->link.waits = LINK_WAITS_YES;
    const int fd = offline_connect("the clean reader", &c->link, &c->sh, err);
    if (fd < 0) return fd;
    scanhead_hash_start(c->sh);
    return SH_OK;
}

int soak_clean_start(struct soak *soak, struct sh_err *err)
{
    soak->clean.running = pthread_create(&soak->clean.thread, NULL, read_clean, soak) == 0;
    return soak->clean.running ? SH_OK : sh_fail(err, SH_EIO, "no thread for the clean reader");
}

void soak_clean_join(struct soak *soak)
{
    if (soak->clean.running) pthread_join(soak->clean.thread, NULL);
    soak->clean.running = 0;
}

void soak_clean_close(struct soak *soak)
{
    struct soak_clean *c = &soak->clean;
    scanhead_close(c->sh);
    c->sh = NULL;
    free(c->ring);
    c->ring = NULL;
}
