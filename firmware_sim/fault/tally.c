/* SPDX-License-Identifier: MIT */
#include "firmware_sim/fault/tally.h"

void fault_tally_renew(struct fault_tally *tally, const struct fault_entry *entry, uint32_t n)
{
    for (uint32_t i = 0; i < FAULT_KEPT; i++) {
        int listed = 0;
        for (uint32_t k = 0; k < n; k++)
            listed |= entry[k].number == tally->number[i];
        if (!listed) tally->number[i] = 0;
    }
}

uint64_t *fault_tally_hits(struct fault_tally *tally, uint32_t number)
{
    uint32_t at = 0;
    while (at + 1 < FAULT_KEPT && tally->number[at] != number && tally->number[at] != 0)
        at++;
    for (uint32_t i = at; i < FAULT_KEPT; i++)
        if (tally->number[i] == number) return &tally->hits[i];
    tally->number[at] = number;
    tally->hits[at] = 0;
    return &tally->hits[at];
}

void fault_tally_take_back(struct fault_tally *tally, uint32_t number)
{
    for (uint32_t i = 0; i < FAULT_KEPT; i++)
        if (tally->number[i] == number && tally->hits[i] != 0) tally->hits[i]--;
}
