/* SPDX-License-Identifier: MIT */
/* The messages of one side of a flow: segments are put in the order of their bytes, and their bytes are cut where
 * messages end. */
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "firmware_sim/replay/capture_inside.h"

/* A part of a side's bytes, as they came. */
struct part {
    const uint8_t *data;
    size_t len;
    int64_t from; /* its first byte's place in the side's bytes */
    int64_t t_ns;
    size_t number; /* of its segment in the flow, in the order of the file */
};

struct parts {
    struct part *part;
    size_t n, room;
    int has_begin; /* place 0 is the side's first byte: its SYN is there, or the flow is not TCP */
    int64_t end;   /* the place after the last byte that was sent, also if that byte was cut off */
};

static int by_place(const void *a, const void *b)
{
    const struct part *one = a, *other = b;
    if (one->from != other->from) return one->from < other->from ? -1 : 1;
    return one->number < other->number ? -1 : 1;
}

/* A place follows from the sequence number and the place before, since numbers wrap. */
static int collect(const struct capture_flow *f, uint32_t side, struct parts *parts)
{
    int is_known = 0;
    uint32_t base = 0;
    int64_t last = 0;
    for (size_t i = 0; i < f->n; i++) {
        const struct capture_segment *s = &f->segment[i];
        if (s->side != side) continue;
        const int is_syn = f->is_tcp && (s->flags & TCP_SYN) != 0;
        const uint32_t seq = s->seq + (uint32_t)is_syn;
        if (!is_known) {
            base = seq;
            parts->has_begin = is_syn || !f->is_tcp;
        }
        is_known = 1;
        const int64_t from = f->is_tcp ? last + (int32_t)(seq - base - (uint32_t)last) : last;
        const int64_t end = from + s->len + s->missing;
        if (end > parts->end) parts->end = end;
        if (s->len == 0) continue;
        last = f->is_tcp ? from : last + s->len;
        if (!grow(&parts->part, &parts->room, parts->n + 1, sizeof *parts->part)) return SH_ENOMEM;
        parts->part[parts->n++] = (struct part){s->data, s->len, from, s->t_ns, i};
    }
    if (parts->n != 0) qsort(parts->part, parts->n, sizeof *parts->part, by_place);
    return SH_OK;
}

/* Leaves out bytes that came twice. If bytes before a part came later than the part, the part gets their later time,
 * since a receiver has its bytes only then. Without a SYN the first segment of the file need not be the first of the
 * stream. */
static void trim(struct replay_capture *c, struct parts *parts)
{
    int64_t place = parts->has_begin || parts->n == 0 ? 0 : parts->part[0].from, t_ns = INT64_MIN;
    size_t n = 0, number = 0;
    for (size_t i = 0; i < parts->n; i++) {
        struct part p = parts->part[i];
        if (p.t_ns < t_ns) p.t_ns = t_ns;
        if (p.number < number) p.number = number;
        if (p.from > place) c->counts.missing_bytes += (uint64_t)(p.from - place);
        const int64_t had = p.from < place ? place - p.from : 0;
        if (had >= (int64_t)p.len) continue;
        p.data += had;
        p.len -= (size_t)had;
        place = p.from + had + (int64_t)p.len;
        t_ns = p.t_ns;
        number = p.number;
        parts->part[n++] = p;
    }
    if (parts->end > place) c->counts.missing_bytes += (uint64_t)(parts->end - place);
    parts->n = n;
}

size_t capture_first_bytes(const struct capture_flow *flow, uint32_t side, uint8_t *to, size_t room)
{
    size_t len = 0;
    for (size_t i = 0; i < flow->n && len < room; i++) {
        const struct capture_segment *s = &flow->segment[i];
        const size_t n = s->len < room - len ? s->len : room - len;
        if (s->side != side || n == 0) continue;
        memcpy(to + len, s->data, n);
        len += n;
    }
    return len;
}

static int add_said(struct capture_list *list, const struct capture_said *said)
{
    if (!grow(&list->said, &list->room, list->n + 1, sizeof *list->said)) return SH_ENOMEM;
    list->said[list->n++] = *said;
    return SH_OK;
}

/* A place that moves forward through the parts. part_at finds the part with byte `at` of the side, gaps not counted. */
struct cursor {
    size_t part, passed; /* passed: bytes of the parts before */
};

static const struct part *part_at(const struct parts *parts, struct cursor *c, size_t at)
{
    while (at >= c->passed + parts->part[c->part].len && c->part + 1 < parts->n)
        c->passed += parts->part[c->part++].len;
    return &parts->part[c->part];
}

static int cut(const struct parts *parts, const uint8_t *bytes, size_t len, size_t base, uint32_t side,
               size_t (*message_len)(const uint8_t *, size_t), struct capture_list *list)
{
    struct cursor cursor = {0, 0};
    int rc = SH_OK;
    for (size_t at = 0, n; at < len && rc == SH_OK; at += n) {
        n = message_len(bytes + at, len - at);
        if (n == 0) n = len - at; /* the capture ends within it */
        const int64_t begin_ns = part_at(parts, &cursor, at)->t_ns;
        const struct part *end = part_at(parts, &cursor, at + n - 1);
        rc = add_said(list, &(struct capture_said){base + at, (uint32_t)n, side, begin_ns, end->t_ns, end->number});
    }
    return rc;
}

int capture_add_messages(struct replay_capture *c, const struct capture_flow *flow, uint32_t side,
                         const struct talk_kind *kind, struct capture_store *store, struct capture_list *list)
{
    size_t (*message_len)(const uint8_t *, size_t) = (int)side == flow->device ? kind->answer_len : kind->request_len;
    struct parts parts = {0};
    const size_t base = store->n_bytes;
    int rc = collect(flow, side, &parts);
    if (rc == SH_OK) trim(c, &parts);
    for (size_t i = 0; i < parts.n && rc == SH_OK; i++) {
        const struct part *p = &parts.part[i];
        if (!grow(&store->bytes, &store->byte_room, store->n_bytes + p->len, 1)) {
            rc = SH_ENOMEM;
            break;
        }
        memcpy(store->bytes + store->n_bytes, p->data, p->len);
        if (message_len == NULL)
            rc = add_said(list,
                          &(struct capture_said){store->n_bytes, (uint32_t)p->len, side, p->t_ns, p->t_ns, p->number});
        store->n_bytes += p->len;
    }
    if (rc == SH_OK && message_len != NULL && parts.n != 0)
        rc = cut(&parts, store->bytes + base, store->n_bytes - base, base, side, message_len, list);
    free(parts.part);
    return rc;
}
