#include "firmware_sim/loop/stream.h"

#include <errno.h>
#include <sys/eventfd.h>
#include <time.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/base/clock.h"

static const int64_t PATIENCE_NS = 2000000000;

int stream_create(struct stream *stream, const struct ring_size *size, int64_t tick_ns, struct sh_err *err)
{
    stream->tick_ns = tick_ns;
    sem_init(&stream->work, 0, 0);
    sem_init(&stream->ready, 0, 0);
    sem_init(&stream->progress, 0, 0);
    return ring_create(&stream->ring, size, err);
}

void stream_free(struct stream *stream)
{
    ring_free(&stream->ring);
    sem_destroy(&stream->work);
    sem_destroy(&stream->ready);
    sem_destroy(&stream->progress);
}

/* all: also those that want nothing of this tick. */
static void wake_readers(struct stream *stream, uint64_t tick, int all)
{
    for (uint32_t i = 0; i < stream->n_listeners; i++)
        if (all || atomic_load(&stream->listener[i].wake_tick) <= tick)
            eventfd_write(stream->listener[i].fd, 1); /* a full counter is a wake-up, too */
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

/* Lost is what was cast and not delivered. It is known here: all ticks before were released or lost. */
static void complete_counts(struct stream *stream, uint8_t *frame)
{
    struct native_header header;
    native_read_header(frame, &header);
    if (header.type == NATIVE_TELEMETRY) complete_telemetry(stream, frame, &header);
    if (header.type == NATIVE_EVENT) complete_event(stream, frame, &header);
}

static void count(struct stream *stream, const struct ring_tick *tick, int64_t now_ns)
{
    struct device_counters *c = stream->counters;
    atomic_fetch_add(&c->pulses, tick->n_cast);
    if (tick->n_cast != 0) scan_of(stream, tick->scan)->delivered += tick->n_cast;
    atomic_fetch_add(&c->echoes, tick->hits.echoes);
    atomic_fetch_add(&c->crowded, tick->hits.crowded);
    atomic_fetch_add(&c->faint, tick->hits.faint);
    atomic_fetch_add(&c->unfit, tick->hits.unfit);
    atomic_fetch_add(&c->lines, tick->n_lines);
    if (tick->n_fired == 0) return;
    if (atomic_load(&stream->first_pulse_ns) == 0) atomic_store(&stream->first_pulse_ns, now_ns);
    atomic_store(&stream->last_pulse_ns, now_ns);
}

void stream_release(struct stream *stream, struct ring_slot *slot, uint64_t tick, int64_t now_ns)
{
    struct ring_tick *made = &slot->tick;
    finish_lines(stream, made);
    slot->first_seq = stream->seq;
    slot->pulses_before = atomic_load(&stream->counters->pulses);
    count(stream, made, now_ns);
    for (uint32_t at = 0; at < made->len;) {
        uint8_t *frame = made->bytes + at;
        complete_counts(stream, frame);
        at += (uint32_t)native_seal(frame, stream->seq++);
        kept_put(&stream->kept, frame);
    }
    slot->n_frames = stream->seq - slot->first_seq;
    /* Where the pacing thread waits for readers, they must see empty ticks pass, too. */
    const int all = made->len != 0 || stream->waits;
    ring_release(&stream->ring, tick);
    wake_readers(stream, tick, all);
    sem_post(&stream->work);
}

int stream_lose(struct stream *stream, uint64_t tick)
{
    if (!ring_lose(&stream->ring, tick)) return 0;
    stream->line_broken = 1;
    sem_post(&stream->work);
    return 1;
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

void stream_wait_for_readers(struct stream *stream, uint64_t tick)
{
    if (!atomic_load(&stream->ending)) {
        sem_wait(&stream->progress);
        return;
    }
    int64_t until_ns = clock_now_ns() + PATIENCE_NS;
    struct timespec until = {.tv_sec = until_ns / 1000000000, .tv_nsec = until_ns % 1000000000};
    if (sem_clockwait(&stream->progress, CLOCK_MONOTONIC, &until) == 0 || errno != ETIMEDOUT) return;
    for (int i = 0; i < RING_MAX_READERS; i++)
        if (holds_back(stream, i, tick)) atomic_store(&stream->reader[i].active, 0);
}

void stream_end(struct stream *stream)
{
    atomic_store(&stream->over, 1);
    wake_readers(stream, 0, 1);
}

struct stream_listener *stream_listen(struct stream *stream, int fd)
{
    struct stream_listener *listener = &stream->listener[stream->n_listeners++];
    listener->fd = fd;
    atomic_store(&listener->wake_tick, UINT64_MAX);
    return listener;
}

int stream_wake_at(struct stream *stream, struct stream_listener *listener, uint64_t tick)
{
    atomic_store(&listener->wake_tick, tick);
    return tick < stream_released(stream);
}

void stream_set_reader(struct stream *stream, int reader, uint64_t cursor, int active)
{
    atomic_store(&stream->reader[reader].active, active);
    stream_move_reader(stream, reader, cursor);
}

void stream_move_reader(struct stream *stream, int reader, uint64_t cursor)
{
    atomic_store(&stream->reader[reader].cursor, cursor);
    if (stream->waits) sem_post(&stream->progress);
}

uint64_t stream_released(const struct stream *stream)
{
    return atomic_load(&stream->ring.released);
}

uint64_t stream_grant(struct stream *stream, uint64_t ns)
{
    return atomic_fetch_add(&stream->granted_ns, ns) + ns;
}

uint64_t stream_pass(struct stream *stream, uint64_t total_ns)
{
    uint64_t tick = total_ns / (uint64_t)stream->tick_ns;
    atomic_store(&stream->granted, tick);
    return tick;
}

void stream_poke(struct stream *stream)
{
    for (uint32_t i = 0; i < stream->n_casters; i++)
        sem_post(&stream->work);
    if (stream->waits) {
        sem_post(&stream->ready);
        sem_post(&stream->progress);
    }
}
