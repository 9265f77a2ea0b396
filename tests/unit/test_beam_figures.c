/* SPDX-License-Identifier: MIT */
/* Figures of a beam against the definitions of core/footprint.h, integrated here by numbers. */
#include <math.h>

#include "core/footprint.h"
#include "core/vec3.h"
#include "tests/common/cases.h"

static const double E2 = 0.1353352832366127; /* exp(-2) */

/* The density of the energy in the unit disc. */
static double density(double r2)
{
    return 2.0 / (M_PI * (1.0 - E2)) * exp(-2.0 * r2);
}

struct beyond {
    double energy, moment, along, across;
};

static double simpson(int i, int steps)
{
    return i == 0 || i == steps ? 1.0 / 3.0 : i % 2 == 1 ? 4.0 / 3.0 : 2.0 / 3.0;
}

/* Sums the part of the disc beyond x = h by Simpson's rule. With x = sin a and y = y1 sin b the integrand is smooth
 * up to the disc's edge. The error is about the step's fourth power over 180: 2e-7. */
static struct beyond beyond(double h)
{
    enum { STEPS = 200, ACROSS = 40 };
    struct beyond sum = {0.0, 0.0, 0.0, 0.0};
    const double from = asin(h), step = (0.5 * M_PI - from) / STEPS, turn = M_PI / ACROSS;
    for (int i = 0; i <= STEPS; i++) {
        const double x = sin(from + i * step), y1 = cos(from + i * step);
        for (int k = 0; k <= ACROSS; k++) {
            const double b = -0.5 * M_PI + k * turn, y = y1 * sin(b), area = step * y1 * turn * y1 * cos(b);
            const double energy = density(x * x + y * y) * area * simpson(i, STEPS) * simpson(k, ACROSS);
            sum.energy += energy;
            sum.moment += energy * x;
            sum.along += energy * x * x;
            sum.across += energy * y * y;
        }
    }
    return sum;
}

/* The mean of f over t = rho^2, which is distributed as exp(-2 t) on 0 .. 1. */
static double mean_over_t(double (*f)(double t, double x), double x)
{
    enum { STEPS = 1000 };
    double sum = 0.0, all = 0.0;
    for (int i = 0; i < STEPS; i++) {
        const double t = (i + 0.5) / STEPS;
        sum += exp(-2.0 * t) * f(t, x);
        all += exp(-2.0 * t);
    }
    return sum / all;
}

static double itself(double t, double x)
{
    (void)x;
    return t;
}

/* Tables have 1024 rows over 2 radii. Between rows of distance d they are straight: d^2 / 8 times the largest second
 * derivative, of about 2, is 1e-6. */
static void parts_beyond_a_line(void **state)
{
    (void)state;
    static const double h[] = {-1.0, -0.95, -0.6, -0.3001, 0.0, 0.1234, 0.5, 0.77, 0.95, 1.0};
    struct beam beam;
    beam_init(&beam, 0.007, 0.00035, 4e-9);
    for (size_t i = 0; i < sizeof h / sizeof h[0]; i++) {
        const struct beyond want = beyond(h[i]);
        struct beyond got;
        beam_half(&beam, h[i], &got.energy, &got.moment);
        beam_half_squares(&beam, h[i], &got.along, &got.across);
        if (!(fabs(got.energy - want.energy) < 2e-6 && fabs(got.moment - want.moment) < 2e-6 &&
              fabs(got.along - want.along) < 2e-6 && fabs(got.across - want.across) < 2e-6))
            fail_msg("beyond %g: %.8f %.8f %.8f %.8f, not %.8f %.8f %.8f %.8f", h[i], got.energy, got.moment, got.along,
                     got.across, want.energy, want.moment, want.along, want.across);
    }
}

static void widths_by_definition(void **state)
{
    (void)state;
    struct beam beam;
    assert_true(beam_widening(BEAM_AT_1_E2) == 1.0 && beam_widening(BEAM_HALF_AT_1_E2) == 2.0);
    assert_true(fabs(beam_widening(BEAM_AT_1_E) - 1.41421356) < 1e-8);
    assert_true(fabs(beam_widening(BEAM_AT_HALF_MAXIMUM) - 1.69864360) < 1e-8);
    beam_init(&beam, 0.008, 0.0006, 4e-9);
    assert_true(fabs(beam_radius(&beam, 10.0) - 0.005) < 1e-15); /* 4 and 3 mm */
    assert_true(fabs(beam.resolution_m - 0.599584916) < 1e-12);
    assert_true(beam_echo_width(0.6, 0.0) == 0.6);
    assert_true(fabs(beam_echo_width(0.6, 0.09) - sqrt(0.36 + 2.354820045 * 2.354820045 * 0.09)) < 1e-9);
    /* at 60 degrees the tangent is the root of 3 */
    assert_true(fabs((double)beam_round_sigma(&beam, 10.0, 0.5, 0.04) - 0.005 * 0.2 * sqrt(3.0)) < 1e-9);
    assert_true(beam_round_sigma(&beam, 10.0, 1.0, 0.04) == 0.0F);
}

static double stretched(double t, double x)
{
    return 1.0 / sqrt(1.0 - t * x) - 1.0;
}

/* The mean range, without the terms that are smaller by s^2, is R times the mean of 1 / sqrt(1 - t x), x = s^2 / cos^2.
 * The series has three terms; the fourth is 35/128 x^4 times the mean of t^4, which is below 0.1. The terms after it
 * fall at least fourfold. */
static void means_on_a_plane(void **state)
{
    (void)state;
    static const double x[] = {1e-6, 1e-3, 0.05, 0.1, 0.2, 0.25};
    struct beam beam;
    beam_init(&beam, 0.007, 2e-3, 4e-9); /* s^2 is 1e-6 */
    for (size_t i = 0; i < sizeof x / sizeof x[0]; i++) {
        const float steep = (float)(x[i] * 1e6);
        double range_m = 100.0;
        beam_plane_means(&beam, &steep, 1, &range_m);
        const double want_m = 100.0 * (1.0 + mean_over_t(stretched, x[i]));
        const double bound_m = 100.0 * (35.0 / 128.0 * pow(x[i], 4.0) * 0.1 * 4.0 / 3.0 + 1e-7 * x[i]);
        if (!(fabs(range_m - want_m) < bound_m)) fail_msg("%g: %.9f, not %.9f", x[i], range_m, want_m);
    }
    const float most[2] = {250000.0F, 400000.0F}; /* x stays at 1/4 */
    double range_m[2] = {100.0, 100.0}, ray_m = 100.0;
    beam_plane_means(&beam, most, 2, range_m);
    assert_true(range_m[0] == range_m[1]);
    beam_init(&beam, 0.007, 0.0, 4e-9);
    beam_plane_means(&beam, &most[0], 1, &ray_m);
    assert_true(ray_m == 100.0);
}

/* The variance of rho cos phi is half the mean of rho^2. Floats have 24 bits, and a few operations round. */
static void widths_on_a_plane(void **state)
{
    (void)state;
    const double half_t = 0.5 * mean_over_t(itself, 0.0);
    static const float steep[4] = {1.0F, 4.0F, 100.0F, 0.9999999F};
    static const double range_m[4] = {50.0, 50.0, 500.0, 50.0};
    struct beam beam;
    float width_m[4];
    beam_init(&beam, 0.01, 0.0004, 2e-9);
    beam_plane_widths(&beam, steep, range_m, 4, width_m);
    for (int i = 0; i < 4; i++) {
        const double w_m = beam_radius(&beam, range_m[i]), tan2 = i == 3 ? 0.0 : (double)steep[i] - 1.0;
        const double want_m = beam_echo_width(beam.resolution_m, half_t * w_m * w_m * tan2);
        assert_true(fabs((double)width_m[i] - want_m) < 1e-6 * want_m);
    }
}

/* Returns the range at which the sub-ray at (x, y) meets a plane. */
static double range_of(const struct beam *beam, const struct beam_sight *s, const double n[3], double d, double x,
                       double y)
{
    double along = 0.0, from = 0.0, length2 = 0.0;
    for (int k = 0; k < 3; k++) {
        const double dir = s->dir[k] + beam->slope * (x * s->e2[k] - y * s->e1[k]);
        from += n[k] * beam->exit_radius_m * (x * s->e1[k] + y * s->e2[k]);
        along += n[k] * dir;
        length2 += dir * dir;
    }
    return (d - from) / along * sqrt(length2);
}

/* Across the part the ranges change linearly, except for a share of 1e-4 (the slope) times the tangent, up to 3.1. */
static void ranges_within_a_part(void **state)
{
    (void)state;
    static const struct beam_part part = {.energy = 0.5, .xx = 0.07, .xy = -0.03, .yy = 0.02};
    static const double normals[3][3] = {{0.3, 0.9, -0.2}, {-0.6, 0.5, 0.7}, {0.1, -0.2, 0.8}};
    struct beam beam;
    struct beam_sight sight = {.dir = {0.6, 0.48, 0.64}};
    beam_init(&beam, 0.02, 2e-4, 4e-9);
    beam_axes(sight.dir, sight.e1, sight.e2);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 2; k++) {
            const double *n = normals[i], range_m = k ? 300.0 : 30.0, d = range_m * vec3_dot(n, sight.dir), step = 0.01;
            const double by_x =
                (range_of(&beam, &sight, n, d, step, 0) - range_of(&beam, &sight, n, d, -step, 0)) / 0.02;
            const double by_y =
                (range_of(&beam, &sight, n, d, 0, step) - range_of(&beam, &sight, n, d, 0, -step)) / 0.02;
            const double want_m = sqrt(by_x * by_x * part.xx + 2.0 * by_x * by_y * part.xy + by_y * by_y * part.yy);
            assert_true(fabs((double)beam_part_sigma(&beam, &sight, n, range_m, &part) - want_m) < 1e-3 * want_m);
        }
}

/* The axes and the direction are right-angled, of length one, and go round one way. */
static void axes_across_a_direction(void **state)
{
    (void)state;
    uint64_t seed = 7;
    for (int i = 0; i < 1000; i++) {
        double d[3] = {case_unit(&seed) - 0.5, case_unit(&seed) - 0.5, case_unit(&seed) - 0.5}, e1[3], e2[3], n[3];
        if (i < 6)
            for (int k = 0; k < 3; k++)
                d[k] = k == i / 2 ? (i % 2 ? -1.0 : 1.0) : 0.0;
        const double length = vec3_length(d);
        for (int k = 0; k < 3; k++)
            d[k] /= length;
        beam_axes(d, e1, e2);
        vec3_cross(e1, e2, n);
        assert_true(fabs(vec3_length(e1) - 1.0) < 1e-14 && fabs(vec3_length(e2) - 1.0) < 1e-14);
        assert_true(vec3_distance(n, d) < 1e-14);
    }
}

/* Ring k has 6 k places at equal angles, those of odd rings turned by half a step. The ring lies where half of the
 * energy of its annulus is inside. `rest` adds the spread that the places lack. Places are floats. */
static void rings_of_sub_rays(void **state)
{
    (void)state;
    static struct beam_pattern p;
    const double half_t = 0.5 * mean_over_t(itself, 0.0);
    for (uint32_t rings = 0; rings <= BEAM_MAX_RINGS; rings++) {
        double xx = 0.0, yy = 0.0;
        uint32_t at = 1;
        beam_rings(rings, &p);
        assert_int_equal(p.n, 1 + 3 * rings * (rings + 1));
        assert_true(p.x[0] == 0.0F && p.y[0] == 0.0F);
        for (uint32_t k = 1; k <= rings; k++) {
            for (uint32_t i = 0; i < 6 * k; i++, at++) {
                const double x = (double)p.x[at], y = (double)p.y[at], phi = (i + 0.5 * (k % 2)) * M_PI / (3.0 * k);
                const double inside = (1.0 - exp(-2.0 * (x * x + y * y))) / (1.0 - E2);
                assert_true(fabs(inside - (at - i + 3.0 * k) / p.n) < 1e-6);
                assert_true(fabs(remainder(atan2(y, x) - phi, 2.0 * M_PI)) < 1e-6);
                xx += x * x / p.n;
                yy += y * y / p.n;
            }
        }
        for (uint32_t i = p.n; i < BEAM_SUBRAY_ROOM; i++)
            assert_true(p.x[i] == 0.0F && p.y[i] == 0.0F);
        assert_true(fabs(p.rest + xx - half_t) < 1e-6 && fabs(p.rest + yy - half_t) < 1e-6);
    }
    assert_true(beam_end_error(0) == 1.0);
    assert_true(fabs(beam_end_error(4) - 0.12) < 0.005 && fabs(beam_end_error(12) - 0.05) < 0.005);
}

/* ---- parts */

/* Sums the part of the disc on one side of each line, on a grid: bit i of `sides` says whether it is beyond line i. */
static struct beam_part on_grid(const struct beam_line *line, uint32_t n, uint32_t sides)
{
    enum { STEPS = 500 };
    struct beam_part p = {0};
    for (int i = 0; i < STEPS; i++)
        for (int k = 0; k < STEPS; k++) {
            const double x = (2.0 * i + 1.0) / STEPS - 1.0, y = (2.0 * k + 1.0) / STEPS - 1.0;
            uint32_t at = 0;
            if (x * x + y * y > 1.0) continue;
            for (uint32_t m = 0; m < n; m++)
                at |= (uint32_t)(line[m].n[0] * x + line[m].n[1] * y > line[m].h) << m;
            if (at != sides) continue;
            const double energy = density(x * x + y * y) * 4.0 / STEPS / STEPS;
            p.energy += energy;
            p.x += energy * x;
            p.y += energy * y;
            p.xx += energy * x * x;
            p.xy += energy * x * y;
            p.yy += energy * y * y;
        }
    if (p.energy < 1e-9) return p;
    p.x /= p.energy;
    p.y /= p.energy;
    p.xx = p.xx / p.energy - p.x * p.x;
    p.xy = p.xy / p.energy - p.x * p.y;
    p.yy = p.yy / p.energy - p.y * p.y;
    return p;
}

static int is_like(const struct beam_part *a, const struct beam_part *b, double most)
{
    return fabs(a->energy - b->energy) < most && fabs(a->x - b->x) < most && fabs(a->y - b->y) < most &&
           fabs(a->xx - b->xx) < most && fabs(a->xy - b->xy) < most && fabs(a->yy - b->yy) < most;
}

/* Each part is one of those that the lines make, and the parts together are the whole footprint. Lines that don't cross
 * in the disc cut it in closed form. Where they do, 469 places stand for the footprint: an edge is wrong by up to half
 * a row of places, which is 0.09 radii wide. */
static void parts_of_a_footprint(void **state)
{
    (void)state;
    static const struct {
        uint32_t n, parts;
        struct beam_line line[3];
        double most;
    } is[] = {{0, 1, {{.h = 0.0}}, 1e-3},
              {1, 2, {{{0.6, 0.8}, 0.25}}, 1e-3},
              {2, 3, {{{0.6, 0.8}, 0.1}, {{0.6, 0.8}, 0.5}}, 1e-3},    /* one cap within the other */
              {2, 3, {{{0.6, 0.8}, 0.6}, {{0.64, 0.768}, 0.2}}, 1e-3}, /* likewise, the other way round */
              {2, 3, {{{0.6, 0.8}, 0.3}, {{-0.6, -0.8}, 0.4}}, 1e-3},  /* side by side */
              {2, 3, {{{1.0, 0.0}, 0.8}, {{0.0, 1.0}, 0.8}}, 1e-3},
              {2, 4, {{{1.0, 0.0}, 0.2}, {{0.0, 1.0}, 0.3}}, 0.05},
              {3, 4, {{{1.0, 0.0}, 0.3}, {{-1.0, 0.0}, 0.2}, {{0.8, 0.6}, 0.7}}, 0.05}};
    struct beam beam;
    static struct beam_pattern fine;
    static struct beam_parts parts;
    const double half_t = 0.5 * mean_over_t(itself, 0.0);
    beam_init(&beam, 0.007, 0.00035, 4e-9);
    beam_rings(BEAM_FINE_RINGS, &fine);
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        double energy = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
        uint32_t found = 0, whole = 0;
        assert_int_equal(beam_cut(&beam, &fine, is[i].line, is[i].n, 1, &parts), 0);
        for (uint32_t sides = 0; sides < 1U << is[i].n; sides++) {
            const struct beam_part want = on_grid(is[i].line, is[i].n, sides);
            if (want.energy < 0.01) continue;
            uint32_t k = 0;
            while (k < parts.n && !is_like(&parts.part[k], &want, is[i].most))
                k++;
            if (k == parts.n) fail_msg("case %zu: no part of energy %g at %g %g", i, want.energy, want.x, want.y);
            if (sides == 0) whole = k;
            found++;
        }
        assert_true(found <= parts.n && found + 1 >= is[i].parts);
        assert_int_equal(parts.centre, whole);
        for (uint32_t k = 0; k < parts.n; k++) {
            const struct beam_part *p = &parts.part[k];
            energy += p->energy;
            x += p->energy * p->x;
            y += p->energy * p->y;
            xx += p->energy * (p->xx + p->x * p->x);
            xy += p->energy * (p->xy + p->x * p->y);
            yy += p->energy * (p->yy + p->y * p->y);
        }
        assert_true(fabs(energy - 1.0) < 1e-5 && fabs(x) < 1e-5 && fabs(y) < 1e-5);
        assert_true(fabs(xx - half_t) < 1e-5 && fabs(xy) < 1e-5 && fabs(yy - half_t) < 1e-5);
    }
}

/* Counts the sets of places that lie on the same sides of all lines. Sets *margin to the least distance of a place from
 * a line. */
static uint32_t count_parts(const struct beam_pattern *fine, const struct beam_line *line, uint32_t n, double *margin)
{
    uint8_t seen[1 << BEAM_MAX_LINES] = {0};
    uint32_t count = 0;
    *margin = INFINITY;
    for (uint32_t k = 0; k < fine->n; k++) {
        uint32_t sides = 0;
        for (uint32_t i = 0; i < n; i++) {
            const double d = line[i].n[0] * (double)fine->x[k] + line[i].n[1] * (double)fine->y[k] - line[i].h;
            *margin = fmin(*margin, fabs(d));
            sides |= (uint32_t)(d > 0.0) << i;
        }
        count += seen[sides] == 0;
        seen[sides] = 1;
    }
    return count;
}

/* Twelve lines cut the places into up to 70 parts, by the last line's distance. 64 parts are the most that fit. */
static void footprints_of_many_parts(void **state)
{
    (void)state;
    static const double angle[BEAM_MAX_LINES] = {0.120, 3.443, 0.490, 0.972, 4.533, 1.675,
                                                 1.455, 4.937, 2.062, 5.232, 2.555, 5.948};
    static const double h[BEAM_MAX_LINES] = {0.471, 0.289, 0.273, -0.214, 0.426, 0.132,
                                             0.100, 0.175, 0.366, 0.015,  0.007, 0.104};
    static struct beam_pattern fine;
    static struct beam_parts parts;
    struct beam_line line[BEAM_MAX_LINES];
    struct beam beam;
    uint32_t n_exact = 0, n_over = 0;
    double margin;
    beam_init(&beam, 0.007, 0.00035, 4e-9);
    beam_rings(BEAM_FINE_RINGS, &fine);
    for (int i = 0; i < BEAM_MAX_LINES; i++)
        line[i] = (struct beam_line){{cos(angle[i]), sin(angle[i])}, h[i]};
    for (int step = 0; step <= 200; step++) {
        line[BEAM_MAX_LINES - 1].h = 0.01 * step - 1.0;
        const uint32_t n = count_parts(&fine, line, BEAM_MAX_LINES, &margin);
        if (margin < 1e-5) continue; /* the places are floats */
        assert_int_equal(beam_cut(&beam, &fine, line, BEAM_MAX_LINES, 0, &parts), n > BEAM_MAX_PARTS);
        assert_int_equal(parts.n, n > BEAM_MAX_PARTS ? 0 : n); /* each place has 0.2 % of the energy */
        n_exact += n == BEAM_MAX_PARTS;
        n_over += n == BEAM_MAX_PARTS + 1;
    }
    assert_true(n_exact > 0 && n_over > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(parts_beyond_a_line),      cmocka_unit_test(widths_by_definition),
        cmocka_unit_test(means_on_a_plane),         cmocka_unit_test(widths_on_a_plane),
        cmocka_unit_test(ranges_within_a_part),     cmocka_unit_test(axes_across_a_direction),
        cmocka_unit_test(rings_of_sub_rays),        cmocka_unit_test(parts_of_a_footprint),
        cmocka_unit_test(footprints_of_many_parts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
