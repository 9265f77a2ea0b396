/* SPDX-License-Identifier: MIT */
/* Makes talks of flows: each message of a device goes to the request that it answers, or whose stream it belongs to. */
#include <arpa/inet.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "firmware_sim/replay/capture_inside.h"

enum { MAX_REQUESTS = 20000, MAX_STREAMS = 16, MOST_PENDING = 16, MOST_BACK = 4096, KIND_BYTES = 1024 };
enum { OF_CONNECTION = -1 };

/* A request of a client. A request that came several times has an entry for each time. */
struct asked {
    uint32_t request; /* of the store */
    size_t at;
    uint32_t len;
    int64_t t_ns;
    int is_answered;
    struct talk_run run;
};

/* A place of the capture while its talk is made. */
struct builder {
    struct replay_capture *capture;
    struct capture_place *place;
    struct capture_store *store;
    struct capture_list said; /* of the flow at hand */
    int *owner;               /* of each: index in asked, or OF_CONNECTION */
    size_t owner_room;
    struct asked *asked;                     /* of all flows */
    size_t n_asked, asked_room, first_asked; /* first_asked: of the flow at hand */
    size_t streaming[MAX_STREAMS];           /* indices in asked: requests whose stream came */
    uint32_t n_streaming;
    struct talk_run connection;
    int has_connection;
};

/* ---- which request a message belongs to */

static int add_asked(struct builder *b, const struct capture_said *s)
{
    struct capture_store *store = b->store;
    uint32_t i = 0;
    while (i < store->n_requests && (store->request[i].len != s->len ||
                                     memcmp(store->bytes + store->request[i].at, store->bytes + s->at, s->len) != 0))
        i++;
    if (i == store->n_requests) {
        if (i == MAX_REQUESTS) return SH_EINPUT;
        if (!grow(&store->request, &store->request_room, i + 1, sizeof *store->request)) return SH_ENOMEM;
        store->request[store->n_requests++] = (struct talk_request){.at = s->at, .len = s->len};
    }
    if (!grow(&b->asked, &b->asked_room, b->n_asked + 1, sizeof *b->asked)) return SH_ENOMEM;
    b->asked[b->n_asked++] =
        (struct asked){.request = i, .at = s->at, .len = s->len, .t_ns = s->end_ns, .run.loop_from = TALK_NO_LOOP};
    return SH_OK;
}

static void end_streams(struct builder *b, const struct capture_said *s)
{
    const struct talk_kind *kind = b->place->talk.kind;
    const uint8_t *bytes = b->store->bytes;
    uint32_t n = 0;
    for (uint32_t i = 0; i < b->n_streaming; i++) {
        const struct asked *a = &b->asked[b->streaming[i]];
        if (!kind->stops(bytes + s->at, s->len, bytes + a->at, a->len)) b->streaming[n++] = b->streaming[i];
    }
    b->n_streaming = n;
}

/* Looks at the last MOST_PENDING requests. Returns the oldest one that has no answer yet and that this message
 * answers. */
static int find_answered(struct builder *b, const struct capture_said *s)
{
    const uint8_t *bytes = b->store->bytes;
    size_t i = b->n_asked > b->first_asked + MOST_PENDING ? b->n_asked - MOST_PENDING : b->first_asked;
    for (; i < b->n_asked; i++) {
        struct asked *a = &b->asked[i];
        if (a->is_answered || !b->place->talk.kind->answers(bytes + a->at, a->len, bytes + s->at, s->len)) continue;
        a->is_answered = 1;
        return (int)i;
    }
    return OF_CONNECTION;
}

static int find_stream(struct builder *b, const struct capture_said *s)
{
    const struct talk_kind *kind = b->place->talk.kind;
    const uint8_t *bytes = b->store->bytes;
    for (uint32_t i = b->n_streaming; i-- > 0;) {
        const struct asked *a = &b->asked[b->streaming[i]];
        if (kind->streams(bytes + a->at, a->len, bytes + s->at, s->len)) return (int)b->streaming[i];
    }
    for (size_t i = b->n_asked, k = 0; i-- > b->first_asked && k < MOST_BACK; k++) {
        struct asked *a = &b->asked[i];
        if (!kind->streams(bytes + a->at, a->len, bytes + s->at, s->len)) continue;
        if (b->n_streaming < MAX_STREAMS) b->streaming[b->n_streaming++] = i;
        if (a->run.loop_from == TALK_NO_LOOP) a->run.loop_from = (uint32_t)a->is_answered;
        return (int)i;
    }
    return OF_CONNECTION;
}

/* The device takes turns with its client: each message belongs to the last request. */
static int last_asked(const struct builder *b)
{
    return b->n_asked > b->first_asked ? (int)b->n_asked - 1 : OF_CONNECTION;
}

static int find_owner(struct builder *b, const struct capture_said *s)
{
    if (b->place->talk.kind->answers == NULL) return last_asked(b);
    const int answered = find_answered(b, s);
    return answered != OF_CONNECTION ? answered : find_stream(b, s);
}

static int own_all(struct builder *b, int device)
{
    const struct talk_kind *kind = b->place->talk.kind;
    if (!grow(&b->owner, &b->owner_room, b->said.n, sizeof *b->owner)) return SH_ENOMEM;
    b->first_asked = b->n_asked;
    b->n_streaming = 0;
    for (size_t i = 0; i < b->said.n; i++) {
        const struct capture_said *s = &b->said.said[i];
        if (sh_stopped(b->capture->report)) return SH_ESTOPPED;
        if ((int)s->side == device) {
            b->owner[i] = find_owner(b, s);
            continue;
        }
        if (kind->stops != NULL) end_streams(b, s);
        const int rc = add_asked(b, s);
        if (rc != SH_OK) return rc;
    }
    return SH_OK;
}

/* ---- runs */

static struct talk_run *run_of(struct builder *b, struct talk_run *connection, int owner)
{
    return owner == OF_CONNECTION ? connection : &b->asked[owner].run;
}

/* Puts the messages of the flow at hand into the store, run by run (drivers/protocol/talk.h says what a run is). Flows
 * of a place may each have a run of the connection: the longest one is kept. */
static int put_messages(struct builder *b, int device, int64_t t0_ns)
{
    struct capture_store *store = b->store;
    struct talk_run connection = {.loop_from = 0};
    size_t n = store->n_messages;
    for (size_t i = 0; i < b->said.n; i++)
        if ((int)b->said.said[i].side == device) run_of(b, &connection, b->owner[i])->n++;
    connection.first = (uint32_t)n;
    n += connection.n;
    for (size_t i = b->first_asked; i < b->n_asked; i++) {
        b->asked[i].run.first = (uint32_t)n;
        n += b->asked[i].run.n;
        b->asked[i].run.n = 0;
    }
    if (n > UINT32_MAX || !grow(&store->message, &store->message_room, n, sizeof *store->message)) return SH_ENOMEM;
    store->n_messages = n;
    connection.n = 0;
    for (size_t i = 0; i < b->said.n; i++) {
        const struct capture_said *s = &b->said.said[i];
        if ((int)s->side != device) continue;
        struct talk_run *run = run_of(b, &connection, b->owner[i]);
        const int64_t from_ns = b->owner[i] == OF_CONNECTION ? t0_ns : b->asked[b->owner[i]].t_ns;
        const int64_t after_ns = s->begin_ns > from_ns ? s->begin_ns - from_ns : 0;
        store->message[run->first + run->n++] = (struct talk_message){s->at, s->len, after_ns};
    }
    if (connection.n == 0 || (b->has_connection && connection.n <= b->connection.n)) return SH_OK;
    b->connection = connection;
    b->has_connection = 1;
    return SH_OK;
}

/* Puts the runs of each request one after the other, and that of the connection last. */
static int put_runs(struct builder *b)
{
    struct capture_store *store = b->store;
    if (!grow(&store->run, &store->run_room, b->n_asked + 1, sizeof *store->run)) return SH_ENOMEM;
    for (size_t i = 0; i < b->n_asked; i++)
        store->request[b->asked[i].request].n_runs++;
    for (uint32_t i = 0, n = 0; i < store->n_requests; i++) {
        store->request[i].first_run = n;
        n += store->request[i].n_runs;
        store->request[i].n_runs = 0;
    }
    for (size_t i = 0; i < b->n_asked; i++) {
        struct talk_request *r = &store->request[b->asked[i].request];
        store->run[r->first_run + r->n_runs++] = b->asked[i].run;
    }
    store->n_runs = b->n_asked;
    if (b->has_connection) store->run[store->n_runs++] = b->connection;
    return SH_OK;
}

/* ---- places */

/* Packets lie in the file in the order of time. So their order decides also where clocks are too coarse. */
static int by_order(const void *a, const void *b)
{
    const struct capture_said *one = a, *other = b;
    if (one->number != other->number) return one->number < other->number ? -1 : 1;
    return one->at < other->at ? -1 : one->at > other->at;
}

static int is_at(const struct capture_flow *f, const struct capture_flow *other)
{
    const struct ethernet_end *a = &f->end[f->device], *b = &other->end[other->device];
    if (f->is_tcp != other->is_tcp || a->is_v6 != b->is_v6 || memcmp(a->address, b->address, sizeof a->address) != 0)
        return 0;
    return f->is_tcp ? a->port == b->port : f->end[!f->device].port == other->end[!other->device].port;
}

static const struct talk_kind *kind_of(const struct replay_capture *c, const struct capture_flow *first)
{
    uint8_t bytes[KIND_BYTES];
    if (!first->is_tcp) return &talk_bytes;
    for (const struct capture_flow *f = first; f < c->flow + c->n_flows; f++) {
        const size_t n = is_at(f, first) ? capture_first_bytes(f, (uint32_t)!f->device, bytes, sizeof bytes) : 0;
        if (n != 0) return talk_kind_of(bytes, n);
    }
    return &talk_bytes;
}

static int add_flow(struct builder *b, const struct capture_flow *f, int64_t t0_ns)
{
    b->said.n = 0;
    int rc = SH_OK;
    for (uint32_t side = 0; side < 2 && rc == SH_OK; side++)
        rc = capture_add_messages(b->capture, f, side, b->place->talk.kind, b->store, &b->said);
    if (rc == SH_OK && b->said.n != 0) qsort(b->said.said, b->said.n, sizeof *b->said.said, by_order);
    if (rc == SH_OK) rc = own_all(b, f->device);
    if (rc == SH_OK) rc = put_messages(b, f->device, t0_ns);
    return rc;
}

static void describe(struct capture_place *place, const struct capture_flow *f)
{
    const struct ethernet_end *device = &f->end[f->device];
    place->is_tcp = f->is_tcp;
    place->port = f->is_tcp ? device->port : f->end[!f->device].port;
    place->source_port = device->port;
    inet_ntop(device->is_v6 ? AF_INET6 : AF_INET, device->address, place->device, sizeof place->device);
}

/* udp_t0_ns: the time of the devices' first datagram. The messages of all UDP ports count from it, so that ports stay
 * in step with each other. */
static int build_place(struct replay_capture *c, const struct capture_flow *first, int64_t udp_t0_ns)
{
    struct capture_place *place = &c->place[c->n_places];
    struct builder b = {.capture = c, .place = place, .store = &c->store[c->n_places]};
    c->n_places++; /* also where this fails: capture_free frees the store */
    describe(place, first);
    place->talk =
        (struct talk){.kind = kind_of(c, first), .is_datagrams = !first->is_tcp, .connection_run = TALK_NO_RUN};
    int rc = SH_OK;
    for (const struct capture_flow *f = first; f < c->flow + c->n_flows && rc == SH_OK; f++)
        if (is_at(f, first)) rc = add_flow(&b, f, f->is_tcp ? f->t0_ns : udp_t0_ns);
    if (rc == SH_OK) rc = put_runs(&b);
    place->talk.bytes = b.store->bytes;
    place->talk.message = b.store->message;
    place->talk.run = b.store->run;
    place->talk.request = b.store->request;
    place->talk.n_requests = (uint32_t)b.store->n_requests;
    place->n_messages = (uint32_t)b.store->n_messages;
    if (b.has_connection) place->talk.connection_run = (int)b.store->n_runs - 1;
    free(b.said.said);
    free(b.owner);
    free(b.asked);
    return rc;
}

/* Whether a flow is the first of its place: flows before it are of other places. */
static int is_first(const struct replay_capture *c, const struct capture_flow *f)
{
    for (const struct capture_flow *before = c->flow; before < f; before++)
        if (is_at(before, f)) return 0;
    return 1;
}

static int64_t first_datagram_ns(const struct replay_capture *c)
{
    int64_t t_ns = INT64_MAX;
    for (size_t i = 0; i < c->n_flows; i++) {
        const struct capture_flow *f = &c->flow[i];
        for (size_t k = 0; !f->is_tcp && k < f->n; k++) {
            if (f->segment[k].side == f->device && f->segment[k].t_ns < t_ns) t_ns = f->segment[k].t_ns;
            if (f->segment[k].side == f->device) break;
        }
    }
    return t_ns;
}

int capture_build(struct replay_capture *c, struct sh_err *err)
{
    for (size_t i = 0; i < c->n_flows; i++) {
        struct capture_flow *f = &c->flow[i];
        if (!f->is_tcp) f->device = f->n_sent[1] >= f->n_sent[0]; /* if both sent as many: the second */
        if (f->is_tcp && !f->has_begin) f->device = f->bytes_sent[1] > f->bytes_sent[0];
    }
    const int64_t udp_t0_ns = first_datagram_ns(c);
    for (size_t i = 0; i < c->n_flows; i++) {
        const struct capture_flow *f = &c->flow[i];
        if (!is_first(c, f)) continue;
        if (c->n_places == CAPTURE_MAX_TALKS)
            return sh_fail(err, SH_EINPUT, "too many ports of devices; allowed are up to %d", (int)CAPTURE_MAX_TALKS);
        const int rc = build_place(c, f, udp_t0_ns);
        if (rc == SH_EINPUT)
            return sh_fail(err, rc, "too many different requests to a port; allowed are up to %d", (int)MAX_REQUESTS);
        if (rc == SH_ESTOPPED) return rc;
        if (rc != SH_OK) return sh_fail(err, rc, "no memory for its messages");
        if (c->place[c->n_places - 1].n_messages == 0) capture_forget(c, --c->n_places);
    }
    return SH_OK;
}
