/* SPDX-License-Identifier: MIT */
/* Surfaces, signal, zones and the ball, against closed forms. */
#include "tests/common/cases.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/colour.h"
#include "core/detect.h"
#include "core/line.h"
#include "core/rng.h"
#include "core/surface.h"
#include "core/surface/texture.h"

static const double TURN = 6.283185307179586477;

static struct detect_signal_spec spec_of(double extinction_1_m, double overlap_m)
{
    return (struct detect_signal_spec){.n_reaches = 1,
                                       .reach = {{0.9, 900.0}},
                                       .threshold_snr = 8.0,
                                       .sharp = 1,
                                       .overlap_m = overlap_m,
                                       .extinction_1_m = extinction_1_m,
                                       .sigma_m = 0.003,
                                       .sigma_at_m = 100.0,
                                       .sigma_reflectance = 0.9,
                                       .seed = 1};
}

static void set_up(const struct detect_signal_spec *spec, struct detect_signal *signal)
{
    struct sh_err err;
    if (detect_signal_set_up(spec, signal, &err) != SH_OK) fail_msg("%s", err.text);
}

/* Returns the reflectance of one echo that a head with such a signal reports, in 0.01 dB; LINE_REFL_NONE: not seen. */
static int told(const struct detect_signal *signal, double range_m, double rho)
{
    uint64_t key = 7;
    double amplitude;
    int16_t refl_cdb;
    const struct detect_echoes echoes = {
        .n = 1, .key = &key, .range_m = &range_m, .rho = &rho, .amplitude = &amplitude, .refl_cdb = &refl_cdb};
    detect_by_signal(signal, &echoes);
    assert_true(isnan(range_m) == (refl_cdb == LINE_REFL_NONE));
    return refl_cdb;
}

static void what_surfaces_send_back(void **state)
{
    (void)state;
    struct surface_table table;
    struct sh_err err;
    assert_int_equal(surface_table_alloc(3, &table, &err), SH_OK);
    table.surface[0] = (struct surface){.reflectance = 0.4};
    table.surface[1] = (struct surface){.reflectance = 0.1, .specular = 0.5, .gloss = 30.0};
    table.surface[2] = (struct surface){.retro = 250.0};
    table.has_lobes = 1;
    const uint32_t label[] = {0, 0, 1, 1, 1, 2, 3, 0xffff};
    const double incidence_deg[] = {0, 60, 0, 15, 50, 70, 0, 0};
    double cosine[8], rho[8];
    for (int i = 0; i < 8; i++)
        cosine[i] = cos(incidence_deg[i] * TURN / 360.0);
    surface_return(&table, 8, label, cosine, rho);
    /* 15 deg: the way back lies 30 deg off the mirror direction; 50 deg: 100 deg off it, behind the lobe. */
    double c15 = cos(15.0 * TURN / 360.0), c30 = cos(30.0 * TURN / 360.0);
    const double expected[] = {
        0.4, 0.2, 0.1 + 0.5 * 16.0, 0.1 * c15 + 0.5 * 16.0 * pow(c30, 30.0) * c15, 0.1 * cosine[4], 250.0, 0.0, 0.0};
    for (int i = 0; i < 8; i++)
        if (!(fabs(rho[i] - expected[i]) <= 1e-12 * expected[i]))
            fail_msg("case %d: %.15g, not %.15g", i, rho[i], expected[i]);
    surface_table_free(&table);
}

/* IEC 61966-2-1: the curve is straight up to 0.04045. Both pieces meet there, to the digits that the standard gives. */
static void dark_colours_are_straight(void **state)
{
    (void)state;
    assert_true(fabs(colour_srgb_decode(0.02) - 0.02 / 12.92) < 1e-16 && colour_srgb_decode(0.0) == 0.0);
    assert_true(fabs(colour_srgb_decode(0.04045) - colour_srgb_decode(0.04046)) < 1e-6);
    assert_true(fabs(colour_srgb_decode(0.5) - 0.21404114) < 1e-8 && colour_srgb_decode(1.0) == 1.0);
}

/* The widest lobe, of gloss 0, ends 90 degrees beside the mirror direction, too. 45 degrees of incidence reach it. */
static void a_lobe_ends_beside_the_surface(void **state)
{
    (void)state;
    static const uint32_t label[] = {0, 0, 0};
    const double cosine[] = {cos(44.0 * TURN / 360.0), cos(46.0 * TURN / 360.0), cos(80.0 * TURN / 360.0)};
    double rho[3];
    struct surface_table table;
    struct sh_err err;
    assert_int_equal(surface_table_alloc(1, &table, &err), SH_OK);
    table.surface[0] = (struct surface){.specular = 0.5};
    table.has_lobes = 1;
    surface_return(&table, 3, label, cosine, rho);
    assert_true(fabs(rho[0] - 0.5 * cosine[0]) < 1e-12 && rho[1] == 0.0 && rho[2] == 0.0);
    surface_table_free(&table);
}

/* Equal surfaces have one number, wherever they stand among the others. Numbers count from 0. */
static void equal_surfaces_are_of_one_kind(void **state)
{
    (void)state;
    static const double reflectance[] = {0.5, 0.2, 0.5, 0.7, 0.2, 0.5};
    uint16_t kind[6];
    struct surface_table table;
    struct sh_err err;
    assert_int_equal(surface_table_alloc(6, &table, &err), SH_OK);
    for (int i = 0; i < 6; i++)
        table.surface[i].reflectance = reflectance[i];
    assert_int_equal(surface_kinds(&table, kind, &err), SH_OK);
    for (int i = 0; i < 6; i++) {
        assert_true(kind[i] < 3);
        for (int k = 0; k < 6; k++)
            assert_true((kind[i] == kind[k]) == (reflectance[i] == reflectance[k]));
    }
    surface_table_free(&table);
}

/* Names choose the first rule that fits. Values that it lacks come from the colour. sRGB 0.5 is 0.2140 of the light
 * (IEC 61966-2-1). */
static void names_and_colours_choose(void **state)
{
    (void)state;
    const double unsaid = (double)NAN;
    const struct surface_rule rule[] = {
        {"*", "Glas*", {unsaid, unsaid, 100.0, unsaid, 0.9, unsaid}},
        {"sign ?", "*", {0.3, unsaid, 100.0, 300.0, unsaid, unsaid}},
        {"*", "paint", {0.05, unsaid, 100.0, unsaid, unsaid, unsaid}},
        {"*", "silver", {unsaid, unsaid, 100.0, unsaid, unsaid, 0.8}},
    };
    const struct scene_surface named[] = {{"window", "Glas, klar", {0.5f, 0.5f, 0.5f}, .has_colour = 1},
                                          {"sign 1", "paint", {1, 1, 1}, .has_colour = 1},
                                          {"sign 12", "paint", {1, 1, 1}, .has_colour = 1},
                                          {"wall", "brick", {1, 0, 0}, .has_colour = 1},
                                          {"wall", "brick", {0, 0, 0}, .has_colour = 0},
                                          {"m", "silver", {1, 1, 1}, .has_colour = 1}};
    static const int chosen[] = {0, 1, 2, -1, -1, 3};
    const double grey = 0.21404114, reflectance[] = {0.1 * grey, 0.3, 0.05, 0.2126, 0.6, 0.0};
    struct surface_table table;
    struct sh_err err;
    assert_int_equal(surface_table_alloc(6, &table, &err), SH_OK);
    for (uint32_t i = 0; i < 6; i++) {
        assert_int_equal(surface_table_set(&table, i, &named[i], rule, 4, 0.6), chosen[i]);
        assert_true(fabs(table.surface[i].reflectance - reflectance[i]) < 1e-8);
    }
    assert_true(table.surface[0].glass == 0.9 && table.surface[1].retro == 300.0 && table.surface[2].retro == 0.0 &&
                table.surface[5].mirror == 0.8);
    assert_true(table.has_optics && table.has_lobes && table.has_mirror);
    surface_table_free(&table);
}

/* Reflectance is the target's, whatever the range and the lens. Fog takes 2 a R from it. */
static void reflectance_is_the_targets(void **state)
{
    (void)state;
    static const double range_m[] = {0.3, 1.0, 7.0, 50.0, 300.0};
    struct detect_signal_spec clear = spec_of(0.0, 0.0), lens = spec_of(0.0, 5.0), fog = spec_of(0.003, 0.0);
    struct detect_signal signal;
    for (int i = 0; i < 5; i++) {
        set_up(&clear, &signal);
        assert_int_equal(told(&signal, range_m[i], 1.0), 0);
        assert_int_equal(told(&signal, range_m[i], 0.2 * 0.5), -1000);
        assert_int_equal(told(&signal, range_m[i], 300.0), 2477); /* 10 log10(300) = 24.77 dB */
        set_up(&lens, &signal);
        assert_int_equal(told(&signal, range_m[i], 0.5), -301);
        set_up(&fog, &signal);
        int lost_cdb = (int)lround(100.0 * 10.0 / log(10.0) * 2.0 * 0.003 * range_m[i]);
        assert_int_equal(told(&signal, range_m[i], 1.0), -lost_cdb);
    }
}

/* The amplitude follows from the range equation, and at short range from the light that the lens catches. */
static void amplitude_follows_the_range_equation(void **state)
{
    (void)state;
    struct detect_signal_spec spec = spec_of(0.001, 4.0);
    struct detect_signal signal;
    set_up(&spec, &signal);
    for (double r = 0.01; r < 2000.0; r *= 1.7) {
        double expected = 0.3 / 0.9 * pow(900.0 / r, 2.0) * exp(-0.002 * r) * -expm1(-r * r / 16.0);
        double a = detect_amplitude(&signal, r, 0.3);
        assert_true(fabs(a / expected - 1.0) < 1e-5); /* the series for small R / R_o */
        /* a reflectance just above the one that A needs is seen, one just below is not */
        assert_int_equal(told(&signal, r, 0.3 / expected * 1.0001) == LINE_REFL_NONE, 0);
        assert_int_equal(told(&signal, r, 0.3 / expected * 0.9999) == LINE_REFL_NONE, 1);
    }
    assert_int_equal(told(&signal, 10.0, 0.0), LINE_REFL_NONE); /* absorbs */
    assert_int_equal(told(&signal, (double)NAN, 1.0), LINE_REFL_NONE);
}

/* Kim's table: in fog, up to a visibility V of 500 m, extinction is 3.912 / V at any wavelength. From 0.5 to 1 km the
 * exponent is q = V / km - 0.5, without a step at either end. Haze of 4 km has q = 0.98, clear air of 23 km q = 1.3. */
static void extinction_by_visibility(void **state)
{
    (void)state;
    assert_true(fabs(detect_extinction_1_m(500.0, 1550e-9) - 3.912 / 500.0) < 1e-15);
    assert_true(fabs(detect_extinction_1_m(200.0, 1550e-9) - 3.912 / 200.0) < 1e-15);
    assert_true(fabs(detect_extinction_1_m(750.0, 1550e-9) - 3.912 / 750.0 * pow(1550.0 / 550.0, -0.25)) < 1e-12);
    assert_true(fabs(detect_extinction_1_m(500.0 * (1 + 1e-12), 1550e-9) - 3.912 / 500.0) < 1e-12);
    assert_true(fabs(detect_extinction_1_m(1000.0, 905e-9) - detect_extinction_1_m(1000.0 * (1 + 1e-12), 905e-9)) <
                1e-12);
    assert_true(fabs(detect_extinction_1_m(8000.0, 905e-9) - 3.912 / 8000.0 * pow(905.0 / 550.0, -1.3)) < 1e-12);
    assert_true(fabs(detect_extinction_1_m(60000.0, 905e-9) - 3.912 / 60000.0 * pow(905.0 / 550.0, -1.6)) < 1e-12);
    assert_true(fabs(detect_extinction_1_m(4000.0, 1550e-9) - 3.912 / 4000.0 * pow(1550.0 / 550.0, -0.98)) < 1e-12);
    assert_true(fabs(detect_extinction_1_m(23000.0, 905e-9) - 3.912 / 23000.0 * pow(905.0 / 550.0, -1.3)) < 1e-12);
}

/* Returns the logarithm of the least reflectance that is seen. Less 2 log R, it is linear between the three reaches;
 * beyond them the nearest piece goes on. */
static double log_least_of(const struct detect_reach reach[3], double range_m)
{
    const struct detect_reach *a = range_m < reach[1].range_m ? &reach[0] : &reach[1], *b = a + 1;
    const double ga = log(a->reflectance / (a->range_m * a->range_m));
    const double gb = log(b->reflectance / (b->range_m * b->range_m));
    return ga + (gb - ga) * (range_m - a->range_m) / (b->range_m - a->range_m) + 2.0 * log(range_m);
}

/* The least reflectance passes through three reaches, in whatever order they come. Amplitudes, reflectances and what is
 * detected agree on it before, between and beyond them. */
static void signal_passes_through_reaches(void **state)
{
    (void)state;
    static const struct detect_reach reach[3] = {{0.1, 500.0}, {0.2, 650.0}, {0.8, 1000.0}};
    static const double range_m[] = {10.0, 300.0, 500.0, 600.0, 650.0, 800.0, 1000.0, 1300.0};
    struct detect_signal_spec spec = spec_of(0.0, 0.0);
    struct detect_signal signal;
    spec.n_reaches = 3;
    for (int turn = 0; turn < 3; turn++) {
        for (int i = 0; i < 3; i++)
            spec.reach[(i + turn) % 3] = reach[turn == 2 ? 2 - i : i];
        set_up(&spec, &signal);
        for (int i = 0; i < 8; i++) {
            const double least = exp(log_least_of(reach, range_m[i]));
            assert_true(fabs(detect_amplitude(&signal, range_m[i], least) - 1.0) < 1e-12);
            assert_true(fabs(detect_reflectance(&signal, range_m[i], 3.0) / least - 3.0) < 1e-12);
            assert_int_equal(told(&signal, range_m[i], least * 1.0001) == LINE_REFL_NONE, 0);
            assert_int_equal(told(&signal, range_m[i], least * 0.9999) == LINE_REFL_NONE, 1);
        }
    }
}

static void reaches_that_contradict_are_refused(void **state)
{
    (void)state;
    struct detect_signal_spec spec = spec_of(0.0, 0.0);
    struct detect_signal signal;
    struct sh_err err;
    spec.n_reaches = 2;
    spec.reach[1] = (struct detect_reach){0.2, 300.0}; /* 900 sqrt(0.2 / 0.9) = 424 m without any air */
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), SH_EINPUT);
    assert_string_equal(err.text,
                        "300 m on 0.2 and 900 m on 0.9: a signal must fall at least with the square of the range");
    spec.reach[1] = (struct detect_reach){0.2, 900.0};
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), SH_EINPUT);
    /* Deviations of up to a tenth, in the logarithm, are rounding: 900 sqrt(0.2 / 0.9) m times exp(-0.05). */
    spec.reach[1] = (struct detect_reach){0.2, 900.0 * sqrt(0.2 / 0.9) * exp(-0.0501)};
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), SH_EINPUT);
    spec.reach[1] = (struct detect_reach){0.2, 900.0 * sqrt(0.2 / 0.9) * exp(-0.0499)};
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), SH_OK);
    spec.reach[1] = (struct detect_reach){0.2, 424.0};
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), SH_OK);
    spec.sigma_floor_m = spec.sigma_m;
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), SH_OK);
    spec.sigma_floor_m = 0.004;
    assert_int_equal(detect_signal_set_up(&spec, &signal, &err), SH_EINPUT);
    assert_string_equal(err.text, "a floor of the range noise of 0.004 m is above the noise itself, 0.003 m");
}

/* 1.2 MHz: zones of 124.9135 m. */
static void zones_fold(void **state)
{
    (void)state;
    const double zone_m = 299792458.0 / 2.0 / 1.2e6;
    const double in[] = {1.0,          100.0, zone_m + 50.0, 3.0 * zone_m + 2.0, 0.4, 2.0 * zone_m + 0.4, (double)NAN,
                         4.5 * zone_m, 0.5};
    const double folded[] = {1.0, 100.0, 50.0, 2.0, (double)NAN, (double)NAN, (double)NAN, 0.5 * zone_m, 0.5};
    double range_m[9]; /* the last is the least range itself */
    for (int how = 0; how < 3; how++) {
        memcpy(range_m, in, sizeof in);
        detect_zones((enum detect_ambiguity)how, 1.0 / 1.2e6, 4, 0.5, 9, range_m);
        for (int i = 0; i < 9; i++) {
            int lost = isnan(folded[i]) || (how == DETECT_RESOLVED && i == 7); /* beyond its zones */
            double expected = how == DETECT_AMBIGUITY_NONE ? in[i]
                              : lost                       ? (double)NAN
                              : how == DETECT_FOLDED       ? folded[i]
                                                           : in[i];
            assert_true(isnan(expected) ? isnan(range_m[i]) : fabs(range_m[i] - expected) < 1e-9);
        }
    }
}

static void point_at(double range_m, double mirror_turn, double pan_turn, double p[3])
{
    double m = TURN * mirror_turn, a = TURN * pan_turn;
    p[0] = range_m * sin(a) * cos(m);
    p[1] = range_m * cos(a) * cos(m);
    p[2] = range_m * sin(m);
}

/* Points in the ball, and their distribution. For a uniform ball of radius r the mean square along each axis is r^2 /
 * 5, and (distance / r)^3 is uniform. Line angles are on both sides of the zenith. Bounds: 4.75 standard errors; the
 * variance of x^2 is r^4 (3/35 - 1/25). */
static void the_ball_is_full(void **state)
{
    (void)state;
    enum { N = 200000 };
    static const double rotation[9] = {0, 1, 0, -1, 0, 0, 0, 0, 1}; /* a quarter turn about z */
    static const double factor[3] = {1.0, 2.0, 0.5};
    static uint64_t key[N];
    static double range_m[N], mirror[N], pan[N];
    for (int local = 0; local < 2; local++) {
        struct detect_ball ball = {.radius_m = 0.01, .per_distance_1_m = 0.1, .local = local};
        double sum[3] = {0}, sum2[3] = {0}, cubes = 0.0;
        uint64_t seed = 11;
        memcpy(ball.factor, factor, sizeof factor);
        detect_ball_keys(&ball, 5);
        for (uint32_t i = 0; i < N; i++) {
            key[i] = rng_echo(i / 2, i % 2);
            range_m[i] = 10.0 + 20.0 * case_unit(&seed);
            mirror[i] = case_unit(&seed) - 0.25;
            pan[i] = case_unit(&seed);
            double before[3], after[3], moved[3], v[3], r = range_m[i], m = mirror[i], p = pan[i];
            point_at(r, m, p, before);
            detect_move_in_ball(&ball, rotation, &(struct detect_points){1, &key[i], &r, &m, &p, 0});
            point_at(r, m, p, after);
            double cm = cos(TURN * mirror[i]), sm = sin(TURN * mirror[i]), cp = cos(TURN * pan[i]),
                   sp = sin(TURN * pan[i]);
            for (int k = 0; k < 3; k++)
                v[k] = after[k] - before[k];
            if (local) {
                moved[0] = v[0] * sp * cm + v[1] * cp * cm + v[2] * sm; /* along */
                moved[1] = v[0] * cp - v[1] * sp;                       /* right */
                moved[2] = -v[0] * sp * sm - v[1] * cp * sm + v[2] * cm;
            } else {
                moved[0] = v[1]; /* prcs = rotation socs */
                moved[1] = -v[0];
                moved[2] = v[2];
            }
            double radius = 0.01 * (1.0 + 0.1 * range_m[i]), d2 = 0.0;
            for (int k = 0; k < 3; k++) {
                double u = moved[k] / (radius * factor[k]);
                sum[k] += u;
                sum2[k] += u * u;
                d2 += u * u;
            }
            assert_true(d2 < 1.0 + 1e-9);
            cubes += pow(d2, 1.5);
            assert_true(fabs(m - mirror[i]) < 0.25 || cos(TURN * mirror[i]) * cos(TURN * m) > -0.01); /* same face */
        }
        for (int k = 0; k < 3; k++) {
            assert_true(fabs(sum[k] / N) < 4.75 * sqrt(0.2 / N));
            assert_true(fabs(sum2[k] / N - 0.2) < 4.75 * sqrt((3.0 / 35.0 - 1.0 / 25.0) / N));
        }
        assert_true(fabs(cubes / N - 0.5) < 4.75 * sqrt(1.0 / 12.0 / N));
    }
}

/* Two points with the same key that start at the same place are moved alike. A missing echo stays missing. Other seeds
 * give other places. */
static void the_ball_does_not_accumulate(void **state)
{
    (void)state;
    struct detect_ball ball = {.radius_m = 0.1, .factor = {1, 1, 1}, .local = 1};
    const uint64_t key[3] = {1, 1, 2};
    double range_m[3] = {5.0, 5.0, (double)NAN}, mirror[3] = {0.1, 0.1, 0.1}, pan[3] = {0.2, 0.2, 0.2};
    detect_ball_keys(&ball, 1);
    detect_move_in_ball(&ball, NULL, &(struct detect_points){3, key, range_m, mirror, pan, 0});
    assert_true(range_m[0] == range_m[1] && mirror[0] == mirror[1] && pan[0] == pan[1] && range_m[0] != 5.0);
    assert_true(isnan(range_m[2]) && mirror[2] == 0.1 && pan[2] == 0.2);
    double other_m = 5.0, other_mirror = 0.1, other_pan = 0.2;
    detect_ball_keys(&ball, 2);
    detect_move_in_ball(&ball, NULL, &(struct detect_points){1, key, &other_m, &other_mirror, &other_pan, 0});
    assert_true(other_m != range_m[0]);
}

/* At the data sheet's range and reflectance the noise is the data sheet's, whatever part of it is a floor. With more
 * signal the floor remains, and the part per distance is added. The same number is drawn each time. */
static void range_noise_has_a_floor(void **state)
{
    (void)state;
    static const uint64_t key[3] = {5, 5, 5};
    double drawn = 0.0;
    for (int k = 0; k < 3; k++) {
        struct detect_signal_spec spec = spec_of(0.0, 0.0);
        struct detect_signal signal;
        spec.sigma_floor_m = k == 0 ? 0.0 : 0.002;
        spec.sigma_ppm = k == 2 ? 40.0 : 0.0;
        set_up(&spec, &signal);
        const double at_y = detect_amplitude(&signal, 100.0, 0.9);
        double range_m[3] = {100.0, 50.0, 100.0}, amplitude[3] = {at_y, at_y, 1e6 * at_y};
        const struct detect_echoes echoes = {.n = 3, .key = key, .range_m = range_m, .amplitude = amplitude};
        detect_range_noise(&signal, &echoes);
        if (k == 0) drawn = (range_m[0] - 100.0) / 0.003;
        const double floor_m = k == 0 ? 3e-9 : 0.002, ppm = 1e-6 * spec.sigma_ppm;
        /* doubles near 100 m step by 1.4e-14 m; the noise reaches the floor within 1e-12 of it */
        assert_true(fabs(range_m[0] - 100.0 - (0.003 + 100.0 * ppm) * drawn) < 1e-13);
        assert_true(fabs(range_m[1] - 50.0 - (0.003 + 50.0 * ppm) * drawn) < 1e-13);
        assert_true(fabs(range_m[2] - 100.0 - (floor_m + 100.0 * ppm) * drawn) < 1e-13);
    }
    assert_true(fabs(drawn) > 0.01);
}

/* Echoes of noise alone have a signal of nearly 0. Their ranges stay within 7 sigmas, since no larger number is drawn.
 * Sigma is that of the least signal: the data sheet's, times its amplitude / DETECT_LEAST_AMPLITUDE. */
static void noise_alone_has_a_range(void **state)
{
    (void)state;
    enum { N = 4 };
    static const uint64_t key[N] = {5, 6, 7, 8};
    const struct detect_signal_spec spec = spec_of(0.0, 0.0);
    struct detect_signal signal;
    double range_m[N] = {100.0, 100.0, 100.0, 100.0}, amplitude[N] = {0.0, 1e-200, 1e-9, 0.09};
    set_up(&spec, &signal);
    const double at_y = detect_amplitude(&signal, spec.sigma_at_m, spec.sigma_reflectance);
    detect_range_noise(&signal,
                       &(struct detect_echoes){.n = N, .key = key, .range_m = range_m, .amplitude = amplitude});
    for (int i = 0; i < N; i++)
        assert_true(fabs(range_m[i] - 100.0) < 7.0 * spec.sigma_m * at_y / DETECT_LEAST_AMPLITUDE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_surfaces_send_back),
        cmocka_unit_test(names_and_colours_choose),
        cmocka_unit_test(equal_surfaces_are_of_one_kind),
        cmocka_unit_test(reflectance_is_the_targets),
        cmocka_unit_test(amplitude_follows_the_range_equation),
        cmocka_unit_test(a_lobe_ends_beside_the_surface),
        cmocka_unit_test(dark_colours_are_straight),
        cmocka_unit_test(extinction_by_visibility),
        cmocka_unit_test(range_noise_has_a_floor),
        cmocka_unit_test(noise_alone_has_a_range),
        cmocka_unit_test(signal_passes_through_reaches),
        cmocka_unit_test(reaches_that_contradict_are_refused),
        cmocka_unit_test(zones_fold),
        cmocka_unit_test(the_ball_is_full),
        cmocka_unit_test(the_ball_does_not_accumulate),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
