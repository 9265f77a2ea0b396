/* SPDX-License-Identifier: MIT */
/* Echoes whose tops are not seen, since the receiver or the digits are at their limit: all are found and flagged. */
#include "tests/common/cases.h"
#include "tests/common/wave_echoes.h"

static const enum waveform_detector all[WAVE_DETECTORS] = {WAVEFORM_THRESHOLD, WAVEFORM_FRACTION, WAVEFORM_GAUSSIANS};

/* Echoes are limited by the digits, by the receiver, or by a receiver that is then blind. They are flagged, and their
 * ranges hold. Two samples of one flank may be all that there is. For an amplitude of 120 both are well above the noise
 * of 1/8; for 1,000 the weaker is not, so the range holds to a sample of 1 ns. */
static void a_saturated_echo_is_flagged_and_ranged(void **state)
{
    (void)state;
    static const struct {
        double saturation, dead_s, amplitude, most_m;
    } how[4] = {
        {0.0, 0.0, 1000.0, 0.01}, {60.0, 0.0, 1000.0, 0.01}, {60.0, 20e-9, 1000.0, 0.15}, {60.0, 20e-9, 120.0, 0.025}};
    for (int h = 0; h < 8; h++) {
        struct waveform_spec spec = wave_spec();
        struct wave_echoes w;
        spec.saturation = how[h / 2].saturation;
        spec.dead_s = how[h / 2].dead_s;
        if (h % 2 == 1) {
            spec.shape = WAVEFORM_ASYMMETRIC;
            spec.skew = 1.5;
            spec.sample_s = 0.5e-9;
        }
        wave_open(&w, &spec);
        for (int d = 0; d < WAVE_DETECTORS; d++)
            for (uint64_t p = 0; p < 150; p++) {
                const struct waveform_return r = {20.0 + 0.001 * (double)p, how[h / 2].amplitude, 0.0, WAVEFORM_POINT};
                assert_int_equal(wave_shoot(&w, all[d], p, &r, 1), 1);
                assert_int_equal(w.echo[0].saturated, 1);
                wave_near(w.echo[0].range_m, r.range_m, how[h / 2].most_m);
            }
        wave_close(&w);
    }
}

/* Samples are limited at the level of detection itself, so tops are not seen and their heights are fitted. No echo below
 * the level is reported all the same. Echoes of three times the level are seen by all detectors. */
static void a_saturated_echo_is_not_below_the_level(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    spec.full_scale = 1.0;
    wave_open(&w, &spec);
    for (int d = 0; d < WAVE_DETECTORS; d++)
        for (uint64_t p = 0; p < 400; p++) {
            const double amplitude = p < 300 ? 0.7 + 0.002 * (double)p : 3.0;
            const struct waveform_return r = {20.0 + 0.001 * (double)p, amplitude, 0.0, WAVEFORM_POINT};
            const uint32_t n = wave_shoot(&w, all[d], p, &r, 1);
            for (uint32_t i = 0; i < n; i++)
                assert_true(w.echo[i].amplitude >= 1.0);
            if (p >= 300) assert_true(n == 1 && w.echo[0].saturated);
        }
    wave_close(&w);
}

/* A receiver that saturates at 1.5 or 1.012 of the level, or digits that end at 1.2 of it. Little of the pulse is seen,
 * so a fit gives a poor height. But the samples are above the level: no strong echo is lost, and none is sent below it. */
static void a_strong_saturated_echo_is_found(void **state)
{
    (void)state;
    static const struct {
        double saturation, dead_s, full_scale;
    } how[] = {{1.5, 20e-9, 100.0}, {1.012, 20e-9, 100.0}, {1.012, 0.0, 100.0}, {0.0, 0.0, 1.2}};
    static const double amplitude[] = {10.0, 300.0};
    for (size_t h = 0; h < 2 * sizeof how / sizeof how[0]; h++) {
        struct waveform_spec spec = wave_spec();
        struct wave_echoes w;
        spec.saturation = how[h / 2].saturation;
        spec.dead_s = how[h / 2].dead_s;
        spec.full_scale = how[h / 2].full_scale;
        wave_open(&w, &spec);
        for (int d = 0; d < WAVE_DETECTORS; d++)
            for (uint64_t p = 0; p < 300; p++) {
                const struct waveform_return r = {20.0 + 0.001 * (double)p, amplitude[h % 2], 0.0, WAVEFORM_POINT};
                assert_int_equal(wave_shoot(&w, all[d], p, &r, 1), 1);
                assert_true(w.echo[0].saturated && w.echo[0].amplitude >= 1.0);
            }
        wave_close(&w);
    }
}

/* Only the digits are at their limit, of 100 thresholds: the receiver takes 400, so it is not blind for 40 ns after. A
 * wall 3 m behind the target stays an echo of its own. Ranges are within 4 deviations of `threshold`, the roughest:
 * 14 mm at an amplitude of 24 (core/waveform/DETECTION.md). */
static void a_receiver_that_does_not_saturate_is_not_blind(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    spec.saturation = 400.0;
    spec.dead_s = 40e-9;
    wave_open(&w, &spec);
    assert_true(spec.full_scale == 100.0);
    for (int d = 0; d < WAVE_DETECTORS; d++)
        for (uint64_t p = 0; p < 40; p++) {
            const double near_m = 20.0 + 0.004 * (double)p;
            const struct waveform_return r[2] = {{near_m, 200.0, 0.0, WAVEFORM_POINT},
                                                 {near_m + 3.0, 30.0, 0.0, WAVEFORM_POINT}};
            assert_int_equal(wave_shoot(&w, all[d], p, r, 2), 2);
            assert_true(w.echo[0].saturated && !w.echo[1].saturated);
            wave_near(w.echo[0].range_m, r[0].range_m, 0.056);
            wave_near(w.echo[1].range_m, r[1].range_m, 0.056);
        }
    wave_close(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_saturated_echo_is_flagged_and_ranged),
        cmocka_unit_test(a_saturated_echo_is_not_below_the_level),
        cmocka_unit_test(a_strong_saturated_echo_is_found),
        cmocka_unit_test(a_receiver_that_does_not_saturate_is_not_blind),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
