#include "firmware_sim/fault/wire_inside.h"

#include <stdlib.h>
#include <string.h>

#include "core/err.h"
#include "drivers/protocol/native.h"

struct wire *wire_create(const struct wire_spec *spec)
{
    struct wire *wire = calloc(1, sizeof *wire);
    if (wire == NULL) return NULL;
    wire->spec = *spec;
    wire->unit = malloc(spec->max_unit);
    wire->mask = malloc(spec->max_unit);
    wire->last_reply = malloc(spec->max_unit);
    if (wire->unit != NULL && wire->mask != NULL && wire->last_reply != NULL) return wire;
    wire_free(wire);
    return NULL;
}

void wire_free(struct wire *wire)
{
    if (wire == NULL) return;
    wire_queue_clear(&wire->queue);
    free(wire->unit);
    free(wire->mask);
    free(wire->last_reply);
    free(wire);
}

/* Those that were there keep what they know; new ones count from here. */
static void renew(struct wire *wire)
{
    struct fault_entry entry[FAULT_MAX];
    struct wire_fault before[FAULT_MAX];
    const uint32_t n_before = wire->n_faults;
    memcpy(before, wire->fault, sizeof before);
    wire->version = fault_board_copy(wire->spec.board, entry, &wire->n_faults);
    if (wire->spec.tally != NULL) fault_tally_renew(wire->spec.tally, entry, wire->n_faults);
    for (uint32_t i = 0; i < wire->n_faults; i++) {
        struct wire_fault *fault = &wire->fault[i];
        *fault = (struct wire_fault){.entry = entry[i]};
        if (!entry[i].from_start) memcpy(fault->base, wire->count, sizeof fault->base);
        for (uint32_t k = 0; k < n_before; k++)
            if (before[k].entry.number == entry[i].number) *fault = before[k];
    }
}

static int is_act(enum fault_kind kind)
{
    return kind >= FAULT_DISCONNECT && kind <= FAULT_SHORT_PACKETS;
}

/* How often it has struck: what the link does counts for all its sessions. */
static uint64_t *hits_of(struct wire *wire, struct wire_fault *fault)
{
    return is_act(fault->entry.fault.kind) && wire->spec.tally != NULL
               ? fault_tally_hits(wire->spec.tally, fault->entry.number)
               : &fault->hits;
}

static int concerns(struct wire *wire, struct wire_fault *fault, int of)
{
    const struct fault *f = &fault->entry.fault;
    if (is_act(f->kind) && (wire->spec.acts & UINT32_C(1) << (f->kind - FAULT_DISCONNECT)) == 0) return 0;
    if (f->count != 0 && *hits_of(wire, fault) >= f->count) return 0;
    return fault_place_of(f->kind) == FAULT_AT_REPLY  ? of == FAULT_OF_REPLIES
           : fault_place_of(f->kind) == FAULT_AT_FRAME ? of == f->of
                                                       : 0;
}

static int change_all(struct wire *wire, struct wire_making *making)
{
    const int of = making->item->of;
    for (uint32_t i = 0; i < wire->n_faults && !making->dropped; i++) {
        struct wire_fault *fault = &wire->fault[i];
        struct fault_spot spot = making->spot;
        if (!concerns(wire, fault, of)) continue;
        spot.number -= fault->base[of];
        spot.t_ns -= fault->entry.since_ns;
        if (!fault_strikes(&fault->entry.fault, fault->entry.number, wire->spec.link, &spot)) continue;
        ++*hits_of(wire, fault);
        if (wire_change(wire, fault, spot.number, making) != SH_OK) return SH_ENOMEM;
    }
    return SH_OK;
}

/* One copy of what has become of it, in as many writes as it is split into. */
static int emit(struct wire *wire, const struct wire_making *making, int first)
{
    const uint32_t n = making->split > 1 && making->split <= making->len ? making->split : 1;
    for (uint32_t i = 0; i < n; i++) {
        const size_t from = making->len * i / n, to = making->len * (i + 1) / n;
        struct wire_piece *piece = wire_piece_new(making->kind, wire->unit + from, to - from, (size_t)making->joins * wire->spec.max_unit);
        if (piece == NULL) return SH_ENOMEM;
        piece->alone = n > 1;
        piece->not_before_ns = making->not_before_ns;
        piece->quiet_ms = i == 0 && first ? making->quiet_ms : 0.0;
        piece->behind = making->behind;
        piece->joins = i + 1 == n ? making->joins : 0;
        if (making->behind != 0 || (making->holds_alone && making->not_before_ns > making->now_ns))
            wire_queue_hold(&wire->queue, piece);
        else
            wire_queue_put(&wire->queue, piece);
    }
    return SH_OK;
}

static int emit_all(struct wire *wire, const struct wire_making *making)
{
    int rc = SH_OK;
    for (uint32_t i = 0; i < making->copies && rc == SH_OK; i++)
        rc = emit(wire, making, i == 0);
    return rc;
}

/* Frames that depend on nothing but the scan. */
static int is_of_stream(const struct native_header *header)
{
    return header->type != NATIVE_TELEMETRY && header->type != NATIVE_EVENT &&
           (header->flags & (NATIVE_REPEAT | NATIVE_LOCAL)) == 0;
}

static void look_at_frame(const struct wire_item *item, struct fault_spot *spot)
{
    struct native_header header;
    struct native_points points;
    native_read_header(item->bytes, &header);
    spot->t_ns = header.t_ns;
    if (header.type != NATIVE_POINTS ||
        native_decode_points(item->bytes + NATIVE_HEADER_LEN, header.length, &points) != SH_OK)
        return;
    spot->has_pulses = 1;
    spot->pulse0 = points.pulse0;
    spot->n_pulses = points.n_pulses;
}

static void keep_reply(struct wire *wire, const struct wire_item *item)
{
    wire->last_reply_len = item->len <= wire->spec.max_unit ? item->len : 0;
    memcpy(wire->last_reply, item->bytes, wire->last_reply_len);
    wire->heard_len = 0;
}

int wire_put(struct wire *wire, const struct wire_item *given, int64_t now_ns)
{
    struct wire_item item = *given;
    struct wire_making making = {.item = &item, .copies = 1, .now_ns = now_ns, .len = item.len};
    if (item.len > wire->spec.max_unit) return SH_ENOMEM;
    if (wire->version != fault_board_version(wire->spec.board)) renew(wire);
    making.spot.t_ns = item.t_ns;
    making.kind = wire->spec.units ? WIRE_UNIT : WIRE_FRAMES;
    if (wire->spec.native && item.of == FAULT_OF_REPLIES) {
        making.kind = WIRE_TEXT;
    } else if (wire->spec.native) {
        struct native_header header;
        native_read_header(item.bytes, &header);
        item.of = is_of_stream(&header) ? FAULT_OF_STREAM : FAULT_OF_NOTICES;
        look_at_frame(&item, &making.spot);
    }
    making.spot.number = ++wire->count[item.of];
    making.not_before_ns = wire->last_due_ns > now_ns ? wire->last_due_ns : 0;
    memcpy(wire->unit, item.bytes, item.len);
    int rc = change_all(wire, &making);
    if (rc == SH_OK && !making.dropped) rc = emit_all(wire, &making);
    if (!making.holds_alone && making.not_before_ns > wire->last_due_ns) wire->last_due_ns = making.not_before_ns;
    if (item.of == FAULT_OF_REPLIES)
        keep_reply(wire, &item);
    else if (!making.dropped && making.behind == 0)
        wire_queue_overtake(&wire->queue);
    return rc;
}

void wire_heard(struct wire *wire, const void *bytes, size_t len)
{
    const size_t room = sizeof wire->heard - wire->heard_len;
    if (len > room) len = room;
    memcpy(wire->heard + wire->heard_len, bytes, len);
    wire->heard_len += len;
}

struct wire_piece *wire_due(struct wire *wire, int64_t now_ns, int all)
{
    wire_queue_let_go(&wire->queue, now_ns, all);
    return wire_queue_due(&wire->queue, now_ns, all);
}

int64_t wire_next_ns(const struct wire *wire)
{
    return wire_queue_next_ns(&wire->queue);
}

void wire_pop(struct wire *wire)
{
    wire_queue_pop(&wire->queue);
}

size_t wire_bytes(const struct wire *wire)
{
    return wire->queue.n_bytes;
}

int wire_is_empty(const struct wire *wire)
{
    return wire->queue.first == NULL && wire->queue.held == NULL;
}
