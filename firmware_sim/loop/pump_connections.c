/* SPDX-License-Identifier: MIT */
/* Injected faults at connections: clients that are turned away, and USB enumerations that go wrong. Connections are
 * counted from 1 on the link, those that are turned away too. On a USB link, each time that a host gets the device is a
 * connection. */
#include "firmware_sim/base/clock.h"
#include "firmware_sim/loop/pump_inside.h"

#include <string.h>

_Static_assert((int)LINK_FAULT_UNPLUG == FAULT_UNPLUG - FAULT_DISCONNECT &&
                   (int)LINK_FAULT_BUS_RESET == FAULT_USB_RESET - FAULT_DISCONNECT &&
                   (int)LINK_FAULT_ENDPOINT_STALL == FAULT_ENDPOINT_STALL - FAULT_DISCONNECT &&
                   (int)LINK_FAULT_SHORT_PACKETS == FAULT_SHORT_PACKETS - FAULT_DISCONNECT &&
                   (int)LINK_FAULT_REFUSE == FAULT_REFUSE - FAULT_DISCONNECT &&
                   (int)LINK_FAULT_SLOW_ENUMERATION == FAULT_SLOW_ENUMERATION - FAULT_DISCONNECT &&
                   (int)LINK_FAULT_DESCRIPTOR_LENGTH == FAULT_DESCRIPTOR_LENGTH - FAULT_DISCONNECT,
               "kinds of faults and of faults of links are in one order");

enum link_fault pump_link_fault(enum fault_kind kind)
{
    return (enum link_fault)(kind - FAULT_DISCONNECT);
}

/* Takes over the list. A fault that was added since the last connection counts from this one. */
static void look_at_list(struct pump *pump)
{
    struct pump_connections *c = &pump->connections;
    struct pump_fault before[FAULT_MAX];
    struct fault_entry entry[FAULT_KEPT];
    uint32_t n;
    const uint32_t n_before = c->n_faults;
    if (c->version == fault_board_version(pump->board)) return;
    memcpy(before, c->fault, sizeof before);
    c->version = fault_board_copy_all(pump->board, entry, &n);
    fault_tally_renew(&pump->tally, entry, n); /* faults that were taken out last keep their counts */
    c->n_faults = 0;
    for (uint32_t i = 0; i < n; i++) {
        if (entry[i].until_ns != INT64_MAX) continue;
        const struct pump_fault *old = fault_find(before, n_before, sizeof *before, entry[i].number);
        c->fault[c->n_faults++] = old != NULL ? *old : (struct pump_fault){entry[i], entry[i].from_start ? 0 : c->n};
    }
}

/* Whether the fault strikes at this connection. */
static int strikes(struct pump *pump, uint32_t i, int64_t t_ns)
{
    const struct pump_connections *c = &pump->connections;
    const struct fault_entry *entry = &c->fault[i].entry;
    const struct fault *f = &entry->fault;
    const struct fault_spot spot = {.number = c->n - c->fault[i].base, .t_ns = t_ns - entry->since_ns};
    if (fault_place_of(f->kind) != FAULT_AT_CONNECTION) return 0;
    if ((pump->can & LINK_FAULT_BIT(pump_link_fault(f->kind))) == 0) return 0;
    if (f->count != 0 && *fault_tally_hits(&pump->tally, entry->number) >= f->count) return 0;
    return fault_strikes(f, entry->number, pump->number, &spot);
}

/* Carries it out, and notes it. index: of the session, or -1. */
static int inject(struct pump *pump, uint32_t i, int index, int64_t t_ns)
{
    const struct fault_entry *entry = &pump->connections.fault[i].entry;
    const struct fault *f = &entry->fault;
    const struct fault_note note = {
        .fault = entry->number,
        .kind = f->kind,
        .t_ns = t_ns,
        .link = pump->number,
        .session = index >= 0 ? pump->session[index].id : 0,
        .number = pump->connections.n,
        .byte = -1,
        .n = f->kind == FAULT_DESCRIPTOR_LENGTH ? fault_n(f) : 0,
        .for_ms = f->for_ms,
    };
    if (pump->ops->fault(pump->link, pump_link_fault(f->kind), index, fault_n(f), f->for_ms) != SH_OK) return 0;
    ++*fault_tally_hits(&pump->tally, entry->number);
    fault_board_note(pump->board, &note);
    return 1;
}

/* Injects the faults of the next connection. Returns 1 when its client was turned away. */
static int connect_next(struct pump *pump, int index)
{
    const int64_t t_ns = (int64_t)stream_released(pump->stream) * pump->stream->tick_ns;
    int refused = 0;
    look_at_list(pump);
    pump->connections.n++;
    for (uint32_t i = 0; i < pump->connections.n_faults && !refused; i++)
        if (strikes(pump, i, t_ns) && inject(pump, i, index, t_ns))
            refused = pump->connections.fault[i].entry.fault.kind == FAULT_REFUSE;
    return refused;
}

int pump_turns_away(struct pump *pump, int index)
{
    if (pump->board == NULL || (pump->can & LINK_FAULT_BIT(LINK_FAULT_REFUSE)) == 0) return 0;
    if (connect_next(pump, index)) return 1;
    return clock_now_ns() < pump->refuse_until_ns &&
           pump->ops->fault(pump->link, LINK_FAULT_REFUSE, index, 0, 0.0) == SH_OK;
}

void pump_plugged(struct pump *pump)
{
    if (pump->board == NULL) return;
    pump->ops->fault(pump->link, LINK_FAULT_SLOW_ENUMERATION, 0, 0, 0.0);
    pump->ops->fault(pump->link, LINK_FAULT_DESCRIPTOR_LENGTH, 0, 0, 0.0);
    connect_next(pump, -1);
}
