/* SPDX-License-Identifier: MIT */
/* Injected faults of the head's time of day: jumps, gains, standstills, leap seconds, missing PPS, a lost PTP master.
 * The faults hold from their exact nanosecond on, not from a tick on. */
#include <math.h>
#include <stdio.h>

#include "firmware_sim/device/clock_faults.h"
#include "firmware_sim/device/events.h"
#include "firmware_sim/device/head_clock.h"

static const double MOST_LATE_MS = 10000.0; /* of a sentence; RECEIVER_KEPT sentences are enough for that */
static const uint64_t GAINS = HEAD_FAULT(FAULT_CLOCK_DRIFT) | HEAD_FAULTS_HOLDOVER;

static void add_leap(struct head_clock *clock, struct device_events *events, const struct head_fault *f)
{
    char text[UTC_TEXT_LEN], said[96];
    int64_t posix_s;
    struct utc_time utc;
    const int added = head_clock_add_leap(clock, f->begin_ns, &posix_s);
    utc_from_tai(&clock->table, utc_tai_from_posix(&clock->table, (posix_s - 1) * UTC_SECOND_NS), &utc);
    utc.second += added;
    utc_format(&utc, 0, text);
    snprintf(said, sizeof said,
             added                                    ? "leap second %s"
             : posix_s < clock->table.leap[0].posix_s ? "no leap second after %s: UTC has them from 1972 on"
                                                      : "no room for a leap second after %s",
             text);
    if (!added) device_push_error(events, 0, CMD_E_SETTINGS, said);
}

/* Changes the clock from the fault's begin on (sign 1), or undoes that from its end on (-1). */
static void change(struct head_clock *clock, const struct head_fault *f, int64_t t_ns, int sign)
{
    struct head_clock_change change = {0};
    if ((HEAD_FAULT(f->fault.kind) & GAINS) != 0) change.gain_ppt = sign * llround(1e6 * f->fault.ppm);
    if (f->fault.kind == FAULT_CLOCK_STOP) change.stands = sign;
    if (f->fault.kind == FAULT_CLOCK_JUMP) change.jump_ns = llround(1e9 * f->fault.jump_s);
    head_clock_change(clock, t_ns, &change);
}

/* Applies to the clock what a fault does in a tick, which ends at end_ns and takes tick_ns. */
static void clock_faults_run(struct head_clock *clock, struct head_fault *f, int64_t end_ns, int64_t tick_ns)
{
    const int lasts = (HEAD_FAULT(f->fault.kind) & (GAINS | HEAD_FAULT(FAULT_CLOCK_STOP))) != 0;
    if (f->begins && (lasts || f->fault.kind == FAULT_CLOCK_JUMP)) change(clock, f, f->begin_ns, 1);
    if (!lasts || f->undone) return;
    if (f->active && f->until_ns < end_ns) { /* within this tick */
        change(clock, f, f->until_ns, -1);
        f->undone = 1;
    } else if (f->ends) {
        change(clock, f, end_ns - tick_ns, -1);
    }
}

void device_run_clock_faults(struct head_faults *faults, struct head_clock *clock, struct device_events *events,
                             uint64_t tick)
{
    const int64_t end_ns = (int64_t)(tick + 1) * faults->tick_ns;
    for (uint32_t i = 0; i < faults->n; i++) {
        struct head_fault *f = &faults->fault[i];
        if ((HEAD_FAULT(f->fault.kind) & HEAD_FAULTS_CLOCK) == 0 || (!f->active && !f->ends)) continue;
        if (f->begins && f->fault.kind == FAULT_LEAP_SECOND) add_leap(clock, events, f);
        clock_faults_run(clock, f, end_ns, faults->tick_ns);
    }
}

static int has_moment(const struct head_fault *f, enum fault_kind kind, int64_t t_ns)
{
    return f->fault.kind == kind && f->active && t_ns >= f->from_ns && t_ns < f->until_ns;
}

int device_has_clock_fault(const struct head_faults *faults, enum fault_kind kind, int64_t t_ns)
{
    for (uint32_t i = 0; i < faults->n; i++)
        if (has_moment(&faults->fault[i], kind, t_ns)) return 1;
    return 0;
}

int64_t device_sentence_late_ns(const struct head_faults *faults, int64_t t_ns)
{
    double sum_ms = 0.0;
    for (uint32_t i = 0; i < faults->n; i++)
        if (has_moment(&faults->fault[i], FAULT_NMEA_LATE, t_ns)) sum_ms += faults->fault[i].fault.for_ms;
    return llround(1e6 * fmin(sum_ms, MOST_LATE_MS));
}

int64_t device_pulse_late_ns(const struct head_faults *faults, int64_t edge_ns)
{
    double sum_ms = 0.0;
    for (uint32_t i = 0; i < faults->n; i++) {
        const struct head_fault *f = &faults->fault[i];
        if (!has_moment(f, FAULT_PPS_JITTER, edge_ns)) continue;
        if ((edge_ns - f->from_ns) / UTC_SECOND_NS % 2 == 0) sum_ms += f->fault.for_ms;
    }
    return llround(1e6 * sum_ms);
}

void device_count_clock_fault(struct head_faults *faults, enum fault_kind kind, int64_t t_ns)
{
    for (uint32_t i = 0; i < faults->n; i++)
        if (has_moment(&faults->fault[i], kind, t_ns)) faults->fault[i].n++;
}
