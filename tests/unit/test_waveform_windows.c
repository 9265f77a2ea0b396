/* SPDX-License-Identifier: MIT */
/* These tests check which samples of a pulse are kept, and which counts the digitiser makes of them. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/rng.h"
#include "tests/common/thorough.h"
#include "tests/unit/waveform_rig.h"

enum { MOST_SAMPLES = 16 * 4096, GRID = 40000 };
static uint16_t sample[MOST_SAMPLES];
static double grid[GRID];

static void record_into(const struct waveform *w, uint64_t pulse, const struct waveform_return *r, uint32_t n,
                        struct waveform_record *record)
{
    *record = (struct waveform_record){.sample = sample, .capacity = MOST_SAMPLES};
    waveform_sample(w, rng_scan(1, 1), pulse, r, n, record);
}

static struct waveform_return point(double at_samples, double amplitude)
{
    return (struct waveform_return){at_samples * SAMPLE_M, amplitude, 0.0, WAVEFORM_POINT};
}

static double count_of(const struct waveform_spec *spec, double signal)
{
    const double top = (1U << spec->bits) - 1.0;
    return fmin(top, fmax(0.0, spec->baseline_counts + signal / spec->full_scale * (top - spec->baseline_counts)));
}

/* A count is the signal on the grid, rounded. The tables have an error of 2e-6 of 500 thresholds, so both neighbours
 * of a half count are allowed. */
static void counts_are_the_signal(void **state)
{
    (void)state;
    struct waveform_spec spec = waveform_rig_spec();
    struct waveform *w = waveform_rig_open(&spec);
    struct waveform_record record;
    const struct waveform_return r[] = {point(100.3, 500.0), point(104.9, 300.0), {25.0, 400.0, 0.3, WAVEFORM_DISC}};
    record_into(w, 1, r, 3, &record);
    assert_int_equal(record.n_windows, 2);
    assert_int_equal(record.n_left_out, 0);
    for (uint32_t k = 0; k < record.n_windows; k++)
        for (uint32_t i = 0; i < record.window[k].n; i++) {
            double signal = waveform_signal(w, r, 3, (record.window[k].first + i) * SAMPLE_M);
            double off = sample[record.window[k].at + i] - count_of(&spec, signal);
            assert_true(fabs(off) <= 0.5 + 1e-6);
        }
    waveform_free(w);
}

/* A signal that a digitiser can't show gives its first or last count. */
static void counts_end_at_both_ends(void **state)
{
    (void)state;
    struct waveform_spec spec = waveform_rig_spec();
    struct waveform_record record;
    spec.bits = 10;
    spec.baseline_counts = 3.0;
    spec.noise = 3.0;
    struct waveform *w = waveform_rig_open(&spec);
    const struct waveform_return r = point(100.0, 2000.0);
    uint32_t low = 0, high = 0;
    for (uint64_t pulse = 0; pulse < 200; pulse++) {
        record_into(w, pulse, &r, 1, &record);
        for (uint32_t i = 0; i < record.n_samples; i++) {
            assert_true(sample[i] <= 1023);
            low += sample[i] == 0;
            high += sample[i] == 1023;
        }
    }
    assert_true(low > 100 && high > 600);
    waveform_free(w);
}

/* Finds the windows by a plain reading of the header: each sample with a signal is kept, with those before and after
 * it. */
static uint32_t plain_windows(const struct waveform *w, uint8_t *kept, uint32_t before, uint32_t after)
{
    uint32_t n = 0;
    memset(kept, 0, GRID);
    for (uint32_t k = 0; k < GRID; k++)
        if (grid[k] >= waveform_spec_of(w)->keep)
            for (uint32_t i = k < before ? 0 : k - before; i <= k + after && i < GRID; i++)
                kept[i] = 1;
    for (uint32_t k = 0; k < GRID; k++)
        n += kept[k] && (k == 0 || !kept[k - 1]);
    return n;
}

static void fill_grid(const struct waveform *w, const struct waveform_return *r, uint32_t n)
{
    memset(grid, 0, sizeof grid);
    for (uint32_t i = 0; i < n; i++) {
        double at = r[i].range_m / SAMPLE_M, reach = 40.0 + 6.0 * r[i].extent_m / SAMPLE_M;
        for (int64_t k = (int64_t)fmax(0.0, at - reach); k < (int64_t)(at + reach) && k < GRID; k++)
            grid[k] += waveform_signal(w, &r[i], 1, (double)k * SAMPLE_M);
    }
}

/* Returns of three kinds: few, many, and weak ones close together with some that are kept among them. */
static uint32_t random_returns(uint64_t *random, int turn, struct waveform_return r[64])
{
    const int weak = turn % 3 == 1, wide = turn % 7 == 0;
    const uint32_t n = (uint32_t)case_between(random, 1, weak ? 64 : wide ? 2 : turn % 4 == 0 ? 64 : 5);
    const double far = (double)case_between(random, 20, turn % 3 == 0 ? 9000 : weak ? 1 + 60 * n : 300);
    for (uint32_t i = 0; i < n; i++) {
        const int kept = !weak || case_between(random, 0, 1) == 0;
        r[i] = point(case_unit(random) * far, kept ? pow(10.0, 4.0 * case_unit(random) - 1.0) : 0.2);
        if (weak) r[i].range_m = SAMPLE_M * far * (i + case_unit(random)) / n;
        r[i].spread = (enum waveform_spread)case_between(random, 0, 2);
        r[i].extent_m = case_unit(random) * (wide ? 20.0 : 0.5);
    }
    return n;
}

/* Checks windows against those that the plain reading keeps. Returns how many of them touch the one before, as parts of
 * a stretch that is too long for one window. */
static uint32_t check_windows(const struct waveform_record *record, const uint8_t *kept, uint32_t want)
{
    uint32_t all = 0, runs = 0, parts = 0, run = 0;
    for (uint32_t k = 0; k < GRID; k++)
        all += kept[k];
    for (uint32_t k = 0, at = 0; k < record->n_windows; k++) {
        const struct waveform_window *x = &record->window[k];
        const int touches = k > 0 && x[-1].first + x[-1].n == x->first;
        assert_true(x->n >= 1 && x->n <= WAVEFORM_MAX_SAMPLES && x->at == at);
        assert_true(k == 0 || x->first >= x[-1].first + x[-1].n);
        for (uint32_t i = 0; i < x->n; i++)
            assert_true(kept[x->first + i]);
        at += x->n;
        run = touches ? run + x->n : x->n;
        if (touches) assert_true(run > WAVEFORM_MAX_SAMPLES);
        parts += (uint32_t)touches;
        runs += !touches;
    }
    assert_int_equal(record->n_samples + record->n_left_out, all);
    if (record->n_left_out == 0) assert_int_equal(runs, want);
    return parts;
}

/* Random pulses have stretches longer than a piece. The pulses' windows are where the plain reading has them. */
static void windows_are_where_light_is(void **state)
{
    (void)state;
    static uint8_t kept[GRID];
    uint64_t random = 99;
    struct waveform_spec spec = waveform_rig_spec();
    uint32_t many = 0, parts = 0;
    for (int turn = 0; turn < fewer(thorough(6000, 600)); turn++) {
        struct waveform_return r[64];
        struct waveform_record record;
        const uint32_t n = random_returns(&random, turn, r);
        spec.before_s = 1e-9 * (double)case_between(&random, 0, turn % 5 == 0 ? 900 : 100);
        spec.after_s = 1e-9 * (double)case_between(&random, 0, turn % 5 == 0 ? 900 : 30);
        struct waveform *w = waveform_rig_open(&spec);
        fill_grid(w, r, n);
        uint32_t want =
            plain_windows(w, kept, (uint32_t)lround(1e9 * spec.before_s), (uint32_t)lround(1e9 * spec.after_s));
        record_into(w, (uint64_t)turn, r, n, &record);
        many += want > WAVEFORM_MAX_WINDOWS;
        parts += check_windows(&record, kept, want);
        waveform_free(w);
    }
    print_message("# %u pulses with more than 16 windows, %u windows in parts\n", many, parts);
    if (!SANITIZED) assert_true(many > 0 && parts > 0);
}

/* A fixed window has all of its samples, however much light comes before it. */
static void a_fixed_window_is_whole(void **state)
{
    (void)state;
    struct waveform_spec spec = waveform_rig_spec();
    struct waveform_record record;
    struct waveform_return r[320];
    for (uint32_t i = 0; i < 320; i++)
        r[i] = point(100.0 + 20.0 * i, 50.0 + i % 7);
    spec.near_m = 4000.0 * SAMPLE_M;
    spec.far_m = 7000.5 * SAMPLE_M;
    struct waveform *w = waveform_rig_open(&spec);
    record_into(w, 0, r, 320, &record);
    assert_int_equal(record.n_windows, 1);
    assert_int_equal(record.window[0].first, 4000);
    assert_int_equal(record.n_samples, 3001);
    for (uint32_t i = 0; i < 3001; i += 50) {
        double want = count_of(&spec, waveform_signal(w, r, 320, (4000.0 + i) * SAMPLE_M));
        assert_true(fabs(sample[i] - want) <= 0.5 + 1e-6);
    }
    waveform_free(w);
}

/* A sample does not depend on what is kept around it, nor on the pulses before. */
static void samples_are_keyed(void **state)
{
    (void)state;
    struct waveform_spec spec = waveform_rig_spec();
    struct waveform_record record;
    const struct waveform_return r[] = {point(100.3, 500.0), point(180.0, 300.0), point(190.5, 3.0)};
    static uint16_t whole[1000];
    spec.noise = 0.5;
    spec.near_m = 0.0;
    spec.far_m = 149.0;
    struct waveform *gate = waveform_rig_open(&spec);
    record_into(gate, 77, r, 3, &record);
    assert_int_equal(record.n_windows, 1);
    assert_int_equal(record.window[0].first, 0);
    assert_int_equal(record.window[0].n, 995);
    memcpy(whole, sample, 995 * sizeof *whole);
    spec.near_m = spec.far_m = 0.0;
    struct waveform *w = waveform_rig_open(&spec);
    for (int times = 0; times < 2; times++) {
        record_into(w, 77, r, 3, &record);
        assert_int_equal(record.n_windows, 2);
        for (uint32_t k = 0; k < 2; k++)
            assert_memory_equal(sample + record.window[k].at, whole + record.window[k].first, 2 * record.window[k].n);
        record_into(w, 78, r, 3, &record); /* another pulse has another noise */
        assert_memory_not_equal(sample + record.window[1].at, whole + record.window[1].first, 2 * record.window[1].n);
    }
    waveform_sample(w, rng_scan(1, 2), 77, r, 3, &record); /* and so has another scan */
    assert_memory_not_equal(sample + record.window[1].at, whole + record.window[1].first, 2 * record.window[1].n);
    waveform_free(gate);
    waveform_free(w);
}

/* Mean, sigma and correlation of neighbours, of 4e6 samples, in counts: the errors of these are 1/sqrt(n) = 5e-4,
 * 3.5e-4 and 5e-4 of sigma; 5 times that is a false alarm in a million. Rounding adds 1/12 to the square. */
static void noise_is_white(void **state)
{
    (void)state;
    struct waveform_spec spec = waveform_rig_spec();
    struct waveform_record record;
    double sum = 0.0, square = 0.0, beside = 0.0;
    const uint32_t pulses = (uint32_t)fewer(1000);
    spec.noise = 0.7;
    spec.baseline_counts = 300.0;
    spec.near_m = 1.0;
    spec.far_m = 1.0 + 4001.5 * SAMPLE_M * 0.999;
    struct waveform *w = waveform_rig_open(&spec);
    double n = 0.0, sigma = 0.7 * (4095.0 - 300.0) / 1000.0;
    for (uint64_t pulse = 0; pulse < pulses; pulse++) {
        record_into(w, pulse, NULL, 0, &record);
        assert_int_equal(record.n_windows, 1);
        for (uint32_t i = 0; i < record.n_samples; i++) {
            double x = sample[i] - 300.0;
            sum += x;
            square += x * x;
            if (i > 0) beside += x * (sample[i - 1] - 300.0);
        }
        n += record.n_samples;
    }
    const double most = 5.0 / sqrt(n), variance = sigma * sigma + 1.0 / 12.0;
    assert_true(fabs(sum / n) < most * sigma);
    assert_true(fabs(square / n / variance - 1.0) < most * 1.42);
    assert_true(fabs(beside / n) < most * variance);
    waveform_free(w);
}

/* A strong return is flat at the limit. After its last flat sample nothing comes for the dead time, also where another
 * return lies. Later ones come again. */
static void a_receiver_saturates_and_recovers(void **state)
{
    (void)state;
    struct waveform_spec spec = waveform_rig_spec();
    struct waveform_record record;
    const struct waveform_return r[] = {point(200.0, 5000.0), point(252.0, 100.0), point(300.0, 100.0)};
    spec.saturation = 600.0;
    spec.dead_s = 50e-9;
    spec.near_m = 20.0;
    spec.far_m = 80.0;
    for (int dead = 0; dead < 2; dead++) {
        if (!dead) spec.dead_s = 0.0;
        if (dead) spec.dead_s = 50e-9;
        struct waveform *w = waveform_rig_open(&spec);
        record_into(w, 0, r, 3, &record);
        assert_int_equal(record.n_windows, 1);
        uint32_t first = record.window[0].first, flat = 0, last = 0;
        for (uint32_t i = 0; i < record.n_samples; i++)
            if (waveform_signal(w, r, 3, (first + i) * SAMPLE_M) >= 600.0) {
                assert_int_equal(sample[i], (int)lround(count_of(&spec, 600.0)));
                flat++;
                last = first + i;
            }
        assert_true(flat > 4);
        for (uint32_t i = last + 1 - first; i < record.n_samples; i++) {
            double signal = waveform_signal(w, r, 3, (first + i) * SAMPLE_M);
            double want = count_of(&spec, dead && first + i <= last + 50 ? 0.0 : signal);
            assert_true(fabs(sample[i] - want) <= 0.5 + 1e-6);
        }
        waveform_free(w);
    }
}

/* Light before the fixed window, and in another stretch, blinds the receiver as well. */
static void saturation_lies_outside_of_windows(void **state)
{
    (void)state;
    struct waveform_spec spec = waveform_rig_spec();
    struct waveform_record record;
    const struct waveform_return r[] = {point(300.0, 100.0), point(100.0, 5000.0)};
    spec.saturation = 600.0;
    spec.dead_s = 250e-9;
    for (int gated = 0; gated < 2; gated++) {
        spec.near_m = 280.0 * SAMPLE_M * gated;
        spec.far_m = 320.5 * SAMPLE_M * gated;
        struct waveform *w = waveform_rig_open(&spec);
        record_into(w, 0, r, 2, &record);
        assert_int_equal(record.n_windows, gated ? 1 : 2);
        const struct waveform_window *window = &record.window[record.n_windows - 1];
        for (uint32_t i = 0; i < window->n; i++)
            assert_int_equal(sample[window->at + i], 100);
        waveform_free(w);
    }
}

/* Where there is no room for a window it counts as lost, whole. */
static void no_room_is_counted(void **state)
{
    (void)state;
    struct waveform_spec spec = waveform_rig_spec();
    struct waveform *w = waveform_rig_open(&spec);
    struct waveform_return r[20];
    struct waveform_record record;
    for (uint32_t i = 0; i < 20; i++)
        r[i] = point(100.0 + 60.0 * i, 10.0);
    record_into(w, 0, r, 20, &record);
    const uint32_t each = record.window[0].n;
    assert_int_equal(record.n_windows, 16);
    assert_int_equal(record.n_left_out, 4 * each);
    record.capacity = 3 * each + each / 2;
    waveform_sample(w, 0, 0, r, 20, &record);
    assert_int_equal(record.n_windows, 3);
    assert_int_equal(record.n_samples, 3 * each);
    assert_int_equal(record.n_left_out, 17 * each);
    record_into(w, 0, r, 0, &record);
    assert_int_equal(record.n_windows + record.n_samples + record.n_left_out, 0);
    waveform_free(w);
}

/* Three windows fill the room to its end, with noise and without, and what lies behind it stays. */
static void windows_end_with_the_room(void **state)
{
    (void)state;
    const struct waveform_return r[] = {point(100.0, 10.0), point(160.0, 10.0), point(220.0, 10.0)};
    for (int noisy = 0; noisy < 2; noisy++) {
        struct waveform_spec spec = waveform_rig_spec();
        struct waveform_record record;
        spec.noise = noisy;
        struct waveform *w = waveform_rig_open(&spec);
        record_into(w, 0, r, 3, &record);
        const uint32_t n = record.n_samples;
        assert_int_equal(record.n_windows, 3);
        record.capacity = n;
        sample[n] = 0xbeef;
        waveform_sample(w, 0, 0, r, 3, &record);
        assert_int_equal(record.n_samples, n);
        assert_int_equal(sample[n], 0xbeef);
        waveform_free(w);
    }
}

/* Nothing is sampled before the emission: the window of a return at 0 begins there. */
static void windows_begin_at_the_emission(void **state)
{
    (void)state;
    struct waveform_spec spec = waveform_rig_spec();
    struct waveform *w = waveform_rig_open(&spec);
    struct waveform_record record;
    const struct waveform_return r = point(0.4, 50.0);
    record_into(w, 0, &r, 1, &record);
    assert_int_equal(record.n_windows, 1);
    assert_int_equal(record.window[0].first, 0);
    assert_int_equal(sample[0], (int)lround(count_of(&spec, waveform_signal(w, &r, 1, 0.0))));
    waveform_free(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(counts_are_the_signal),
                                       cmocka_unit_test(counts_end_at_both_ends),
                                       cmocka_unit_test(windows_are_where_light_is),
                                       cmocka_unit_test(a_fixed_window_is_whole),
                                       cmocka_unit_test(samples_are_keyed),
                                       cmocka_unit_test(noise_is_white),
                                       cmocka_unit_test(a_receiver_saturates_and_recovers),
                                       cmocka_unit_test(saturation_lies_outside_of_windows),
                                       cmocka_unit_test(no_room_is_counted),
                                       cmocka_unit_test(windows_end_with_the_room),
                                       cmocka_unit_test(windows_begin_at_the_emission)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
