/* SPDX-License-Identifier: MIT */
/* Firing times and azimuths of a head with a firing table over an hour. Naive methods round or add up pulse periods,
 * and add up angles. The truth is whole nanoseconds: 55296 a sequence, 2304 a firing. */
#include <math.h>
#include <stdio.h>

#include "core/rng.h"
#include "core/schedule.h"
#include "tests/stability/table.h"

enum { BEAMS = 16, SEQUENCE_NS = 55296, FIRING_NS = 2304, LOOKS = 20000 };

static const uint64_t HOUR_NS = 3600000000000;
static const uint64_t TURN_NS = 100000000; /* ten a second */

static uint64_t true_ns(uint64_t k)
{
    return k / BEAMS * SEQUENCE_NS + k % BEAMS * FIRING_NS;
}

static void start(struct emitter *e, struct schedule_segment *seg)
{
    struct emitter_beam beam[BEAMS];
    for (uint32_t i = 0; i < BEAMS; i++)
        beam[i] = (struct emitter_beam){0, 0, FIRING_NS * i};
    assert_int_equal(emitter_set_beams(e, beam, BEAMS, 1000 * SEQUENCE_NS, 1, NULL), SH_OK);
    const struct schedule_spec spec = {.prr_uhz = emitter_rate_uhz(e),
                                       .lines_uhz = 10000000,
                                       .sweep_udeg = 360000000,
                                       .line_stop_udeg = 360000000,
                                       .emitter = e};
    schedule_start(seg, &spec);
}

static uint64_t drawn(uint64_t i)
{
    const uint64_t n = HOUR_NS / SEQUENCE_NS * BEAMS;
    return n - rng_u64(21, i) % (i % 2 == 0 ? n : 100000);
}

/* An even schedule at the table's rate, which is set in whole micro-hertz. In it the last firing of a sequence comes
 * 17.3 us later than by the table. The rounding of the rate adds up to 2 ns in an hour. */
static void even_row(const struct schedule_segment *seg)
{
    const struct schedule_spec spec = {
        .prr_uhz = seg->spec.prr_uhz, .lines_uhz = 10000000, .sweep_udeg = 360000000, .line_stop_udeg = 360000000};
    struct schedule_segment even;
    double naive_ns = 0.0, drift_ns = 0.0, ours_ns = 0.0;
    schedule_start(&even, &spec);
    for (uint64_t i = 0; i < LOOKS; i++) {
        const uint64_t k = drawn(i), first = k - k % BEAMS;
        naive_ns = fmax(naive_ns, fabs((double)(schedule_time_ns(&even, k) - (int64_t)true_ns(k))));
        drift_ns = fmax(drift_ns, fabs((double)(schedule_time_ns(&even, first) - (int64_t)true_ns(first))));
        ours_ns = fmax(ours_ns, fabs((double)(schedule_time_ns(seg, k) - (int64_t)true_ns(k))));
    }
    table_row("firing times, an hour", "evenly, at the mean rate", naive_ns, ours_ns, 0.0, "ns");
    table_row("first of a sequence, an hour", "rate in whole micro-hertz", drift_ns, ours_ns, 0.0, "ns");
}

/* The two gaps of a sequence are summed, in float and in double seconds. Each addition rounds. */
static void sum_row(const struct schedule_segment *seg)
{
    const uint64_t sequences = HOUR_NS / SEQUENCE_NS;
    const double firing_s = 1e-9 * FIRING_NS, rest_s = 1e-9 * (SEQUENCE_NS - (BEAMS - 1) * FIRING_NS);
    double sum_s = 0.0;
    float sum_f = 0.0f;
    for (uint64_t i = 0; i < sequences; i++) {
        sum_s += (BEAMS - 1) * firing_s;
        sum_s += rest_s;
        sum_f += (float)(1e-9 * SEQUENCE_NS);
    }
    const double end_ns = (double)true_ns(sequences * BEAMS);
    const double ours_ns = fabs((double)schedule_time_ns(seg, sequences * BEAMS) - end_ns);
    table_row("sequences of an hour added up", "double seconds", fabs(1e9 * sum_s - end_ns), ours_ns, 0.0, "ns");
    table_row("sequences of an hour added up", "float seconds", fabs(1e9 * (double)sum_f - end_ns), ours_ns, 0.0, "ns");
}

static void test_times(void **state)
{
    (void)state;
    struct emitter e;
    struct schedule_segment seg;
    start(&e, &seg);
    even_row(&seg);
    sum_row(&seg);
    table_check();
}

static double turns_apart(double a, double b)
{
    const double d = a - b;
    return 360.0 * fabs(d - floor(d + 0.5));
}

/* Angles on the wire of such heads are counts of 0.01 degree. Ours: the place in the turn is a ratio of whole numbers,
 * rounded once, times a reciprocal that is rounded: 2^-52 of a turn. */
static void test_azimuths(void **state)
{
    (void)state;
    const uint64_t sequences = HOUR_NS / SEQUENCE_NS;
    struct emitter e;
    struct schedule_segment seg;
    start(&e, &seg);
    double ours_deg = 0.0, rounded_deg = 0.0;
    for (uint64_t i = 0; i < LOOKS; i++) {
        const uint64_t k = drawn(i);
        const double azimuth = (double)(true_ns(k) % TURN_NS) / (double)TURN_NS;
        ours_deg = fmax(ours_deg, turns_apart(schedule_pan_turn(&seg, k), azimuth));
        /* 0.199 degrees a sequence, as data sheets print it */
        rounded_deg = fmax(rounded_deg, turns_apart((double)(k / BEAMS) * (0.199 / 360.0) +
                                                        (double)(k % BEAMS) * FIRING_NS / (double)TURN_NS,
                                                    azimuth));
    }
    float step = (float)(360.0 * SEQUENCE_NS / (double)TURN_NS), sum = 0.0f;
    for (uint64_t i = 0; i < sequences; i++) {
        sum += step;
        if (sum >= 360.0f) sum -= 360.0f;
    }
    const double end = (double)(true_ns(sequences * BEAMS) % TURN_NS) / (double)TURN_NS;
    const double bound_deg = 360.0 * 0x1p-52;
    table_row("azimuth, an hour at 600 rpm", "steps added up in float", turns_apart((double)sum / 360.0, end), ours_deg,
              bound_deg, "deg");
    table_row("azimuth, an hour at 600 rpm", "0.199 deg a sequence", rounded_deg, ours_deg, bound_deg, "deg");
    table_check();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_times),
        cmocka_unit_test(test_azimuths),
    };
    table_head("stability: firing tables");
    return cmocka_run_group_tests(tests, NULL, NULL);
}
