/* SPDX-License-Identifier: MIT */
/* Signals of waveforms are compared with closed forms and sums of their own: energy, the pulse's shape, the spread
 * of returns. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "tests/unit/waveform_rig.h"

#define METRES_1_S (0.5 * 299792458.0)

static const double measured[] = {0.0, 0.02, 0.1,  0.35, 0.8, 1.3,  1.5,  1.35,
                                  1.0, 0.62, 0.35, 0.2,  0.1, 0.05, 0.02, 0.0};

/* The shapes that the tests go through. The last have receivers that are slower than the pulse. */
static struct waveform_spec shape_of(int k)
{
    struct waveform_spec spec = waveform_rig_spec();
    static const struct {
        enum waveform_shape shape;
        double width_s, skew, bandwidth_hz;
    } shapes[] = {{WAVEFORM_GAUSSIAN, 4e-9, 1.0, 0.0},       {WAVEFORM_GAUSSIAN, 1.6e-9, 1.0, 0.0},
                  {WAVEFORM_GAUSSIAN, 0.5e-9, 1.0, 150e6},   {WAVEFORM_ASYMMETRIC, 4e-9, 1.5, 0.0},
                  {WAVEFORM_ASYMMETRIC, 5e-9, 2.0, 200e6},   {WAVEFORM_ASYMMETRIC, 4e-9, 1.0, 0.0},
                  {WAVEFORM_ASYMMETRIC, 15e-9, 3.0, 0.0},    {WAVEFORM_TABLE, 0.0, 1.0, 0.0},
                  {WAVEFORM_TABLE, 0.0, 1.0, 180e6},         {WAVEFORM_GAUSSIAN, 0.02e-9, 1.0, 150e6},
                  {WAVEFORM_ASYMMETRIC, 0.1e-9, 2.0, 200e6}, {WAVEFORM_GAUSSIAN, 4e-9, 1.0, 50e9}};
    spec.shape = shapes[k].shape;
    spec.width_s = shapes[k].width_s;
    spec.skew = shapes[k].skew;
    spec.bandwidth_hz = shapes[k].bandwidth_hz;
    spec.table = measured;
    spec.n_table = sizeof measured / sizeof *measured;
    spec.table_step_s = 1.6e-9;
    return spec;
}
enum { SHAPES = 12 };

/* Returns the area below the table's straight lines, with its peak at 1; it begins and ends with 0. */
static double area_s(const struct waveform_spec *spec)
{
    double sum = 0.0;
    if (spec->shape != WAVEFORM_TABLE) return waveform_rig_area_s(spec);
    for (uint32_t i = 0; i < spec->n_table; i++)
        sum += spec->table[i];
    return sum / 1.5 * spec->table_step_s;
}

static double samples_area_s(const struct waveform *w, const struct waveform_record *record)
{
    const struct waveform_spec *spec = waveform_spec_of(w);
    double sum = 0.0;
    for (uint32_t i = 0; i < record->n_samples; i++)
        sum += record->sample[i] - spec->baseline_counts;
    return sum * spec->full_scale / ((1U << spec->bits) - 1.0 - spec->baseline_counts) * spec->sample_s;
}

static double peak_of(const struct waveform *w, const struct waveform_return *r)
{
    double peak = 0.0;
    for (int i = -100; i <= 100; i++)
        peak = fmax(peak, waveform_signal(w, r, 1, r->range_m + 0.05 * i));
    return peak;
}

/* Sums of samples are the link budget to 0.1 %, for each shape, spread and place between the samples. Rounding adds
 * at most half a count each, against a peak near 14,000. */
static void samples_have_the_energy(void **state)
{
    (void)state;
    static uint16_t sample[4096];
    static const double extents_m[] = {0.0, 0.02, 0.1, 0.3, 1.0, 4.0};
    double worst = 0.0;
    for (int k = 0; k < SHAPES; k++) {
        struct waveform_spec spec = shape_of(k);
        spec.bits = 14;
        spec.keep = 0.01;
        spec.before_s = spec.after_s = 60e-9;
        struct waveform *w = waveform_rig_open(&spec);
        if (!(fabs(waveform_pulse_area_s(w) / area_s(&spec) - 1.0) < 1e-4))
            fail_msg("shape %d: area %g", k, waveform_pulse_area_s(w) / area_s(&spec) - 1.0);
        for (int phase = 0; phase < 12; phase++)
            for (int e = 0; e < 6; e++)
                for (int spread = 0; spread < 3; spread++) {
                    struct waveform_return r = {(200.0 + phase / 12.0) * SAMPLE_M, 1.0, extents_m[e],
                                                (enum waveform_spread)spread};
                    const double amplitude = 900.0 / peak_of(w, &r);
                    r.amplitude = amplitude;
                    struct waveform_record record = {.sample = sample, .capacity = 4096};
                    waveform_sample(w, 0, 5, &r, 1, &record);
                    double want_s = amplitude * area_s(&spec), off = samples_area_s(w, &record) / want_s - 1.0;
                    worst = fmax(worst, fabs(off));
                    if (!(fabs(off) < 1e-3))
                        fail_msg("shape %d, phase %d, extent %g, spread %d: %.3g", k, phase, extents_m[e], spread, off);
                }
        waveform_free(w);
    }
    print_message("# energy in the samples: within %.4f %% of the link budget\n", 1e2 * worst);
}

/* h has a closed form: a Gaussian with the receiver's sigma added, or the log-normal with its centroid at 0. Cubics
 * through 16 points a sigma have an error of (9/16) / 24 * 3 / 16^4 = 1.1e-6 on a Gaussian. A log-normal's peak
 * bends more. The log-normal's tail is cut at 1e-6 of the peak, 48 widths behind it with a skew of 3, which moves the
 * centroid by 4e-4 widths. */
static void shapes_are_the_closed_forms(void **state)
{
    (void)state;
    for (int k = 0; k < SHAPES; k++) {
        struct waveform_spec spec = shape_of(k);
        if (spec.shape == WAVEFORM_TABLE || (spec.skew > 1.0 && spec.bandwidth_hz > 0.0)) continue;
        struct waveform *w = waveform_rig_open(&spec);
        const struct waveform_return r = {500.0, 2.0, 0.0, WAVEFORM_POINT};
        const double sigma = spec.width_s / sqrt(8.0 * M_LN2), receiver = waveform_rig_receiver_s(&spec);
        const double both = sqrt(sigma * sigma + receiver * receiver);
        const double most = spec.skew > 2.0 ? 5e-4 : spec.skew > 1.0 ? 2e-5 : 1.2e-6;
        double worst = 0.0;
        for (int i = -900; i <= 900; i++) {
            double t_s = i * 0.0173e-9, want = 2.0 * waveform_rig_pulse(&spec, t_s);
            if (spec.skew == 1.0) want = 2.0 * sigma / both * exp(-0.5 * (t_s / both) * (t_s / both));
            worst = fmax(worst, 0.5 * fabs(waveform_signal(w, &r, 1, 500.0 + t_s * METRES_1_S) - want));
        }
        print_message("# shape %d: within %.2g of its peak\n", k, worst);
        assert_true(worst < most);
        waveform_free(w);
    }
}

/* The receiver keeps the centroid where it is, whatever the shape. */
static void the_centroid_is_the_range(void **state)
{
    (void)state;
    for (int k = 0; k < SHAPES; k++) {
        struct waveform_spec spec = shape_of(k);
        struct waveform *w = waveform_rig_open(&spec);
        for (int spread = 0; spread < 3; spread++) {
            const struct waveform_return r = {80.0, 1.0, 0.4, (enum waveform_spread)spread};
            double sum = 0.0, moment = 0.0;
            for (int i = -3000; i < 14000; i++) {
                double r_m = 80.0 + i * 0.008642, p = waveform_signal(w, &r, 1, r_m);
                sum += p;
                moment += p * (r_m - 80.0);
            }
            assert_true(fabs(moment / sum) < 2e-5);
        }
        waveform_free(w);
    }
}

/* The marginal of the irradiance in the disc, as 4,000 strips, each of which is a sum along the strip. */
enum { STRIPS = 4000 };
static double strip[STRIPS];
static void cut_the_disc(void)
{
    double all = 0.0;
    for (int i = 0; i < STRIPS; i++) {
        double x = (2.0 * i + 1.0) / STRIPS - 1.0, half = sqrt(1.0 - x * x);
        strip[i] = 0.0;
        for (int j = 0; j < 500; j++) {
            double y = half * (j + 0.5) / 500.0;
            strip[i] += exp(-2.0 * (x * x + y * y)) * half / 500.0;
        }
        all += strip[i];
    }
    for (int i = 0; i < STRIPS; i++)
        strip[i] /= all;
}

static double spread_of(const struct waveform_spec *spec, enum waveform_spread spread, double extent_s, double t_s)
{
    double sum = 0.0, all = 0.0;
    for (int i = 0; i < STRIPS; i++) {
        double x = (2.0 * i + 1.0) / STRIPS - 1.0, weight = strip[i];
        if (spread == WAVEFORM_BELL) {
            x *= 7.0;
            weight = exp(-0.5 * x * x);
        }
        sum += weight * waveform_rig_pulse(spec, t_s - x * extent_s);
        all += weight;
    }
    return sum / all;
}

/* Returns the largest error of one spread, at `points` places over all of it. Far away, ranges are even across the
 * disc. */
static double spread_error(const struct waveform *w, enum waveform_spread spread, double extent_s, int points)
{
    const struct waveform_spec *spec = waveform_spec_of(w);
    const double far_m = 1e7, end_s = 3.0 * spec->width_s + 5.0 * extent_s;
    const struct waveform_return r = {far_m, 1.0, extent_s * METRES_1_S, spread};
    double worst = 0.0;
    for (int i = -points; i <= points; i++) {
        const double t_s = end_s * i / points, ours = waveform_signal(w, &r, 1, far_m + t_s * METRES_1_S);
        worst = fmax(worst, fabs(ours - spread_of(spec, spread, extent_s, t_s)));
    }
    return worst;
}

/* Spreads of all extents against sums over 4,000 strips. Gauss's 3 and 5 nodes leave out the next moment. At the ends
 * of their reach that is (15 - 9) * 15 / 6! * 0.2^6 = 8e-6 of a bell by 3, and 5! * 945 / 10! * 0.42^10 = 5e-6 by 5.
 * Errors of discs are smaller. Other errors are those of the table of the pulse, and of its tail, whose cut moves the
 * centroid by 3e-6 widths with a skew of 1.5, and by 4e-5 with 2. */
static void spreads_are_the_closed_forms(void **state)
{
    (void)state;
    static const double skews[] = {1.0, 1.5, 2.0}, extents[] = {0.003, 0.05, 0.19, 0.21, 0.41, 0.49, 0.51, 0.9,
                                                                1.45,  1.55, 2.5,  4.0,  7.0,  15.0, 40.0, 100.0};
    cut_the_disc();
    for (int k = 0; k < 3; k++) {
        struct waveform_spec spec = waveform_rig_spec();
        spec.shape = k == 0 ? WAVEFORM_GAUSSIAN : WAVEFORM_ASYMMETRIC;
        spec.skew = skews[k];
        if (k == 2) spec.width_s = 6e-9;
        struct waveform *w = waveform_rig_open(&spec);
        double worst[3] = {0.0};
        for (int spread = WAVEFORM_DISC; spread <= WAVEFORM_BELL; spread++)
            for (size_t e = 0; e < sizeof extents / sizeof *extents; e += k == 0 ? 1 : 2) {
                const double extent_s = extents[e] * 4e-9 / sqrt(8.0 * M_LN2) * 2.0 / (1.0 + spec.skew);
                worst[spread] =
                    fmax(worst[spread], spread_error(w, (enum waveform_spread)spread, extent_s, k == 0 ? 60 : 15));
            }
        print_message("# skew %g: discs within %.2g of the amplitude, bells within %.2g\n", spec.skew,
                      worst[WAVEFORM_DISC], worst[WAVEFORM_BELL]);
        assert_true(fmax(worst[WAVEFORM_DISC], worst[WAVEFORM_BELL]) < (k == 0 ? 1e-5 : k == 1 ? 2e-5 : 1e-4));
        waveform_free(w);
    }
}

/* With a vanishing extent a spread is a point. */
static void no_extent_is_a_point(void **state)
{
    (void)state;
    struct waveform_spec spec = waveform_rig_spec();
    struct waveform *w = waveform_rig_open(&spec);
    for (int spread = 0; spread < 3; spread++)
        for (int i = -20; i <= 20; i++) {
            const struct waveform_return point = {30.0, 5.0, 0.0, WAVEFORM_POINT},
                                         none = {30.0, 5.0, 0.0, (enum waveform_spread)spread},
                                         little = {30.0, 5.0, 1e-6, (enum waveform_spread)spread};
            double r_m = 30.0 + 0.05 * i, want = waveform_signal(w, &point, 1, r_m);
            assert_true(waveform_signal(w, &none, 1, r_m) == want);
            assert_true(fabs(waveform_signal(w, &little, 1, r_m) - want) < 1e-9);
        }
    waveform_free(w);
}

/* A measured pulse counts by its shape, in any scale, wherever its largest value stands. The signal's largest value is
 * the return's amplitude. */
static void a_table_has_any_scale(void **state)
{
    (void)state;
    static const double shapes[3][4] = {{1.0, 0.75, 0.5, 0.25}, {0.25, 0.5, 0.75, 1.0}, {0.5, 1.0, 0.5, 0.25}};
    for (int k = 0; k < 3; k++) {
        struct waveform *w[2];
        double scaled[4], most = 0.0;
        const struct waveform_return r = {10.0, 5.0, 0.0, WAVEFORM_POINT};
        for (int i = 0; i < 4; i++)
            scaled[i] = 512.0 * shapes[k][i];
        for (int big = 0; big < 2; big++) {
            struct waveform_spec spec = waveform_rig_spec();
            spec.shape = WAVEFORM_TABLE;
            spec.table = big ? scaled : shapes[k];
            spec.n_table = 4;
            spec.table_step_s = 4e-9;
            spec.sample_s = 0.25e-9;
            spec.bandwidth_hz = 1e9;
            w[big] = waveform_rig_open(&spec);
        }
        assert_true(waveform_pulse_area_s(w[0]) == waveform_pulse_area_s(w[1]));
        for (double r_m = 7.0; r_m < 13.0; r_m += 0.01) {
            const double signal = waveform_signal(w[0], &r, 1, r_m);
            assert_true(waveform_signal(w[1], &r, 1, r_m) == signal);
            most = fmax(most, signal);
        }
        assert_true(most <= 5.0 && most > 0.85 * 5.0); /* the receiver lowers a peak of one point */
        waveform_free(w[0]);
        waveform_free(w[1]);
    }
}

/* Each change makes the plain spec wrong; the text has the figure, and what is allowed. */
/* clang-format off */
static void change(struct waveform_spec *s, int k)
{
    static const double negative[] = {0.0, 1.0, -0.5}, zeros[] = {0.0, 0.0};
    switch (k) {
    case 0: s->width_s = 2e-6; break;
    case 1: s->shape = WAVEFORM_ASYMMETRIC, s->skew = 0.9; break;
    case 2: s->shape = WAVEFORM_ASYMMETRIC, s->skew = 3.1; break;
    case 3: s->bandwidth_hz = 100.0; break;
    case 4: s->sample_s = 1e-6; break;
    case 5: s->bits = 15; break;
    case 6: s->bits = 7; break;
    case 7: s->baseline_counts = 3000.0; break;
    case 8: s->full_scale = 0.0; break;
    case 9: s->saturation = -1.0; break;
    case 10: s->dead_s = 1e-8; break;
    case 11: s->noise = -1.0; break;
    case 12: s->keep = 0.0; break;
    case 13: s->before_s = 9e-6; break;
    case 14: s->near_m = 10.0, s->far_m = 700.0; break;
    case 15: s->near_m = 10.0, s->far_m = 10.1; break;
    case 16: s->near_m = -1.0; break;
    case 17: s->shape = WAVEFORM_TABLE, s->table_step_s = 1e-9; break;
    case 18: s->shape = WAVEFORM_TABLE, s->table = negative, s->n_table = 3, s->table_step_s = 1e-9; break;
    case 19: s->shape = WAVEFORM_TABLE, s->table = zeros, s->n_table = 2, s->table_step_s = 1e-9; break;
    case 20: s->shape = WAVEFORM_TABLE, s->table = measured, s->n_table = 16, s->table_step_s = 0.0; break;
    case 21: s->width_s = 1e-9; break;
    case 22: s->width_s = 900e-9, s->sample_s = 0.1e-9; break;
    case 23: s->noise = (double)NAN; break;
    case 24: s->shape = WAVEFORM_TABLE, s->table = measured, s->n_table = 2000, s->table_step_s = 1e-9; break;
    case 25: s->after_s = 1e-4; break;
    case 26: s->before_s = 9e-6, s->sample_s = 0.333e-9; break;
    default: break;
    }
}

/* clang-format on */

static void limits_are_told(void **state)
{
    (void)state;
    static const char *const texts[] = {
        "a pulse's width of 2000 ns: 0.01 to 1000 is allowed",
        "a pulse's fall/rise ratio of 0.9 times: 1 to 3 is allowed",
        "a pulse's fall/rise ratio of 3.1 times: 1 to 3 is allowed",
        "a receiver's bandwidth of 0.0001 MHz: 1 to 100000 is allowed, or 0 for none",
        "the time between samples of 1000 ns: 0.05 to 100 is allowed",
        "a digitiser of 15 bits: 8 to 14 are allowed",
        "a digitiser of 7 bits: 8 to 14 are allowed",
        "a baseline of 3000 counts: 0 to 2047.5 is allowed with 12 bits",
        "the largest count's signal of 0 times the threshold: 0.001 to 1e+09 is allowed",
        "the signal that saturates of -1 times the threshold: 0.001 to 1e+09 is allowed, or 0 for none",
        "a dead time of 10 ns begins with saturation, and no signal saturates here",
        "noise of -1 times the threshold: 0 to 1e+06 is allowed",
        "windows around a signal of 0 times the threshold: 1e-06 to 1e+09 is allowed",
        "9000 ns kept before an echo and 8 ns after it: together at most 2048 ns, 2048 samples",
        "a window from 10 to 700 m: 0.1499 to 613.825 m of length are allowed, 1 to 4095 samples",
        "a window from 10 to 10.1 m: 0.1499 to 613.825 m of length are allowed, 1 to 4095 samples",
        "the near end of the window of -1 m: 0 to 1e+07 is allowed",
        "a pulse's table of 0 values: 2 to 1024 are allowed",
        "value 3 of a pulse's table is -0.5: 0 to 1e30 is allowed",
        "a pulse's table of zeros: some value must be above 0",
        "the step of a pulse's table of 0 ns: 0.001 to 100 is allowed",
        "changes by 5.7 % with the range; 0.1 % is allowed, so at most 0.684 ns, or a longer pulse, or a receiver of less",
        "samples of 0.1 ns long; at most 4096 are allowed",
        "noise of nan times the threshold: 0 to 1e+06 is allowed",
        "a pulse's table of 2000 values: 2 to 1024 are allowed",
        "time kept after an echo of 100000 ns: 0 to 10000 is allowed",
        "9000 ns kept before an echo and 8 ns after it: together at most 681.984 ns, 2048 samples"};
    for (size_t k = 0; k < sizeof texts / sizeof *texts; k++) {
        struct waveform_spec spec = waveform_rig_spec();
        struct waveform *w = NULL;
        struct sh_err err = {.code = 0};
        change(&spec, (int)k);
        assert_int_equal(waveform_create(&spec, &w, &err), SH_EINPUT);
        assert_null(w);
        if (strstr(err.text, texts[k]) == NULL) fail_msg("case %zu: %s", k, err.text);
    }
}

/* The limit that the text names is taken: 0.684 of the width is where 2 exp(-2 (pi sigma / T)^2) is 0.1 %. */
static void the_coarsest_sampling_is_taken(void **state)
{
    (void)state;
    struct waveform_spec spec = waveform_rig_spec();
    struct waveform *w;
    struct sh_err err;
    spec.width_s = 1e-9;
    spec.sample_s = 0.68e-9;
    waveform_free(waveform_rig_open(&spec));
    spec.sample_s = 0.69e-9;
    assert_int_equal(waveform_create(&spec, &w, &err), SH_EINPUT);
    spec.bandwidth_hz = 300e6; /* a slower receiver makes it enough */
    waveform_free(waveform_rig_open(&spec));
}

/* Reads the figures behind `name` in the text with which spec is refused: one, or two with "to" between them. */
static void told(const struct waveform_spec *spec, const char *name, double figure[2])
{
    struct waveform *w = NULL;
    struct sh_err err = {.code = 0};
    assert_int_equal(waveform_create(spec, &w, &err), SH_EINPUT);
    const char *at = strstr(err.text, name);
    if (at == NULL || sscanf(at + strlen(name), "%lg to %lg", &figure[0], &figure[1]) < 1) fail_msg("%s", err.text);
}

/* Whatever limit a text names is taken, though it is rounded there. */
static void named_limits_are_taken(void **state)
{
    (void)state;
    for (int i = 0; i < 40; i++) {
        struct waveform_spec spec = waveform_rig_spec();
        double figure[2];
        spec.width_s = 1e-9 * (1.0 + 0.61 * i);
        spec.bandwidth_hz = i % 2 ? 150e6 : 0.0;
        spec.sample_s = 4.0 * spec.width_s;
        told(&spec, "so at most ", figure);
        spec.sample_s = 1e-9 * figure[0];
        waveform_free(waveform_rig_open(&spec));
        spec = waveform_rig_spec();
        spec.sample_s = 1e-9 * (0.4 + 0.013 * i);
        spec.far_m = 0.001;
        told(&spec, "0.001 m: ", figure);
        for (int k = 0; k < 2; k++) {
            spec.far_m = figure[k];
            waveform_free(waveform_rig_open(&spec));
        }
    }
    /* Times in ns add up to 2048 samples of 0.7 ns. In s their sum is larger by a rounding error. */
    struct waveform_spec spec = waveform_rig_spec();
    spec.sample_s = 0.7 / 1e9;
    spec.before_s = 0.28 / 1e9;
    spec.after_s = 1433.32 / 1e9;
    waveform_free(waveform_rig_open(&spec));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(samples_have_the_energy),   cmocka_unit_test(shapes_are_the_closed_forms),
        cmocka_unit_test(the_centroid_is_the_range), cmocka_unit_test(spreads_are_the_closed_forms),
        cmocka_unit_test(no_extent_is_a_point),      cmocka_unit_test(a_table_has_any_scale),
        cmocka_unit_test(limits_are_told),           cmocka_unit_test(the_coarsest_sampling_is_taken),
        cmocka_unit_test(named_limits_are_taken)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
