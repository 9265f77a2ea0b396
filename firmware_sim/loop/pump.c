/* A link with its thread: frames and replies out, command lines in, for each of the link's sessions.
 *
 * A session has a cursor into the ring and a private copy of what it is writing, so that a slow reader holds up nobody:
 * when the ring has gone on too far it loses whole frames, is told so in a frame of its own, and goes on with the
 * present. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/loop/pump_inside.h"

int pump_open(struct loop *loop, uint32_t index, const struct link_spec *spec, struct pump **out, struct sh_err *err)
{
    *out = NULL;
    struct pump *pump = calloc(1, sizeof *pump);
    if (pump == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    pump->loop = loop;
    pump->ops = link_ops_get(spec->type);
    pump->nmea = spec->protocol == PROTOCOL_NMEA;
    pump->out_cap = loop->slot_bytes + BATCH_BYTES + REPLY_ROOM;
    pump->wake_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    int rc = pump->wake_fd < 0 ? sh_fail(err, SH_EIO, "eventfd: %s", strerror(errno)) : SH_OK;
    for (uint32_t i = 0; i < LINK_MAX_SESSIONS && rc == SH_OK; i++) {
        struct session *s = &pump->session[i];
        s->id = index * LINK_MAX_SESSIONS + i + 1;
        s->reader = (int)(s->id - 1);
    }
    if (rc == SH_OK) rc = pump->ops->open(spec, &pump->link, err);
    if (rc != SH_OK) {
        pump_close(pump);
        return rc;
    }
    *out = pump;
    return SH_OK;
}

void pump_close(struct pump *pump)
{
    if (pump == NULL) return;
    if (pump->link != NULL) pump->ops->close(pump->link);
    if (pump->wake_fd >= 0) close(pump->wake_fd);
    for (uint32_t i = 0; i < LINK_MAX_SESSIONS; i++)
        free(pump->session[i].out);
    free(pump);
}

void pump_endpoint(const struct pump *pump, char *buf, size_t len)
{
    pump->ops->endpoint(pump->link, buf, len);
}

double pump_capacity(const struct pump *pump)
{
    return pump->ops->capacity != NULL ? pump->ops->capacity(pump->link) : 0;
}

const char *pump_type(const struct pump *pump)
{
    return pump->ops->name;
}

int pump_is_nmea(const struct pump *pump)
{
    return pump->nmea;
}

void pump_wake(struct pump *pump)
{
    uint64_t one = 1;
    ssize_t n = write(pump->wake_fd, &one, sizeof one);
    (void)n; /* a full counter is a wake-up, too */
}

static void set_active(struct pump *pump, struct session *s, int active)
{
    struct loop_reader *reader = &pump->loop->reader[s->reader];
    atomic_store(&reader->cursor, s->cursor);
    atomic_store(&reader->active, active);
    if (loop_waits(pump->loop)) sem_post(&pump->loop->progress);
}

static void open_session(struct pump *pump, struct session *s, const char *peer)
{
    if (s->out == NULL) s->out = malloc(pump->out_cap);
    if (s->out == NULL) {
        device_report(pump->loop->device, CMD_E_REFUSED, "no memory for a session");
        return;
    }
    s->open = 1;
    s->cursor = atomic_load(&pump->loop->ring.released);
    s->have_seq = s->lagging = s->stepping = s->replies_dropped = 0;
    s->lost_frames = 0;
    s->out_len = s->out_pos = s->reply_len = s->in_len = s->in_pos = 0;
    s->moved_ns = clock_now_ns();
    memset(&s->lines, 0, sizeof s->lines);
    snprintf(s->peer, sizeof s->peer, "%.63s", peer); /* an address: shorter */
    set_active(pump, s, 1);
}

static void close_session(struct pump *pump, struct session *s)
{
    if (!s->open) return;
    s->open = 0;
    set_active(pump, s, 0);
    if (pump->nmea) return; /* it had nothing to say */
    device_session_closed(pump->loop->device, s->id, s->peer, s->lines.len != 0 || s->lines.overrun);
    loop_poke(pump->loop);
}

void pump_count_lost(struct pump *pump, struct session *s, uint32_t n)
{
    struct loop *loop = pump->loop;
    s->lost_frames += n;
    atomic_fetch_add(&loop->counters->reader_lost_frames, n);
    if (!s->lagging) {
        char text[96];
        snprintf(text, sizeof text, "session %u, %.50s", s->id, s->peer);
        device_report(loop->device, CMD_E_READER, text);
    }
    s->lagging = 1;
}

/* Tells the reader in a frame of its own. */
static void say_lost(struct pump *pump, struct session *s, uint32_t frames)
{
    struct loop *loop = pump->loop;
    pump_count_lost(pump, s, frames);
    struct native_event event = {.code = NATIVE_EV_READER_LOST, .a = frames, .c = s->lost_frames};
    snprintf(event.text, sizeof event.text, "%u frames lost: the reader is too slow", frames);
    int64_t t_ns = (int64_t)atomic_load(&loop->ring.released) * loop->tick_ns;
    s->out_len +=
        (uint32_t)native_encode_event(s->out + s->out_len, pump->out_cap - s->out_len, &event, t_ns, NATIVE_LOCAL);
}

/* One tick into the buffer. Returns 0 when there is none or no room. */
static int take_tick(struct pump *pump, struct session *s)
{
    struct loop *loop = pump->loop;
    uint32_t len = 0, n_frames = 0, first_seq = 0;
    uint32_t at = s->out_len + REPLY_ROOM / 8; /* leaves room for a frame that says what was lost */
    if (at >= pump->out_cap) return 0;
    enum ring_read got =
        ring_read(&loop->ring, s->reader, s->cursor, s->out + at, pump->out_cap - at, &len, &n_frames, &first_seq);
    if (got == RING_NONE || (got == RING_READ && len > pump->out_cap - at)) return 0;
    uint64_t released = atomic_load(&loop->ring.released);
    if (got == RING_LOST && s->cursor + loop->ring.queue_ticks < released) {
        s->cursor = released - loop->ring.queue_ticks / 2; /* half a queue of room to recover */
        return 1;
    }
    s->cursor++;
    if (got != RING_READ) return 1;
    /* An empty tick tells, too: what is lost may have been the last frames for long. */
    if (s->have_seq && first_seq != s->next_seq)
        say_lost(pump, s, first_seq - s->next_seq);
    else if (released - s->cursor < loop->ring.queue_ticks / 8)
        s->lagging = 0;
    s->have_seq |= n_frames != 0;
    s->next_seq = first_seq + n_frames;
    memmove(s->out + s->out_len, s->out + at, len);
    s->out_len += len;
    return 1;
}

/* Replies into the buffer; what has no room now comes with the next. */
static void take_replies(struct pump *pump, struct session *s)
{
    if (s->reply_len > pump->out_cap - s->out_len) return;
    memcpy(s->out + s->out_len, s->reply, s->reply_len);
    s->out_len += s->reply_len;
    s->reply_len = 0;
}

static void fill(struct pump *pump, struct session *s)
{
    s->out_len = s->out_pos = 0;
    take_replies(pump, s);
    if (pump->nmea) pump_take_nmea(pump, s);
    while (!pump->nmea && s->out_len < BATCH_BYTES && take_tick(pump, s))
        continue;
    /* The frames of a step go out before its reply: who has that has them all. */
    while (s->stepping && (s->cursor >= s->step_tick || atomic_load(&pump->loop->pacer_done))) {
        s->stepping = 0;
        pump_add_reply(s, s->step_reply);
        pump_take_lines(pump, s);
    }
    pump_take_lines(pump, s); /* those that waited for room */
    take_replies(pump, s);
    struct loop_reader *reader = &pump->loop->reader[s->reader];
    atomic_store(&reader->cursor, s->cursor);
    if (loop_waits(pump->loop)) sem_post(&pump->loop->progress);
}

/* Writes until the link is full (1) or there is nothing left (0). */
static int write_out(struct pump *pump, struct session *s, int index)
{
    for (;;) {
        if (s->out_pos == s->out_len) fill(pump, s);
        if (s->out_pos == s->out_len) return 0;
        ssize_t n = pump->ops->write(pump->link, index, s->out + s->out_pos, s->out_len - s->out_pos);
        if (n == 0) return 1;
        if (n < 0) {
            if (n != SH_ECLOSED) pump->failed = 1; /* the reason comes with LINK_CLOSED */
            close_session(pump, s);
            return 0;
        }
        s->out_pos += (uint32_t)n;
        s->moved_ns = clock_now_ns();
    }
}

/* The first link that could not write what it had to makes the run a failure. */
static void fail_link(struct pump *pump, const char *why)
{
    char endpoint[300];
    int none = 0;
    pump->failed = 0;
    pump->ops->endpoint(pump->link, endpoint, sizeof endpoint);
    sh_warn(pump->loop->options.report, "link %s: %s; what follows is missing there", endpoint, why);
    if (atomic_compare_exchange_strong(&pump->loop->link_failed, &none, 1))
        sh_fail(&pump->loop->link_error, SH_EIO, "link %s: %s; it is cut short", endpoint, why);
}

static void tell_notice(struct pump *pump, const char *text)
{
    char endpoint[300];
    pump->ops->endpoint(pump->link, endpoint, sizeof endpoint);
    sh_warn(pump->loop->options.report, "link %s: %s", endpoint, text);
}

static void handle(struct pump *pump, const struct link_event *event)
{
    struct session *s = &pump->session[event->session];
    switch (event->kind) {
    case LINK_OPENED:
        open_session(pump, s, event->peer);
        break;
    case LINK_CLOSED:
        if (pump->failed) fail_link(pump, event->peer);
        close_session(pump, s);
        break;
    case LINK_READABLE:
        if (s->open && pump->nmea)
            pump_skip_nmea(pump, event->session);
        else if (s->open)
            pump_read_commands(pump, s, event->session);
        break;
    case LINK_REFUSED:
        device_report(pump->loop->device, CMD_E_REFUSED, event->peer);
        loop_poke(pump->loop);
        break;
    case LINK_NOTICE:
        tell_notice(pump, event->peer);
        break;
    case LINK_WRITABLE:
    case LINK_WOKEN:
        break;
    }
}

/* True while some session has something to bring out and its reader takes it. */
static int has_more(struct pump *pump)
{
    uint64_t released = atomic_load(&pump->loop->ring.released);
    for (int i = 0; i < LINK_MAX_SESSIONS; i++) {
        struct session *s = &pump->session[i];
        int pending = s->open && (s->out_pos < s->out_len || s->cursor < released || s->reply_len != 0);
        if (pending && clock_now_ns() - s->moved_ns < DRAIN_NS) return 1;
    }
    return 0;
}

/* At the end of the run: what a reader did not get counts as lost. */
static void leave_session(struct pump *pump, struct session *s)
{
    struct loop *loop = pump->loop;
    uint32_t missing = s->have_seq ? loop->seq - s->next_seq : 0; /* the pacing thread is done with seq */
    if (pump->nmea) missing = pump_nmea_backlog(pump, s);
    if (s->out_pos < s->out_len) missing++; /* at least the frame it was in the middle of */
    if (atomic_load(&loop->pacer_done) && missing != 0) atomic_fetch_add(&loop->counters->reader_lost_frames, missing);
    set_active(pump, s, 0);
}

static void *pump_main(void *arg)
{
    struct pump *pump = arg;
    struct loop *loop = pump->loop;
    struct link_event events[LINK_MAX_EVENTS];
    uint32_t want_write = 0;
    for (;;) {
        int over = atomic_load(&loop->pacer_done);
        if (over && !has_more(pump)) break;
        int n = pump->ops->poll(pump->link, pump->wake_fd, want_write, over ? 50 : -1, events, LINK_MAX_EVENTS);
        if (n < 0) {
            sh_warn(loop->options.report, "link %s: poll failed; the link is given up", pump->ops->name);
            break;
        }
        for (int i = 0; i < n; i++)
            handle(pump, &events[i]);
        want_write = 0;
        for (int i = 0; i < LINK_MAX_SESSIONS; i++)
            if (pump->session[i].open && write_out(pump, &pump->session[i], i)) want_write |= 1U << i;
    }
    for (int i = 0; i < LINK_MAX_SESSIONS; i++)
        if (pump->session[i].open) leave_session(pump, &pump->session[i]);
    atomic_fetch_sub(&loop->pumps_busy, 1);
    return NULL;
}

int pump_start(struct pump *pump, struct sh_err *err)
{
    /* Sessions that are there from the start (a file's) begin with the first tick, however late the thread comes. */
    struct link_event events[LINK_MAX_EVENTS];
    int n = pump->ops->poll(pump->link, pump->wake_fd, 0, 0, events, LINK_MAX_EVENTS);
    for (int i = 0; i < n; i++)
        handle(pump, &events[i]);
    atomic_fetch_add(&pump->loop->pumps_busy, 1);
    int rc = pthread_create(&pump->thread, NULL, pump_main, pump);
    if (rc != 0) {
        atomic_fetch_sub(&pump->loop->pumps_busy, 1);
        return sh_fail(err, SH_EIO, "link %s: no thread: %s", pump->ops->name, strerror(rc));
    }
    pump->running = 1;
    return SH_OK;
}

void pump_join(struct pump *pump)
{
    if (!pump->running) return;
    pump_wake(pump);
    pthread_join(pump->thread, NULL);
    pump->running = 0;
}
