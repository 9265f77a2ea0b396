/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/lateness.h"

static uint32_t bin_of(uint64_t ns)
{
    if (ns < LATENESS_PER_OCTAVE) return (uint32_t)ns;
    const uint32_t shift = 63U - (uint32_t)__builtin_clzll(ns) - LATENESS_BITS;
    return shift * LATENESS_PER_OCTAVE + (uint32_t)(ns >> shift); /* ns >> shift is from 32 to 63 */
}

/* Returns the first lateness of the next bin. */
static uint64_t end_of(uint32_t bin)
{
    if (bin < LATENESS_PER_OCTAVE) return bin + 1;
    const uint32_t shift = bin / LATENESS_PER_OCTAVE - 1;
    return (uint64_t)(LATENESS_PER_OCTAVE + bin % LATENESS_PER_OCTAVE + 1) << shift;
}

void lateness_note(struct lateness *lateness, int64_t late_ns)
{
    const uint64_t ns = late_ns > 0 ? (uint64_t)late_ns : 0;
    atomic_fetch_add(&lateness->bin[bin_of(ns)], 1);
    if (ns > atomic_load(&lateness->max_ns)) atomic_store(&lateness->max_ns, ns);
}

uint64_t lateness_count(const struct lateness *lateness)
{
    uint64_t n = 0;
    for (uint32_t i = 0; i < LATENESS_BINS; i++)
        n += atomic_load(&lateness->bin[i]);
    return n;
}

double lateness_us(const struct lateness *lateness, double q)
{
    const uint64_t n = lateness_count(lateness), max_ns = atomic_load(&lateness->max_ns);
    uint64_t seen = 0;
    for (uint32_t i = 0; i < LATENESS_BINS && n != 0; i++) {
        seen += atomic_load(&lateness->bin[i]);
        if (seen == 0 || (double)seen < q * (double)n) continue;
        const uint64_t most_ns = end_of(i) - 1;
        return (double)(most_ns < max_ns ? most_ns : max_ns) / 1e3;
    }
    return (double)max_ns / 1e3;
}

int lateness_row(const struct lateness *lateness, uint32_t i, uint64_t *below_ns, uint64_t *count)
{
    if (i >= LATENESS_OCTAVES) return 0;
    *count = 0;
    for (uint32_t k = 0; k < LATENESS_PER_OCTAVE; k++)
        *count += atomic_load(&lateness->bin[i * LATENESS_PER_OCTAVE + k]);
    *below_ns = end_of(i * LATENESS_PER_OCTAVE + LATENESS_PER_OCTAVE - 1);
    return 1;
}
