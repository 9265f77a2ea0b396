/* SPDX-License-Identifier: MIT */
/* The pacing thread: releases each tick when its time has come. It takes no lock, allocates and logs nothing. In real
 * time it calls the system only for the clock, to sleep until a tick's time, for wake-ups, and to wait for a tick that
 * is late. In the paces `fast` and `step` it waits for casters, files and readers instead. */
#include <errno.h>
#include <sched.h>
#include <string.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/loop/loop_inside.h"

enum { PACER_PRIORITY = 80 };

static void pace_realtime(struct loop *loop)
{
    struct stream *stream = &loop->stream;
    struct pace *pace = &loop->pacer.pace;
    int64_t now_ns = clock_now_ns(), until_ns;
    pace_begin(pace, now_ns);
    for (uint64_t tick = 0; !atomic_load(&loop->stopping) && tick < atomic_load(&loop->final_tick);
         now_ns = clock_now_ns()) {
        struct ring_slot *slot = ring_peek(&stream->ring, tick);
        if (tick > pace->together_until) pace->together_until = stream_next_wake(stream, tick);
        switch (pace_look(pace, tick, slot != NULL, now_ns, &until_ns)) {
        case PACE_SLEEP:
            clock_sleep_until_ns(until_ns);
            break;
        case PACE_AWAIT:
            stream_await(stream, tick, until_ns);
            break;
        case PACE_RELEASE:
            stream_release(stream, slot, tick, now_ns);
            pace_released(pace, tick++, clock_now_ns());
            break;
        /* This tick may be after the run's end: the pacing thread gets there when the casters, being late, have not yet
         * found that the run is over. */
        case PACE_GIVE_UP:
            tick += stream_lose(stream, tick) != 0;
            break;
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
        else if (loop->source.ops->files_fill(loop->source.self) && !atomic_load(&stream->ending))
            stream_wait_for_files(stream);
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
    const char *warning = NULL;
    pacer->pace.tick_ns = loop->stream.tick_ns;
    pacer->pace.late_ns = (int64_t)(loop->cfg->loop.late_ms * 1e6);
    pacer->pace.counters = loop->stream.counters;
    pacer->pace.epoch_ns = clock_now_ns();
    const struct loop_source *source = &loop->source;
    if (source->ops->power_up != NULL) {
        const int rc = source->ops->power_up(source->self, pacer->pace.epoch_ns, &warning, err);
        if (rc != SH_OK) return rc;
    }
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
