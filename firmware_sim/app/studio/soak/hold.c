/* SPDX-License-Identifier: MIT */
/* A client that waits for a reply leaves its frames with the library, which keeps 64 MiB of them. At pace fast the head
 * fills that within a second, and a reply may be out for five. So the head has to wait for the client. The head can't
 * see how far the client has read. The clean reader can, and the head waits for the clean reader. */
#include "firmware_sim/app/studio/soak/clean.h"
#include "firmware_sim/app/studio/soak/frame.h"
#include "firmware_sim/app/studio/soak/hold.h"
#include "firmware_sim/app/studio/soak/ledger.h"
#include "firmware_sim/app/studio/soak/link.h"
#include "firmware_sim/app/studio/soak/soak.h"
#include "firmware_sim/base/clock.h"

/* MOST_BYTES is half of what the library keeps, since the head's own queues come on top. PATIENCE_NS is longer than a
 * client waits for a reply (ask.c). A client that stands still for longer may wait for device time, which must go on. */
enum { MOST_FRAMES = SOAK_RING / 4, MOST_BYTES = 32 << 20 };
static const int64_t PATIENCE_NS = 6000000000, STEP_NS = 1000000;

/* Whether the frames from `reached` on are too many. 0: the client has read none. */
static int is_far(struct soak *soak, soak_seq reached)
{
    struct soak_clean *c = &soak->clean;
    pthread_mutex_lock(&c->lock);
    const struct soak_clean_frame *at = &c->ring[reached % SOAK_RING];
    const uint64_t n = reached == 0 ? c->frames : c->top > reached ? c->top - reached : 0;
    const uint64_t before = at->there && at->seq == reached ? at->end_byte : reached == 0 ? 0 : c->bytes;
    const int is_so = n > MOST_FRAMES || (n != 0 && c->bytes - before > MOST_BYTES);
    pthread_mutex_unlock(&c->lock);
    return is_so;
}

static int must_wait(struct soak *soak, struct soak_link *link)
{
    pthread_mutex_lock(&link->lock);
    const int is_open = link->is_open;
    const soak_seq reached = link->reached;
    pthread_mutex_unlock(&link->lock);
    if (!is_open || !is_far(soak, reached)) {
        link->held_from_ns = 0;
        return 0;
    }
    const int64_t now_ns = clock_now_ns();
    if (link->held_from_ns == 0 || link->held_at != reached) link->held_from_ns = now_ns;
    link->held_at = reached;
    return now_ns - link->held_from_ns < PATIENCE_NS;
}

int soak_hold(struct soak *soak)
{
    const soak_seq top = soak_clean_top(soak);
    int waits = 0;
    for (uint32_t i = 0; i < soak->n_links; i++)
        if (soak->link[i].usable && soak->link[i].datagrams == NULL) soak_saw_none(&soak->link[i], top);
    if (soak->realtime || atomic_load(&soak->phase) == SOAK_ENDS) return 0;
    for (uint32_t i = 0; i < soak->n_links; i++)
        waits |= soak->link[i].usable && must_wait(soak, &soak->link[i]);
    if (waits) clock_sleep_until_ns(clock_now_ns() + STEP_NS);
    return waits;
}
