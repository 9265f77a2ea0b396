/* SPDX-License-Identifier: MIT */
/* Statistics of how late something was over a whole run: counts in bins of fixed memory, and percentiles of them.
 *
 * In: one lateness after the other, in ns. Out: percentiles, and a short histogram. Below 32 ns each bin is one
 * nanosecond wide. Above, an octave has 32 bins, so that a percentile is at most 1/32 too large.
 *
 * Thread: one notes, any may read. lateness_note is real-time safe. A struct of zeros is an empty one. */
#ifndef FIRMWARE_SIM_LOOP_LATENESS_H
#define FIRMWARE_SIM_LOOP_LATENESS_H

#include <stdatomic.h>
#include <stdint.h>

enum {
    LATENESS_BITS = 5, /* 32 bins per octave */
    LATENESS_PER_OCTAVE = 1 << LATENESS_BITS,
    LATENESS_OCTAVES = 64 - LATENESS_BITS,
    LATENESS_BINS = LATENESS_OCTAVES * LATENESS_PER_OCTAVE
};

struct lateness {
    _Atomic uint64_t bin[LATENESS_BINS];
    _Atomic uint64_t max_ns;
};

/* Notes one lateness. A negative one (early) counts as 0. */
void lateness_note(struct lateness *lateness, int64_t late_ns);
uint64_t lateness_count(const struct lateness *lateness);
/* Returns the quantile q (0 to 1) in microseconds; never more than the latest. 0 when nothing was noted. */
double lateness_us(const struct lateness *lateness, double q);
/* The histogram, octave by octave. Row i counts the latenesses below *below_ns that no row before it counts. Returns 0
 * when there is no row i. Most rows are empty. */
int lateness_row(const struct lateness *lateness, uint32_t i, uint64_t *below_ns, uint64_t *count);

#endif
