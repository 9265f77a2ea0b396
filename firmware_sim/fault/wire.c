/* SPDX-License-Identifier: MIT */
#include "firmware_sim/fault/wire_inside.h"

#include <stdlib.h>
#include <string.h>

#include "core/err.h"
#include "core/grow.h"
#include "drivers/protocol/native.h"

static const int64_t HOLD_NS = WIRE_HOLD_MS * INT64_C(1000000);

struct wire *wire_create(const struct wire_spec *spec)
{
    struct wire *wire = calloc(1, sizeof *wire);
    if (wire == NULL) return NULL;
    wire->spec = *spec;
    if (grow(&wire->unit, &wire->unit_room, spec->max_unit, 1)) return wire;
    wire_free(wire);
    return NULL;
}

void wire_free(struct wire *wire)
{
    if (wire == NULL) return;
    for (const struct wire_piece *left = wire->queue.first; left != NULL; left = left->next)
        if (left->kind == WIRE_ACT && wire->spec.tally != NULL)
            fault_tally_take_back(wire->spec.tally, wire_act_note(left)->fault);
    wire_queue_clear(&wire->queue);
    free(wire->unit);
    free(wire->mask);
    free(wire->last_reply);
    free(wire);
}

/* Faults that were in the list before keep their counts; new ones count from here. */
void wire_renew(struct wire *wire, uint64_t ahead)
{
    struct fault_entry entry[FAULT_KEPT];
    struct wire_fault before[FAULT_KEPT];
    const uint32_t n_before = wire->n_faults;
    memcpy(before, wire->fault, sizeof before);
    wire->version = fault_board_copy_all(wire->spec.board, entry, &wire->n_faults);
    if (wire->spec.tally != NULL) fault_tally_renew(wire->spec.tally, entry, wire->n_faults);
    for (uint32_t i = 0; i < wire->n_faults; i++) {
        const struct wire_fault *old = fault_find(before, n_before, sizeof *before, entry[i].number);
        struct wire_fault *fault = &wire->fault[i];
        *fault = old != NULL ? *old : (struct wire_fault){0};
        fault->entry = entry[i]; /* it may have been taken out since */
        if (old != NULL || entry[i].from_start) continue;
        memcpy(fault->base, wire->count, sizeof fault->base);
        fault->base[FAULT_OF_REPLIES] += ahead;
    }
}

/* ---- which faults strike */

enum { LAST_RANK = 4 };

/* Returns the fault's place in the order in which faults strike at a frame. */
static int rank_of(const struct wire *wire, const struct fault *f)
{
    switch (f->kind) {
    case FAULT_DISCONNECT:
    case FAULT_UNPLUG:
    case FAULT_CABLE:
    case FAULT_USB_RESET:
        return 0;
    case FAULT_DROP:
    case FAULT_NO_REPLY:
        return 1;
    case FAULT_TRUNCATE:
        return 2;
    case FAULT_FLIP:
        return f->reseal ? 3 : wire->spec.datagrams ? 1 : LAST_RANK; /* a damaged datagram is not sent, as with drop */
    default:
        return LAST_RANK;
    }
}

/* Returns the count of how often the fault has struck: an act of the link counts for all its sessions. */
static uint64_t *hits_of(struct wire *wire, struct wire_fault *fault)
{
    return fault_is_act(fault->entry.fault.kind) && wire->spec.tally != NULL
               ? fault_tally_hits(wire->spec.tally, fault->entry.number)
               : &fault->hits;
}

static int concerns(struct wire *wire, struct wire_fault *fault, int of)
{
    const struct fault *f = &fault->entry.fault;
    const enum fault_kind act = fault_act_of(f->kind, wire->spec.acts);
    if (fault_is_act(f->kind) && (wire->spec.acts & UINT32_C(1) << (act - FAULT_DISCONNECT)) == 0) return 0;
    if (f->count != 0 && *hits_of(wire, fault) >= f->count) return 0;
    return fault_place_of(f->kind) == FAULT_AT_REPLY   ? of == FAULT_OF_REPLIES
           : fault_place_of(f->kind) == FAULT_AT_FRAME ? of == f->of
                                                       : 0;
}

/* Frames that were on their way when a fault was added are not counted for that fault. */
static void pass_over_old(struct wire *wire, const struct wire_making *making)
{
    const int of = making->item->of;
    for (uint32_t i = 0; i < wire->n_faults && of != FAULT_OF_REPLIES; i++)
        if (making->spot.t_ns < wire->fault[i].entry.since_ns && making->spot.number > wire->fault[i].base[of])
            wire->fault[i].base[of]++;
}

static int change(struct wire *wire, struct wire_fault *fault, struct wire_making *making)
{
    const int of = making->item->of;
    struct fault_spot spot = making->spot;
    if (!concerns(wire, fault, of) || spot.number <= fault->base[of]) return SH_OK;
    const int is_gone = fault->entry.until_ns != INT64_MAX;
    if (is_gone && (of == FAULT_OF_REPLIES || spot.t_ns >= fault->entry.until_ns)) return SH_OK;
    spot.number -= fault->base[of];
    spot.t_ns -= fault->entry.since_ns;
    if (spot.t_ns < 0 && of != FAULT_OF_REPLIES) return SH_OK;
    if (spot.t_ns < 0) spot.t_ns = 0; /* replies count from the command on, which is before the head's next tick */
    if (!fault_strikes(&fault->entry.fault, fault->entry.number, wire->spec.link, &spot)) return SH_OK;
    const int done = wire_change(wire, fault, spot.number, making);
    if (done > 0) ++*hits_of(wire, fault);
    return done < 0 ? done : SH_OK;
}

static int change_all(struct wire *wire, struct wire_making *making)
{
    int rc = SH_OK;
    pass_over_old(wire, making);
    for (int rank = 0; rank <= LAST_RANK; rank++)
        for (uint32_t i = 0; i < wire->n_faults && rc == SH_OK && !wire->is_over; i++)
            if (rank_of(wire, &wire->fault[i].entry.fault) == rank) rc = change(wire, &wire->fault[i], making);
    return rc;
}

/* ---- from an item to pieces */

static struct wire_piece *make_piece(const struct wire *wire, const struct wire_making *making, uint32_t i)
{
    const size_t from = making->len * i / making->split, to = making->len * (i + 1) / making->split;
    struct wire_piece *piece = wire_piece_new(making->kind, wire->unit + from, to - from);
    if (piece == NULL) return NULL;
    piece->alone = making->split > 1;
    piece->not_before_ns = making->not_before_ns;
    piece->of = making->item->of;
    piece->after = making->behind != 0 ? making->spot.number + making->behind : 0;
    piece->t_ns = making->spot.t_ns;
    return piece;
}

/* Emits one copy of an item, in as many writes as it is split into. */
static int emit(struct wire *wire, const struct wire_making *making, int is_first)
{
    int rc = SH_OK;
    for (uint32_t i = 0; i < making->split && rc == SH_OK; i++) {
        struct wire_piece *piece = make_piece(wire, making, i);
        if (piece == NULL) return SH_ENOMEM;
        if (is_first && i + 1 == making->split) {
            piece->frames = making->frames;
            piece->pulses = making->pulses;
        }
        piece->open = making->opens && i + 1 == making->split;
        if (making->hold_ns > making->now_ns) piece->not_before_ns = making->hold_ns;
        if (making->behind != 0 || making->hold_ns > making->now_ns)
            wire_queue_hold(&wire->queue, piece);
        else
            rc = wire_queue_put(&wire->queue, piece);
    }
    return rc;
}

static int is_merging(const struct wire *wire)
{
    return wire->count[FAULT_OF_STREAM] < wire->merge_until[FAULT_OF_STREAM] ||
           wire->count[FAULT_OF_NOTICES] < wire->merge_until[FAULT_OF_NOTICES];
}

/* Finishes an item. Later ones do not go out before it, even if it is delayed. Pieces that were held for it go on. */
static int wire_finish(struct wire *wire, const struct wire_making *making)
{
    const int of = making->item->of;
    if (making->not_before_ns > wire->last_due_ns) wire->last_due_ns = making->not_before_ns;
    if (making->hold_ns > wire->reply_due_ns) wire->reply_due_ns = making->hold_ns;
    int rc = of != FAULT_OF_REPLIES ? wire_queue_pass(&wire->queue, of, making->spot.number, INT64_MIN) : SH_OK;
    if (!is_merging(wire)) wire_queue_close(&wire->queue);
    if (of != FAULT_OF_REPLIES) return rc;
    wire_heard_answered(wire->spec.heard);
    if (!grow(&wire->last_reply, &wire->last_reply_room, making->item->len, 1)) return SH_ENOMEM;
    wire->last_reply_len = making->item->len;
    memcpy(wire->last_reply, making->item->bytes, making->item->len);
    return rc;
}

/* ---- items */

/* Whether a frame depends on the scan alone. */
static int is_of_stream(const struct native_header *header)
{
    return header->type != NATIVE_TELEMETRY && header->type != NATIVE_EVENT &&
           (header->flags & (NATIVE_REPEAT | NATIVE_LOCAL)) == 0;
}

static void look_at_frame(struct wire_item *item, struct wire_making *making)
{
    struct native_header header;
    struct native_points points;
    native_read_header(item->bytes, &header);
    item->of = is_of_stream(&header) ? FAULT_OF_STREAM : FAULT_OF_NOTICES;
    making->frames = (header.flags & NATIVE_LOCAL) == 0;
    making->spot.t_ns = header.t_ns;
    if (header.type != NATIVE_POINTS ||
        native_decode_points(item->bytes + NATIVE_HEADER_LEN, header.length, &points) != SH_OK)
        return;
    making->spot.has_pulses = 1;
    making->spot.pulse0 = points.pulse0;
    making->pulses = making->spot.n_pulses = points.n_pulses;
}

static void look_at(struct wire *wire, struct wire_item *item, struct wire_making *making)
{
    making->spot.t_ns = item->t_ns;
    making->kind = item->of == FAULT_OF_REPLIES ? WIRE_REPLY : WIRE_FRAMES;
    if (wire->spec.native && item->of != FAULT_OF_REPLIES)
        look_at_frame(item, making);
    else
        making->frames = wire->spec.units != 0;
    making->spot.number = ++wire->count[item->of];
    making->not_before_ns = wire->last_due_ns > making->now_ns ? wire->last_due_ns : 0;
    making->hold_ns = item->of == FAULT_OF_REPLIES && wire->reply_due_ns > making->now_ns ? wire->reply_due_ns : 0;
}

static void lose(struct wire *wire, const struct wire_making *making)
{
    wire->void_frames += making->frames;
    wire->void_pulses += making->pulses;
}

int wire_put(struct wire *wire, const struct wire_item *given, int64_t now_ns)
{
    struct wire_item item = *given;
    struct wire_making making = {.item = &item, .copies = 1, .split = 1, .now_ns = now_ns, .len = item.len};
    if (wire->version != fault_board_version(wire->spec.board)) wire_renew(wire, 0);
    look_at(wire, &item, &making);
    int rc = item.of != FAULT_OF_REPLIES && !wire->is_over ? wire_time(wire, making.spot.t_ns) : SH_OK;
    if (!grow(&wire->unit, &wire->unit_room, item.len, 1)) rc = SH_ENOMEM;
    if (rc == SH_OK) memcpy(wire->unit, item.bytes, item.len);
    if (rc == SH_OK && !wire->is_over) rc = change_all(wire, &making);
    if (rc != SH_OK || wire->is_over) {
        lose(wire, &making);
        return rc;
    }
    for (uint32_t i = 0; i < making.copies && rc == SH_OK && !making.is_dropped; i++)
        rc = emit(wire, &making, i == 0);
    const int end = wire_finish(wire, &making);
    return rc != SH_OK ? rc : end;
}

void wire_go_on(struct wire *wire)
{
    wire->is_over = 0;
}

int wire_put_rest(struct wire *wire, const uint8_t *bytes, size_t len)
{
    struct wire_piece *piece = wire_piece_new(WIRE_FRAMES, bytes, len);
    if (piece == NULL) return SH_ENOMEM;
    piece->alone = 1;
    return wire_queue_put(&wire->queue, piece);
}

int wire_time(struct wire *wire, int64_t t_ns)
{
    int rc = SH_OK;
    struct wire_piece *last = wire->queue.last;
    for (int of = 0; of < FAULT_OF_REPLIES && wire->queue.held != NULL; of++)
        if (wire_queue_pass(&wire->queue, of, 0, t_ns - HOLD_NS) != SH_OK) rc = SH_ENOMEM;
    if (last != NULL && last->open && last->t_ns < t_ns - HOLD_NS) wire_queue_close(&wire->queue);
    return rc;
}

/* ---- out */

const struct fault_note *wire_act_note(const struct wire_piece *act)
{
    return (const struct fault_note *)(const void *)act->bytes;
}

struct wire_piece *wire_due(struct wire *wire, int64_t now_ns)
{
    if (wire->queue.held != NULL) wire_queue_let_go(&wire->queue, now_ns);
    return wire_queue_due(&wire->queue, now_ns);
}

int64_t wire_next_ns(const struct wire *wire)
{
    return wire_queue_next_ns(&wire->queue);
}

void wire_pop(struct wire *wire)
{
    wire_queue_pop(&wire->queue);
}

int wire_is_full(const struct wire *wire, size_t cap, int64_t now_ns)
{
    const struct wire_piece *last = wire->queue.last;
    const size_t opens = last != NULL && last->open ? last->len : 0;
    const size_t most = wire->last_due_ns > now_ns && cap < WIRE_DELAY_BYTES ? WIRE_DELAY_BYTES : cap;
    return wire->queue.n_bytes - opens >= most;
}

int wire_is_empty(const struct wire *wire)
{
    return wire->queue.first == NULL && wire->queue.held == NULL;
}

int wire_keeps_back(const struct wire *wire, int64_t now_ns)
{
    const struct wire_piece *first = wire->queue.first;
    const int stalls = first != NULL && first->kind == WIRE_PAUSE;
    return stalls || (!wire_is_empty(wire) && wire_next_ns(wire) > now_ns);
}

void wire_count_unwritten(const struct wire *wire, uint64_t *frames, uint64_t *pulses)
{
    *frames = wire->void_frames;
    *pulses = wire->void_pulses;
    wire_queue_count(&wire->queue, frames, pulses);
}
