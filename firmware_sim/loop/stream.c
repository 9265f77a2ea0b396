/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/stream.h"

#include <sys/eventfd.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/base/clock.h"

static const int64_t PATIENCE_NS = 2000000000;

int stream_create(struct stream *stream, const struct ring_size *size, int64_t tick_ns, struct sh_err *err)
{
    stream->tick_ns = tick_ns;
    /* In real time casters are woken when a quarter of the ticks ahead is free. The casters then have the time of three
     * quarters left if they have to wait for a processor. Fewer ticks per wake-up would cost more, since caches are
     * cold each time. In the paces that wait, some threads fill the queue while others empty it. */
    stream->say_ticks = 1 + (stream->waits ? size->queue_ticks / 4 : size->ahead_ticks / 4);
    stream->lazy_ticks = 1 + size->queue_ticks / 8;
    atomic_store(&stream->wanted, UINT64_MAX);
    atomic_store(&stream->awaited, UINT64_MAX);
    wakeup_create(&stream->work);
    wakeup_create(&stream->pace);
    return ring_create(&stream->ring, size, err);
}

void stream_free(struct stream *stream)
{
    ring_free(&stream->ring);
    wakeup_free(&stream->work);
    wakeup_free(&stream->pace);
}

/* Real time: wakes the listeners that wait for this tick. */
static void wake_readers(struct stream *stream, uint64_t tick, int frames)
{
    for (uint32_t i = 0; i < stream->n_listeners; i++) {
        struct stream_listener *listener = &stream->listener[i];
        listener->pending |= (frames && atomic_load(&listener->wants_frames)) ||
                             atomic_load(&listener->wake_tick) <= tick || stream->wakes_all;
        if (!listener->pending || tick < listener->quiet_until) continue;
        listener->pending = 0;
        listener->quiet_until = tick + listener->every;
        eventfd_write(listener->fd, 1); /* a full counter is a wake-up, too */
    }
    stream->wakes_all = 0;
}

static void wake_casters(struct stream *stream)
{
    wakeup_signal(&stream->work, stream->unsaid < stream->n_casters ? (uint32_t)stream->unsaid : stream->n_casters);
    stream->unsaid = 0;
}

/* In the paces that wait, readers must see empty ticks pass, too. */
static void say_released(struct stream *stream)
{
    if (stream->unsaid == 0) return;
    for (uint32_t i = 0; i < stream->n_listeners; i++)
        if (atomic_load(&stream->listener[i].wants_frames) || stream->wakes_all)
            eventfd_write(stream->listener[i].fd, 1);
    stream->wakes_all = 0;
    wake_casters(stream);
}

static void wake(struct stream *stream, uint64_t tick, int frames)
{
    stream->unsaid++;
    if (!stream->waits) wake_readers(stream, tick, frames);
    if (stream->unsaid < stream->say_ticks) return;
    if (stream->waits)
        say_released(stream);
    else
        wake_casters(stream);
}

/* Line ends get their counts of echoes; 0 says that blocks of the line are missing. */
static void finish_lines(struct stream *stream, struct ring_tick *tick)
{
    if (tick->broken) stream->line_broken = 1;
    for (uint32_t i = 0; i < tick->n_marks; i++) {
        struct ring_mark *mark = &tick->mark[i];
        ring_hits_add(&stream->line, &mark->before);
        if (stream->line_broken) stream->line = (struct ring_hits){0};
        mark->end.n_echoes = stream->line.echoes;
        mark->end.n_crowded = stream->line.crowded;
        mark->end.n_faint = stream->line.faint;
        mark->end.n_unfit = stream->line.unfit;
        native_encode_line_end(tick->bytes + mark->frame_at, tick->len - mark->frame_at, &mark->end, mark->scan_t0_ns);
        stream->line = (struct ring_hits){0};
        stream->line_broken = 0;
    }
    ring_hits_add(&stream->line, &tick->tail);
}

static struct stream_scan *scan_of(struct stream *stream, uint64_t number)
{
    struct stream_scan *scan = &stream->scan[number % STREAM_SCANS];
    if (scan->number < number) *scan = (struct stream_scan){.number = (uint32_t)number};
    return scan;
}

static void complete_telemetry(struct stream *stream, uint8_t *frame, const struct native_header *header)
{
    const struct device_counters *c = stream->counters;
    struct native_telemetry t;
    if (native_decode_telemetry(frame + NATIVE_HEADER_LEN, header->length, &t) != SH_OK) return;
    t.pulses = atomic_load(&c->pulses);
    t.echoes = atomic_load(&c->echoes);
    t.lines = atomic_load(&c->lines);
    t.lost_pulses -= t.pulses;
    t.scan_lost -= scan_of(stream, t.scan)->delivered;
    native_encode_telemetry(frame, native_frame_len(frame), &t, header->t_ns, header->flags);
}

static void complete_event(struct stream *stream, uint8_t *frame, const struct native_header *header)
{
    struct native_event event;
    if (native_decode_event(frame + NATIVE_HEADER_LEN, header->length, &event) != SH_OK) return;
    if (event.code != NATIVE_EV_SCAN_END) return;
    event.c -= scan_of(stream, event.a)->delivered;
    native_encode_event(frame, native_frame_len(frame), &event, header->t_ns, header->flags);
}

/* Lost pulses were cast and not delivered. The lost pulses are known here: all ticks before were released or lost. */
static void complete_counts(struct stream *stream, uint8_t *frame)
{
    struct native_header header;
    native_read_header(frame, &header);
    if (header.type == NATIVE_TELEMETRY) complete_telemetry(stream, frame, &header);
    if (header.type == NATIVE_EVENT) complete_event(stream, frame, &header);
}

static void stream_count(struct stream *stream, const struct ring_tick *tick, int64_t now_ns)
{
    struct device_counters *c = stream->counters;
    atomic_fetch_add(&c->pulses, tick->n_cast);
    if (tick->n_cast != 0) scan_of(stream, tick->scan)->delivered += tick->n_cast;
    atomic_fetch_add(&c->echoes, tick->hits.echoes);
    atomic_fetch_add(&c->empty, tick->hits.empty);
    atomic_fetch_add(&c->crowded, tick->hits.crowded);
    atomic_fetch_add(&c->faint, tick->hits.faint);
    atomic_fetch_add(&c->unfit, tick->hits.unfit);
    atomic_fetch_add(&c->lost_samples, tick->hits.lost_samples);
    atomic_fetch_add(&c->lines, tick->n_lines);
    if (tick->n_fired == 0) return;
    if (atomic_load(&stream->first_pulse_ns) == 0) atomic_store(&stream->first_pulse_ns, now_ns);
    atomic_store(&stream->last_pulse_ns, now_ns);
}

/* When power goes, the line at hand has no end. */
static void pass_power(struct stream *stream, uint64_t tick)
{
    while (stream_power_tick(stream, stream->power_passed) <= tick) {
        stream->power_passed++;
        stream->wakes_all = 1;
        stream->line = (struct ring_hits){0};
        stream->line_broken = 0;
    }
}

void stream_release(struct stream *stream, struct ring_slot *slot, uint64_t tick, int64_t now_ns)
{
    struct ring_tick *made = &slot->tick;
    pass_power(stream, tick);
    finish_lines(stream, made);
    slot->first_seq = stream->seq;
    slot->pulses_before = atomic_load(&stream->counters->pulses);
    stream_count(stream, made, now_ns);
    for (uint32_t at = 0; at < made->len;) {
        uint8_t *frame = made->bytes + at;
        if (stream->as_they_are) {
            at += (uint32_t)native_frame_len(frame);
            stream->seq += (frame[3] & NATIVE_LOCAL) == 0;
        } else {
            complete_counts(stream, frame);
            at += (uint32_t)native_finish_frame(frame, stream->seq++);
        }
        latched_put(&stream->latched, frame);
    }
    slot->n_frames = stream->seq - slot->first_seq;
    const int frames = made->len != 0; /* a released slot is no longer ours */
    ring_release(&stream->ring, tick);
    wake(stream, tick, frames);
}

int stream_lose(struct stream *stream, uint64_t tick)
{
    if (!ring_lose(&stream->ring, tick)) return 0;
    pass_power(stream, tick);
    stream->line_broken = 1;
    wake(stream, tick, 0);
    return 1;
}

static uint64_t earlier(uint64_t a, uint64_t b)
{
    return a < b ? a : b;
}

/* Whether a tick has frames is not known yet. If it has, they may wait for `every` - 1 more ticks. */
uint64_t stream_next_wake(const struct stream *stream, uint64_t tick)
{
    const uint64_t power = stream_power_tick(stream, stream->power_passed);
    uint64_t next = tick + stream->say_ticks - stream->unsaid - 1; /* casters */
    for (uint32_t i = 0; i < stream->n_listeners; i++) {
        const struct stream_listener *listener = &stream->listener[i];
        uint64_t at = listener->pending ? tick : earlier(atomic_load(&listener->wake_tick), power);
        if (atomic_load(&listener->wants_frames)) at = earlier(at, tick + listener->every - 1);
        if (at < listener->quiet_until) at = listener->quiet_until;
        next = earlier(next, at);
    }
    return next > tick ? next : tick;
}

/* Either this thread sees that the tick became ready, or its caster sees that the tick is awaited. */
void stream_await(struct stream *stream, uint64_t tick, int64_t until_ns)
{
    atomic_store(&stream->awaited, tick);
    if (ring_peek(&stream->ring, tick) == NULL) wakeup_sleep_until(&stream->pace, until_ns);
    atomic_store(&stream->awaited, UINT64_MAX);
}

static int holds_back(const struct stream *stream, int reader, uint64_t tick)
{
    const struct stream_reader *r = &stream->reader[reader];
    return atomic_load(&r->active) && atomic_load(&r->cursor) + stream->ring.queue_ticks <= tick + 1;
}

int stream_has_room(const struct stream *stream, uint64_t tick)
{
    for (int i = 0; i < RING_MAX_READERS; i++)
        if (holds_back(stream, i, tick)) return 0;
    return 1;
}

void stream_wait_for_casters(struct stream *stream)
{
    say_released(stream);
    wakeup_sleep(&stream->pace);
}

/* The run is to end: waits for readers, but not for ever. Wake-ups by other readers, and by commands, give the tick no
 * more time. */
static void wait_patiently(struct stream *stream, uint64_t tick)
{
    if (stream->held_tick != tick) stream->held_until_ns = clock_now_ns() + PATIENCE_NS;
    stream->held_tick = tick;
    wakeup_sleep_until(&stream->pace, stream->held_until_ns);
    if (clock_now_ns() < stream->held_until_ns) return;
    for (int i = 0; i < RING_MAX_READERS; i++)
        if (holds_back(stream, i, tick)) atomic_store(&stream->reader[i].active, 0);
}

/* A reader that gets to `wanted` signals at once; any other one signals before it sleeps. */
void stream_wait_for_readers(struct stream *stream, uint64_t tick)
{
    say_released(stream);
    atomic_store(&stream->wanted, tick + 2 - stream->ring.queue_ticks + stream->ring.queue_ticks / 4);
    if (stream_has_room(stream, tick)) {
        /* the reader went on meanwhile */
    } else if (!atomic_load(&stream->ending)) {
        wakeup_sleep(&stream->pace);
    } else {
        wait_patiently(stream, tick);
    }
    atomic_store(&stream->wanted, UINT64_MAX);
}

void stream_wait_for_files(struct stream *stream)
{
    say_released(stream);
    wakeup_sleep_until(&stream->pace, clock_now_ns() + STREAM_FILES_NS);
}

void stream_end(struct stream *stream)
{
    atomic_store(&stream->over, 1);
    for (uint32_t i = 0; i < stream->n_listeners; i++)
        eventfd_write(stream->listener[i].fd, 1);
}

struct stream_listener *stream_listen(struct stream *stream, int fd, uint64_t every)
{
    struct stream_listener *listener = &stream->listener[stream->n_listeners++];
    *listener = (struct stream_listener){.fd = fd, .every = every};
    atomic_store(&listener->wants_frames, 1);
    atomic_store(&listener->wake_tick, UINT64_MAX);
    return listener;
}

int stream_wake_at(struct stream *stream, struct stream_listener *listener, int frames, uint64_t tick)
{
    const int wanted = atomic_exchange(&listener->wants_frames, frames);
    atomic_store(&listener->wake_tick, tick);
    return tick < stream_released(stream) || (frames && !wanted);
}

/* Clears the flag, so that a listener is woken once; one that still waits sets it again. */
static void wake_steppers(struct stream *stream)
{
    for (uint32_t i = 0; i < stream->n_listeners; i++)
        if (atomic_load(&stream->listener[i].wants_written) && atomic_exchange(&stream->listener[i].wants_written, 0))
            eventfd_write(stream->listener[i].fd, 1);
}

void stream_set_reader(struct stream *stream, int reader, uint64_t cursor, int active)
{
    atomic_store(&stream->reader[reader].active, active);
    atomic_store(&stream->reader[reader].cursor, cursor);
    atomic_store(&stream->reader[reader].written, cursor);
    stream_rest_reader(stream);
    wake_steppers(stream); /* nobody waits for a reader that is gone */
}

void stream_move_reader(struct stream *stream, int reader, uint64_t cursor)
{
    const uint64_t from = atomic_exchange(&stream->reader[reader].cursor, cursor);
    const uint64_t wanted = atomic_load(&stream->wanted);
    if (from < wanted && wanted <= cursor) wakeup_signal(&stream->pace, 1);
}

void stream_note_written(struct stream *stream, int reader, uint64_t cursor)
{
    if (!stream->steps) return;
    const uint64_t from = atomic_exchange(&stream->reader[reader].written, cursor);
    if (from < cursor && cursor >= atomic_load(&stream->granted)) wake_steppers(stream);
}

int stream_has_written(struct stream *stream, struct stream_listener *listener, int reader, uint64_t tick)
{
    /* Set the flag before looking: a reader that writes meanwhile either sees the flag, or is seen here. */
    atomic_store(&listener->wants_written, 1);
    for (int i = 0; i < STREAM_HASH_READER; i++) {
        const struct stream_reader *r = &stream->reader[i];
        if (i != reader && atomic_load(&r->active) && atomic_load(&r->written) < tick) return 0;
    }
    return 1; /* the flag stays: another session of this listener may still wait */
}

void stream_rest_reader(struct stream *stream)
{
    if (atomic_load(&stream->wanted) != UINT64_MAX) wakeup_signal(&stream->pace, 1);
}

void stream_wait_for_work(struct stream *stream)
{
    wakeup_sleep(&stream->work);
}

void stream_say_ready(struct stream *stream)
{
    wakeup_signal(&stream->pace, 1);
}

void stream_say_late(struct stream *stream, uint64_t tick)
{
    if (atomic_load(&stream->awaited) == tick) wakeup_signal(&stream->pace, 1);
}

uint64_t stream_released(const struct stream *stream)
{
    return atomic_load(&stream->ring.released);
}

void stream_power(struct stream *stream, uint64_t tick)
{
    const uint32_t n = atomic_load(&stream->n_power);
    atomic_store(&stream->power_tick[n % STREAM_POWER_TICKS], tick);
    atomic_store(&stream->n_power, n + 1);
}

uint64_t stream_power_tick(const struct stream *stream, uint32_t i)
{
    return i < atomic_load(&stream->n_power) ? atomic_load(&stream->power_tick[i % STREAM_POWER_TICKS]) : UINT64_MAX;
}

/* Changes with even numbers: power goes; with odd ones, it comes. */
static uint64_t change_from(const struct stream *stream, uint32_t odd, uint64_t cursor)
{
    const uint32_t n = atomic_load(&stream->n_power);
    for (uint32_t i = odd + (n > STREAM_POWER_TICKS ? (n - STREAM_POWER_TICKS + 1) & ~1U : 0); i < n; i += 2)
        if (stream_power_tick(stream, i) >= cursor) return stream_power_tick(stream, i);
    return UINT64_MAX;
}

uint64_t stream_off_tick(const struct stream *stream, uint64_t cursor)
{
    return change_from(stream, 0, cursor);
}

uint64_t stream_on_tick(const struct stream *stream, uint64_t cursor)
{
    return change_from(stream, 1, cursor);
}

uint64_t stream_grant(struct stream *stream, uint64_t ns)
{
    return atomic_fetch_add(&stream->granted_ns, ns) + ns;
}

uint64_t stream_pass(struct stream *stream, uint64_t total_ns)
{
    const uint64_t tick = total_ns / (uint64_t)stream->tick_ns;
    uint64_t seen = atomic_load(&stream->granted);
    /* The run's end, or a later grant of another session, may have let more time pass by now. That time is not taken
     * back. */
    while (seen < tick && !atomic_compare_exchange_weak(&stream->granted, &seen, tick))
        continue;
    return tick;
}

void stream_poke(struct stream *stream)
{
    wakeup_signal(&stream->work, stream->n_casters);
    wakeup_signal(&stream->pace, 1);
}
