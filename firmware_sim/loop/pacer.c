/* The pacing thread: releases each tick when its time has come. It takes no lock, allocates and logs nothing,
 * and calls the system for the clock and for wake-ups alone. */
#include <errno.h>
#include <sched.h>
#include <string.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/loop/loop_inside.h"

enum { PACER_PRIORITY = 80 };

static uint32_t late_bucket(uint64_t ns)
{
    if (ns < 8) return (uint32_t)ns;
    uint32_t top = 63U - (uint32_t)__builtin_clzll(ns);
    return (top - 2) * 8 + (uint32_t)(ns >> (top - 3) & 7);
}

double pacer_late_us(const struct loop *loop, double q)
{
    const struct pacer *pacer = &loop->pacer;
    uint64_t total = 0, seen = 0;
    for (uint32_t i = 0; i < LATE_BUCKETS; i++)
        total += atomic_load(&pacer->late[i]);
    for (uint32_t i = 0; i < LATE_BUCKETS && total != 0; i++) {
        seen += atomic_load(&pacer->late[i]);
        if ((double)seen < q * (double)total) continue;
        double upper_ns = i < 8 ? (double)(i + 1) : (double)((uint64_t)(8 + i % 8 + 1) << (i / 8 - 1));
        return upper_ns * 1e-3;
    }
    return 0.0;
}

static void note_late(struct loop *loop, int64_t late_ns)
{
    struct device_counters *counters = loop->stream.counters;
    uint64_t ns = late_ns > 0 ? (uint64_t)late_ns : 0;
    atomic_fetch_add(&loop->pacer.late[late_bucket(ns)], 1);
    if (late_ns > loop->stream.tick_ns) atomic_fetch_add(&counters->late_blocks, 1);
    if (ns > atomic_load(&counters->late_max_ns)) atomic_store(&counters->late_max_ns, ns);
}

/* A tick that is not ready late_ms after its time is given up, even one that will never be: when casters come
 * late to find that the run is over, the pacing thread may be beyond its end. What the pacing thread itself
 * overslept is added to late_ms (credit) until it has caught up. */
static void pace_realtime(struct loop *loop)
{
    struct stream *stream = &loop->stream;
    const int64_t tick_ns = stream->tick_ns, late_ns = (int64_t)(loop->cfg->loop.late_ms * 1e6);
    int64_t epoch_ns = loop->pacer.epoch_ns, credit_ns = 0;
    for (uint64_t tick = 0; !atomic_load(&loop->stopping) && tick < atomic_load(&loop->final_tick);) {
        int64_t due_ns = epoch_ns + (int64_t)(tick + 1) * tick_ns;
        int64_t now_ns = clock_now_ns();
        /* Not ready in time: look again on the next beat of the clock. */
        int64_t wake_ns = due_ns > now_ns ? due_ns : now_ns + tick_ns - (now_ns - epoch_ns) % tick_ns;
        if (due_ns > now_ns || ring_peek(&stream->ring, tick) == NULL) {
            clock_sleep_until_ns(wake_ns);
            now_ns = clock_now_ns();
            if (now_ns - wake_ns > credit_ns) credit_ns = now_ns - wake_ns;
        }
        struct ring_slot *slot = ring_peek(&stream->ring, tick);
        if (slot != NULL) {
            note_late(loop, now_ns - due_ns);
            if (now_ns - due_ns <= tick_ns) credit_ns = 0;
            stream_release(stream, slot, tick++, now_ns);
        } else if (now_ns - due_ns > late_ns + credit_ns && stream_lose(stream, tick)) {
            tick++;
        }
    }
}

static void pace_waiting(struct loop *loop)
{
    struct stream *stream = &loop->stream;
    for (uint64_t tick = 0; !atomic_load(&loop->stopping) && tick < atomic_load(&loop->final_tick);) {
        struct ring_slot *slot = ring_peek(&stream->ring, tick);
        if (slot == NULL)
            stream_wait_for_casters(stream);
        else if (!stream_has_room(stream, tick))
            stream_wait_for_readers(stream, tick);
        else
            stream_release(stream, slot, tick++, clock_now_ns());
    }
}

static void *pacer_main(void *arg)
{
    struct loop *loop = arg;
    if (loop->stream.waits)
        pace_waiting(loop);
    else
        pace_realtime(loop);
    stream_end(&loop->stream);
    return NULL;
}

static int create_realtime(struct pacer *pacer, struct loop *loop)
{
    struct sched_param param = {.sched_priority = PACER_PRIORITY};
    pthread_attr_t attr;
    pthread_attr_init(&attr);
    pthread_attr_setinheritsched(&attr, PTHREAD_EXPLICIT_SCHED);
    pthread_attr_setschedpolicy(&attr, SCHED_FIFO);
    pthread_attr_setschedparam(&attr, &param);
    int rc = pthread_create(&pacer->thread, &attr, pacer_main, loop);
    pthread_attr_destroy(&attr);
    if (rc == EPERM)
        sh_warn(loop->options.report, "no SCHED_FIFO for the pacing thread (%s): raise RLIMIT_RTPRIO to %d",
                strerror(rc), PACER_PRIORITY);
    return rc;
}

int pacer_start(struct loop *loop, struct sh_err *err)
{
    struct pacer *pacer = &loop->pacer;
    const char *warning;
    pacer->epoch_ns = clock_now_ns();
    int rc = loop->source.ops->power_up(loop->source.self, pacer->epoch_ns, &warning, err);
    if (rc != SH_OK) return rc;
    if (warning != NULL) sh_warn(loop->options.report, "%s", warning);
    int failed = loop->stream.waits ? EPERM : create_realtime(pacer, loop);
    if (failed == EPERM) failed = pthread_create(&pacer->thread, NULL, pacer_main, loop);
    if (failed != 0) return sh_fail(err, SH_EIO, "loop: no pacing thread: %s", strerror(failed));
    pacer->running = 1;
    return SH_OK;
}

void pacer_join(struct loop *loop)
{
    if (loop->pacer.running) pthread_join(loop->pacer.thread, NULL);
}
