/* SPDX-License-Identifier: MIT */
/* Waveforms of planes, steps, wedges, spheres and foliage against 100,000 sub-rays, which are summed here with a pulse
 * of the test's own. Figures are the RMS of all samples of a window, in counts of 12 bits, full scale at the peak. */
#include <math.h>
#include <string.h>

#include "tests/common/cases.h"
#include "tests/common/waveform_reference.h"

static const double COUNTS = 4095.0;

static struct waveform *open_waveform(void)
{
    const struct waveform_spec spec = waveref_spec();
    struct waveform *w;
    struct sh_err err;
    if (waveform_create(&spec, &w, &err) != SH_OK) fail_msg("%s", err.text);
    return w;
}

/* ---- planes */

struct plane {
    struct beam beam;
    double range_m, incidence;
};

/* The sub-ray at (x, y) of the unit disc, as core/footprint.h has it: a line of the hyperboloid meets the plane. */
static double plane_range(const struct plane *plane, double x, double y)
{
    const double d = plane->beam.exit_radius_m, s = plane->beam.slope, tangent = tan(plane->incidence);
    return (plane->range_m - d * tangent * x) / (1.0 - s * tangent * y) * sqrt(1.0 + s * s * (x * x + y * y));
}

/* The closed form neglects that the far side of the footprint is hit from further away, and more steeply. Both effects
 * change the power of a sub-ray by its range: (R / r)^2 for the distance, and as much as R / r for the cosine. */
static double plane_weight(const struct plane *plane, double range_m, int weighed)
{
    return weighed ? pow(plane->range_m / range_m, 3) : 1.0;
}

static void by_rays(const struct plane *plane, int weighed, struct waveref_window *out)
{
    double all = 0.0;
    for (uint32_t i = 0; i < WAVEREF_RAYS; i++) {
        double x, y;
        waveref_place(i, WAVEREF_RAYS, &x, &y);
        double r = plane_range(plane, x, y), weight = plane_weight(plane, r, weighed);
        waveref_add(out, r, weight);
        all += weight;
    }
    for (uint32_t i = 0; i < out->n; i++)
        out->p[i] /= all;
}

/* Simpson's rule over t = rho^2, with the density exp(-2 t), and equal steps over the angle. */
static void by_quadrature(const struct plane *plane, struct waveref_window *out)
{
    enum { STEPS = 200, AROUND = 180 };
    double all = 0.0;
    for (int i = 0; i <= STEPS; i++)
        for (int k = 0; k < AROUND; k++) {
            double t = (double)i / STEPS, phi = 2.0 * M_PI * (k + 0.5) / AROUND;
            double weight = (i == 0 || i == STEPS ? 1.0 : i % 2 == 1 ? 4.0 : 2.0) * exp(-2.0 * t);
            waveref_add(out, plane_range(plane, sqrt(t) * cos(phi), sqrt(t) * sin(phi)), weight);
            all += weight;
        }
    for (uint32_t i = 0; i < out->n; i++)
        out->p[i] /= all;
}

/* One return for the whole footprint, at the mean of its ranges. */
static struct waveform_return closed_form(const struct plane *plane)
{
    const float steep = (float)(1.0 / pow(cos(plane->incidence), 2));
    double mean_m = plane->range_m;
    beam_plane_means(&plane->beam, &steep, 1, &mean_m);
    return (struct waveform_return){mean_m, 1.0, beam_radius(&plane->beam, plane->range_m) * tan(plane->incidence),
                                    WAVEFORM_DISC};
}

/* The error of the closed form is below one count for sub-rays of equal power. The closed form neglects only ranges of
 * second order in b = s tan i. Power by distance and cosine changes by at most 3 b at the rim, so the samples change
 * by less than 3 b of themselves. */
static void planes_are_the_closed_form(void **state)
{
    (void)state;
    static const double ranges_m[] = {10.0, 100.0, 800.0};
    struct waveform *w = open_waveform();
    for (int k = 0; k < 3; k++) {
        double worst = 0.0, worst_quadrature = 0.0, worst_weighed = 0.0;
        for (int i = 0; i <= 9; i++) {
            static struct waveref_window ours, rays, weighed, sums;
            struct plane plane = {.range_m = ranges_m[k], .incidence = (i < 9 ? 10.0 * i : 85.0) * M_PI / 180.0};
            beam_init(&plane.beam, 0.007, 0.35e-3, WAVEREF_PULSE_S);
            const struct waveform_return r = closed_form(&plane);
            waveref_open(&rays, r.range_m - 1.1 * r.extent_m, r.range_m + 1.1 * r.extent_m);
            weighed = sums = rays;
            waveref_fill(w, &r, 1, &rays, &ours);
            by_rays(&plane, 0, &rays);
            by_quadrature(&plane, &sums);
            by_rays(&plane, 1, &weighed);
            const double b = r.extent_m / r.range_m;
            double off = waveref_counts(&ours, &rays), off_sums = waveref_counts(&ours, &sums),
                   off_weighed = waveref_counts(&ours, &weighed);
            worst = fmax(worst, off);
            worst_quadrature = fmax(worst_quadrature, off_sums);
            worst_weighed = fmax(worst_weighed, off_weighed);
            assert_true(off < 1.0);
            assert_true(off_sums < 1.0);
            assert_true(off_weighed < 1.0 + 3.0 * b * COUNTS);
        }
        print_message(
            "# planes at %.0f m, 0 to 85 degrees: RMS %.4f counts of 100,000 sub-rays, %.4f of a quadrature; with "
            "power by distance and cosine %.2f\n",
            ranges_m[k], worst, worst_quadrature, worst_weighed);
    }
    waveform_free(w);
}

/* ---- what fills a footprint in other ways */

/* One of n sub-rays stands for 1/n of the energy. To either side, an edge may take half a row of them, and a row has
 * about the root of n. So 0.5 / sqrt(n) of the light lies elsewhere, or a bit nearer or further. Leaves have many
 * edges: twice that. */
static void rings_come_nearer(void **state)
{
    (void)state;
    static const uint32_t rings[] = {1, 2, 4, 6, 18};
    static struct waveref_window reference, ours;
    static struct waveform_return r[BEAM_SUBRAY_ROOM];
    struct waveform *w = open_waveform();
    for (int k = 0; k < WAVEREF_SHAPES; k++) {
        double rms[5];
        waveref_by_rays(&waveref_shape[k], &reference);
        for (int i = 0; i < 5; i++) {
            uint32_t n = waveref_rings(&waveref_shape[k], rings[i], r);
            waveref_fill(w, r, n, &reference, &ours);
            rms[i] = waveref_counts(&ours, &reference);
            assert_true(rms[i] < COUNTS * (k == WAVEREF_FOLIAGE ? 1.0 : 0.5) / sqrt(n));
        }
        assert_true(rms[4] < 0.5 * rms[0]);
        print_message("# %-12s RMS counts by 7, 19, 61, 127, 1027 sub-rays: %.2f %.2f %.2f %.2f %.2f\n",
                      waveref_shape[k].name, rms[0], rms[1], rms[2], rms[3], rms[4]);
    }
    waveform_free(w);
}

/* Returns the mean of (x - mean)^3 of the energy on one side of the edge at h. */
static double skewness(double h)
{
    double n = 0.0, sum = 0.0, square = 0.0, cube = 0.0;
    for (uint32_t i = 0; i < WAVEREF_RAYS; i++) {
        double x, y;
        waveref_place(i, WAVEREF_RAYS, &x, &y);
        if (x < h) continue;
        n += 1.0;
        sum += x;
        square += x * x;
        cube += x * x * x;
    }
    const double mean = sum / n;
    return cube / n - 3.0 * mean * square / n + 2.0 * mean * mean * mean;
}

/* Both sides of a line as two returns. On a step that is hit head on the two returns are exact: the reference has an
 * error of half a row of its sub-rays, 0.5 / sqrt(100,000). On a wedge a bell stands for half of a disc with the same
 * energy, centre and spread. The bell's third moment is 0. The error is that of the half disc times a sixth of the
 * pulse's third derivative, which is at most 1.38 / sigma^3. */
static void parts_are_nearly_exact(void **state)
{
    (void)state;
    static struct waveref_window reference, ours;
    struct waveform *w = open_waveform();
    const double per_sigma = 0.15 / (WAVEREF_METRES_1_S * WAVEREF_SIGMA_S), row = 0.5 / sqrt(WAVEREF_RAYS);
    const double third = 1.38 / 6.0 * fmax(fabs(skewness(-0.23)), fabs(skewness(0.23)));
    for (int k = WAVEREF_STEP; k <= WAVEREF_WEDGE; k++) {
        struct waveform_return r[2];
        const double bound = COUNTS * (k == WAVEREF_STEP ? row : third * pow(per_sigma, 3) + row * per_sigma);
        waveref_by_rays(&waveref_shape[k], &reference);
        waveref_fill(w, r, waveref_parts(k, r), &reference, &ours);
        double rms = waveref_counts(&ours, &reference);
        print_message("# %-12s RMS counts by parts: %.3f (bound %.3f)\n", waveref_shape[k].name, rms, bound);
        assert_true(rms < bound);
    }
    waveform_free(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(planes_are_the_closed_form),
                                       cmocka_unit_test(rings_come_nearer), cmocka_unit_test(parts_are_nearly_exact)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
