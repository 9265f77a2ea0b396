/* SPDX-License-Identifier: MIT */
#include "firmware_sim/device/pps.h"

#include <stdlib.h>

static const int64_t SECOND_NS = 1000000000, HOUR_NS = 3600000000000;

static int64_t in_hour(int64_t ns)
{
    return (ns % HOUR_NS + HOUR_NS) % HOUR_NS;
}

static int64_t hour_at(const struct pps_state *s, int64_t head_ns)
{
    return in_hour(s->hour_ns + head_ns - s->from.head_ns);
}

static int is_absent(const struct pps_state *s, int64_t t_ns)
{
    if (!s->has_pulse) return s->state == PROTOCOL_PPS_ABSENT || t_ns - s->from.t_ns > SECOND_NS + PPS_TOLERANCE_NS;
    return t_ns - s->pulse.t_ns > SECOND_NS + PPS_TOLERANCE_NS;
}

static const struct pps_state *last_of(const struct pps *pps)
{
    return &pps->kept[(pps->n + PPS_KEPT - 1) % PPS_KEPT];
}

static void pps_keep(struct pps *pps, const struct pps_state *state)
{
    pps->kept[pps->n++ % PPS_KEPT] = *state;
}

void pps_power_up(struct pps *pps, struct pps_moment at, int64_t hour_ns, int pulses)
{
    const struct pps_state state = {
        .from = at, .state = pulses ? PROTOCOL_PPS_SYNCHRONISING : PROTOCOL_PPS_ABSENT, .hour_ns = in_hour(hour_ns)};
    pps_keep(pps, &state);
}

/* Sets state and run by the time since the pulse before. */
static void compare(const struct pps_state *last, struct pps_state *next)
{
    const int64_t since_ns = next->from.head_ns - last->pulse.head_ns, seconds = (since_ns + SECOND_NS / 2) / SECOND_NS;
    next->state = PROTOCOL_PPS_SYNCHRONISING;
    next->run = 0;
    if (!last->has_pulse) return;
    if (seconds < 1 || llabs(since_ns - seconds * SECOND_NS) > seconds * PPS_TOLERANCE_NS)
        next->state = PROTOCOL_PPS_ERROR;
    else if (seconds == 1)
        next->run = last->run + 1;
    if (next->run >= PPS_TO_LOCK) next->state = PROTOCOL_PPS_LOCKED;
}

void pps_take(struct pps *pps, struct pps_moment edge)
{
    const struct pps_state *last = last_of(pps);
    struct pps_state next = {.from = edge, .pulse = edge, .has_pulse = 1, .hour_ns = hour_at(last, edge.head_ns)};
    compare(last, &next);
    /* At a locked pulse the counter's part of a second becomes 0. The manual does not say which second that is: the
     * nearest one changes the counter least. */
    if (next.state == PROTOCOL_PPS_LOCKED)
        next.hour_ns = in_hour((next.hour_ns + SECOND_NS / 2) / SECOND_NS * SECOND_NS);
    pps_keep(pps, &next);
}

void pps_take_sentence(struct pps *pps, struct pps_moment at, int64_t second)
{
    struct pps_state next = *last_of(pps);
    const int64_t was_ns = hour_at(&next, at.head_ns), is_ns = in_hour(second * SECOND_NS + was_ns % SECOND_NS);
    if (next.state != PROTOCOL_PPS_LOCKED || is_absent(&next, at.t_ns) || is_ns == was_ns) return;
    next.from = at;
    next.hour_ns = is_ns;
    pps_keep(pps, &next);
}

enum protocol_pps pps_at(const struct pps *pps, struct pps_moment at, int64_t *hour_ns)
{
    const uint32_t kept = pps->n < PPS_KEPT ? pps->n : PPS_KEPT;
    const struct pps_state *s = NULL;
    for (uint32_t i = 1; i <= kept && (s == NULL || s->from.t_ns > at.t_ns); i++)
        s = &pps->kept[(pps->n - i) % PPS_KEPT];
    *hour_ns = s != NULL ? hour_at(s, at.head_ns) : 0;
    return s == NULL || is_absent(s, at.t_ns) ? PROTOCOL_PPS_ABSENT : s->state;
}
