/* SPDX-License-Identifier: MIT */
#include "firmware_sim/device/pps.h"

#include <stdlib.h>

static const int64_t SECOND_NS = 1000000000;

static const struct pps_state *last_of(const struct pps *pps)
{
    return &pps->kept[(pps->n + PPS_KEPT - 1) % PPS_KEPT];
}

static void pps_keep(struct pps *pps, const struct pps_state *state)
{
    pps->kept[pps->n++ % PPS_KEPT] = *state;
}

void pps_power_up(struct pps *pps, int64_t t_ns, int lost)
{
    const struct pps_state state = {.from_ns = t_ns,
                                    .tai_s = INT64_MIN,
                                    .state = lost ? PROTOCOL_PPS_ABSENT : PROTOCOL_PPS_SYNCHRONISING,
                                    .set = !lost};
    pps_keep(pps, &state);
}

void pps_take(struct pps *pps, int64_t edge_ns, int64_t tai_s)
{
    struct pps_state next = {.from_ns = edge_ns, .tai_s = tai_s, .state = PROTOCOL_PPS_SYNCHRONISING, .set = 1};
    const struct pps_state *last = last_of(pps);
    if (pps->n != 0 && last->tai_s != INT64_MIN) {
        const int64_t seconds = tai_s - last->tai_s, since_ns = edge_ns - last->from_ns;
        if (seconds < 1 || llabs(since_ns - seconds * SECOND_NS) > seconds * PPS_TOLERANCE_NS)
            next.state = PROTOCOL_PPS_ERROR;
        else if (seconds == 1)
            next.run = last->run + 1;
        if (next.run >= PPS_TO_LOCK) next.state = PROTOCOL_PPS_LOCKED;
    }
    pps_keep(pps, &next);
}

enum protocol_pps pps_at(const struct pps *pps, int64_t t_ns, int *set)
{
    const uint32_t kept = pps->n < PPS_KEPT ? pps->n : PPS_KEPT;
    const struct pps_state *at = NULL;
    for (uint32_t i = 1; i <= kept && (at == NULL || at->from_ns > t_ns); i++)
        at = &pps->kept[(pps->n - i) % PPS_KEPT];
    *set = at == NULL || at->set;
    if (at == NULL || t_ns - at->from_ns > SECOND_NS + PPS_TOLERANCE_NS) return PROTOCOL_PPS_ABSENT;
    return at->state;
}
