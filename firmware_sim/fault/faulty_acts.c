/* SPDX-License-Identifier: MIT */
/* Injected faults of a link: acts at frames, clients that are turned away, and USB enumerations that go wrong.
 *
 * Connections are counted from 1 on the link, those that are turned away too, but not those that come while the head
 * has no power: nobody is there to count them. On a USB link, each time that a host gets the device is a connection. */
#include <stdio.h>
#include <string.h>

#include "core/err.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/fault/faulty_inside.h"

static const int64_t AGAIN_NS = 100000000; /* between attempts to plug the link in again */

_Static_assert((int)LINK_FAULT_UNPLUG == FAULT_UNPLUG - FAULT_DISCONNECT &&
                   (int)LINK_FAULT_CABLE == FAULT_CABLE - FAULT_DISCONNECT &&
                   (int)LINK_FAULT_BUS_RESET == FAULT_USB_RESET - FAULT_DISCONNECT &&
                   (int)LINK_FAULT_ENDPOINT_STALL == FAULT_ENDPOINT_STALL - FAULT_DISCONNECT &&
                   (int)LINK_FAULT_SHORT_PACKETS == FAULT_SHORT_PACKETS - FAULT_DISCONNECT &&
                   (int)LINK_FAULT_REFUSE == FAULT_REFUSE - FAULT_DISCONNECT &&
                   (int)LINK_FAULT_SLOW_ENUMERATION == FAULT_SLOW_ENUMERATION - FAULT_DISCONNECT &&
                   (int)LINK_FAULT_DESCRIPTOR_LENGTH == FAULT_DESCRIPTOR_LENGTH - FAULT_DISCONNECT,
               "kinds of faults and of faults of links are in one order");

static enum link_fault link_fault_of(enum fault_kind kind)
{
    return (enum link_fault)(kind - FAULT_DISCONNECT);
}

static int64_t in_ms(double ms)
{
    return clock_now_ns() + (int64_t)(ms * 1e6);
}

/* ---- acts at frames */

/* Marks the sessions that the act has ended: all of the link for an unplug or a bus reset, this one for a disconnect.
 * The owner learns of it by its next write to such a session. */
static void end_sessions(struct faulty_link *f, int session, enum link_fault what)
{
    const int all = what == LINK_FAULT_UNPLUG || what == LINK_FAULT_BUS_RESET;
    for (int i = 0; i < LINK_MAX_SESSIONS; i++)
        f->session[i].is_gone |= all || (what == LINK_FAULT_DISCONNECT && i == session);
}

void faulty_carry_out(struct faulty_link *f, int session, const struct wire_piece *act)
{
    struct wire *wire = f->session[session].wire;
    const enum fault_kind kind = (enum fault_kind)act->act;
    const enum link_fault what = link_fault_of(kind);
    const double for_ms = act->for_ms;
    const uint32_t n = act->n;
    struct fault_note note = *wire_act_note(act); /* wire_pop frees the act */
    const int rc = f->inner->fault(f->link, what, session, n, for_ms);
    wire_pop(wire);
    if (what == LINK_FAULT_BUS_RESET) f->plug_ns = in_ms(0.0); /* a reset may unplug, and fail to plug in again */
    if (rc != SH_OK) {
        fault_tally_take_back(&f->tally, note.fault);
        wire_go_on(wire);
        char text[96];
        snprintf(text, sizeof text, "the fault %s could not be carried out now", fault_names[note.kind]);
        f->spec.say(f->spec.owner, text);
        return;
    }
    if (f->pulled.ended && note.t_ns <= f->pulled.t_ns) /* the act has waited for the cable */
        note.t_ns = f->spec.time_ns(f->spec.owner);
    fault_board_note(f->spec.board, &note);
    if (what == LINK_FAULT_UNPLUG || what == LINK_FAULT_CABLE) f->plug_ns = in_ms(for_ms);
    if (note.kind == FAULT_CABLE) f->pulled = note;
    if (what == LINK_FAULT_CABLE) f->resets = (int)n;
    if (what == LINK_FAULT_DISCONNECT && for_ms > 0.0) f->refuse_until_ns = in_ms(for_ms);
    end_sessions(f, session, what);
}

int faulty_is_pulled(const struct faulty_link *f)
{
    return f->pulled.fault != 0 && !f->pulled.ended;
}

int faulty_is_same_pull(const struct faulty_link *f, const struct wire_piece *act)
{
    const struct fault_note *note = wire_act_note(act);
    return note->fault == f->pulled.fault && note->session != f->pulled.session &&
           (!f->pulled.ended || note->t_ns <= f->pulled.t_ns);
}

void faulty_drop_act(struct faulty_link *f, int session, const struct wire_piece *act)
{
    fault_tally_take_back(&f->tally, wire_act_note(act)->fault);
    wire_pop(f->session[session].wire);
}

void faulty_end_cable(struct faulty_link *f)
{
    if (!faulty_is_pulled(f)) return;
    f->pulled.ended = 1;
    f->pulled.t_ns = f->spec.time_ns(f->spec.owner);
    const struct fault_note over = {.fault = f->pulled.fault,
                                    .kind = f->pulled.kind,
                                    .t_ns = f->pulled.t_ns,
                                    .link = f->pulled.link,
                                    .of = f->pulled.of,
                                    .byte = -1,
                                    .ended = 1};
    fault_board_note(f->spec.board, &over);
}

void faulty_plug(struct faulty_link *f)
{
    if (f->plug_ns == 0 || clock_now_ns() < f->plug_ns) return;
    if (f->inner->fault(f->link, LINK_FAULT_PLUG, 0, (uint32_t)f->resets, 0.0) == SH_OK) {
        if (f->plug_failed) f->spec.say(f->spec.owner, "is there again");
        f->plug_ns = f->plug_failed = f->resets = 0;
        faulty_end_cable(f);
        return;
    }
    if (!f->plug_failed)
        f->spec.say(f->spec.owner,
                    "was unplugged on request, and somebody else has its endpoint now; tries until it is free");
    f->plug_failed = 1;
    f->plug_ns = clock_now_ns() + AGAIN_NS;
}

int faulty_fault(void *link, enum link_fault what, int session, uint32_t n, double for_ms)
{
    struct faulty_link *f = link;
    if (what != LINK_FAULT_PLUG) {
        f->plug_ns = f->refuse_until_ns = f->resets = 0;
        faulty_end_cable(f);
        return f->inner->fault(f->link, what, session, n, for_ms);
    }
    f->plug_ns = clock_now_ns(); /* now, or once its endpoint is free */
    faulty_plug(f);
    return f->plug_ns == 0 ? SH_OK : SH_ESTATE;
}

/* ---- connections */

/* Takes over the list. A fault that was added since the last connection counts from this one. */
static void look_at_list(struct faulty_link *f)
{
    struct faulty_connections *c = &f->connections;
    struct faulty_connection before[FAULT_MAX];
    struct fault_entry entry[FAULT_KEPT];
    uint32_t n;
    const uint32_t n_before = c->n_faults;
    if (c->version == fault_board_version(f->spec.board)) return;
    memcpy(before, c->fault, sizeof before);
    c->version = fault_board_copy_all(f->spec.board, entry, &n);
    fault_tally_renew(&f->tally, entry, n); /* entry also has the faults taken out last: their counts stay */
    c->n_faults = 0;
    for (uint32_t i = 0; i < n; i++) {
        if (entry[i].until_ns != INT64_MAX) continue;
        const struct faulty_connection *old = fault_find(before, n_before, sizeof *before, entry[i].number);
        c->fault[c->n_faults++] =
            old != NULL ? *old : (struct faulty_connection){entry[i], entry[i].from_start ? 0 : c->n};
    }
}

/* Whether the fault strikes at this connection. */
static int strikes(struct faulty_link *f, uint32_t i, int64_t t_ns)
{
    const struct faulty_connections *c = &f->connections;
    const struct fault_entry *entry = &c->fault[i].entry;
    const struct fault *fault = &entry->fault;
    const struct fault_spot spot = {.number = c->n - c->fault[i].base, .t_ns = t_ns - entry->since_ns};
    if (fault_place_of(fault->kind) != FAULT_AT_CONNECTION) return 0;
    if ((f->can & LINK_FAULT_BIT(link_fault_of(fault->kind))) == 0) return 0;
    if (fault->count != 0 && *fault_tally_hits(&f->tally, entry->number) >= fault->count) return 0;
    return fault_strikes(fault, entry->number, f->spec.number, &spot);
}

/* Carries the fault out, and notes it. session: -1: none. */
static int inject(struct faulty_link *f, uint32_t i, int session, int64_t t_ns)
{
    const struct fault_entry *entry = &f->connections.fault[i].entry;
    const struct fault *fault = &entry->fault;
    const struct fault_note note = {
        .fault = entry->number,
        .kind = fault->kind,
        .t_ns = t_ns,
        .link = f->spec.number,
        .session = session >= 0 ? f->spec.first_session + (uint32_t)session : 0,
        .number = f->connections.n,
        .byte = -1,
        .n = fault->kind == FAULT_DESCRIPTOR_LENGTH ? fault_n(fault) : 0,
        .for_ms = fault->for_ms,
    };
    if (f->inner->fault(f->link, link_fault_of(fault->kind), session, fault_n(fault), fault->for_ms) != SH_OK) return 0;
    ++*fault_tally_hits(&f->tally, entry->number);
    fault_board_note(f->spec.board, &note);
    return 1;
}

/* Injects the faults of the next connection. Returns 1 when its client was turned away. */
static int connect_next(struct faulty_link *f, int session)
{
    const int64_t t_ns = f->spec.time_ns(f->spec.owner);
    int refused = 0;
    look_at_list(f);
    f->connections.n++;
    for (uint32_t i = 0; i < f->connections.n_faults && !refused; i++)
        if (strikes(f, i, t_ns) && inject(f, i, session, t_ns))
            refused = f->connections.fault[i].entry.fault.kind == FAULT_REFUSE;
    return refused;
}

int faulty_turns_away(struct faulty_link *f, int session)
{
    if (f->spec.board == NULL || (f->can & LINK_FAULT_BIT(LINK_FAULT_REFUSE)) == 0) return 0;
    if (f->spec.is_off(f->spec.owner)) return 0;
    if (connect_next(f, session)) return 1;
    return clock_now_ns() < f->refuse_until_ns && f->inner->fault(f->link, LINK_FAULT_REFUSE, session, 0, 0.0) == SH_OK;
}

void faulty_plugged(struct faulty_link *f)
{
    if (f->spec.board == NULL) return;
    f->inner->fault(f->link, LINK_FAULT_SLOW_ENUMERATION, 0, 0, 0.0);
    f->inner->fault(f->link, LINK_FAULT_DESCRIPTOR_LENGTH, 0, 0, 0.0);
    if (!f->spec.is_off(f->spec.owner)) connect_next(f, -1);
}
