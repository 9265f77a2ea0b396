/* SPDX-License-Identifier: MIT */
/* The figures that detectors have of a pulse (core/waveform/detect_inside.h) agree with closed forms of the pulse, and
 * with numbers that are integrated here. */
#include <math.h>

#include "core/light.h"
#include "tests/unit/finder_rig.h"

enum { SHAPES = 2 };

/* A Gaussian of 4 ns, and a pulse that falls twice as long as it rises. Samples are 1 and 0.5 ns apart. */
static struct waveform *open_shape(int shape, struct waveform_spec *spec)
{
    *spec = waveform_rig_spec();
    spec->noise = 0.3;
    spec->saturation = 0.0;
    if (shape == 1) {
        spec->shape = WAVEFORM_ASYMMETRIC;
        spec->skew = 2.0;
        spec->sample_s = 0.5e-9;
    }
    return waveform_rig_open(spec);
}

/* h, x samples after its centroid. */
static double pulse_at(const struct waveform_spec *spec, double x)
{
    return waveform_rig_pulse(spec, x * spec->sample_s);
}

/* Where h has a part of its peak, in samples after its centroid: `side` -1 while it rises, 1 while it falls. Of the
 * log-normal see waveform_rig_pulse. */
static double crossing(const struct waveform_spec *spec, double part, int side)
{
    const double root = side * sqrt(log2(1.0 / part));
    if (spec->skew == 1.0) return 0.5 * root * spec->width_s / spec->sample_s;
    const double a = (spec->skew - 1.0 / spec->skew) / spec->width_s, k2 = pow(log(spec->skew), 2) / (2.0 * M_LN2);
    return (pow(spec->skew, root) - exp(1.5 * k2)) / a / spec->sample_s;
}

/* The energy of the unit disc per unit of x, as in core/footprint.h. */
static double marginal(double x)
{
    const double y2 = 1.0 - x * x, scale = 2.0 / (M_PI * (1.0 - exp(-2.0)));
    return y2 > 0.0 ? scale * exp(-2.0 * x * x) * sqrt(0.5 * M_PI) * erf(sqrt(2.0 * y2)) : 0.0;
}

/* The echo of a plane: h spread over -extent .. extent samples. Midpoints in a, x = sin a, are even in the marginal's
 * root at its ends. */
static double echo_at(const struct waveform_spec *spec, double extent, double x)
{
    enum { STEPS = 400 };
    double sum = 0.0;
    if (extent == 0.0) return pulse_at(spec, x);
    for (int i = 0; i < STEPS; i++) {
        const double a = ((i + 0.5) / STEPS - 0.5) * M_PI;
        sum += marginal(sin(a)) * cos(a) * M_PI / STEPS * pulse_at(spec, x - extent * sin(a));
    }
    return sum;
}

/* The pulse is sampled in steps by the product, and what lies between them is interpolated: a share of 1e-4 covers it
 * in all that follows, where nothing else is said. */
static const double NEAR = 1e-4;

static void near(double got, double want, double most)
{
    if (!(fabs(got - want) <= most)) fail_msg("%.9g instead of %.9g, to %.2g", got, want, most);
}

static void figures_of_the_pulse(void **state)
{
    (void)state;
    for (int shape = 0; shape < SHAPES; shape++) {
        struct waveform_spec spec;
        struct waveform *w = open_shape(shape, &spec);
        const struct finder *f = finder_rig_of(w);
        const double rise = crossing(&spec, 0.5, -1), fall = crossing(&spec, 0.5, 1), width = fall - rise;
        const double top = 4095.0, step = 0.01;
        double area = 0.0, square = 0.0, cube = 0.0;
        for (double x = -4.0 * width; x < 8.0 * width; x += step) { /* as far as the table goes */
            area += pulse_at(&spec, x) * step;
            square += pulse_at(&spec, x) * step * x * x;
            cube += pulse_at(&spec, x) * step * x * x * x;
        }
        assert_int_equal(f->seen, 1);
        assert_int_equal(f->gaussian, shape == 0);
        near(f->peak, 1.0, NEAR);
        near(f->width, width, NEAR * width);
        near(f->middle, 0.5 * (rise + fall) / width, NEAR);
        near(f->area, area, NEAR * area);
        near(f->variance, square / area, 1e-3 * square / area);
        near(f->third, cube / area, 3e-3 * pow(square / area, 1.5));
        near(f->metre, 0.5 * LIGHT_SPEED_M_S * spec.sample_s, 1e-12);
        near(f->signal, 1000.0 / (top - 100.0), 1e-12);
        near(f->noise, sqrt(0.09 + f->signal * f->signal / 12.0), 1e-12); /* digits spread evenly over a count */
        near(f->limit, 1000.0 - 0.5 * f->signal, 1e-9);
        assert_int_equal(f->blind, 0);
        for (uint32_t i = 0; i < FINDER_SHAPE; i += 7) {
            const double x = (i / 64.0 - 4.0) * width, h = pulse_at(&spec, x);
            near(f->shape[i], h, NEAR);
            if (h > 1e-3) near(f->log_shape[i], log(h), 2e-3);
        }
        const double most = (f->top / 64.0 - 4.0) * width;
        near(pulse_at(&spec, most), 1.0, 1e-3);
        waveform_free(w);
    }
}

/* Samples count as limited from 5 sigma of noise below the saturation on. The receiver is blind for its dead time. */
static void a_limited_receiver(void **state)
{
    (void)state;
    struct waveform_spec spec = waveform_rig_spec();
    spec.noise = 0.5;
    spec.saturation = 60.0;
    spec.dead_s = 7e-9;
    struct waveform *w = waveform_rig_open(&spec);
    near(finder_rig_of(w)->limit, 60.0 - 5.0 * finder_rig_of(w)->noise, 1e-9);
    assert_int_equal(finder_rig_of(w)->blind, 7);
    waveform_free(w);
}

/* A term of sigma 1 is h. The term's middle lies between its half maxima, which are 2.355 sigmas apart. The logarithm
 * of h is interpolated by straight lines over steps d of 1/64 width. Where h rises, its second derivative is up to
 * 30 / width^2, and the error d^2 / 8 times that: 1e-3. */
static void values_of_a_term(void **state)
{
    (void)state;
    for (int shape = 0; shape < SHAPES; shape++) {
        struct waveform_spec spec;
        struct waveform *w = open_shape(shape, &spec);
        const double rise = crossing(&spec, 0.5, -1), fall = crossing(&spec, 0.5, 1);
        const double sigma = (fall - rise) / 2.3548200450309493, middle = 0.5 * (rise + fall);
        for (double d = -3.0; d < 5.0; d += 0.37) {
            const double want = pulse_at(&spec, middle + d * sigma), value = finder_value(finder_rig_of(w), d);
            const double slope =
                (pulse_at(&spec, middle + (d + 0.01) * sigma) - pulse_at(&spec, middle + (d - 0.01) * sigma)) / 0.02;
            near(value, want, 1e-3);
            near(finder_fall(finder_rig_of(w), d, value), -slope, 3e-3);
        }
        for (double part = 0.02; part < 1.0; part += 0.07)
            near(finder_lead(finder_rig_of(w), part), -crossing(&spec, part, -1), 5e-3 * (fall - rise));
        waveform_free(w);
    }
}

/* Each tilt has the width and the rise of its echo. Its misfit is the RMS difference of term and echo within 2.5
 * sigmas, and its tail the largest one beyond. Grids differ, so these two agree to a tenth, or to 3e-4 of the peak. */
static void echoes_of_planes(void **state)
{
    (void)state;
    static const double tilts[FINDER_SPREADS] = {0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 9.0, 14.0};
    for (int shape = 0; shape < SHAPES; shape++) {
        struct waveform_spec spec;
        struct waveform *w = open_shape(shape, &spec);
        const double width = crossing(&spec, 0.5, 1) - crossing(&spec, 0.5, -1);
        for (int k = 0; k < FINDER_SPREADS; k += 2) {
            const struct finder_spread *s = &finder_rig_of(w)->spread[k];
            const double extent = tilts[k] * width, step = 0.02 * s->width;
            double top = 0.0, square = 0.0, n = 0.0, tail = 0.0;
            for (double x = -2.0 * s->width; x < 2.0 * s->width; x += step)
                top = fmax(top, echo_at(&spec, extent, x));
            near(echo_at(&spec, extent, -s->half_lead), 0.5 * top, 3e-3 * top);
            near(echo_at(&spec, extent, s->width - s->half_lead), 0.5 * top, 3e-3 * top);
            for (double x = -(extent + 3.0 * width); x < extent + 5.0 * width; x += step) {
                const double d = (x - s->lag) / s->sigma;
                const double rest = echo_at(&spec, extent, x) / top - finder_value(finder_rig_of(w), d) / s->gain;
                if (fabs(d) > FINDER_NEAR) tail = fmax(tail, rest);
                if (fabs(d) > FINDER_NEAR) continue;
                square += rest * rest;
                n += 1.0;
            }
            const double rms = sqrt(square / n);
            if (k == 0) near(s->gain, 1.0, 1e-3);
            if (k == 0) near(s->sigma, width / 2.3548200450309493, 1e-3);
            near(s->misfit, rms, 0.1 * rms + 3e-4);
            near(s->tail, tail, 0.1 * tail + 3e-4);
        }
        waveform_free(w);
    }
}

static void expect_spread(const struct finder_spread *got, const struct finder_spread *a, const struct finder_spread *b,
                          double u)
{
    near(got->sigma, a->sigma + u * (b->sigma - a->sigma), 1e-9);
    near(got->lag, a->lag + u * (b->lag - a->lag), 1e-9);
    near(got->gain, a->gain + u * (b->gain - a->gain), 1e-9);
    near(got->width, a->width + u * (b->width - a->width), 1e-9);
    near(got->half_lead, a->half_lead + u * (b->half_lead - a->half_lead), 1e-9);
    assert_true(got->misfit == fmax(a->misfit, b->misfit) && got->tail == fmax(a->tail, b->tail));
}

/* Between tilts figures are interpolated; the larger misfit and tail hold. Beyond the ends widths keep their ratios. */
static void echoes_between_tilts(void **state)
{
    (void)state;
    struct waveform_spec spec;
    struct waveform *w = open_shape(1, &spec);
    const struct finder_spread *s = finder_rig_of(w)->spread;
    for (int key = 0; key < 2; key++) {
        struct finder_spread got;
        for (int k = 0; k + 1 < FINDER_SPREADS; k++)
            for (double u = 0.25; u < 1.0; u += 0.25) {
                const double from = key == FINDER_SIGMA ? s[k].sigma : s[k].width,
                             to = key == FINDER_SIGMA ? s[k + 1].sigma : s[k + 1].width;
                finder_find(finder_rig_of(w), (enum finder_key)key, from + u * (to - from), &got);
                expect_spread(&got, &s[k], &s[k + 1], u);
            }
        for (int end = 0; end < 2; end++) {
            const struct finder_spread *last = &s[end ? FINDER_SPREADS - 1 : 0];
            const double ratio = end ? 1.5 : 0.8;
            finder_find(finder_rig_of(w), (enum finder_key)key,
                        ratio * (key == FINDER_SIGMA ? last->sigma : last->width), &got);
            near(got.sigma, ratio * last->sigma, 1e-9);
            near(got.width, ratio * last->width, 1e-9);
            near(got.half_lead, ratio * last->half_lead, 1e-9);
            assert_true(got.lag == last->lag && got.gain == last->gain && got.misfit == last->misfit);
        }
    }
    waveform_free(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(figures_of_the_pulse), cmocka_unit_test(a_limited_receiver),
        cmocka_unit_test(values_of_a_term),     cmocka_unit_test(echoes_of_planes),
        cmocka_unit_test(echoes_between_tilts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
