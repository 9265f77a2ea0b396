/* SPDX-License-Identifier: MIT */
#include "firmware_sim/replay/timing.h"

#include <math.h>

#include "core/schedule.h"

__extension__ typedef unsigned __int128 wide;

static const uint64_t FEMTO = UINT64_C(1000000000000000); /* 1e15: ns x uHz */

/* Firing time of pulse k since the scan's start, if the rates have never changed. */
static int64_t fired_ns(const struct timing *t, uint64_t k)
{
    const uint64_t n = t->n_beams > 0 ? t->n_beams : 1;
    return native_after_ns((int64_t)(uint64_t)((wide)(k / n) * t->num / t->den),
                           t->n_beams > 0 ? t->offset_ns[k % n] : 0);
}

/* Firing time of pulse k, at or after another pulse whose time is known. */
static int64_t fired_after_ns(const struct timing *t, uint64_t known, int64_t known_ns, uint64_t k)
{
    if (fired_ns(t, known) == known_ns) return fired_ns(t, k);
    return native_after_ns(known_ns, native_since_ns(fired_ns(t, k), fired_ns(t, known)));
}

/* Finds the first pulse of the points' line. 0: it is not known. */
static int find_first(const struct timing *t, const struct native_points *points, uint64_t *first)
{
    *first = t->next_first;
    if (t->knows_line && points->line == t->next_line && points->pulse0 >= t->next_first) {
        if (*first < t->changed_at) *first = t->changed_at;
        return 1;
    }
    const double period_ns = (double)t->num / (double)t->den;
    const double before = rint(((double)points->t0_ns - (double)points->line_t0_ns) / period_ns);
    if (t->n_beams > 0 || !(before >= 0.0) || before >= 0x1p63 || before > (double)points->pulse0) return 0;
    *first = points->pulse0 - (uint64_t)before;
    return 1;
}

static struct timing_moment timing_take_points(const struct timing *t, const struct native_header *header,
                                               const uint8_t *payload)
{
    struct native_points points;
    struct native_point last = {0};
    uint64_t first;
    struct timing_moment moment = {TIMING_KNOWN, header->t_ns};
    if (native_decode_points(payload, header->length, &points) != SH_OK || points.n_points == 0) return moment;
    native_decode_point(payload, points.n_points - 1, &last);
    const int64_t scan_t0_ns = native_since_ns(header->t_ns, points.t0_ns);
    const uint64_t k = points.pulse0 + points.n_pulses - 1; /* the last pulse */
    moment.t_ns = native_after_ns(header->t_ns, last.dt_ns);
    if (!t->has_rate || points.n_pulses == 0 || !find_first(t, &points, &first) || k < first) return moment;
    const uint64_t rest = (k + 1 - first) % SCHEDULE_PACKET;
    if (rest == 0) return moment;
    moment.kind = TIMING_AT_MOST;
    moment.t_ns =
        native_after_ns(scan_t0_ns, fired_after_ns(t, points.pulse0, points.t0_ns, k + SCHEDULE_PACKET - rest));
    return moment;
}

static struct timing_moment take_line_end(struct timing *t, const struct native_header *header, const uint8_t *payload)
{
    struct line_end end;
    struct timing_moment moment = {TIMING_KNOWN, header->t_ns};
    if (native_decode_line_end(payload, header->length, &end) != SH_OK) return moment;
    const uint64_t next = end.pulse0 + end.n_fired;
    const int64_t scan_t0_ns = native_since_ns(header->t_ns, end.t1_ns);
    t->knows_line = 1;
    t->next_line = end.line + 1;
    t->next_first = next;
    if ((end.status & LINE_PARTIAL) != 0) moment.kind = TIMING_STOPS;
    if (!t->has_rate || next == 0) return moment;
    /* t1 is the time of the next line's first pulse; this line's last pulse is the one before that. */
    moment.t_ns = fired_ns(t, next) == end.t1_ns
                      ? native_after_ns(scan_t0_ns, fired_ns(t, next - 1))
                      : native_since_ns(header->t_ns, native_since_ns(fired_ns(t, next), fired_ns(t, next - 1)));
    return moment;
}

static void take_descriptor(struct timing *t, const struct native_header *header, const uint8_t *payload)
{
    struct native_descriptor d;
    if (native_decode_descriptor(payload, header->length, &d) != SH_OK || d.prr_uhz == 0) return;
    t->has_rate = 1;
    t->num = FEMTO;
    t->den = d.prr_uhz;
    t->n_beams = 0;
}

static void take_emitter(struct timing *t, const struct native_header *header, const uint8_t *payload)
{
    struct native_emitter e;
    struct native_beam beam;
    if (native_decode_emitter(payload, header->length, &e) != SH_OK || e.sequence_ns_den == 0) return;
    t->num = e.sequence_ns_num;
    t->den = e.sequence_ns_den;
    t->n_beams = e.n_beams <= NATIVE_MAX_BEAMS ? e.n_beams : 0;
    t->has_rate = t->num != 0;
    for (uint32_t i = 0; i < t->n_beams; i++) {
        native_decode_beam(payload, i, &beam);
        t->offset_ns[i] = beam.offset_ns;
    }
}

static void timing_take_event(struct timing *t, const struct native_header *header, const uint8_t *payload)
{
    struct native_event event;
    if (native_decode_event(payload, header->length, &event) != SH_OK) return;
    if (event.code == NATIVE_EV_SETTINGS) t->changed_at = event.a;
    if (event.code != NATIVE_EV_SCAN_START) return;
    t->knows_line = 1;
    t->next_line = 0;
    t->next_first = t->changed_at = 0;
}

struct timing_moment timing_take(struct timing *timing, const struct native_header *header, const uint8_t *payload)
{
    if ((header->flags & NATIVE_LOCAL) != 0) return (struct timing_moment){TIMING_FOLLOWS, header->t_ns};
    switch (header->type) {
    case NATIVE_POINTS:
        return timing_take_points(timing, header, payload);
    case NATIVE_LINE_END:
        return take_line_end(timing, header, payload);
    case NATIVE_ATTRIBUTES:
    case NATIVE_COLOURS:
    case NATIVE_WAVES:
        return (struct timing_moment){TIMING_FOLLOWS, header->t_ns};
    case NATIVE_DESCRIPTOR:
        take_descriptor(timing, header, payload);
        break;
    case NATIVE_EMITTER:
        take_emitter(timing, header, payload);
        break;
    case NATIVE_EVENT:
        timing_take_event(timing, header, payload);
        break;
    default:
        break;
    }
    return (struct timing_moment){TIMING_KNOWN, header->t_ns};
}
