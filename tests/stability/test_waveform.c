/* SPDX-License-Identifier: MIT */
/* Plain sampling fails for some waveforms: pulses shorter than the samples, grazing planes, far ranges, extents that
 * vanish or that are much larger than the pulse. */
#include <math.h>
#include <stdio.h>

#include "tests/common/waveform_reference.h"
#include "tests/stability/table.h"

static const double SAMPLE_M = WAVEREF_SAMPLE_S * WAVEREF_METRES_1_S;

static struct waveform *open_waveform(const struct waveform_spec *spec)
{
    struct waveform *w;
    struct sh_err err;
    if (waveform_create(spec, &w, &err) != SH_OK) fail_msg("%s", err.text);
    return w;
}

static double gaussian(double t_s, double width_s)
{
    return exp(-4.0 * M_LN2 * t_s * t_s / (width_s * width_s));
}

/* The largest change, from its mean, of the energy in samples of one return as it moves through a sample. */
static double energy_jitter(const struct waveform *w, double width_s)
{
    enum { PHASES = 64 };
    double energy[PHASES], mean = 0.0, worst = 0.0;
    for (int phase = 0; phase < PHASES; phase++) {
        const struct waveform_return r = {100.0 + SAMPLE_M * phase / PHASES, 1.0, 0.0, WAVEFORM_POINT};
        energy[phase] = 0.0;
        for (int k = 600; k < 740; k++) {
            double off_s = (k * SAMPLE_M - r.range_m) / WAVEREF_METRES_1_S;
            energy[phase] += w == NULL ? gaussian(off_s, width_s) : waveform_signal(w, &r, 1, k * SAMPLE_M);
        }
        mean += energy[phase] / PHASES;
    }
    for (int phase = 0; phase < PHASES; phase++)
        worst = fmax(worst, fabs(energy[phase] / mean - 1.0));
    return worst;
}

/* Naive: the pulse's power at each sample. Ours refuses a pulse whose energy would change by more than 0.1 %, and
 * takes it with a receiver that is slow enough. */
static void short_pulses_fall_between_samples(void **state)
{
    (void)state;
    static const double widths_s[] = {0.2e-9, 0.5e-9, 1e-9, 1.4e-9};
    for (int k = 0; k < 4; k++) {
        struct waveform_spec spec = waveref_spec();
        struct waveform *w;
        struct sh_err err;
        char regime[64];
        spec.width_s = widths_s[k];
        assert_int_equal(waveform_create(&spec, &w, &err), SH_EINPUT);
        spec.bandwidth_hz = 200e6;
        w = open_waveform(&spec);
        snprintf(regime, sizeof regime, "energy of a %.1f ns pulse, samples of 1 ns", 1e9 * widths_s[k]);
        table_row(regime, "power at the samples", energy_jitter(NULL, widths_s[k]), energy_jitter(w, 0.0), 1e-3,
                  "of it");
        waveform_free(w);
    }
    table_check();
}

/* Naive: sub-rays, whose pulses stand apart as a comb. The bound is one count of 12 bits. */
static void grazing_planes_are_no_comb(void **state)
{
    (void)state;
    static const double extents_m[] = {0.5, 3.0, 20.0};
    const struct waveform_spec spec = waveref_spec();
    struct waveform *w = open_waveform(&spec);
    for (int k = 0; k < 3; k++) {
        static struct waveref_window reference, few, ours;
        const struct waveform_return r = {1e5, 1.0, extents_m[k], WAVEFORM_DISC};
        const uint32_t rays = 61;
        char regime[64];
        waveref_open(&reference, r.range_m - r.extent_m, r.range_m + r.extent_m);
        few = reference;
        for (uint32_t i = 0; i < 10 * WAVEREF_RAYS; i++) {
            double x, y;
            waveref_place(i, 10 * WAVEREF_RAYS, &x, &y);
            waveref_add(&reference, r.range_m + r.extent_m * x, 0.1 / WAVEREF_RAYS);
            if (i >= rays) continue;
            waveref_place(i, rays, &x, &y);
            waveref_add(&few, r.range_m + r.extent_m * x, 1.0 / rays);
        }
        waveref_fill(w, &r, 1, &reference, &ours);
        snprintf(regime, sizeof regime, "a plane over +/- %g m of range", extents_m[k]);
        table_row(regime, "61 sub-rays", waveref_counts(&few, &reference), waveref_counts(&ours, &reference), 1.0,
                  "counts, RMS");
    }
    waveform_free(w);
    table_check();
}

/* Centre of the energy of samples about range_m. */
static double centre_m(const struct waveform *w, double range_m, int as_float)
{
    const int64_t middle = llround(range_m / SAMPLE_M);
    double sum = 0.0, moment = 0.0;
    for (int64_t k = middle - 15; k <= middle + 15; k++) {
        const struct waveform_return r = {range_m, 1.0, 0.0, WAVEFORM_POINT};
        double at_m = (double)k * SAMPLE_M, off_m = at_m - range_m;
        if (as_float) off_m = (double)((float)at_m - (float)range_m);
        double p = as_float ? gaussian(off_m / WAVEREF_METRES_1_S, WAVEREF_PULSE_S) : waveform_signal(w, &r, 1, at_m);
        sum += p;
        moment += p * (at_m - range_m);
    }
    return moment / sum;
}

/* Naive: ranges as floats, which are 7.8 mm apart at 100 km. Ours: doubles, which are 1.5e-11 m apart there. The bound
 * is for the pulse's table: it errs by 1e-6 of the peak at up to 2 m from the centre, against an area of 2 samples. */
static void far_ranges_keep_their_millimetres(void **state)
{
    (void)state;
    static const double ranges_m[] = {1e3, 1e4, 1e5};
    const struct waveform_spec spec = waveref_spec();
    struct waveform *w = open_waveform(&spec);
    for (int k = 0; k < 3; k++) {
        double naive = 0.0, ours = 0.0;
        char regime[64];
        for (int i = 0; i < 200; i++) {
            double range_m = ranges_m[k] + 0.001 * i;
            naive = fmax(naive, fabs(centre_m(w, range_m, 1)));
            ours = fmax(ours, fabs(centre_m(w, range_m, 0)));
        }
        snprintf(regime, sizeof regime, "steps of 1 mm at %g km: centre of the samples", 1e-3 * ranges_m[k]);
        table_row(regime, "ranges as floats", naive, ours, 1e-5, "m");
    }
    waveform_free(w);
    table_check();
}

/* Naive: a plane's signal as a difference of two primitives, over the extent. With little extent the difference is
 * lost. A uniform strip stands for the disc, since both tend to the pulse itself. */
static void no_extent_is_a_point(void **state)
{
    (void)state;
    static const double extents_m[] = {1e-13, 1e-15};
    const struct waveform_spec spec = waveref_spec();
    struct waveform *w = open_waveform(&spec);
    for (int k = 0; k < 2; k++) {
        const double sigma_m = WAVEREF_SIGMA_S * WAVEREF_METRES_1_S, extent_m = extents_m[k];
        double naive = 0.0, ours = 0.0;
        char regime[64];
        for (int i = -20; i <= 20; i++) {
            const struct waveform_return r = {50.0, 1.0, extent_m, WAVEFORM_DISC};
            double at_m = 0.02 * i, want = exp(-0.5 * at_m * at_m / (sigma_m * sigma_m));
            double upper = erf((at_m + extent_m) / (M_SQRT2 * sigma_m)),
                   lower = erf((at_m - extent_m) / (M_SQRT2 * sigma_m));
            naive = fmax(naive, fabs(sigma_m * sqrt(0.5 * M_PI) * (upper - lower) / (2.0 * extent_m) - want));
            ours = fmax(ours, fabs(waveform_signal(w, &r, 1, 50.0 + at_m) - want));
        }
        snprintf(regime, sizeof regime, "a plane over +/- %g m of range: signal", extent_m);
        table_row(regime, "difference of primitives", naive, ours, 2e-6, "of its peak");
    }
    waveform_free(w);
    table_check();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(short_pulses_fall_between_samples), cmocka_unit_test(grazing_planes_are_no_comb),
        cmocka_unit_test(far_ranges_keep_their_millimetres), cmocka_unit_test(no_extent_is_a_point)};
    table_head("Waveforms: short pulses, grazing planes, far ranges");
    return cmocka_run_group_tests(tests, NULL, NULL);
}
