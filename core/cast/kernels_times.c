/* SPDX-License-Identifier: MIT */
#include "core/cast/kernels_times.h"

#include "core/vecmath.h"

/* Computes times in a run with a table, whose pulses fire at ticks of the sequence. */
static void times_of_table(const struct schedule_run *run, uint32_t *dt_ns)
{
    const uint64_t begin = run->firing[run->firing_at].tick;
    uint64_t base = 0;
    uint32_t at = run->firing_at;
    for (uint32_t i = 0; i < run->n; i++) {
        const uint64_t d = base + run->firing[at].tick - begin;
        dt_ns[i] = (uint32_t)(d * (uint64_t)run->ns_quot + (run->ns_acc + d * run->ns_rem) / run->ns_den);
        if (++at < run->n_firings) continue;
        at = 0;
        base += run->sequence_ticks;
    }
}

/* The times of up to TIMES pulses in a row, counted from the first of them: whole nanoseconds, and a rest in units of
 * 1 / den ns, which is below den. */
enum { TIMES = 64 };
struct times {
    int64_t part[TIMES + 1];
    uint32_t ns[TIMES + 1];
};

/* The remainder is below the divisor, so each step adds the quotient or one more. */
static void make_times(const struct schedule_run *run, uint32_t n, struct times *t)
{
    const int64_t rem = (int64_t)run->ns_rem, den = (int64_t)run->ns_den;
    int64_t part = 0;
    uint32_t ns = 0;
    for (uint32_t i = 0; i <= n; i++) {
        t->part[i] = part;
        t->ns[i] = ns;
        part += rem;
        ns += (uint32_t)run->ns_quot + (part >= den);
        part -= part >= den ? den : 0;
    }
}

VEC_CLONES
static void add_times(const struct times *t, uint32_t begin_ns, int64_t begin_part, int64_t den, uint32_t n,
                      uint32_t *restrict dt_ns)
{
    const int64_t *restrict part = t->part;
    const uint32_t *restrict ns = t->ns;
    for (uint32_t i = 0; i < n; i++)
        dt_ns[i] = begin_ns + ns[i] + (begin_part + part[i] >= den);
}

/* Each block of TIMES pulses adds its begin to one table of times. */
void kernel_times(const struct schedule_run *run, uint32_t *dt_ns)
{
    const int64_t den = (int64_t)run->ns_den; /* below 2^62: the largest is a pulse rate in uHz */
    int64_t part = (int64_t)run->ns_acc;
    uint32_t ns = 0;
    struct times t;
    if (run->sequence_ticks != 0) {
        times_of_table(run, dt_ns);
        return;
    }
    make_times(run, run->n < TIMES ? run->n : TIMES, &t);
    for (uint32_t at = 0, n; at < run->n; at += n) {
        n = run->n - at < TIMES ? run->n - at : TIMES;
        add_times(&t, ns, part, den, n, dt_ns + at);
        part += t.part[n];
        ns += t.ns[n] + (part >= den);
        part -= part >= den ? den : 0;
    }
}
