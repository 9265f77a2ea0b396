/* SPDX-License-Identifier: MIT */
/* Casters: threads that claim ticks ahead of their time, compute them and put them into the stream. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/loop/loop_inside.h"

enum { MOST_TICKS = 128 };             /* that a caster claims together */
static const int64_t SAY_NS = 2000000; /* the first tick that is ready after this time ends its batch */

/* With claim_lock held. */
static int may_claim(struct loop *loop)
{
    const struct casters *casters = &loop->casters;
    enum config_pace pace = loop->cfg->loop.pace;
    if (casters->next_tick >= stream_released(&loop->stream) + casters->ahead_ticks) return 0;
    if (pace == PACE_STEP && casters->next_tick >= atomic_load(&loop->stream.granted)) return 0;
    return pace != PACE_FAST || !device_is_idle(loop->device);
}

int loop_settles(struct loop *loop)
{
    struct casters *casters = &loop->casters;
    pthread_mutex_lock(&casters->claim_lock);
    const int is_released = stream_released(&loop->stream) >= casters->next_tick;
    const int settles = device_settles(loop->device) || (device_is_idle(loop->device) && !is_released);
    pthread_mutex_unlock(&casters->claim_lock);
    return settles;
}

/* Whether as many ticks as the caster wants may be claimed now. They are at most half of the ticks ahead, so there
 * is room for them once the ticks on their way are released. With claim_lock held. */
static int has_room(const struct loop_caster *caster)
{
    const struct casters *casters = &caster->loop->casters;
    return casters->next_tick + caster->wanted <= stream_released(&caster->loop->stream) + casters->ahead_ticks;
}

/* Claims the next tick, as number i of the caster's. 1: work and slot are set; 0: not now; -1: the run is over. With
 * claim_lock held. */
static int claim_tick(struct loop_caster *caster, uint32_t i)
{
    struct loop *loop = caster->loop;
    struct casters *casters = &loop->casters;
    struct device_work *work = &caster->work[i];
    /* Once another caster has found the end, nobody wakes this one when there is more room. */
    if (atomic_load(&loop->stopping) || atomic_load(&loop->final_tick) != UINT64_MAX) return -1;
    if (!may_claim(loop) || (i == 0 && !has_room(caster))) return 0;
    if (device_claim(loop->device, work) != 0) {
        /* A tick that is still being computed may be lost. Its events then need one more tick to go out with. So the
         * run is over only once no tick is being computed. */
        if (atomic_load(&casters->n_computing) != 0) return 0;
        atomic_store(&loop->final_tick, casters->next_tick);
        return -1;
    }
    atomic_fetch_add(&casters->n_computing, 1);
    if (work->power != DEVICE_POWER_STAYS) stream_power(&loop->stream, work->tick);
    caster->slot[i] = ring_claim(&loop->stream.ring, work->tick);
    casters->next_tick = work->tick + 1;
    return 1;
}

/* Sets how many ticks the caster wants, with the one claimed already: about those up to the pulse `end`; 0: one. */
static void set_wanted(struct loop_caster *caster, uint64_t end)
{
    const struct device_work *first = &caster->work[0];
    const double tick_pulses = 1e-15 * (double)first->prr_uhz * (double)caster->loop->stream.tick_ns;
    const double ticks = end != 0 ? ceil((double)(end - first->pulse0) / tick_pulses) : 1.0;
    caster->wanted = ticks < (double)caster->room ? (uint32_t)ticks : caster->room;
}

/* Notes how many pulses the caster has claimed, for the watch of the cost. With claim_lock held. */
static void note_claimed(struct loop_caster *caster, uint32_t n)
{
    _Atomic uint64_t *most = &caster->loop->casters.most_claimed;
    uint64_t pulses = 0;
    for (uint32_t i = 0; i < n; i++)
        pulses += caster->work[i].n_cast;
    if (pulses > atomic_load(most)) atomic_store(most, pulses);
}

/* Claims one tick, or several whose lines are cast together. Returns how many; -1: the run is over. */
static int claim(struct loop_caster *caster)
{
    struct casters *casters = &caster->loop->casters;
    pthread_mutex_lock(&casters->claim_lock);
    int n = claim_tick(caster, 0);
    caster->looks_ahead = 0;
    if (n > 0 && caster->room > 1) {
        const uint64_t end = worker_end_ahead(caster->worker, &caster->work[0]);
        caster->looks_ahead = end != 0;
        set_wanted(caster, end);
        while (n < (int)caster->wanted && claim_tick(caster, (uint32_t)n) > 0)
            n++;
    }
    if (n > 0) note_claimed(caster, (uint32_t)n);
    pthread_mutex_unlock(&casters->claim_lock);
    return n;
}

/* Makes the tick in its slot. 0: the slot has no room, and there is no memory for more. The lack is reported once per
 * episode. */
static int casters_fill(struct loop_caster *caster, const struct device_work *work, struct ring_slot *slot)
{
    struct loop *loop = caster->loop;
    _Atomic int *no_memory = &loop->casters.no_memory;
    if (worker_fill(caster->worker, work, slot) == SH_OK) {
        if (atomic_load(no_memory)) atomic_store(no_memory, 0);
        return 1;
    }
    if (atomic_exchange(no_memory, 1) == 0) device_report(loop->device, CMD_E_PULSES, "no memory for a tick");
    return 0;
}

/* 1: the tick is ready. */
static int compute(struct loop_caster *caster, const struct device_work *work, struct ring_slot *slot)
{
    struct loop *loop = caster->loop;
    if (slot == NULL) return 0;
    if (work->tick < atomic_load(&loop->casters.drop_until)) {
        ring_drop(slot);
        return 0;
    }
    struct casters *casters = &loop->casters;
    int whole = casters_fill(caster, work, slot);
    if (ring_ready(slot, work->tick)) {
        if (atomic_load(&casters->in_vain)) atomic_store(&casters->in_vain, 0);
        return whole;
    }
    /* This tick came too late, and the next ones are as late: computing each in turn would lose them all. So half of
     * the ticks ahead are left out, which gives the others their time. Where half was not enough, all but one are left
     * out. */
    const uint64_t lead = atomic_exchange(&casters->in_vain, 1) ? casters->ahead_ticks - 1 : casters->ahead_ticks / 2;
    atomic_store(&casters->drop_until, stream_released(&loop->stream) + lead);
    return 0;
}

/* A tick is ready. In the paces that wait, the pacing thread is notified once per batch: before the ticks ahead are
 * used up, after SAY_NS, and when this caster goes to sleep. */
static void note_ready(struct loop_caster *caster, uint64_t tick)
{
    struct loop *loop = caster->loop;
    if (!loop->stream.waits) {
        stream_say_late(&loop->stream, tick);
        return;
    }
    const int64_t now_ns = clock_now_ns();
    caster->unsaid++;
    if (caster->unsaid * loop->casters.n < loop->casters.ahead_ticks / 2 && now_ns - caster->said_ns < SAY_NS) return;
    stream_say_ready(&loop->stream);
    caster->unsaid = 0;
    caster->said_ns = now_ns;
}

static void sleep_caster(struct loop_caster *caster)
{
    if (caster->unsaid != 0) stream_say_ready(&caster->loop->stream);
    caster->unsaid = 0;
    stream_wait_for_work(&caster->loop->stream);
}

static void make_tick(struct loop_caster *caster, uint32_t i)
{
    struct loop *loop = caster->loop;
    struct device_work *work = &caster->work[i];
    if (!compute(caster, work, caster->slot[i])) device_lost(loop->device, work);
    device_done(work);
    atomic_fetch_sub(&loop->casters.n_computing, 1);
    note_ready(caster, work->tick);
}

static void *caster_main(void *arg)
{
    struct loop_caster *caster = arg;
    for (int n; (n = claim(caster)) >= 0;) {
        if (n == 0) sleep_caster(caster);
        if (caster->looks_ahead) worker_look_ahead(caster->worker, caster->work, (uint32_t)n);
        for (int i = 0; i < n; i++)
            make_tick(caster, (uint32_t)i);
        if (caster->looks_ahead) worker_forget(caster->worker);
    }
    stream_poke(&caster->loop->stream); /* so that the other casters see the end, too */
    return NULL;
}

/* In the pace `fast` there is time to claim several ticks. The ticks ahead are cut into one share more than there are
 * casters, so that a caster need not wait until all of its last ticks are released. */
static int create_caster(struct loop *loop, uint32_t n, struct loop_caster *caster, struct sh_err *err)
{
    const uint64_t room = loop->casters.ahead_ticks / (n + 1);
    caster->loop = loop;
    caster->room = loop->cfg->loop.pace != PACE_FAST || room < 2 ? 1 : room < MOST_TICKS ? (uint32_t)room : MOST_TICKS;
    caster->work = calloc(caster->room, sizeof *caster->work);
    caster->slot = calloc(caster->room, sizeof *caster->slot);
    if (caster->work == NULL || caster->slot == NULL) return sh_fail(err, SH_ENOMEM, "loop: no memory for a caster");
    int rc = worker_create(loop->site, &caster->worker, err);
    if (rc == SH_OK && caster->room > 1) rc = worker_add_ahead(caster->worker, err);
    return rc;
}

int casters_create(struct loop *loop, uint32_t n, struct sh_err *err)
{
    struct casters *casters = &loop->casters;
    int rc = SH_OK;
    pthread_mutex_init(&casters->claim_lock, NULL);
    for (; casters->n < n && rc == SH_OK; casters->n++)
        rc = create_caster(loop, n, &casters->caster[casters->n], err);
    loop->stream.n_casters = casters->n;
    return rc;
}

int casters_start(struct loop *loop, struct sh_err *err)
{
    struct casters *casters = &loop->casters;
    for (; casters->n_running < casters->n; casters->n_running++) {
        struct loop_caster *caster = &casters->caster[casters->n_running];
        int e = pthread_create(&caster->thread, NULL, caster_main, caster);
        if (e != 0) return sh_fail(err, SH_EIO, "loop: no thread for a caster: %s", strerror(e));
    }
    return SH_OK;
}

void casters_join(struct loop *loop)
{
    for (uint32_t i = 0; i < loop->casters.n_running; i++)
        pthread_join(loop->casters.caster[i].thread, NULL);
}

void casters_free(struct loop *loop)
{
    for (uint32_t i = 0; i < loop->casters.n; i++) {
        worker_free(loop->casters.caster[i].worker);
        free(loop->casters.caster[i].work);
        free(loop->casters.caster[i].slot);
    }
    pthread_mutex_destroy(&loop->casters.claim_lock);
}
