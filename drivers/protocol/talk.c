/* SPDX-License-Identifier: MIT */
/* The protocol `capture`: a device says again what it said in a capture (talk.h).
 *
 * A request that comes again gets the next run that the capture has for it, and the last one once there is no further
 * one. A run is what followed one request in the capture. The run's messages come after the request with the same
 * delays as in the capture. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/protocol.h"
#include "drivers/protocol/talk.h"

enum { MAX_PLAYED = 64, NO_REQUEST = -1, LEAST_SPAN_NS = 1000000 };

/* A run that is being sent. */
struct played {
    const struct talk_run *run; /* NULL: the place is free */
    int request;                /* that it answers; NO_REQUEST: it is the connection's */
    uint32_t next;
    int64_t t0_ns;
};

struct capture_session {
    struct protocol_spec spec;
    const struct talk *talk; /* spec.talk */
    int64_t now_ns;
    int is_begun, is_over;
    struct played played[MAX_PLAYED];
    int is_partial;               /* the bytes are not yet a whole request */
    size_t len;                   /* of bytes that the client sent, and that were not taken */
    uint8_t in[TALK_MAX_REQUEST]; /* each datagram has its length in front */
    uint32_t *times;              /* of each request, so far */
};

static int capture_begin(void *protocol, struct sh_err *err)
{
    struct capture_session *s = protocol;
    s->talk = s->spec.talk;
    s->times = s->talk != NULL ? calloc(s->talk->n_requests + 1, sizeof s->times[0]) : NULL;
    return s->times != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "protocol capture: no memory, or no capture");
}

static void capture_end(void *protocol)
{
    struct capture_session *s = protocol;
    if (s != NULL) free(s->times);
}

/* ---- runs */

static const struct talk_message *message_of(const struct capture_session *s, const struct played *p)
{
    return &s->talk->message[p->run->first + p->next];
}

static int64_t due_ns(const struct capture_session *s, const struct played *p)
{
    return p->t0_ns + message_of(s, p)->after_ns;
}

static void talk_begin(struct capture_session *s, int run, int request)
{
    const struct talk_run *r = &s->talk->run[run];
    if (r->n == 0) return;
    for (int i = 0; i < MAX_PLAYED; i++) {
        if (s->played[i].run != NULL) continue;
        s->played[i] = (struct played){r, request, 0, s->now_ns};
        return;
    }
}

/* A request waits while no place is free. If the device speaks in turns, a request ends the answer to the one before.
 * So a request also waits until that answer has begun. */
static int must_wait(const struct capture_session *s)
{
    const int takes_turns = s->talk->kind->stops == NULL;
    int n_free = 0;
    for (int i = 0; i < MAX_PLAYED; i++) {
        const struct played *p = &s->played[i];
        n_free += p->run == NULL;
        if (takes_turns && p->run != NULL && p->request != NO_REQUEST && p->next == 0) return 1;
    }
    return n_free == 0;
}

/* A stream that begins again goes on as evenly as it was: after its last message, its mean period passes. Messages that
 * came all at once have no period, and are not repeated. */
static void talk_advance(const struct capture_session *s, struct played *p)
{
    const struct talk_run *run = p->run;
    if (++p->next < run->n) return;
    const uint32_t from = run->loop_from;
    const struct talk_message *m = &s->talk->message[run->first];
    const int repeats = s->spec.talk_options->loop && from < run->n - 1;
    const int64_t span_ns = repeats ? m[run->n - 1].after_ns - m[from].after_ns : 0;
    if (span_ns < LEAST_SPAN_NS) {
        p->run = NULL;
        return;
    }
    p->next = from;
    p->t0_ns += span_ns + span_ns / (run->n - 1 - from);
}

static void talk_send(const struct capture_session *s, const struct talk_message *m)
{
    for (uint32_t at = 0, n; at < m->len; at += n) {
        n = m->len - at < TALK_MAX_MESSAGE ? m->len - at : TALK_MAX_MESSAGE;
        s->spec.host.send(s->spec.host.ctx, s->talk->bytes + m->at + at, n);
    }
}

/* Sends what is due, in the order of time. Beyond MOST_AT_ONCE messages the rest waits for the next tick. */
static void send_due(struct capture_session *s)
{
    enum { MOST_AT_ONCE = 10000 };
    for (int i = 0; i < MOST_AT_ONCE; i++) {
        struct played *first = NULL;
        for (int k = 0; k < MAX_PLAYED; k++) {
            struct played *p = &s->played[k];
            if (p->run != NULL && (first == NULL || due_ns(s, p) < due_ns(s, first))) first = p;
        }
        if (first == NULL || due_ns(s, first) > s->now_ns) return;
        talk_send(s, message_of(s, first));
        talk_advance(s, first);
    }
}

/* ---- requests */

static void stop_others(struct capture_session *s, const uint8_t *request, size_t len)
{
    const struct talk_kind *kind = s->talk->kind;
    for (int i = 0; i < MAX_PLAYED; i++) {
        struct played *p = &s->played[i];
        if (p->run == NULL) continue;
        const struct talk_request *began = p->request >= 0 ? &s->talk->request[p->request] : NULL;
        const int stops =
            kind->stops == NULL || (began != NULL && kind->stops(request, len, s->talk->bytes + began->at, began->len));
        if (stops) p->run = NULL;
    }
}

static int talk_find(const struct talk *t, const uint8_t *bytes, size_t len)
{
    for (uint32_t i = 0; i < t->n_requests; i++)
        if (t->request[i].len == len && memcmp(t->bytes + t->request[i].at, bytes, len) == 0) return (int)i;
    return NO_REQUEST;
}

static void take_known(struct capture_session *s, int request)
{
    const struct talk_request *r = &s->talk->request[request];
    const uint32_t k = s->times[request] < r->n_runs - 1 ? s->times[request]++ : r->n_runs - 1;
    stop_others(s, s->talk->bytes + r->at, r->len);
    talk_begin(s, (int)(r->first_run + k), request);
}

static void take_unknown(struct capture_session *s, const uint8_t *bytes, size_t len)
{
    const struct talk_kind *kind = s->talk->kind;
    uint8_t error[64];
    char name[TALK_NAME_LEN], text[120];
    talk_name(kind, bytes, len, name);
    snprintf(text, sizeof text, "the capture has no such request: %s", name);
    s->spec.host.count(s->spec.host.ctx, PROTOCOL_WRONG, 1);
    if (s->spec.host.tell_once != NULL) s->spec.host.tell_once(s->spec.host.ctx, text);
    if (kind->stops != NULL) stop_others(s, bytes, len);
    if (s->spec.talk_options->unknown == TALK_CLOSE) {
        s->is_over = 1;
        s->spec.host.hang_up(s->spec.host.ctx);
    }
    if (s->spec.talk_options->unknown == TALK_ERROR && kind->error != NULL)
        s->spec.host.send(s->spec.host.ctx, error, kind->error(bytes, len, error));
}

/* Finds a request where the bytes don't show where one ends (no request_len). Returns the length of the longest request
 * of the capture that the bytes begin with, or 0 if they are only the beginning of one. All other bytes are one unknown
 * request. */
static size_t match_beginning(const struct capture_session *s)
{
    const struct talk *t = s->talk;
    size_t best = 0;
    int may_come = 0;
    for (uint32_t i = 0; i < t->n_requests; i++) {
        const size_t n = t->request[i].len, common = n < s->len ? n : s->len;
        if (memcmp(t->bytes + t->request[i].at, s->in, common) != 0) continue;
        if (n > s->len) may_come = 1;
        if (n <= s->len && n > best) best = n;
    }
    return best != 0 ? best : may_come ? 0 : s->len;
}

/* The first request of the bytes. Returns how many bytes it has with its length in front; 0: it is not whole. */
static size_t next_request(const struct capture_session *s, const uint8_t **request, size_t *len)
{
    const struct talk_kind *kind = s->talk->kind;
    uint32_t n;
    *request = s->in;
    if (s->talk->is_datagrams) {
        memcpy(&n, s->in, sizeof n);
        *request += sizeof n;
        *len = n;
        return sizeof n + n;
    }
    return *len = kind->request_len != NULL ? kind->request_len(s->in, s->len) : match_beginning(s);
}

static void talk_lose(struct capture_session *s, size_t len)
{
    s->spec.host.count(s->spec.host.ctx, PROTOCOL_INPUT_LOST, len);
    if (s->spec.host.tell_once != NULL)
        s->spec.host.tell_once(s->spec.host.ctx,
                               "bytes of a client were left out: more than 65536 of them wait, or are one request");
}

static void take_requests(struct capture_session *s)
{
    while (s->len != 0 && !s->is_partial && !s->is_over && !must_wait(s)) {
        const uint8_t *bytes;
        size_t len;
        const size_t used = next_request(s, &bytes, &len);
        s->is_partial = used == 0;
        if (used == 0) break;
        const int request = talk_find(s->talk, bytes, len);
        if (request >= 0)
            take_known(s, request);
        else
            take_unknown(s, bytes, len);
        s->len -= used;
        memmove(s->in, s->in + used, s->len);
    }
    if (s->is_partial && s->len == sizeof s->in) {
        talk_lose(s, s->len);
        s->len = 0;
    }
    if (!s->is_over) return;
    s->spec.host.count(s->spec.host.ctx, PROTOCOL_INPUT_LOST, s->len);
    s->len = 0;
}

/* ---- the protocol */

static void open_at(void *protocol, int64_t t_ns)
{
    struct capture_session *s = protocol;
    s->now_ns = t_ns;
    if (s->is_begun) return;
    s->is_begun = 1;
    if (s->talk->connection_run != TALK_NO_RUN) talk_begin(s, s->talk->connection_run, NO_REQUEST);
}

/* Requests are taken with the next tick. By then all pieces of a request that arrived together are in the buffer. */
static void talk_input(void *protocol, const uint8_t *bytes, size_t len)
{
    struct capture_session *s = protocol;
    const uint32_t n = (uint32_t)len;
    const size_t front = s->talk->is_datagrams ? sizeof n : 0;
    if (len > sizeof s->in - s->len || front > sizeof s->in - s->len - len) {
        talk_lose(s, len);
        return;
    }
    if (front != 0) memcpy(s->in + s->len, &n, front);
    memcpy(s->in + s->len + front, bytes, len);
    s->len += front + len;
    s->is_partial = 0;
}

static size_t takes(const void *protocol)
{
    const struct capture_session *s = protocol;
    return sizeof s->in - s->len;
}

static void talk_time(void *protocol, int64_t t_ns)
{
    struct capture_session *s = protocol;
    s->now_ns = t_ns;
    take_requests(s);
    if (!s->is_over) send_due(s);
}

static int64_t talk_next_ns(const void *protocol)
{
    const struct capture_session *s = protocol;
    int64_t next_ns = s->len != 0 && !s->is_partial ? s->now_ns : INT64_MAX;
    for (int i = 0; i < MAX_PLAYED; i++)
        if (s->played[i].run != NULL && due_ns(s, &s->played[i]) < next_ns) next_ns = due_ns(s, &s->played[i]);
    return next_ns;
}

static int owes(const void *protocol)
{
    const struct capture_session *s = protocol;
    return !s->is_over && talk_next_ns(s) != INT64_MAX;
}

const struct protocol_ops protocol_capture = {
    .name = "capture",
    .emitters = 1u << 31, /* no kind of emitter has this bit: links of heads can't have this protocol */
    .max_unit = TALK_MAX_MESSAGE,
    .size = sizeof(struct capture_session),
    .begin = capture_begin,
    .end = capture_end,
    .open = open_at,
    .time = talk_time,
    .input = talk_input,
    .takes = takes,
    .owes = owes,
    .next_ns = talk_next_ns,
};
