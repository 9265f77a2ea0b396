/* SPDX-License-Identifier: MIT */
/* The schedule over a day, over many changes, and with line rates that do not divide the pulse rate. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/rng.h"
#include "core/schedule.h"
#include "tests/stability/table.h"

__extension__ typedef unsigned __int128 u128;

static const uint64_t DAY_S = 86400;

static struct schedule_spec spec_of(int64_t prr_uhz, int64_t lines_uhz)
{
    return (struct schedule_spec){.prr_uhz = prr_uhz,
                                  .lines_uhz = lines_uhz,
                                  .pan_udeg_s = 0,
                                  .sweep_udeg = 360000000,
                                  .line_stop_udeg = 100000000};
}

/* ---- a day */

/* Adds a period n times, without n additions. While the sum stays within one power of two, each addition rounds to the
 * same multiple of its last place (ties too, once the sum's last bit is even). So two real additions give the step of
 * all. */
static double add_up(double period, uint64_t n)
{
    double sum = 0.0;
    while (n > 0) {
        double first = sum + period, next = n > 1 ? first + period : first;
        n -= n > 1 ? 2 : 1;
        if (next == sum || ilogb(next) != ilogb(sum)) {
            sum = next;
            continue;
        }
        double step = next - first, room = floor((ldexp(1.0, ilogb(next) + 1) - next) / step) - 1.0;
        uint64_t jump = room <= 0.0 ? 0 : room < (double)n ? (uint64_t)room : n;
        sum = next + (double)jump * step; /* exact: multiples of the last place below the next power of two */
        n -= jump;
    }
    return sum;
}

/* The sum ends where time stands still: where the period is below half of the sum's last place. */
static float add_up_float(float period, uint64_t n)
{
    float sum = 0.0f;
    for (; n > 0 && sum + period != sum; n--)
        sum += period;
    return sum;
}

/* The shortcut above gives the same as the loop. */
static void test_shortcut(void **state)
{
    (void)state;
    const double period = 1.0 / 2.2e6;
    double sum = 0.0;
    for (uint32_t i = 0; i < 3000000; i++) {
        sum += period;
        if (i < 1000 || i % 10007 == 0) assert_true(add_up(period, i + 1) == sum);
    }
}

/* The first pulse of each second fires at that second exactly, and any pulse at the floor of its time in nanoseconds.
 * The truth follows from the quotient by seconds, and not from the program's formula. */
static double worst_time_ns(const struct schedule_segment *seg, uint64_t prr_hz)
{
    double worst_ns = 0.0;
    for (uint64_t second = 0; second <= DAY_S; second += second < 100 ? 1 : 97) {
        uint64_t within[3] = {0, rng_u64(1, second) % prr_hz, prr_hz - 1};
        for (int i = 0; i < 3; i++) {
            int64_t expected = (int64_t)(second * 1000000000 + within[i] * 1000000000 / prr_hz);
            int64_t off = schedule_time_ns(seg, second * prr_hz + within[i]) - expected;
            worst_ns = fmax(worst_ns, fabs((double)off));
        }
    }
    return worst_ns;
}

static void test_day(void **state)
{
    (void)state;
    const uint64_t prr_hz = 2200000, n = prr_hz * DAY_S;
    const double day_ns = 1e9 * (double)DAY_S;
    struct schedule_spec spec = spec_of((int64_t)(prr_hz * 1000000), 100000000);
    struct schedule_segment seg;
    schedule_start(&seg, &spec);
    assert_true(schedule_time_ns(&seg, n) == (int64_t)(DAY_S * 1000000000));
    double ours_ns = worst_time_ns(&seg, prr_hz);
    table_row("a day at 2.2 MHz", "period added up, double seconds", fabs(1e9 * add_up(1.0 / 2.2e6, n) - day_ns),
              ours_ns, 0.0, "ns");
    table_row("a day at 2.2 MHz", "period added up, double ns", fabs(add_up(1e9 / 2.2e6, n) - day_ns), ours_ns, 0.0,
              "ns");
    table_row("a day at 2.2 MHz", "period added up, float seconds",
              fabs(1e9 * (double)add_up_float(1.0f / 2.2e6f, n) - day_ns), ours_ns, 0.0, "ns");
    table_row("a day at 2.2 MHz", "period in whole ns", fabs((double)n * round(1e9 / 2.2e6) - day_ns), ours_ns, 0.0,
              "ns");
    table_check();
}

/* ---- changes in mid-scan */

/* Rates whose periods are multiples of 1/2310 ns (10 x PART), as then is the sum of all periods so far. */
static const uint64_t PART = 231; /* 3 x 7 x 11 */
static const int64_t CHANGE_PRR_HZ[] = {2200000, 300000, 700000, 550000, 2100000, 100000};
enum { CHANGES = 100000, N_RATES = 6 };

static uint64_t parts_of(int64_t prr_hz)
{
    return PART * 1000000000 * 10 / (uint64_t)prr_hz; /* period in 1/2310 ns: whole for each of the rates */
}

/* Ours: a change cuts the rest of a nanosecond to a multiple of 1/prr_uhz, which loses at most 1e-11 ns with these
 * rates, and 1e-6 ns in 10^5 changes. If the true time is a whole number of nanoseconds or just above, the floor of
 * ours is then one less. There is no drift, but a bound of 1 ns. Naive: each segment's length in float seconds, or
 * periods in whole nanoseconds. */
static void test_changes(void **state)
{
    (void)state;
    struct schedule_spec spec = spec_of(CHANGE_PRR_HZ[0] * 1000000, 100000000);
    struct schedule_segment seg;
    schedule_start(&seg, &spec);
    uint64_t k = 0, parts = 0;
    double float_s = 0.0, whole_ns = 0.0, ours_ns = 0.0;
    int64_t prr_hz = CHANGE_PRR_HZ[0];
    for (int i = 0; i < CHANGES; i++) {
        uint64_t n = 1000 + rng_u64(2, (uint64_t)i) % 9001;
        assert_int_equal(parts_of(prr_hz) * (uint64_t)prr_hz, PART * 10 * 1000000000);
        k += n;
        parts += n * parts_of(prr_hz);
        whole_ns += (double)n * floor(1e9 / (double)prr_hz);
        float_s = (double)((float)float_s + (float)n / (float)prr_hz);
        prr_hz = CHANGE_PRR_HZ[rng_u64(3, (uint64_t)i) % N_RATES];
        spec = spec_of(prr_hz * 1000000, 100000000);
        schedule_change(&seg, &seg, &spec, k);
        int64_t expected = (int64_t)(parts / (PART * 10));
        ours_ns = fmax(ours_ns, fabs((double)(schedule_time_ns(&seg, k) - expected)));
    }
    double true_ns = (double)parts / (double)(PART * 10);
    table_row("100000 changes of the pulse rate", "float seconds per segment", fabs(1e9 * float_s - true_ns), ours_ns,
              1.0, "ns");
    table_row("100000 changes of the pulse rate", "periods in whole ns", fabs(whole_ns - true_ns), ours_ns, 1.0, "ns");
    table_check();
}

/* ---- lines that do not divide the pulses */

/* The mirror angle after an hour is compared with k * lines / pulses modulo 1 in whole numbers. Ours: the ratio r/den
 * and two products round by 2^-53 of a turn each: 4 x 2^-53 turns = 2.8e-15 rad. Naive: the line has the nearest whole
 * number of pulses, or the mirror's step is added up in double. */
static void line_row(int64_t prr_hz, int64_t lines_uhz)
{
    const double turn_rad = 2.0 * acos(-1.0);
    struct schedule_spec spec = spec_of(prr_hz * 1000000, lines_uhz);
    struct schedule_segment seg;
    uint64_t n = (uint64_t)prr_hz * 3600;
    uint64_t whole = (uint64_t)round((double)prr_hz * 1e6 / (double)lines_uhz);
    double ours_rad = 0.0, naive_rad = 0.0, off_lines;
    char regime[96];
    schedule_start(&seg, &spec);
    for (uint64_t i = 0; i < 20000; i++) {
        uint64_t k = n - rng_u64(4, i) % n, prr_uhz = (uint64_t)prr_hz * 1000000;
        uint64_t place = (uint64_t)((u128)k * (uint64_t)lines_uhz % prr_uhz);
        long double expected = (long double)place / (long double)prr_uhz;
        ours_rad = fmax(ours_rad, turn_rad * (double)fabsl(schedule_mirror_turn(&seg, k) - expected));
        off_lines = fabs((double)(k % whole) / (double)whole - (double)expected);
        naive_rad = fmax(naive_rad, turn_rad * fmin(off_lines, 1.0 - off_lines));
    }
    snprintf(regime, sizeof regime, "%.6g lines/s at %g MHz, an hour", 1e-6 * (double)lines_uhz, 1e-6 * (double)prr_hz);
    table_row(regime, "whole pulses per line", naive_rad, ours_rad, 4.0 * 0x1p-53 * turn_rad, "rad");
    double step = (double)lines_uhz / ((double)prr_hz * 1e6), sum = 0.0;
    for (uint32_t k = 0; k < 10000000; k++) /* some seconds of it will do */
        sum += sum + step >= 1.0 ? step - 1.0 : step;
    long double end = (long double)((u128)10000000 * (uint64_t)lines_uhz % ((uint64_t)prr_hz * 1000000));
    off_lines = fabs(sum - (double)(end / ((long double)prr_hz * 1e6L)));
    table_row(regime, "steps added up, 10^7 pulses", turn_rad * fmin(off_lines, 1.0 - off_lines), ours_rad,
              4.0 * 0x1p-53 * turn_rad, "rad");
}

static void test_lines(void **state)
{
    (void)state;
    line_row(300000, 7300000);
    line_row(2200000, 240000000);
    line_row(1200000, 97654321);
    table_check();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_shortcut),
        cmocka_unit_test(test_day),
        cmocka_unit_test(test_changes),
        cmocka_unit_test(test_lines),
    };
    table_head("stability: schedule");
    return cmocka_run_group_tests(tests, NULL, NULL);
}
