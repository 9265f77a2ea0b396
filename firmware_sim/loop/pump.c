/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/pump.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "drivers/link/memory.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/loop/pump_inside.h"

/* At the end a reader may take this long between two bytes, and bytes held back by faults this long in all. */
static const int64_t DRAIN_NS = 2000000000;

void pump_say(void *owner, const char *text)
{
    const struct pump *pump = owner;
    struct link_place place;
    pump_get_place(pump, &place);
    sh_warn(pump->links->report, "link %s: %s", place.endpoint, text);
}

static int64_t device_time_ns(void *owner)
{
    const struct pump *pump = owner;
    return (int64_t)stream_released(pump->stream) * pump->stream->tick_ns;
}

/* In the pace `step`, links stay open while the head has no power. A client may learn from another link that power has
 * changed, and come before this link's thread has carried that out (pump_power). So the stream is asked. */
static int has_no_power(void *owner)
{
    const struct pump *pump = owner;
    const uint64_t released = stream_released(pump->stream);
    uint32_t passed = pump->power_seen;
    while (stream_power_tick(pump->stream, passed) < released)
        passed++;
    return passed % 2 != 0;
}

static int open_link(struct pump *pump, const struct link_spec *spec, uint32_t index, struct sh_err *err)
{
    const struct loop_source *source = pump->links->source;
    const struct faulty_spec faults = {
        .board = pump->is_clean ? NULL : source->ops->faults(source->self),
        .number = index + 1,
        .first_session = pump->session[0].id,
        .protocol = pump->protocol,
        .room = pump->out_cap,
        .owner = pump,
        .time_ns = device_time_ns,
        .is_off = has_no_power,
        .say = pump_say,
        .source = source->self,
        .report = source->ops->report,
    };
    const int rc = faulty_open(&faults, spec, &pump->link, err);
    if (rc == SH_OK) pump->ops = faulty_ops(pump->link);
    return rc;
}

/* Returns how many ticks of real time go out together. No reader waits for a file or a null link, so these take the
 * most. */
static uint64_t ticks_a_wake_up(const struct stream *stream, const struct link_spec *spec)
{
    const uint64_t most = stream->lazy_ticks;
    const uint64_t ticks = (uint64_t)(1000000 * (int64_t)spec->latency_ms / stream->tick_ns) + 1;
    return spec->type == LINK_NULL || spec->type == LINK_FILE || ticks > most ? most : ticks;
}

int pump_open(struct links *links, uint32_t index, const struct link_spec *spec, struct pump **out, struct sh_err *err)
{
    *out = NULL;
    struct pump *pump = calloc(1, sizeof *pump);
    if (pump == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    pump->links = links;
    pump->index = index;
    pump->stream = links->stream;
    pump->is_own = spec->type == LINK_FD || spec->type == LINK_MEMORY;
    pump->is_clean = pump->is_own || spec->clean;
    pump->can_unplug = (link_faults(spec) & LINK_FAULT_BIT(LINK_FAULT_UNPLUG)) != 0;
    pump->protocol = protocol_ops_get((enum protocol_id)spec->protocol);
    pump->dialect = spec->dialect;
    pump->client = spec->type == LINK_MEMORY ? spec->memory : NULL;
    pump->out_cap = links->stream->tick_bytes + BATCH_BYTES + REPLY_ROOM;
    struct link_spec with = *spec;
    with.web = links->web;
    pump->holds = spec->waits == LINK_WAITS_YES || (spec->waits == LINK_WAITS_BY_TYPE && spec->type != LINK_WEB);
    pump->wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    int rc = pump->wake_fd < 0 ? sh_fail(err, SH_EIO, "eventfd: %s", strerror(errno)) : SH_OK;
    for (uint32_t i = 0; i < LINK_MAX_SESSIONS; i++) {
        pump->session[i].reader = (int)(index * LINK_MAX_SESSIONS + i);
        pump->session[i].id = index * LINK_MAX_SESSIONS + i + 1;
    }
    if (rc == SH_OK && pump->protocol == NULL)
        rc = sh_fail(err, SH_EINPUT, "link %s: this build does not have its protocol", link_ops_get(spec->type)->name);
    if (rc == SH_OK && !pump->protocol->passes_native) {
        with.units = 1;
        with.brief = pump->protocol->brief;
        pump->out_cap = QUEUE_UNITS * pump->protocol->max_unit + BATCH_BYTES;
        pump->tick = malloc(links->stream->tick_bytes);
        if (pump->tick == NULL) rc = sh_fail(err, SH_ENOMEM, "no memory");
    }
    if (rc == SH_OK) rc = open_link(pump, &with, index, err);
    if (rc != SH_OK) {
        pump_close(pump);
        return rc;
    }
    pump->listener = stream_listen(links->stream, pump->wake_fd, ticks_a_wake_up(links->stream, spec));
    *out = pump;
    return SH_OK;
}

void pump_close(struct pump *pump)
{
    if (pump == NULL) return;
    if (pump->link != NULL) pump->ops->close(pump->link);
    if (pump->wake_fd >= 0) close(pump->wake_fd);
    for (uint32_t i = 0; i < LINK_MAX_SESSIONS; i++) {
        free(pump->session[i].out);
        unit_queue_free(&pump->session[i].units);
    }
    free(pump->tick);
    free(pump);
}

void pump_get_place(const struct pump *pump, struct link_place *place)
{
    place->type = pump->ops->name;
    place->bytes_s = pump->ops->capacity != NULL ? pump->ops->capacity(pump->link) : 0.0;
    place->protocol = pump->protocol->name;
    pump->ops->endpoint(pump->link, place->endpoint, sizeof place->endpoint);
}

void pump_get_counts(const struct pump *pump, struct link_counts *counts)
{
    *counts = pump->counts;
    if (pump->ops->refused == NULL || pump->link == NULL) return;
    uint64_t refused = pump->ops->refused(pump->link);
    if (refused > counts->sent_units) refused = counts->sent_units;
    counts->sent_units -= refused;
    counts->lost_units += refused;
}

/* Keeps the error of the first link that failed to write or to wait; the run then fails. */
static void fail_link(struct pump *pump, const char *why)
{
    struct links *links = pump->links;
    struct link_place place;
    int none = 0;
    pump->failed = 0;
    pump_get_place(pump, &place);
    sh_warn(links->report, "link %s: %s; the rest of the stream is missing there", place.endpoint, why);
    if (atomic_compare_exchange_strong(&links->failed, &none, 1))
        sh_fail(&links->error, SH_EIO, "link %s: %s; it is cut short", place.endpoint, why);
}

static void handle(struct pump *pump, const struct link_event *event)
{
    struct session *s = &pump->session[event->session];
    switch (event->kind) {
    case LINK_OPENED:
        if (pump->is_off && pump->ops->end != NULL) /* nobody is there to take it */
            pump->ops->end(pump->link, event->session);
        else
            session_open(pump, s, event->peer);
        break;
    case LINK_CLOSED:
        if (pump->failed) fail_link(pump, event->peer);
        session_close(pump, s);
        break;
    case LINK_READABLE:
        if (s->open && !pump->protocol->passes_native)
            session_read_protocol(pump, s, event->session);
        else if (s->open)
            pump_read_commands(pump, s, event->session);
        break;
    case LINK_SHUT:
        session_shut(pump, s);
        break;
    case LINK_REFUSED:
        source_report(pump->links->source, CMD_E_REFUSED, event->peer);
        stream_poke(pump->stream);
        break;
    case LINK_NOTICE:
        pump_say(pump, event->peer);
        break;
    case LINK_WRITABLE:
    case LINK_WOKEN:
    case LINK_PLUGGED:
        break;
    }
}

/* Waits for events and handles them. Negative: poll failed; errno has the reason, or is 0. */
static int take_events(struct pump *pump, uint32_t want_write, int timeout_ms)
{
    struct link_event events[LINK_MAX_EVENTS];
    errno = 0;
    int n = pump->ops->poll(pump->link, pump->wake_fd, want_write, timeout_ms, events, LINK_MAX_EVENTS);
    for (int i = 0; i < n; i++)
        handle(pump, &events[i]);
    return n;
}

/* True while the system holds bytes that closing would discard. The system reports the last bytes a moment late. */
static int is_unread(struct pump *pump, struct session *s, int index, int64_t now_ns)
{
    static const int64_t MOMENT_NS = 20000000;
    if (pump->ops->unread == NULL || !s->open) return 0;
    const int unread = pump->ops->unread(pump->link, index);
    if (unread != s->unread) s->moved_ns = now_ns;
    s->unread = unread;
    return unread > 0 || now_ns - s->moved_ns < MOMENT_NS;
}

/* True while some session has something to write and its reader takes it. A client in memory calls for each turn of the
 * link, so it is waited for, however long it works between two turns. */
static int has_more(struct pump *pump)
{
    uint64_t released = stream_released(pump->stream);
    const int64_t now_ns = clock_now_ns();
    if (pump->over_ns == 0) pump->over_ns = now_ns;
    for (int i = 0; i < LINK_MAX_SESSIONS; i++) {
        struct session *s = &pump->session[i];
        const struct faulty_state link = faulty_look(pump->link, i);
        if (link.moved_ns > s->moved_ns) s->moved_ns = link.moved_ns;
        const int pending =
            (s->open && (s->out_pos < s->out_len || s->cursor < released || s->commands.reply_len != 0 ||
                         s->commands.moving || s->units.n != 0 || link.waits)) ||
            is_unread(pump, s, i, now_ns);
        const int in_time = now_ns - pump->over_ns < DRAIN_NS || !link.keeps_back;
        const int takes = pump->client != NULL || (in_time && now_ns - s->moved_ns < DRAIN_NS);
        if (pending && takes) return 1;
    }
    return 0;
}

/* Asks the stream to wake this thread at ticks with frames while there are sessions, and at further ticks that a
 * protocol needs. Returns 1 when such a tick passed meanwhile. */
static int set_wake(struct pump *pump)
{
    /* In the paces that wait, empty ticks wake this thread anyway. */
    const int by_frames = pump->protocol->passes_native || pump->stream->waits;
    uint64_t tick = UINT64_MAX;
    int sessions = 0;
    for (int i = 0; i < LINK_MAX_SESSIONS; i++) {
        const struct session *s = &pump->session[i];
        uint64_t wake = s->open && !by_frames ? session_wake_tick(pump, s) : UINT64_MAX;
        if (wake < tick) tick = wake;
        sessions |= s->open;
    }
    return stream_wake_at(pump->stream, pump->listener, sessions, tick);
}

/* Returns the time to wait for events, at most most_ms. */
static int timeout_ms(const struct pump *pump, int over, int most_ms)
{
    int ms = over ? 50 : -1;
    for (int i = 0; i < LINK_MAX_SESSIONS; i++)
        if (pump->session[i].open && session_waits_for_files(pump)) ms = STREAM_FILES_NS / 1000000;
    if (pump->at_once) ms = 0;
    return most_ms >= 0 && (ms < 0 || ms > most_ms) ? most_ms : ms;
}

/* Returns the session's bit where the link is full. */
static uint32_t write_one(struct pump *pump, int index)
{
    struct session *s = &pump->session[index];
    if (session_write(pump, s, index)) return 1U << index;
    if (s->open && session_is_done(pump, s)) pump->ops->end(pump->link, index);
    return 0;
}

/* Waits for events, for most_ms at most (-1: for ever), and does what there is to do. 0: there will be nothing more. */
static int pump_turn(struct pump *pump, int most_ms)
{
    const int over = atomic_load(&pump->stream->over);
    if (over && !has_more(pump) && !pump->failed) return 0; /* LINK_CLOSED still brings a failed write's reason */
    if (take_events(pump, pump->want_write, timeout_ms(pump, over, most_ms)) < 0) {
        char why[128];
        snprintf(why, sizeof why, "the wait for its clients failed: %s", errno != 0 ? strerror(errno) : "no reason");
        fail_link(pump, why);
        return 0;
    }
    pump->want_write = 0;
    for (int i = 0; i < LINK_MAX_SESSIONS; i++)
        if (pump->session[i].open) pump->want_write |= write_one(pump, i);
    stream_rest_reader(pump->stream);
    pump->at_once = pump_rest(pump);
    pump->at_once |= pump_power(pump, pump->want_write);
    pump->at_once |= set_wake(pump);
    return 1;
}

static void pump_finish(struct pump *pump)
{
    for (int i = 0; i < LINK_MAX_SESSIONS; i++) {
        if (pump->session[i].open && pump->session[i].unread > 0)
            sh_warn(pump->links->report,
                    "link %s: its reader did not read %d bytes or more from the system; they are lost", pump->ops->name,
                    pump->session[i].unread);
        if (pump->session[i].open) session_leave(pump, &pump->session[i]);
    }
    faulty_end_cable(pump->link);
    pump->is_done = 1;
    atomic_fetch_sub(&pump->links->n_busy, 1);
}

static void *pump_main(void *arg)
{
    while (pump_turn(arg, -1))
        continue;
    pump_finish(arg);
    return NULL;
}

static void turn_for_client(void *owner, int most_ms)
{
    struct pump *pump = owner;
    if (pump->is_done || pump_turn(pump, most_ms)) return;
    pump_finish(pump);
    pump->client->over = 1;
}

int pump_start(struct pump *pump, struct sh_err *err)
{
    /* Sessions that are open from the start (a file's) begin with the first tick, however late their thread starts. */
    take_events(pump, 0, 0);
    atomic_fetch_add(&pump->links->n_busy, 1);
    pump->at_once = 1; /* for these sessions */
    if (pump->client != NULL) {
        pump->client->turn = turn_for_client;
        pump->client->owner = pump;
    }
    int rc = pump->client == NULL ? pthread_create(&pump->thread, NULL, pump_main, pump) : 0;
    if (rc != 0) {
        atomic_fetch_sub(&pump->links->n_busy, 1);
        return sh_fail(err, SH_EIO, "link %s: no thread: %s", pump->ops->name, strerror(rc));
    }
    pump->running = 1;
    return SH_OK;
}

/* A memory link without a thread is finished here: its client no longer asks for turns. */
void pump_join(struct pump *pump)
{
    if (!pump->running) return;
    if (pump->client == NULL)
        pthread_join(pump->thread, NULL);
    else if (!pump->is_done)
        pump_finish(pump);
}
