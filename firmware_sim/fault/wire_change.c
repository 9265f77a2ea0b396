/* SPDX-License-Identifier: MIT */
/* Applies each kind of fault to one frame, unit or reply. Each function returns 1; 0: there is nothing for it to do; or
 * SH_ENOMEM. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/err.h"
#include "core/grow.h"
#include "drivers/protocol/native.h"
#include "firmware_sim/fault/wire_inside.h"

/* The random draws of one change (fault_random). */
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

/* ---- the frame, and where it goes */

static int drop(struct change *c)
{
    if (c->making->is_dropped) return 0;
    c->making->is_dropped = 1;
    return 1;
}

static int duplicate(struct change *c)
{
    c->note.n = fault_n(&c->fault->entry.fault);
    c->making->copies += (uint32_t)c->note.n;
    return 1;
}

static int reorder(struct change *c)
{
    if (c->making->opens || c->making->behind != 0) return 0;
    c->note.n = 1 + draw_below(c, DRAW_N, fault_n(&c->fault->entry.fault));
    c->making->behind = (uint32_t)c->note.n;
    return 1;
}

/* Moves *not_before_ns to ms after now, unless it is later already. */
static int put_off(struct change *c, double ms, int64_t *not_before_ns)
{
    const int64_t due_ns = c->making->now_ns + llround(ms * 1e6);
    if (due_ns > *not_before_ns) *not_before_ns = due_ns;
    c->note.for_ms = ms;
    return 1;
}

static int delay(struct change *c)
{
    return put_off(c, c->fault->entry.fault.for_ms, &c->making->not_before_ns);
}

static int jitter(struct change *c)
{
    return put_off(c, c->fault->entry.fault.for_ms * 0x1p-64 * (double)draw(c, DRAW_MS), &c->making->not_before_ns);
}

static int late_reply(struct change *c)
{
    return put_off(c, c->fault->entry.fault.for_ms, &c->making->hold_ns);
}

static int split(struct change *c)
{
    struct wire_making *m = c->making;
    const uint32_t n = fault_n(&c->fault->entry.fault);
    if (m->len < 2 || n < 2 || m->split > 1) return 0;
    m->split = n <= m->len ? n : (uint32_t)m->len;
    c->note.n = m->split;
    return 1;
}

/* A merge never begins within a write that another one began, so that its place depends on frames' numbers alone. */
static int merge(struct change *c)
{
    const int of = c->making->item->of;
    uint64_t *until = &c->wire->merge_until[of];
    const uint32_t n = fault_n(&c->fault->entry.fault);
    if (n < 2 || c->making->behind != 0 || c->making->spot.number <= *until) return 0;
    *until = c->making->spot.number + n - 1;
    c->making->opens = 1;
    c->note.n = n;
    return 1;
}

/* ---- its bytes */

/* Cuts the end off: at least one byte is left, and at least one is missing. */
static int cut(struct change *c)
{
    struct wire_making *m = c->making;
    uint64_t n = fault_n(&c->fault->entry.fault);
    if (m->len < 2) return 0;
    if (n == 0) n = 1 + draw_below(c, DRAW_N, m->len - 1);
    if (n > m->len - 1) n = m->len - 1;
    m->len -= n;
    m->is_cut = 1;
    c->note.n = n;
    c->note.byte = (int64_t)m->len;
    return 1;
}

/* Marks in the wire's mask the bits that may change. Returns how many. */
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

/* Returns the place of the mask's bit number k, from 0. The mask has more than k bits. */
static uint64_t find_bit(const uint8_t *mask, uint64_t k)
{
    size_t i = 0;
    for (; k >= (uint64_t)__builtin_popcount(mask[i]); i++)
        k -= (uint64_t)__builtin_popcount(mask[i]);
    unsigned left = mask[i];
    for (; k > 0; k--)
        left &= left - 1;
    return 8 * i + (uint64_t)__builtin_ctz(left);
}

/* Returns the next bit of the mask after this one; after the last comes the first. */
static uint64_t next_bit(const uint8_t *mask, size_t len, uint64_t at)
{
    for (at++;; at = (at / 8 + 1) * 8) {
        if (at / 8 == len) at = 0;
        const unsigned left = mask[at / 8] >> at % 8;
        if (left != 0) return at + (uint64_t)__builtin_ctz(left);
    }
}

/* Flips n of the marked bits: the first by chance, then the next ones. A bit that another fault has flipped is skipped,
 * since a second flip would restore it. Returns how many were flipped. */
static uint64_t flip_bits(struct change *c, uint64_t n_bits, uint64_t n)
{
    uint8_t *bytes = c->wire->unit;
    const uint8_t *before = c->making->item->bytes, *mask = c->wire->mask;
    uint64_t at = find_bit(mask, draw_below(c, DRAW_BYTES, n_bits)), done = 0;
    for (uint64_t i = 0; i < n_bits && done < n; i++, at = next_bit(mask, c->making->len, at)) {
        const uint8_t bit = (uint8_t)(1U << at % 8);
        if (((bytes[at / 8] ^ before[at / 8]) & bit) != 0) continue;
        bytes[at / 8] ^= bit;
        if (done++ != 0) continue;
        c->note.byte = (int64_t)(at / 8);
        c->note.bit = (uint32_t)(at % 8);
    }
    return done;
}

/* The reader's system drops a datagram that is damaged on its way, so a flip drops it. With reseal the datagram is
 * wrong before it is sent, and arrives. */
static int flip(struct change *c)
{
    const struct fault *f = &c->fault->entry.fault;
    struct wire *wire = c->wire;
    if (f->reseal && c->making->is_cut) return 0; /* no checksum makes a cut frame valid */
    if (!grow(&wire->mask, &wire->mask_room, c->making->len, 1)) return SH_ENOMEM;
    const uint64_t n_bits = mark_bits(c);
    if (n_bits != 0) c->note.n = flip_bits(c, n_bits, fault_n(f));
    if (c->note.n == 0) return 0;
    if (f->reseal && wire->spec.reseal != NULL) wire->spec.reseal(wire->unit, c->making->len);
    if (f->reseal) strcpy(c->note.text, "resealed");
    if (f->reseal || !wire->spec.datagrams) return 1;
    c->making->is_dropped = 1;
    strcpy(c->note.text, "not sent: its UDP checksum would be wrong");
    return 1;
}

/* ---- pieces before the frame */

static int put_before(struct change *c, struct wire_piece *piece)
{
    if (piece == NULL) return SH_ENOMEM;
    piece->not_before_ns = c->making->not_before_ns;
    return wire_queue_put(&c->wire->queue, piece) == SH_OK ? 1 : SH_ENOMEM;
}

/* Garbage has no carriage return, since a reply line ends with one. */
static int garbage(struct change *c)
{
    enum { GARBAGE_MAX = 1024, CARRIAGE_RETURN = 0x0d };
    uint8_t bytes[GARBAGE_MAX];
    const uint32_t wanted = fault_n(&c->fault->entry.fault), n = wanted < GARBAGE_MAX ? wanted : GARBAGE_MAX;
    for (uint32_t i = 0; i < n; i++) {
        bytes[i] = (uint8_t)(draw(c, DRAW_BYTES + i / 8) >> 8 * (i % 8));
        if (bytes[i] == CARRIAGE_RETURN) bytes[i]++;
    }
    c->note.n = n;
    return put_before(c, wire_piece_new(c->making->kind, bytes, n));
}

static int stall(struct change *c)
{
    struct wire_piece *piece = wire_piece_new(WIRE_PAUSE, NULL, 0);
    c->note.for_ms = c->fault->entry.fault.for_ms;
    if (piece != NULL) piece->for_ms = c->note.for_ms;
    return put_before(c, piece);
}

/* Releases all held pieces: no frame is reordered beyond the end of a session. */
static int end_session(struct change *c)
{
    c->wire->is_over = 1;
    const int stream = wire_queue_pass(&c->wire->queue, FAULT_OF_STREAM, UINT64_MAX, 0);
    const int notices = wire_queue_pass(&c->wire->queue, FAULT_OF_NOTICES, UINT64_MAX, 0);
    return stream != SH_OK ? stream : notices;
}

static int act(struct change *c)
{
    const struct fault *f = &c->fault->entry.fault;
    c->note.for_ms = f->for_ms;
    if (f->kind == FAULT_SHORT_PACKETS) c->note.n = fault_n(f);
    if (f->reset) snprintf(c->note.text, sizeof c->note.text, "reset");
    struct wire_piece *piece = wire_piece_new(WIRE_ACT, &c->note, sizeof c->note);
    if (piece == NULL) return SH_ENOMEM;
    piece->act = fault_act_of(f->kind, c->wire->spec.acts);
    piece->n = f->kind == FAULT_CABLE ? (uint32_t)f->reset : fault_n(f);
    piece->for_ms = f->for_ms;
    const int ends = piece->act <= FAULT_USB_RESET && piece->act != FAULT_CABLE; /* disconnect, unplug, usb_reset */
    if (ends && end_session(c) != SH_OK) {
        wire_piece_free(piece);
        return SH_ENOMEM;
    }
    return put_before(c, piece);
}

/* Echoes as a terminal does: a line ends with CR LF. */
static int echo(struct change *c)
{
    size_t len;
    const uint8_t *heard = wire_heard_first(c->wire->spec.heard, &len);
    if (heard == NULL) return 0;
    struct wire_piece *piece = wire_piece_new(c->making->kind, heard, len);
    if (piece != NULL && c->wire->spec.native) {
        if (!grow(&piece->bytes, &piece->room, len + 2, 1)) {
            wire_piece_free(piece);
            return SH_ENOMEM;
        }
        memcpy(piece->bytes + len, "\r\n", 2);
        piece->len += 2;
    }
    c->note.n = piece != NULL ? piece->len : 0;
    return put_before(c, piece);
}

/* Sends the previous reply in place of this one. Where that is missing or the same, a native client gets OK, or gets 0
 * instead of OK. */
static int wrong_reply(struct change *c)
{
    struct wire *wire = c->wire;
    static const char *const others[] = {"OK\r\n", "0\r\n"};
    const struct wire_item *item = c->making->item;
    const uint8_t *wrong = wire->last_reply;
    size_t len = wire->last_reply_len;
    for (int i = 0; i < 2 && (len == 0 || (len == item->len && memcmp(wrong, item->bytes, len) == 0)); i++) {
        if (!wire->spec.native) return 0;
        wrong = (const uint8_t *)others[i];
        len = strlen(others[i]);
    }
    if (!grow(&wire->unit, &wire->unit_room, len, 1)) return SH_ENOMEM;
    memcpy(wire->unit, wrong, len);
    c->making->len = len;
    return 1;
}

/* ---- one fault */

/* Returns whether the fault acts before the frame, and so needs no frame. */
static int is_before(enum fault_kind kind)
{
    return kind == FAULT_GARBAGE || kind == FAULT_STALL || kind == FAULT_ECHO || kind >= FAULT_DISCONNECT;
}

/* Other kinds are acts. */
static int (*const changes[FAULT_N_KINDS])(struct change *c) = {
    [FAULT_DROP] = drop,
    [FAULT_DUPLICATE] = duplicate,
    [FAULT_REORDER] = reorder,
    [FAULT_DELAY] = delay,
    [FAULT_JITTER] = jitter,
    [FAULT_TRUNCATE] = cut,
    [FAULT_FLIP] = flip,
    [FAULT_STALL] = stall,
    [FAULT_SPLIT] = split,
    [FAULT_MERGE] = merge,
    [FAULT_GARBAGE] = garbage,
    [FAULT_NO_REPLY] = drop,
    [FAULT_LATE_REPLY] = late_reply,
    [FAULT_WRONG_REPLY] = wrong_reply,
    [FAULT_ECHO] = echo,
};

static void wire_change_describe(struct change *c)
{
    const struct wire_making *m = c->making;
    struct fault_note *note = &c->note;
    *note = (struct fault_note){.fault = c->fault->entry.number,
                                .kind = c->fault->entry.fault.kind,
                                .t_ns = m->spot.t_ns,
                                .link = c->wire->spec.link,
                                .session = c->wire->spec.session,
                                .of = m->item->of,
                                .number = c->number,
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
    if (making->is_dropped && !is_before(fault->entry.fault.kind)) return 0;
    wire_change_describe(&c);
    const enum fault_kind kind = fault->entry.fault.kind;
    const int done = changes[kind] != NULL ? changes[kind](&c) : act(&c);
    if (done > 0 && !fault_is_act(kind)) fault_board_note(wire->spec.board, &c.note);
    return done;
}
