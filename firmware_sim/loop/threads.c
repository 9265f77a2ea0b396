/* Casters and the pacing thread. */
#include <errno.h>
#include <sched.h>
#include <string.h>
#include <time.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/loop/loop_inside.h"

static const int64_t PATIENCE_NS = 2000000000;

void loop_poke(struct loop *loop)
{
    for (uint32_t i = 0; i < loop->n_threads; i++)
        sem_post(&loop->work);
    if (loop_waits(loop)) {
        sem_post(&loop->ready);
        sem_post(&loop->progress);
    }
}

/* With claim_lock held. */
static int may_claim(struct loop *loop)
{
    uint64_t released = atomic_load(&loop->ring.released);
    if (loop->next_tick >= released + loop->ahead_ticks) return 0;
    if (loop->cfg->loop.pace == PACE_STEP && loop->next_tick >= atomic_load(&loop->granted)) return 0;
    return loop->cfg->loop.pace != PACE_FAST || !device_is_idle(loop->device);
}

static void tick_lost(struct loop *loop, const struct device_work *work)
{
    uint64_t first, n_cast = worker_count_cast(work, &first);
    device_lost(loop->device, work, n_cast, first);
}

/* Claims the next tick. 1: work and slot are set (slot NULL: lost already); 0: not now; -1: the run is over. */
static int claim(struct loop *loop, struct device_work *work, struct ring_slot **slot)
{
    int got = 0;
    pthread_mutex_lock(&loop->claim_lock);
    if (atomic_load(&loop->stopping)) {
        got = -1;
    } else if (may_claim(loop)) {
        if (device_claim(loop->device, atomic_load(&loop->ring.released), work) != 0) {
            /* A tick that is still computed may yet be lost; what it says then needs one more. */
            if (atomic_load(&loop->n_computing) == 0) {
                atomic_store(&loop->final_tick, loop->next_tick);
                got = -1;
            }
        } else {
            atomic_fetch_add(&loop->n_computing, 1);
            *slot = ring_claim(&loop->ring, work->tick);
            loop->next_tick = work->tick + 1;
            got = 1;
        }
    }
    pthread_mutex_unlock(&loop->claim_lock);
    return got;
}

/* A block that was computed in vain: the next ones are as late. Taking up each in turn just before its time is over
 * would lose them all; so leave out as many as give those behind them half the time ahead. */
static void skip_ahead(struct loop *loop)
{
    atomic_store(&loop->drop_until, atomic_load(&loop->ring.released) + loop->ahead_ticks / 2);
}

/* 1: the tick is ready. */
static int compute(struct loop_caster *caster, const struct device_work *work, struct ring_slot *slot)
{
    struct loop *loop = caster->loop;
    if (slot == NULL) return 0;
    if (work->tick < atomic_load(&loop->drop_until)) {
        ring_drop(slot);
        return 0;
    }
    worker_fill(caster->worker, work, slot, loop->slot_bytes);
    if (ring_ready(&loop->ring, slot, work->tick)) return 1;
    skip_ahead(loop);
    return 0;
}

void *loop_caster_main(void *arg)
{
    struct loop_caster *caster = arg;
    struct loop *loop = caster->loop;
    struct device_work work;
    for (;;) {
        struct ring_slot *slot = NULL;
        int got = claim(loop, &work, &slot);
        if (got < 0) break;
        if (got == 0) {
            while (sem_wait(&loop->work) != 0 && errno == EINTR)
                continue;
            continue;
        }
        if (!compute(caster, &work, slot)) tick_lost(loop, &work);
        atomic_fetch_sub(&loop->n_computing, 1);
        if (loop_waits(loop)) sem_post(&loop->ready);
    }
    if (loop_waits(loop)) sem_post(&loop->ready);
    sem_post(&loop->work); /* the next one learns of the end, too */
    return NULL;
}

static uint32_t late_bucket(uint64_t ns)
{
    if (ns < 8) return (uint32_t)ns;
    uint32_t top = 63U - (uint32_t)__builtin_clzll(ns);
    return (top - 2) * 8 + (uint32_t)(ns >> (top - 3) & 7);
}

static void wake_all(struct loop *loop)
{
    for (uint32_t i = 0; i < loop->n_pumps; i++)
        pump_wake(loop->pump[i]);
    if (loop->hasher != NULL) hasher_wake(loop->hasher);
}

/* Line ends get their counts of echoes; 0 says that blocks of the line are missing. */
static void finish_lines(struct loop *loop, struct ring_slot *slot)
{
    for (uint32_t i = 0; i < slot->n_marks; i++) {
        struct ring_mark *mark = &slot->mark[i];
        ring_hits_add(&loop->line, &mark->before);
        if (loop->line_broken) loop->line = (struct ring_hits){0};
        mark->end.n_echoes = loop->line.echoes;
        mark->end.n_crowded = loop->line.crowded;
        mark->end.n_faint = loop->line.faint;
        mark->end.n_unfit = loop->line.unfit;
        native_encode_line_end(slot->bytes + mark->frame_at, loop->slot_bytes - mark->frame_at, &mark->end,
                               mark->scan_t0_ns);
        loop->line = (struct ring_hits){0};
        loop->line_broken = 0;
    }
    ring_hits_add(&loop->line, &slot->tail);
}

static void count(struct loop *loop, const struct ring_slot *slot, int64_t now_ns)
{
    struct device_counters *c = loop->counters;
    atomic_fetch_add(&c->pulses, slot->n_cast);
    atomic_fetch_add(&c->fired, slot->n_fired);
    atomic_fetch_add(&c->echoes, slot->n_echoes);
    if ((slot->n_crowded | slot->n_faint | slot->n_unfit) != 0) {
        atomic_fetch_add(&c->crowded, slot->n_crowded);
        atomic_fetch_add(&c->faint, slot->n_faint);
        atomic_fetch_add(&c->unfit, slot->n_unfit);
    }
    atomic_fetch_add(&c->lines, slot->n_lines);
    if (slot->n_fired == 0) return;
    if (atomic_load(&loop->first_pulse_ns) == 0) atomic_store(&loop->first_pulse_ns, now_ns);
    atomic_store(&loop->last_pulse_ns, now_ns);
}

static void release(struct loop *loop, struct ring_slot *slot, uint64_t tick, int64_t now_ns)
{
    finish_lines(loop, slot);
    slot->first_seq = loop->seq;
    for (uint32_t at = 0; at < slot->len;)
        at += (uint32_t)native_seal(slot->bytes + at, loop->seq++);
    count(loop, slot, now_ns);
    /* Where the pacing thread waits for readers, they must see empty ticks pass, too. */
    int wake = slot->len != 0 || slot->wake || loop_waits(loop);
    ring_release(&loop->ring, tick);
    if (wake) wake_all(loop);
    sem_post(&loop->work);
}

static void note_late(struct loop *loop, int64_t late_ns)
{
    uint64_t ns = late_ns > 0 ? (uint64_t)late_ns : 0;
    atomic_fetch_add(&loop->late[late_bucket(ns)], 1);
    if (late_ns > loop->tick_ns) atomic_fetch_add(&loop->counters->late_blocks, 1);
    if (ns > atomic_load(&loop->counters->late_max_ns)) atomic_store(&loop->counters->late_max_ns, ns);
}

static void pace_realtime(struct loop *loop)
{
    const int64_t late_ns = (int64_t)(loop->cfg->loop.late_ms * 1e6);
    int64_t epoch_ns = loop->epoch_ns, credit_ns = 0;
    for (uint64_t tick = 0; !atomic_load(&loop->stopping) && tick != atomic_load(&loop->final_tick);) {
        int64_t due_ns = epoch_ns + (int64_t)(tick + 1) * loop->tick_ns;
        int64_t now_ns = clock_now_ns();
        /* Not ready in time: look again on the next beat of the clock. */
        int64_t wake_ns = due_ns > now_ns ? due_ns : now_ns + loop->tick_ns - (now_ns - epoch_ns) % loop->tick_ns;
        if (due_ns > now_ns || ring_peek(&loop->ring, tick) == NULL) {
            clock_sleep_until_ns(wake_ns);
            now_ns = clock_now_ns();
            if (now_ns - wake_ns > credit_ns) credit_ns = now_ns - wake_ns;
        }
        struct ring_slot *slot = ring_peek(&loop->ring, tick);
        if (slot != NULL) {
            note_late(loop, now_ns - due_ns);
            if (now_ns - due_ns <= loop->tick_ns) credit_ns = 0;
            release(loop, slot, tick++, now_ns);
        } else if (now_ns - due_ns > late_ns + credit_ns && ring_lose(&loop->ring, tick)) {
            tick++;
            loop->line_broken = 1;
            sem_post(&loop->work);
        }
    }
}

static int holds_back(const struct loop *loop, int reader, uint64_t tick)
{
    const struct loop_reader *r = &loop->reader[reader];
    return atomic_load(&r->active) && atomic_load(&r->cursor) + loop->ring.queue_ticks <= tick + 1;
}

static int readers_have_room(const struct loop *loop, uint64_t tick)
{
    for (int i = 0; i < RING_MAX_READERS; i++)
        if (holds_back(loop, i, tick)) return 0;
    return 1;
}

/* Until a reader goes on. Once the run is to end, readers who let PATIENCE_NS pass hold back nothing any more. */
static void wait_for_readers(struct loop *loop, uint64_t tick)
{
    if (!atomic_load(&loop->ending)) {
        sem_wait(&loop->progress);
        return;
    }
    int64_t until_ns = clock_now_ns() + PATIENCE_NS;
    struct timespec until = {.tv_sec = until_ns / 1000000000, .tv_nsec = until_ns % 1000000000};
    if (sem_clockwait(&loop->progress, CLOCK_MONOTONIC, &until) == 0 || errno != ETIMEDOUT) return;
    for (int i = 0; i < RING_MAX_READERS; i++)
        if (holds_back(loop, i, tick)) atomic_store(&loop->reader[i].active, 0);
}

static void pace_waiting(struct loop *loop)
{
    for (uint64_t tick = 0; !atomic_load(&loop->stopping) && tick != atomic_load(&loop->final_tick);) {
        struct ring_slot *slot = ring_peek(&loop->ring, tick);
        if (slot == NULL) {
            sem_wait(&loop->ready);
        } else if (!readers_have_room(loop, tick)) {
            wait_for_readers(loop, tick);
        } else {
            release(loop, slot, tick++, clock_now_ns());
        }
    }
}

void *loop_pacer_main(void *arg)
{
    struct loop *loop = arg;
    if (loop_waits(loop))
        pace_waiting(loop);
    else
        pace_realtime(loop);
    atomic_store(&loop->pacer_done, 1);
    wake_all(loop);
    return NULL;
}
