/* SPDX-License-Identifier: MIT */
#include "firmware_sim/fault/faulty_link.h"

#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/native.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/command/command.h"
#include "firmware_sim/fault/faulty_inside.h"

int faulty_is_on(const struct faulty_link *f)
{
    return f->spec.board != NULL && fault_board_version(f->spec.board) != 0;
}

/* Returns whether the session's bytes go through a wire. Makes the wire once there is a fault. */
static int has_wire(struct faulty_link *f, int session)
{
    struct faulty_session *s = &f->session[session];
    const struct protocol_ops *protocol = f->spec.protocol;
    const int native = protocol->passes_native;
    if (s->wire != NULL) return 1;
    if (!faulty_is_on(f)) return 0;
    const struct wire_spec spec = {
        .board = f->spec.board,
        .link = f->spec.number,
        .session = f->spec.first_session + (uint32_t)session,
        .max_unit = native ? NATIVE_MAX_FRAME : protocol->max_unit,
        .units = !native,
        .native = native,
        .datagrams = f->inner->datagrams,
        .content = protocol->content,
        .reseal = protocol->reseal,
        .acts = f->can,
        .tally = &f->tally,
        .heard = &s->heard,
    };
    s->wire = wire_create(&spec);
    if (s->wire == NULL) f->spec.report(f->spec.source, CMD_E_REFUSED, "no memory for the faults of a session");
    return s->wire != NULL;
}

/* ---- bytes from the owner */

/* Returns the first frame, reply line or unit of the bytes. Replies lie between frames, and have no byte that begins a
 * frame. */
static struct wire_item first_item(const struct faulty_link *f, int session, const uint8_t *bytes, size_t len)
{
    const struct faulty_session *s = &f->session[session];
    if (!f->spec.protocol->passes_native)
        return (struct wire_item){s->next_is_reply ? FAULT_OF_REPLIES : FAULT_OF_STREAM, bytes, len, s->next_t_ns};
    if (bytes[0] == NATIVE_SYNC) return (struct wire_item){FAULT_OF_STREAM, bytes, native_frame_len(bytes), 0};
    const uint8_t *end = memchr(bytes, '\n', len);
    if (end != NULL) len = (size_t)(end + 1 - bytes);
    return (struct wire_item){FAULT_OF_REPLIES, bytes, len, f->spec.time_ns(f->spec.owner)};
}

static void faulty_link_put(struct faulty_link *f, int session, const uint8_t *bytes, size_t len)
{
    struct faulty_session *s = &f->session[session];
    int rc = s->rest != 0 ? wire_put_rest(s->wire, bytes, s->rest) : SH_OK;
    size_t at = s->rest;
    s->rest = 0;
    for (;;) {
        if (rc != SH_OK)
            f->spec.report(f->spec.source, CMD_E_READER, "no memory for the faults of a session: a frame is lost");
        if (at == len) return;
        const struct wire_item item = first_item(f, session, bytes + at, len - at);
        rc = wire_put(s->wire, &item, clock_now_ns());
        at += item.len;
    }
}

/* Follows bytes that go out without a wire. A wire that is made later must know how many bytes of the present item are
 * still to come, and which commands were answered. */
static void faulty_link_follow(struct faulty_link *f, int session, const uint8_t *bytes, size_t len, size_t written)
{
    struct faulty_session *s = &f->session[session];
    size_t at = s->rest;
    while (at < written) {
        const struct wire_item item = first_item(f, session, bytes + at, len - at);
        if (item.of == FAULT_OF_REPLIES) wire_heard_answered(&s->heard);
        at += item.len;
    }
    s->rest = at - written;
}

/* ---- bytes to the inner link */

static ssize_t write_inner(struct faulty_link *f, int session, const void *bytes, size_t len)
{
    struct faulty_session *s = &f->session[session];
    const ssize_t n = f->inner->write(f->link, session, bytes, len);
    s->is_blocked = n == 0;
    if (n > 0) s->moved_ns = clock_now_ns();
    return n;
}

/* Writes what is due. Returns 1 if the wire takes more; 0: not now; negative: as write(). */
static int flush(struct faulty_link *f, int session)
{
    struct faulty_session *s = &f->session[session];
    s->is_blocked = 0;
    while (!s->is_gone) {
        struct wire_piece *piece = wire_due(s->wire, clock_now_ns());
        if (piece == NULL) return !wire_is_full(s->wire, f->spec.room, clock_now_ns());
        if (piece->kind == WIRE_ACT && faulty_is_same_pull(f, piece)) {
            faulty_drop_act(f, session, piece);
            continue;
        }
        if (piece->kind == WIRE_ACT && faulty_is_pulled(f)) { /* other acts wait until the cable is in */
            s->is_blocked = 1;
            return 0;
        }
        if (piece->kind == WIRE_ACT) {
            faulty_carry_out(f, session, piece);
            continue;
        }
        const ssize_t n = write_inner(f, session, piece->bytes + piece->out, piece->len - piece->out);
        if (n <= 0) return (int)n;
        piece->out += (size_t)n;
        if (piece->out == piece->len) wire_pop(s->wire);
    }
    return SH_ECLOSED;
}

void faulty_next(struct faulty_link *f, int session, int is_reply, int64_t t_ns)
{
    f->session[session].next_is_reply = is_reply;
    f->session[session].next_t_ns = t_ns;
}

int faulty_pass(struct faulty_link *f, int session, int64_t t_ns)
{
    if (!has_wire(f, session)) return 1;
    wire_time(f->session[session].wire, t_ns);
    return flush(f, session);
}

void faulty_changed(struct faulty_link *f, int session, uint64_t n_replies)
{
    if (has_wire(f, session)) wire_renew(f->session[session].wire, n_replies);
}

struct faulty_state faulty_look(const struct faulty_link *f, int session)
{
    const struct faulty_session *s = &f->session[session];
    return (struct faulty_state){.waits = s->wire != NULL && !wire_is_empty(s->wire),
                                 .keeps_back = s->wire != NULL && wire_keeps_back(s->wire, clock_now_ns()),
                                 .moved_ns = s->moved_ns};
}

struct faulty_unwritten faulty_forget(struct faulty_link *f, int session)
{
    struct faulty_session *s = &f->session[session];
    struct faulty_unwritten unwritten = {0, 0};
    if (s->wire != NULL) wire_count_unwritten(s->wire, &unwritten.frames, &unwritten.pulses);
    wire_free(s->wire);
    wire_heard_free(&s->heard);
    *s = (struct faulty_session){.heard = s->heard};
    return unwritten;
}

/* ---- link_ops */

/* Returns the time to wait for events, or for the first wire or act that is due before. */
static int wait_ms(const struct faulty_link *f, int most_ms)
{
    int64_t next_ns = f->plug_ns != 0 ? f->plug_ns : INT64_MAX;
    for (int i = 0; i < LINK_MAX_SESSIONS; i++) {
        const struct faulty_session *s = &f->session[i];
        if (s->wire == NULL) continue;
        if (s->is_gone) return 0;    /* its owner closes it after this poll */
        if (s->is_blocked) continue; /* its first piece waits for the inner link */
        const int64_t due_ns = wire_next_ns(s->wire);
        if (due_ns < next_ns) next_ns = due_ns;
    }
    if (next_ns == INT64_MAX) return most_ms;
    const int64_t ms = (next_ns - clock_now_ns()) / 1000000 + 1;
    return ms < 0 ? 0 : most_ms >= 0 && ms > most_ms ? most_ms : ms > 60000 ? 60000 : (int)ms;
}

static int faulty_poll(void *link, int wake_fd, uint32_t want_write, int timeout_ms, struct link_event *events, int max)
{
    struct faulty_link *f = link;
    int kept = 0;
    for (int i = 0; i < LINK_MAX_SESSIONS; i++) /* what a fault holds back does not wait for the inner link */
        if (f->session[i].wire != NULL && !f->session[i].is_blocked) want_write &= ~(UINT32_C(1) << i);
    const int n = f->inner->poll(f->link, wake_fd, want_write, wait_ms(f, timeout_ms), events, max);
    for (int i = 0; i < n; i++) {
        const int opened = events[i].kind == LINK_OPENED;
        if (events[i].kind == LINK_PLUGGED) faulty_plugged(f);
        if (opened) f->session[events[i].session].is_gone = 0;
        if (!opened || !faulty_turns_away(f, events[i].session)) events[kept++] = events[i];
    }
    faulty_plug(f);
    return n < 0 ? n : kept;
}

static ssize_t faulty_read(void *link, int session, void *buf, size_t len)
{
    struct faulty_link *f = link;
    const ssize_t n = f->inner->read(f->link, session, buf, len);
    if (n > 0 && f->spec.board != NULL) wire_heard_add(&f->session[session].heard, buf, (size_t)n);
    return n;
}

static ssize_t faulty_write(void *link, int session, const void *buf, size_t len)
{
    struct faulty_link *f = link;
    if (has_wire(f, session)) {
        const int takes = flush(f, session);
        if (takes <= 0) return takes;
        faulty_link_put(f, session, buf, len);
        return (ssize_t)len;
    }
    const ssize_t n = write_inner(f, session, buf, len);
    if (n > 0 && f->spec.board != NULL) faulty_link_follow(f, session, buf, len, (size_t)n);
    return n;
}

/* Links with faults don't lend, since their bytes go through a wire. */
static ssize_t faulty_lend(void *link, int session, const void *buf, size_t len)
{
    struct faulty_link *f = link;
    const ssize_t n = f->inner->lend(f->link, session, buf, len);
    if (n > 0) f->session[session].moved_ns = clock_now_ns();
    return n;
}

static void faulty_endpoint(const void *link, char *buf, size_t len)
{
    const struct faulty_link *f = link;
    f->inner->endpoint(f->link, buf, len);
}

static double faulty_capacity(const void *link)
{
    const struct faulty_link *f = link;
    return f->inner->capacity(f->link);
}

static uint64_t faulty_refused(const void *link)
{
    const struct faulty_link *f = link;
    return f->inner->refused(f->link);
}

static int faulty_unread(void *link, int session)
{
    const struct faulty_link *f = link;
    return f->inner->unread(f->link, session);
}

static void faulty_end(void *link, int session)
{
    const struct faulty_link *f = link;
    f->inner->end(f->link, session);
}

static void faulty_close(void *link)
{
    struct faulty_link *f = link;
    for (int i = 0; i < LINK_MAX_SESSIONS; i++)
        faulty_forget(f, i);
    f->inner->close(f->link);
    free(f);
}

const struct link_ops *faulty_ops(const struct faulty_link *f)
{
    return &f->ops;
}

int faulty_open(const struct faulty_spec *faults, const struct link_spec *spec, struct faulty_link **out,
                struct sh_err *err)
{
    struct faulty_link *f = calloc(1, sizeof *f);
    if (f == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    f->spec = *faults;
    f->can = link_faults(spec);
    f->inner = link_ops_get(spec->type);
    for (int i = 0; i < LINK_MAX_SESSIONS; i++)
        f->session[i].heard.has_lines = faults->protocol->passes_native;
    const int rc = f->inner->open(spec, &f->link, err);
    if (rc != SH_OK) {
        free(f);
        return rc;
    }
    f->ops = *f->inner;
    f->ops.endpoint = faulty_endpoint;
    f->ops.poll = faulty_poll;
    f->ops.read = faulty_read;
    f->ops.write = faulty_write;
    f->ops.lend = f->inner->lend != NULL && faults->board == NULL ? faulty_lend : NULL;
    f->ops.close = faulty_close;
    if (f->ops.capacity != NULL) f->ops.capacity = faulty_capacity;
    if (f->ops.refused != NULL) f->ops.refused = faulty_refused;
    if (f->ops.unread != NULL) f->ops.unread = faulty_unread;
    if (f->ops.end != NULL) f->ops.end = faulty_end;
    if (f->ops.fault != NULL) f->ops.fault = faulty_fault;
    *out = f;
    return SH_OK;
}
