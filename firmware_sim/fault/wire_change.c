/* What each kind of fault does to one frame, unit or reply. */
#include <math.h>
#include <string.h>

#include "core/err.h"
#include "drivers/protocol/native.h"
#include "firmware_sim/fault/wire_inside.h"

/* Draws of one place. */
enum { DRAW_N = 1, DRAW_MS, DRAW_BYTES };

struct change {
    struct wire *wire;
    const struct wire_fault *fault;
    uint64_t number; /* of the frame, as the fault counts */
    struct wire_making *making;
    struct fault_note note;
};

static uint64_t draw(const struct change *c, uint32_t which)
{
    return fault_random(&c->fault->entry.fault, c->fault->entry.number, c->wire->spec.link, c->number, which);
}

/* From 0 to n - 1. */
static uint64_t draw_below(const struct change *c, uint32_t which, uint64_t n)
{
    return (uint64_t)(((unsigned __int128)draw(c, which) * n) >> 64);
}

static void reorder(struct change *c)
{
    c->note.n = 1 + draw_below(c, DRAW_N, fault_n(&c->fault->entry.fault));
    c->making->behind = (uint32_t)c->note.n;
}

static void delay(struct change *c, double ms)
{
    const int64_t due_ns = c->making->now_ns + llround(ms * 1e6);
    if (due_ns > c->making->not_before_ns) c->making->not_before_ns = due_ns;
    c->note.for_ms = ms;
}

/* At least one byte is left, and one is missing. */
static void truncate_unit(struct change *c)
{
    struct wire_making *m = c->making;
    uint64_t n = fault_n(&c->fault->entry.fault);
    if (m->len < 2) n = 0;
    else if (n == 0) n = 1 + draw_below(c, DRAW_N, m->len - 1);
    else if (n > m->len - 1) n = m->len - 1;
    m->len -= n;
    c->note.n = n;
    c->note.byte = (int64_t)m->len;
}

/* Into the wire's mask: the bits that may change. Returns how many. */
static uint64_t mark_bits(const struct change *c)
{
    const struct fault *f = &c->fault->entry.fault;
    const struct wire *wire = c->wire;
    const size_t len = c->making->len;
    const int all = !f->reseal || wire->spec.content == NULL;
    uint64_t n = 0;
    memset(wire->mask, all ? 0xff : 0, len);
    if (!all) wire->spec.content(wire->unit, len, wire->mask);
    for (size_t i = 0; i < len; i++) {
        if (f->byte >= 0 && (uint64_t)f->byte != i) wire->mask[i] = 0;
        n += (uint64_t)__builtin_popcount(wire->mask[i]);
    }
    return n;
}

/* Bit k of those that may change; there are more. */
static uint64_t find_bit(const uint8_t *mask, uint64_t k)
{
    uint64_t at = 0;
    for (; k >= (uint64_t)__builtin_popcount(mask[at / 8]); at += 8)
        k -= (uint64_t)__builtin_popcount(mask[at / 8]);
    for (;; at++) {
        const int may = mask[at / 8] >> at % 8 & 1;
        if (may && k == 0) return at;
        k -= (uint64_t)may;
    }
}

/* Of n bits the first is anywhere, the others follow it. A datagram that is damaged on its way is dropped by the system
 * of its reader; with reseal it was wrong before it was sent. */
static void flip(struct change *c)
{
    const struct fault *f = &c->fault->entry.fault;
    const uint64_t n_bits = mark_bits(c), n = n_bits < fault_n(f) ? n_bits : fault_n(f);
    if (f->reseal) strcpy(c->note.text, "resealed");
    if (!f->reseal && c->wire->spec.datagrams) {
        c->making->dropped = 1;
        strcpy(c->note.text, "not sent: its UDP checksum would be wrong");
    }
    if (n == 0) return;
    uint64_t k = draw_below(c, DRAW_BYTES, n_bits);
    c->note.byte = (int64_t)(find_bit(c->wire->mask, k) / 8);
    c->note.n = n;
    for (uint64_t done = 0; done < n; done++, k = (k + 1) % n_bits) {
        const uint64_t at = find_bit(c->wire->mask, k);
        c->wire->unit[at / 8] ^= (uint8_t)(1U << at % 8);
    }
    if (f->reseal && c->wire->spec.reseal != NULL) c->wire->spec.reseal(c->wire->unit, c->making->len);
}

static int garbage(struct change *c)
{
    const uint32_t n = fault_n(&c->fault->entry.fault);
    const enum wire_piece_kind kind = c->making->kind == WIRE_TEXT ? WIRE_FRAMES : c->making->kind;
    struct wire_piece *piece = wire_piece_new(kind, NULL, 0, n);
    if (piece == NULL) return SH_ENOMEM;
    for (uint32_t i = 0; i < n; i++)
        piece->bytes[i] = (uint8_t)(draw(c, DRAW_BYTES + i / 8) >> 8 * (i % 8));
    piece->len = n;
    piece->not_before_ns = c->making->not_before_ns;
    wire_queue_put(&c->wire->queue, piece);
    c->note.n = n;
    return SH_OK;
}

static int act(struct change *c)
{
    const struct fault *f = &c->fault->entry.fault;
    struct wire_piece *piece = wire_piece_new(WIRE_ACT, NULL, 0, 0);
    if (piece == NULL) return SH_ENOMEM;
    piece->act = f->kind;
    piece->n = fault_n(f);
    piece->for_ms = f->for_ms;
    piece->not_before_ns = c->making->not_before_ns;
    wire_queue_put(&c->wire->queue, piece);
    c->note.for_ms = f->for_ms;
    if (f->kind == FAULT_SHORT_PACKETS) c->note.n = piece->n;
    return SH_OK;
}

static int wrong_reply(struct change *c)
{
    struct wire *wire = c->wire;
    static const char none[] = "OK\r\n"; /* there was no reply before */
    const size_t len = wire->last_reply_len;
    c->making->len = len != 0 ? len : sizeof none - 1;
    memcpy(wire->unit, len != 0 ? wire->last_reply : (const uint8_t *)none, c->making->len);
    return SH_OK;
}

static int echo(struct change *c)
{
    const struct wire *wire = c->wire;
    struct wire_piece *piece = wire_piece_new(c->making->kind, wire->heard, wire->heard_len, 0);
    if (piece == NULL) return SH_ENOMEM;
    wire_queue_put(&c->wire->queue, piece);
    c->note.n = wire->heard_len;
    return SH_OK;
}

static int change_frame(struct change *c)
{
    const struct fault *f = &c->fault->entry.fault;
    struct wire_making *m = c->making;
    switch (f->kind) {
    case FAULT_DROP:
    case FAULT_NO_REPLY:
        m->dropped = 1;
        return SH_OK;
    case FAULT_DUPLICATE:
        m->copies += fault_n(f);
        c->note.n = fault_n(f);
        return SH_OK;
    case FAULT_REORDER:
        reorder(c);
        return SH_OK;
    case FAULT_DELAY:
        delay(c, f->for_ms);
        return SH_OK;
    case FAULT_JITTER:
        delay(c, f->for_ms * 0x1p-64 * (double)draw(c, DRAW_MS));
        return SH_OK;
    case FAULT_LATE_REPLY:
        delay(c, f->for_ms);
        m->holds_alone = 1;
        return SH_OK;
    case FAULT_TRUNCATE:
        truncate_unit(c);
        return SH_OK;
    case FAULT_FLIP:
        flip(c);
        return SH_OK;
    case FAULT_STALL:
        m->quiet_ms += f->for_ms;
        c->note.for_ms = f->for_ms;
        return SH_OK;
    case FAULT_SPLIT:
        m->split = fault_n(f);
        c->note.n = m->split;
        return SH_OK;
    case FAULT_MERGE:
        m->joins = fault_n(f) - 1;
        c->note.n = fault_n(f);
        return SH_OK;
    case FAULT_GARBAGE:
        return garbage(c);
    case FAULT_WRONG_REPLY:
        return wrong_reply(c);
    case FAULT_ECHO:
        return echo(c);
    default:
        return act(c);
    }
}

static void describe(struct change *c)
{
    const struct wire_making *m = c->making;
    struct fault_note *note = &c->note;
    *note = (struct fault_note){.fault = c->fault->entry.number,
                                .kind = c->fault->entry.fault.kind,
                                .t_ns = m->spot.t_ns,
                                .link = c->wire->spec.link,
                                .session = c->wire->spec.session,
                                .of = m->item->of,
                                .number = m->spot.number,
                                .has_pulse = m->spot.has_pulses,
                                .pulse = m->spot.pulse0,
                                .byte = -1};
    if (!c->wire->spec.native || m->item->of == FAULT_OF_REPLIES) return;
    struct native_header header;
    native_read_header(m->item->bytes, &header);
    note->has_seq = (header.flags & NATIVE_LOCAL) == 0;
    note->seq = header.seq;
    note->type = header.type;
}

int wire_change(struct wire *wire, const struct wire_fault *fault, uint64_t number, struct wire_making *making)
{
    struct change c = {.wire = wire, .fault = fault, .number = number, .making = making};
    describe(&c);
    const int rc = change_frame(&c);
    if (rc == SH_OK) fault_board_note(wire->spec.board, &c.note);
    return rc;
}
