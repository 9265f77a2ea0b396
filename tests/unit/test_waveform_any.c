/* SPDX-License-Identifier: MIT */
/* Echoes found in samples, whatever they are: the result depends on the samples alone, and its figures stay finite. */
#include <math.h>
#include <string.h>

#include "tests/common/cases.h"
#include "tests/common/thorough.h"
#include "tests/common/wave_echoes.h"

/* The result depends on the samples alone, and on nothing left from before. */
static void detection_is_pure(void **state)
{
    (void)state;
    const struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    struct waveform_echo before[WAVE_MOST];
    wave_open(&w, &spec);
    struct waveform_return r[6];
    uint64_t seed = 5;
    for (int turn = 0; turn < 50; turn++) {
        for (int k = 0; k < 6; k++)
            r[k] = (struct waveform_return){20.0 + 6.0 * case_unit(&seed), 1.0 + 30.0 * case_unit(&seed), 0.0,
                                            WAVEFORM_POINT};
        uint32_t n = wave_shoot(&w, WAVEFORM_GAUSSIANS, (uint64_t)turn, r, 6);
        memcpy(before, w.echo, sizeof before);
        memset(w.echo, 0x5a, sizeof w.echo);
        assert_int_equal(wave_detect(&w, WAVEFORM_GAUSSIANS), n);
        for (uint32_t i = 0; i < n; i++) {
            assert_true(before[i].range_m == w.echo[i].range_m && before[i].amplitude == w.echo[i].amplitude &&
                        before[i].width_s == w.echo[i].width_s && before[i].deviation == w.echo[i].deviation);
            assert_true(i == 0 || w.echo[i].range_m >= w.echo[i - 1].range_m);
            assert_true(isfinite(w.echo[i].range_m) && w.echo[i].amplitude >= 1.0 && isfinite(w.echo[i].width_s) &&
                        isfinite(w.echo[i].deviation));
        }
    }
    wave_close(&w);
}

/* Any counts at all: random walks, spikes, all the largest, all nothing. Figures stay finite. */
static void take_any_samples(const struct waveform_spec *spec, uint64_t seed)
{
    struct wave_echoes w;
    wave_open(&w, spec);
    for (int turn = 0; turn < fewer(1000); turn++) {
        uint32_t n = (uint32_t)case_between(&seed, 1, turn % 50 == 0 ? WAVEFORM_MAX_SAMPLES : 60);
        int kind = (int)case_between(&seed, 0, 4);
        double level = 200.0;
        w.record.n_windows = w.record.n_samples = 0;
        w.record.window[w.record.n_windows++] = (struct waveform_window){(uint32_t)turn, n, 0};
        for (uint32_t i = 0; i < n; i++) {
            level = fmin(4095.0, fmax(0.0, level + 400.0 * (case_unit(&seed) - 0.5)));
            const double count[5] = {level, 4095.0 * case_unit(&seed), case_unit(&seed) < 0.1 ? 4095.0 : 200.0, 4095.0,
                                     0.0};
            w.sample[i] = (uint16_t)count[kind];
        }
        for (int d = 0; d < WAVE_DETECTORS; d++) {
            uint32_t found = wave_detect(&w, (enum waveform_detector)d);
            assert_true(found <= WAVE_MOST);
            for (uint32_t i = 0; i < found; i++) {
                const struct waveform_echo *e = &w.echo[i];
                assert_true(isfinite(e->range_m) && isfinite(e->amplitude) && isfinite(e->width_s));
                assert_true(isfinite(e->deviation) && e->width_s > 0.0 && e->amplitude > 0.0);
            }
        }
    }
    wave_close(&w);
}

static void any_samples_are_taken(void **state)
{
    (void)state;
    static const double humps[7] = {0.0, 1.0, 0.2, 0.3, 0.9, 0.4, 0.0};
    struct waveform_spec spec = wave_spec();
    spec.saturation = 80.0;
    spec.dead_s = 7e-9;
    take_any_samples(&spec, 9);
    spec.shape = WAVEFORM_ASYMMETRIC;
    spec.skew = 3.0;
    spec.width_s = 12e-9;
    take_any_samples(&spec, 10);
    spec.shape = WAVEFORM_TABLE;
    spec.table = humps;
    spec.n_table = 7;
    spec.table_step_s = 3e-9;
    spec.bandwidth_hz = 150e6;
    take_any_samples(&spec, 11);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(detection_is_pure),
        cmocka_unit_test(any_samples_are_taken),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
