/* SPDX-License-Identifier: MIT */
/* These tests measure how well each detector ranges, against theory and against another decomposition, and where it
 * is biased. The tables are those of core/waveform/DETECTION.md. Statistics of n pulses are allowed 4.75 of their
 * standard errors. */
#include <math.h>
#include <stdio.h>

#include "tests/accuracy/other_decomposition.h"
#include "tests/common/cases.h"
#include "tests/common/thorough.h"
#include "tests/common/wave_echoes.h"

#include "core/detect.h"
#include "core/footprint.h"
#include "core/light.h"

static const double ERRORS = 4.75, C_2 = 0.5 * 299792458.0;

static uint32_t pulses(void)
{
    return (uint32_t)fewer(thorough(8000, 1000));
}

/* ---- one echo */

/* The deviation of ranges has bounds. The decomposition is within 10 % of Cramer's and Rao's bound, which no
 * unbiased estimate beats. The deviation at an edge has two parts: the noise over the slope at the crossing, and the
 * effect of the peak's noise on the correction. */
static double edge_sigma_m(double peak, double part, double noise, double sigma_s)
{
    double v = sqrt(-2.0 * log(part)), at_edge = noise / (peak * part * v), by_peak = noise / (peak * v);
    return C_2 * sigma_s * sqrt(at_edge * at_edge * 2.0 / 3.0 + by_peak * by_peak);
}

static void ranges_are_as_good_as_noise_allows(void **state)
{
    (void)state;
    static const double amplitude[5] = {3.0, 6.0, 12.0, 24.0, 48.0};
    struct waveform_spec spec = wave_spec();
    const double s = wave_sigma(spec.width_s);
    struct wave_echoes w;
    struct wave_figures f[WAVE_DETECTORS];
    wave_open(&w, &spec);
    printf("# amplitude: sigma of the range, mm: Cramer-Rao | gaussians | fraction | threshold\n");
    for (int k = 0; k < 5; k++) {
        const struct waveform_return r = {80.0, amplitude[k], 0.0, WAVEFORM_POINT};
        for (int d = 0; d < WAVE_DETECTORS; d++) {
            wave_measure(&w, (enum waveform_detector)d, pulses(), &r, &f[d]);
            assert_true(f[d].single >= pulses() - 2);
        }
        /* counts are steps of 100 / 3895 thresholds */
        const double noise = sqrt(spec.noise * spec.noise + pow(100.0 / 3895.0, 2.0) / 12.0);
        const double least = wave_least_sigma_m(amplitude[k], noise, s, spec.sample_s);
        printf("# %9.0f: %8.2f | %8.2f | %8.2f | %8.2f\n", amplitude[k], 1e3 * least, 1e3 * f[2].sigma_m,
               1e3 * f[1].sigma_m, 1e3 * f[0].sigma_m);
        const double slack = ERRORS / sqrt(2.0 * pulses());
        wave_between(f[2].sigma_m / least, 1.0 - slack, 1.10 + slack);
        wave_between(f[1].sigma_m / edge_sigma_m(amplitude[k], 0.5, noise, s), 0.5, 1.2);
        wave_between(f[0].sigma_m / edge_sigma_m(amplitude[k], 1.0 / amplitude[k], noise, s), 0.6, 1.5);
        for (int d = 0; d < WAVE_DETECTORS; d++)
            wave_near(f[d].bias_m, 0.0, ERRORS * f[d].sigma_m / sqrt(pulses()) + 1e-3);
    }
    wave_close(&w);
}

/* detect.h: the jitter falls as 1 / A. So a data sheet's deviation at one amplitude gives those at all others. */
static void the_jitter_is_that_of_the_closed_form(void **state)
{
    (void)state;
    const struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    struct wave_figures f;
    wave_open(&w, &spec);
    struct waveform_return r = {80.0, 12.0, 0.0, WAVEFORM_POINT};
    wave_measure(&w, WAVEFORM_GAUSSIANS, pulses(), &r, &f);
    struct detect_signal signal;
    struct sh_err err;
    const struct detect_signal_spec sheet = {.n_reaches = 1,
                                             .reach = {{0.9, 100.0 * sqrt(12.0)}},
                                             .threshold_snr = 8.0,
                                             .sigma_m = f.sigma_m,
                                             .sigma_at_m = 100.0,
                                             .sigma_reflectance = 0.9,
                                             .seed = 1};
    assert_int_equal(detect_signal_set_up(&sheet, &signal, &err), SH_OK);
    for (int k = 0; k < 4; k++) {
        static const double range_m[4] = {50.0, 71.0, 141.0, 200.0};
        r.amplitude = detect_amplitude(&signal, range_m[k], 0.9);
        wave_measure(&w, WAVEFORM_GAUSSIANS, pulses(), &r, &f);
        wave_between(f.sigma_m * r.amplitude / sqrt(signal.jitter2), 1.0 - 1.5 * ERRORS / sqrt(pulses()),
                     1.05 + 1.5 * ERRORS / sqrt(pulses()));
    }
    wave_close(&w);
}

/* The target is seen in a part of the pulses. By a level: at least one sample of independent noise reaches it. By
 * decomposition: the fitted peak, whose noise is that of a sample times sqrt(1.5 dt / (sqrt(pi) s)), reaches it. */
static double normal(double x)
{
    return 0.5 * erfc(-x / sqrt(2.0));
}

static double seen_by_level(const struct wave_echoes *w, const struct waveform_return *r, double noise)
{
    const struct waveform_spec *spec = waveform_spec_of(w->waveform);
    const double sample_m = C_2 * spec->sample_s, count = spec->full_scale / (4095.0 - spec->baseline_counts);
    const double level = (ceil(1.0 / count) - 0.5) * count; /* counts are rounded */
    double sum = 0.0;
    for (int phase = 0; phase < 20; phase++) {
        double missed = 1.0;
        for (int k = -10; k <= 10; k++) {
            double y = waveform_signal(w->waveform, r, 1, r->range_m + (k + 0.05 * phase) * sample_m);
            missed *= normal((level - y) / noise);
        }
        sum += 1.0 - missed;
    }
    return sum / 20.0;
}

static void targets_are_seen_as_often_as_they_should(void **state)
{
    (void)state;
    static const double amplitude[5] = {0.8, 0.9, 1.0, 1.1, 1.2};
    struct waveform_spec spec = wave_spec();
    struct wave_echoes w;
    struct wave_figures f[WAVE_DETECTORS];
    const double k = 1.0 / spec.noise, less = sqrt(1.5e-9 / (sqrt(M_PI) * wave_sigma(spec.width_s)));
    wave_open(&w, &spec);
    printf("# amplitude: part of pulses seen: detect.h | gaussians, expected | fraction | threshold, expected\n");
    for (int a = 0; a < 5; a++) {
        const struct waveform_return r = {80.0, amplitude[a], 0.0, WAVEFORM_POINT};
        for (int d = 0; d < WAVE_DETECTORS; d++)
            wave_measure(&w, (enum waveform_detector)d, 4 * pulses(), &r, &f[d]);
        const double n = 4.0 * pulses(), level = seen_by_level(&w, &r, spec.noise);
        const double fitted = normal(k * (amplitude[a] - 1.0) / less);
        printf("# %4.1f: %.3f | %.3f, %.3f | %.3f | %.3f, %.3f\n", amplitude[a], normal(k * (amplitude[a] - 1.0)),
               f[2].single / n, fitted, f[1].single / n, f[0].single / n, level);
        wave_near(f[0].single / n, level, ERRORS * 0.5 / sqrt(n));
        wave_between(f[2].single / n, fitted - 0.08, fitted + 0.08);
    }
    wave_close(&w);
}

/* ---- planes */

/* A beam of 0.7 mrad at 100 m. */
static const double BEAM_RAD = 0.7e-3, RANGE_M = 100.0;

static double extent_m(double incidence_deg)
{
    return 0.5 * BEAM_RAD * RANGE_M * tan(incidence_deg * M_PI / 180.0);
}

/* Returns the peak of a return's signal as a share of the peak of a return that is hit head on. */
static double peak_of(const struct wave_echoes *w, const struct waveform_return *r)
{
    const struct waveform_return point = {r->range_m, 1.0, 0.0, WAVEFORM_POINT};
    double most = 0.0, head_on = 0.0;
    for (int k = -200; k <= 200; k++) {
        most = fmax(most, waveform_signal(w->waveform, r, 1, r->range_m + 0.005 * k));
        head_on = fmax(head_on, waveform_signal(w->waveform, &point, 1, r->range_m + 0.005 * k));
    }
    return most / head_on;
}

static void planes(const struct waveform_spec *spec, const char *name, double most_m[WAVE_DETECTORS])
{
    static const double incidence_deg[7] = {0.0, 30.0, 60.0, 70.0, 80.0, 85.0, 88.0};
    struct wave_echoes w;
    struct wave_figures f[WAVE_DETECTORS];
    wave_open(&w, spec);
    printf("# %s pulse, a plane: incidence: bias of the range, mm: threshold | fraction | gaussians; width, ns: closed "
           "form | fraction | gaussians; deviation\n",
           name);
    for (int k = 0; k < 7; k++) {
        const double extent = extent_m(incidence_deg[k]);
        const struct waveform_return r = {RANGE_M, 60.0, extent, extent > 0.0 ? WAVEFORM_DISC : WAVEFORM_POINT};
        for (int d = 0; d < WAVE_DETECTORS; d++) {
            wave_measure(&w, (enum waveform_detector)d, pulses() / 4, &r, &f[d]);
            /* the tail of a skew echo may reach the level once more, with noise on it */
            assert_true(f[d].single >= pulses() / 4 - pulses() / 4000);
            /* Ranges across the plane rise as 1 / (1 - x extent / R), so its echo is skew. A symmetric shape
             * lies off the centroid by less than a third of extent^2 / R, by which the rims' middle is shifted. */
            const double skew_m = extent * extent / RANGE_M / 3.0;
            wave_between(fabs(f[d].bias_m), 0.0, most_m[d] + skew_m + ERRORS * f[d].sigma_m / sqrt(pulses() / 4.0));
        }
        for (int d = 1; d < WAVE_DETECTORS; d++)
            wave_near(f[d].amplitude / peak_of(&w, &r), 1.0, 0.01);
        struct beam beam;
        float width_m;
        const float steep = (float)(1.0 / pow(cos(incidence_deg[k] * M_PI / 180.0), 2.0));
        beam_init(&beam, 0.0, BEAM_RAD, spec->width_s);
        beam_plane_widths(&beam, &steep, &RANGE_M, 1, &width_m);
        printf("# %4.0f: %8.2f | %8.2f | %8.2f; %6.2f | %6.2f | %6.2f; %.4f\n", incidence_deg[k], 1e3 * f[0].bias_m,
               1e3 * f[1].bias_m, 1e3 * f[2].bias_m, 1e9 * width_m / C_2, 1e9 * f[1].width_s, 1e9 * f[2].width_s,
               f[2].deviation);
        /* The closed form takes the footprint's spread as Gaussian, with sigma 0.414 w tan i and a width of 0.975 w tan
         * i (full at half maximum). The disc's marginal, exp(-2 x^2) erf(sqrt(2 - 2 x^2)), has 1.130 w tan i. */
        if (spec->shape == WAVEFORM_GAUSSIAN)
            for (int d = 1; d < WAVE_DETECTORS; d++)
                wave_between(f[d].width_s * C_2 / width_m, 0.99, 1.130 / 0.975 + 0.01);
    }
    wave_close(&w);
}

static void planes_are_ranged_by_their_centroid(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    double most_m[WAVE_DETECTORS] = {INFINITY, 2e-3, 1e-3};
    planes(&spec, "Gaussian", most_m);
    spec.shape = WAVEFORM_ASYMMETRIC;
    spec.skew = 2.0;
    spec.sample_s = 0.5e-9;
    most_m[WAVEFORM_FRACTION] = 10e-3;
    most_m[WAVEFORM_GAUSSIANS] = 2e-3;
    planes(&spec, "asymmetric", most_m);
}

/* ---- two echoes */

static void two(const struct waveform_spec *spec, const char *name, double second)
{
    static const double apart[7] = {0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 3.0};
    const double width_m = C_2 * spec->width_s, sample_m = C_2 * spec->sample_s;
    const uint32_t n = pulses() / 8;
    struct wave_echoes w;
    wave_open(&w, spec);
    printf("# %s pulse, echoes of 60 and %.0f: apart, in widths: by threshold, fraction, gaussians: part found as two, "
           "biases of both, mm\n",
           name, second);
    for (int a = 0; a < 7; a++) {
        printf("# %4.2f:", apart[a]);
        for (int d = 0; d < WAVE_DETECTORS; d++) {
            double off[2] = {0.0, 0.0};
            uint32_t found = 0;
            for (uint32_t p = 0; p < n; p++) {
                const double at_m = RANGE_M + (p + 0.5) / n * sample_m;
                const struct waveform_return r[2] = {{at_m, 60.0, 0.0, WAVEFORM_POINT},
                                                     {at_m + apart[a] * width_m, second, 0.0, WAVEFORM_POINT}};
                if (wave_shoot(&w, (enum waveform_detector)d, p, r, 2) != 2) continue;
                found++;
                for (int k = 0; k < 2; k++)
                    off[k] += w.echo[k].range_m - r[k].range_m;
            }
            if (found == 0) printf("  0.00      -       -");
            if (found > 0) printf("  %4.2f %7.1f %7.1f", (double)found / n, 1e3 * off[0] / found, 1e3 * off[1] / found);
            if (d != WAVEFORM_GAUSSIANS) continue;
            if (apart[a] >= 1.0) assert_int_equal(found, n);
            if (apart[a] >= 1.0) wave_between(fabs(off[0] / n) + fabs(off[1] / n), 0.0, 0.010);
        }
        printf("\n");
    }
    wave_close(&w);
}

static void echoes_that_overlap_are_separated(void **state)
{
    (void)state;
    struct waveform_spec spec = wave_spec();
    two(&spec, "Gaussian", 60.0);
    two(&spec, "Gaussian", 15.0);
    spec.shape = WAVEFORM_ASYMMETRIC;
    spec.skew = 2.0;
    spec.sample_s = 0.5e-9;
    two(&spec, "asymmetric", 60.0);
}

/* Three echoes of 5 to 60 thresholds are 0.8 to 1.6 widths apart: the middle one seldom has a maximum of its own.
 * Few triples are found as two, fewer as four. */
static void three_echoes_are_three(void **state)
{
    (void)state;
    const struct waveform_spec spec = wave_spec();
    const uint32_t n = pulses();
    struct wave_echoes w;
    uint64_t seed = 1;
    uint32_t count[WAVE_MOST + 1] = {0};
    wave_open(&w, &spec);
    for (uint32_t p = 0; p < n; p++) {
        struct waveform_return r[3];
        double at_m = 30.0 + case_unit(&seed);
        for (int k = 0; k < 3; k++) {
            r[k] = (struct waveform_return){at_m, 5.0 + 55.0 * case_unit(&seed), 0.0, WAVEFORM_POINT};
            at_m += (0.8 + 0.8 * case_unit(&seed)) * C_2 * spec.width_s;
        }
        count[wave_shoot(&w, WAVEFORM_GAUSSIANS, p, r, 3)]++;
    }
    printf("# three echoes, 0.8 to 1.6 widths apart: of %u pulses %u with two, %u with three, %u with four\n", n,
           count[2], count[3], count[4]);
    wave_between(count[3], 0.96 * n, n);
    wave_between(count[4], 0.0, 0.01 * n);
    wave_close(&w);
}

/* ---- the other decomposition */

static uint32_t others_echoes(const struct wave_echoes *w, struct other_echo *echo)
{
    const struct waveform_spec *spec = waveform_spec_of(w->waveform);
    const struct waveform_window *window = &w->record.window[0];
    double y[WAVEFORM_MAX_SAMPLES];
    for (uint32_t i = 0; i < window->n; i++)
        y[i] =
            (w->sample[window->at + i] - spec->baseline_counts) * spec->full_scale / (4095.0 - spec->baseline_counts);
    return other_decompose(y, window->n, 1.0, 4, 12, echo, WAVE_MOST);
}

/* The other decomposition's ranges are samples with the largest count. If the top lies between two samples, noise may
 * make the farther one larger. In a peak of 30 thresholds, 8 sigma of noise do so up to 0.6 samples from the top.
 * Centres and widths of its fits differ from ours by the noise of the offset that it fits too. */
static void another_decomposition_agrees(void **state)
{
    (void)state;
    const struct waveform_spec spec = wave_spec();
    const double sample_m = C_2 * spec.sample_s, width_m = C_2 * spec.width_s;
    double worst[4] = {0.0};
    struct wave_echoes w;
    uint64_t seed = 3;
    wave_open(&w, &spec);
    for (uint32_t p = 0; p < pulses(); p++) {
        struct other_echo other[WAVE_MOST];
        const uint32_t n = p % 2 + 1;
        const double at_m = 20.0 + 50.0 * case_unit(&seed);
        const struct waveform_return r[2] = {
            {at_m, 30.0 + 50.0 * case_unit(&seed), 0.0, WAVEFORM_POINT},
            {at_m + (3.0 + 2.0 * case_unit(&seed)) * width_m, 30.0 + 30.0 * case_unit(&seed), 0.0, WAVEFORM_POINT}};
        assert_int_equal(wave_shoot(&w, WAVEFORM_GAUSSIANS, p, r, n), n);
        assert_int_equal(others_echoes(&w, other), n);
        for (uint32_t k = 0; k < n; k++) {
            const double first = w.record.window[0].first;
            worst[0] = fmax(worst[0], fabs(w.echo[k].range_m / sample_m - first - other[k].sample));
            if (n > 1) continue; /* one Gaussian through two echoes */
            worst[1] = fmax(worst[1], fabs(w.echo[k].range_m - (first + other[k].centre) * sample_m));
            worst[2] = fmax(worst[2], fabs(w.echo[k].amplitude - other[k].peak - other[k].offset));
            worst[3] =
                fmax(worst[3], fabs(w.echo[k].width_s / (other[k].width_e * 2.0 * sqrt(M_LN2) * spec.sample_s) - 1.0));
        }
    }
    printf("# another decomposition: ranges by %.2f samples, centres by %.2f mm, peaks by %.3f, widths by %.2f %%\n",
           worst[0], 1e3 * worst[1], worst[2], 1e2 * worst[3]);
    wave_between(worst[0], 0.4, 0.6);
    wave_between(worst[1], 0.0, 2e-3);
    wave_between(worst[2], 0.0, 0.5);
    wave_between(worst[3], 0.0, 0.02);
    wave_close(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ranges_are_as_good_as_noise_allows),
        cmocka_unit_test(the_jitter_is_that_of_the_closed_form),
        cmocka_unit_test(targets_are_seen_as_often_as_they_should),
        cmocka_unit_test(planes_are_ranged_by_their_centroid),
        cmocka_unit_test(echoes_that_overlap_are_separated),
        cmocka_unit_test(three_echoes_are_three),
        cmocka_unit_test(another_decomposition_agrees),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
