/* SPDX-License-Identifier: MIT */
#include "firmware_sim/device/head_faults.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

void head_faults_init(struct head_faults *faults, struct fault_board *board, int64_t tick_ns)
{
    memset(faults, 0, sizeof *faults);
    faults->board = board;
    faults->tick_ns = tick_ns;
}

static void note(struct head_faults *faults, const struct head_fault *f, const struct head_faults_tick *tick, int ended,
                 const char *text)
{
    struct fault_note note = {
        .fault = f->number, .kind = f->fault.kind, .t_ns = tick->t_ns, .byte = -1, .ended = ended};
    note.for_ms = f->fault.for_ms;
    note.n = ended ? f->n : f->fault.n;
    note.has_pulse = tick->has_pulses;
    note.pulse = tick->pulse0;
    if (!ended && note.has_pulse && f->fault.from_pulse > note.pulse) note.pulse = f->fault.from_pulse;
    if (text != NULL) snprintf(note.text, sizeof note.text, "%s", text);
    fault_board_note(faults->board, &note);
}

void head_faults_note(struct head_faults *faults, const struct head_fault *fault, int64_t t_ns, int ended)
{
    note(faults, fault, &(struct head_faults_tick){.t_ns = t_ns}, ended, NULL);
}

/* Returns the start of the first tick that begins at t_ns or later. */
static int64_t round_up(const struct head_faults *faults, int64_t t_ns)
{
    const int64_t rest_ns = t_ns % faults->tick_ns;
    return rest_ns == 0 ? t_ns : t_ns + faults->tick_ns - rest_ns;
}

static void set_window(const struct head_faults *faults, const struct fault_entry *entry, struct head_fault *f)
{
    const struct fault *fault = &entry->fault;
    f->from_ns = entry->since_ns + llround(1e9 * fault->from_s);
    f->until_ns = fault->until_s > 0.0 ? entry->since_ns + llround(1e9 * fault->until_s) : INT64_MAX;
    if ((HEAD_FAULT(fault->kind) & HEAD_FAULTS_CLOCK) != 0) return;
    f->from_ns = round_up(faults, f->from_ns);
    if (f->until_ns != INT64_MAX) f->until_ns = round_up(faults, f->until_ns);
}

/* Takes over the present list. Faults that were taken out while they were active stay for one more step, and end. */
static void renew(struct head_faults *faults)
{
    struct fault_entry entry[FAULT_MAX];
    struct head_fault was[2 * FAULT_MAX];
    const uint32_t n_was = faults->n;
    uint32_t n;
    memcpy(was, faults->fault, n_was * sizeof was[0]);
    faults->version = fault_board_copy(faults->board, entry, &n);
    faults->n = 0;
    for (uint32_t i = 0; i < n; i++) {
        if (fault_place_of(entry[i].fault.kind) != FAULT_AT_MOMENT) continue;
        struct head_fault *f = &faults->fault[faults->n++];
        const struct head_fault *old = fault_find(was, n_was, sizeof *was, entry[i].number);
        *f = old != NULL ? *old : (struct head_fault){.fault = entry[i].fault, .number = entry[i].number};
        if (old == NULL) set_window(faults, &entry[i], f);
    }
    const uint32_t n_there = faults->n;
    for (uint32_t i = 0; i < n_was; i++) {
        if (!was[i].active || fault_find(faults->fault, n_there, sizeof *was, was[i].number) != NULL) continue;
        if (faults->n == 2 * FAULT_MAX) break; /* can't happen: faults that were taken out before have ended */
        faults->fault[faults->n] = was[i];
        faults->fault[faults->n++].cleared = 1;
    }
}

static int is_active(const struct head_faults *faults, const struct head_fault *f, const struct head_faults_tick *tick)
{
    if (f->cleared) return 0;
    if (f->times != 0 && (HEAD_FAULT(f->fault.kind) & HEAD_FAULTS_ONCE) != 0)
        return f->active && tick->t_ns < round_up(faults, f->begin_ns + llround(1e6 * f->fault.for_ms));
    if (f->from_ns >= tick->t_ns + faults->tick_ns || f->until_ns <= tick->t_ns) return 0;
    if (f->fault.from_pulse == 0 && f->fault.until_pulse == UINT64_MAX) return 1;
    return tick->has_pulses && tick->pulse0 <= f->fault.until_pulse &&
           tick->pulse0 + tick->n_pulses > f->fault.from_pulse;
}

/* Returns the moment in or before this tick at which the fault began, or ended. */
static int64_t at_ns(const struct head_faults_tick *tick, const struct head_fault *f)
{
    if (f->begins) return f->from_ns > tick->t_ns ? f->from_ns : tick->t_ns;
    const int by_time = !f->cleared && (HEAD_FAULT(f->fault.kind) & HEAD_FAULTS_ONCE) == 0;
    return by_time && f->until_ns < tick->t_ns ? f->until_ns : tick->t_ns;
}

/* Notes that the fault begins, or ends. Jumps and leap seconds have no end. */
static void head_faults_say(struct head_faults *faults, struct head_fault *f, const struct head_faults_tick *tick)
{
    struct head_faults_tick at = *tick;
    at.t_ns = at_ns(tick, f);
    if (f->begins) {
        f->begin_ns = at.t_ns;
        f->times++;
        f->n = 0;
        f->undone = 0;
    }
    if (f->ends && (f->fault.kind == FAULT_CLOCK_JUMP || f->fault.kind == FAULT_LEAP_SECOND)) return;
    note(faults, f, &at, f->ends, f->cleared ? "cleared" : NULL);
}

int head_faults_step(struct head_faults *faults, uint64_t kinds, const struct head_faults_tick *tick)
{
    const uint32_t version = fault_board_version(faults->board);
    int any = 0;
    if (version == 0) return 0;
    if (version != faults->version) renew(faults);
    for (uint32_t i = 0; i < faults->n; i++) {
        struct head_fault *f = &faults->fault[i];
        if ((HEAD_FAULT(f->fault.kind) & kinds) == 0) continue;
        const int active = is_active(faults, f, tick);
        f->begins = active && !f->active;
        f->ends = !active && f->active;
        f->active = active;
        any |= active || f->ends;
        if (f->begins || f->ends) head_faults_say(faults, f, tick);
    }
    return any;
}

struct head_fault *head_faults_next(struct head_faults *faults, enum fault_kind kind, const struct head_fault *before)
{
    struct head_fault *f = before != NULL ? &faults->fault[before - faults->fault + 1] : faults->fault;
    for (; f < faults->fault + faults->n; f++)
        if (f->fault.kind == kind && f->active) return f;
    return NULL;
}

struct head_fault *head_faults_at(struct head_faults *faults, enum fault_kind kind, int64_t t_ns,
                                  const struct head_fault *before)
{
    struct head_fault *f = before != NULL ? &faults->fault[before - faults->fault + 1] : faults->fault;
    for (; f < faults->fault + faults->n; f++)
        if (f->fault.kind == kind && !f->cleared && f->from_ns <= t_ns && t_ns < f->until_ns) return f;
    return NULL;
}
