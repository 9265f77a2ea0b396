/* SPDX-License-Identifier: MIT */
#include "tests/common/waveform_reference.h"

#include <math.h>
#include <string.h>

#include "tests/common/cases.h"

void waveref_open(struct waveref_window *window, double from_m, double to_m)
{
    const double edge_s = 6.0 * WAVEREF_SIGMA_S;
    memset(window, 0, sizeof *window);
    window->first = floor((from_m / WAVEREF_METRES_1_S - edge_s) / WAVEREF_SAMPLE_S);
    window->n = (uint32_t)((to_m / WAVEREF_METRES_1_S + edge_s) / WAVEREF_SAMPLE_S - window->first) + 1;
    if (window->n > WAVEREF_SAMPLES) window->n = WAVEREF_SAMPLES;
}

/* exp(-(t + T)^2 / 2) follows from exp(-t^2 / 2) by two products. Seven sigmas on either side. */
void waveref_add(struct waveref_window *window, double range_m, double weight)
{
    const double step = WAVEREF_SAMPLE_S / WAVEREF_SIGMA_S, reach = 7.0 / step;
    double at = range_m / WAVEREF_METRES_1_S / WAVEREF_SAMPLE_S - window->first;
    uint32_t from = at > reach ? (uint32_t)ceil(at - reach) : 0;
    uint32_t to = at + reach + 1.0 < window->n ? (uint32_t)(at + reach + 1.0) : window->n;
    double t = (from - at) * step, p = weight * exp(-0.5 * t * t), q = exp(-t * step - 0.5 * step * step);
    const double each = exp(-step * step);
    for (uint32_t i = from; i < to; i++) {
        window->p[i] += p;
        p *= q;
        q *= each;
    }
}

void waveref_place(uint32_t i, uint32_t n, double *x, double *y)
{
    double rho = sqrt(-0.5 * log(1.0 - (i + 0.5) / n * (1.0 - exp(-2.0)))), phi = i * M_PI * (3.0 - sqrt(5.0));
    *x = rho * cos(phi);
    *y = rho * sin(phi);
}

double waveref_counts(const struct waveref_window *a, const struct waveref_window *b)
{
    double sum = 0.0, peak = 0.0;
    for (uint32_t i = 0; i < a->n; i++) {
        sum += (a->p[i] - b->p[i]) * (a->p[i] - b->p[i]);
        peak = fmax(peak, b->p[i]);
    }
    return 4095.0 * sqrt(sum / a->n) / peak;
}

struct waveform_spec waveref_spec(void)
{
    return (struct waveform_spec){.shape = WAVEFORM_GAUSSIAN,
                                  .width_s = WAVEREF_PULSE_S,
                                  .sample_s = WAVEREF_SAMPLE_S,
                                  .bits = 12,
                                  .full_scale = 1.0,
                                  .keep = 1e-3,
                                  .seed = 1};
}

void waveref_fill(const struct waveform *w, const struct waveform_return *r, uint32_t n,
                  const struct waveref_window *like, struct waveref_window *out)
{
    out->first = like->first;
    out->n = like->n;
    for (uint32_t i = 0; i < out->n; i++)
        out->p[i] = waveform_signal(w, r, n, (out->first + i) * WAVEREF_SAMPLE_S * WAVEREF_METRES_1_S);
}

/* ---- shapes */

/* b = s tan i: a plane's range is FAR / (1 - b x) where the beam is far wider than its exit. */
static const double B_60 = 0.175e-3 * 1.7320508075688772, B_85 = 0.175e-3 * 11.430052302761343;

static double plane_60_range(double x, double y)
{
    (void)y;
    return WAVEREF_FAR_M / (1.0 - B_60 * x);
}

static double plane_85_range(double x, double y)
{
    (void)y;
    return WAVEREF_FAR_M / (1.0 - B_85 * x);
}

/* An edge or a fold crosses the disc at this place. */
static const double EDGE_X = 0.23, STEP_M = 0.5, LEFT_M = 0.15, RIGHT_M = 0.06;

static double step_range(double x, double y)
{
    (void)y;
    return x < EDGE_X ? WAVEREF_FAR_M : WAVEREF_FAR_M + STEP_M;
}

/* Two planes that meet at a fold. */
static double wedge_range(double x, double y)
{
    (void)y;
    return WAVEREF_FAR_M + (x < EDGE_X ? -LEFT_M : RIGHT_M) * (x - EDGE_X);
}

/* The sphere is a little larger than the footprint. */
static double sphere_range(double x, double y)
{
    return WAVEREF_FAR_M + 0.4 - 0.4 * sqrt(fmax(0.0, 1.0 - (x * x + y * y) / 1.21));
}

/* The leaves are 60 discs at random, of which the nearest counts; a wall is behind. */
static double foliage_range(double x, double y)
{
    uint64_t random = 5;
    double range_m = WAVEREF_FAR_M + 3.0;
    for (int i = 0; i < 60; i++) {
        double cx = 2.4 * case_unit(&random) - 1.2, cy = 2.4 * case_unit(&random) - 1.2;
        double at_m = WAVEREF_FAR_M + 2.5 * case_unit(&random), tilt = 0.2 * (case_unit(&random) - 0.5);
        if ((x - cx) * (x - cx) + (y - cy) * (y - cy) < 0.03) range_m = fmin(range_m, at_m + tilt * (x - cx));
    }
    return range_m;
}

const struct waveref_shape waveref_shape[WAVEREF_SHAPES] = {
    {"plane 60 deg", plane_60_range}, {"plane 85 deg", plane_85_range}, {"step", step_range},
    {"wedge", wedge_range},           {"sphere", sphere_range},         {"foliage", foliage_range}};

void waveref_by_rays(const struct waveref_shape *shape, struct waveref_window *out)
{
    waveref_open(out, WAVEREF_FAR_M - 0.5, WAVEREF_FAR_M + 3.5);
    for (uint32_t i = 0; i < WAVEREF_RAYS; i++) {
        double x, y;
        waveref_place(i, WAVEREF_RAYS, &x, &y);
        waveref_add(out, shape->range_m(x, y), 1.0 / WAVEREF_RAYS);
    }
}

uint32_t waveref_rings(const struct waveref_shape *shape, uint32_t rings, struct waveform_return *r)
{
    static struct beam_pattern pattern;
    beam_rings(rings, &pattern);
    for (uint32_t i = 0; i < pattern.n; i++) {
        double range_m = shape->range_m((double)pattern.x[i], (double)pattern.y[i]);
        r[i] = (struct waveform_return){range_m, 1.0 / pattern.n, 0.0, WAVEFORM_POINT};
    }
    return pattern.n;
}

/* Returns the part of the disc beyond the line x = h. Its plane has slope_m, and the range at_m on that line. */
static struct waveform_return part_of(const struct beam *beam, double h, double slope_m, double at_m)
{
    double energy, moment, along, across;
    beam_half(beam, h, &energy, &moment);
    beam_half_squares(beam, h, &along, &across);
    const double centre = moment / energy;
    return (struct waveform_return){at_m + slope_m * (centre - h), energy,
                                    slope_m * sqrt(along / energy - centre * centre), WAVEFORM_BELL};
}

/* The plane's mean range is FAR (1 + b^2 E x^2), E x^2 = 0.1715. */
static struct waveform_return plane_of(double b)
{
    return (struct waveform_return){WAVEREF_FAR_M * (1.0 + 0.1715 * b * b), 1.0, WAVEREF_FAR_M * b, WAVEFORM_DISC};
}

uint32_t waveref_parts(int shape, struct waveform_return r[2])
{
    struct beam beam;
    const int step = shape == WAVEREF_STEP;
    if (shape == WAVEREF_PLANE_60 || shape == WAVEREF_PLANE_85) {
        r[0] = plane_of(shape == WAVEREF_PLANE_60 ? B_60 : B_85);
        return 1;
    }
    if (!step && shape != WAVEREF_WEDGE) return 0;
    beam_init(&beam, 0.007, 0.35e-3, WAVEREF_PULSE_S);
    r[0] = part_of(&beam, EDGE_X, step ? 0.0 : RIGHT_M, WAVEREF_FAR_M + (step ? STEP_M : 0.0));
    r[1] = part_of(&beam, -EDGE_X, step ? 0.0 : LEFT_M, WAVEREF_FAR_M); /* the other side, turned round */
    return 2;
}
