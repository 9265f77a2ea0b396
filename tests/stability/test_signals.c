/* SPDX-License-Identifier: MIT */
/* Signals that run off the scale, and returns that run into each other: retro-reflectors, and a pane close in front of
 * a wall. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/rng.h"
#include "core/surface.h"
#include "tests/common/made.h"
#include "tests/stability/rig.h"

static const double PULSE_S = 4e-9, LIGHT_M_S = 299792458.0;

/* Upright planes across the view, from near to far. Each has the label of its place. */
static struct scene *planes(const double *away_m, uint32_t n)
{
    enum { MOST = 2 };
    double vertex[4 * MOST][3];
    uint32_t triangle[2 * MOST][3];
    uint16_t label[2 * MOST];
    static const struct scene_surface surface[MOST] = {{.object = "first"}, {.object = "second"}};
    for (uint32_t p = 0; p < n; p++) {
        for (uint32_t v = 0; v < 4; v++) {
            double half_m = 2.0 + 0.02 * away_m[p];
            vertex[4 * p + v][0] = v == 1 || v == 2 ? half_m : -half_m;
            vertex[4 * p + v][1] = away_m[p];
            vertex[4 * p + v][2] = v >= 2 ? half_m : -half_m;
        }
        for (uint32_t t = 0; t < 2; t++) {
            triangle[2 * p + t][0] = 4 * p;
            triangle[2 * p + t][1] = 4 * p + 1 + t;
            triangle[2 * p + t][2] = 4 * p + 2 + t;
            label[2 * p + t] = (uint16_t)p;
        }
    }
    return made_scene(&(struct scene_arrays){(const double(*)[3])vertex, 4 * n, (const uint32_t(*)[3])triangle, 2 * n,
                                             label, surface, n});
}

struct shot {
    struct line_block block;       /* the caller frees it */
    double along[RIG_LINE_PULSES]; /* cosine of each pulse with the line ahead */
};

/* Casts a line of pulses onto the planes, `times` over; the last line stays. `each` is called after every line, or is
 * NULL. */
static void shoot(struct scene *scene, const struct surface_table *table, const struct cast_detect *asked,
                  struct shot *out, uint32_t times, void (*each)(void *ctx, const struct shot *shot), void *ctx)
{
    struct schedule_segment segment;
    struct schedule_line line;
    struct schedule_run run;
    struct caster *caster;
    struct sh_err err;
    struct cast_detect detect = *asked;
    rig_line_ahead(&segment, &line, &run);
    struct bvh *bvh = made_bvh(scene);
    if (caster_create(&caster, &err) != SH_OK ||
        line_block_alloc(&out->block, RIG_LINE_PULSES * (1 + CAST_MAX_DEPTH), &err) != SH_OK)
        fail_msg("%s", err.text);
    for (uint32_t i = 0; i < RIG_LINE_PULSES; i++)
        out->along[i] = cos(2.0 * M_PI * schedule_mirror_turn(&segment, line.cast0 + i));
    detect.surfaces = table;
    struct cast_setup setup = {.bvh = bvh,
                               .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                               .range_max_m = 2000.0,
                               .mirror_counts = 0x1p32,
                               .pan_counts = 0x1p32,
                               .range_scale_m = 1e-6,
                               .detect = &detect};
    for (uint32_t k = 0; k < times; k++) {
        caster_cast(caster, &setup, &run, &out->block);
        if (each != NULL) each(ctx, out);
        run.pulse0 += RIG_LINE_PULSES; /* other random numbers */
    }
    caster_free(caster);
    bvh_free(bvh);
    scene_free(scene);
}

/* ---- retro-reflectors */

static const double RETRO = 300.0, WHITE = 0.9;

static void set_up_signal(int sharp, struct detect_signal *signal)
{
    struct sh_err err;
    const struct detect_signal_spec spec = {.n_reaches = 1,
                                            .reach = {{WHITE, 900.0}},
                                            .threshold_snr = 8.0,
                                            .sharp = sharp,
                                            .sigma_m = 0.005,
                                            .sigma_at_m = 100.0,
                                            .sigma_reflectance = WHITE,
                                            .sigma_floor_m = 0.002,
                                            .seed = 3};
    if (detect_signal_set_up(&spec, signal, &err) != SH_OK) fail_msg("%s", err.text);
}

/* Returns where the leading edge of a Gaussian pulse of that amplitude crosses the threshold, before its middle. */
static double edge_before_m(double amplitude)
{
    double sigma_s = PULSE_S / 2.3548200450309493;
    return amplitude > 1.0 ? 0.5 * LIGHT_M_S * sigma_s * sqrt(2.0 * log(amplitude)) : 0.0;
}

struct spread {
    double away_m, sum, sum2;
    uint64_t n;
};

static void add_spread(void *ctx, const struct shot *shot)
{
    struct spread *s = ctx;
    assert_int_equal(shot->block.n_points, RIG_LINE_PULSES);
    for (uint32_t i = 0; i < RIG_LINE_PULSES; i++) {
        double off = 1e-6 * shot->block.a[i] - s->away_m / shot->along[i];
        s->sum += off;
        s->sum2 += off * off;
    }
    s->n += RIG_LINE_PULSES;
}

/* This gives range, reflectance and range noise of a foil of reflectance 300. Naive ways: time taken where the leading
 * edge crosses the threshold, with the offset that is right for white paper; reflectance as a fraction of a white
 * target; noise as the inverse of the signal, without a lower limit. The spread of 20,000 pulses has an error of 0.5 %,
 * and four times that is allowed. */
static void a_foil_is_where_it_is(void **state)
{
    (void)state;
    static const double away_m[] = {2.0, 10.0, 50.0, 200.0, 800.0};
    const struct cast_detect plain = {.max_echoes = 1};
    struct surface_table table;
    struct sh_err err;
    assert_int_equal(surface_table_alloc(1, &table, &err), SH_OK);
    table.surface[0] = (struct surface){.reflectance = 0.3, .retro = RETRO};
    table.has_lobes = 1;
    for (size_t k = 0; k < sizeof away_m / sizeof *away_m; k++) {
        static struct shot shot;
        struct detect_signal signal;
        struct cast_detect detect = plain;
        struct spread spread = {.away_m = away_m[k]};
        double off_m = 0.0, off_db = 0.0;
        char regime[2][64];
        set_up_signal(1, &signal);
        detect.signal = &signal;
        shoot(planes(&away_m[k], 1), &table, &detect, &shot, 1, NULL, NULL);
        assert_int_equal(shot.block.n_points, RIG_LINE_PULSES);
        for (uint32_t i = 0; i < RIG_LINE_PULSES; i++) {
            double want_db = 10.0 * log10(RETRO + 0.3 * shot.along[i]);
            off_m = fmax(off_m, fabs(1e-6 * shot.block.a[i] - away_m[k] / shot.along[i]));
            off_db = fmax(off_db, fabs(0.01 * shot.block.refl_cdb[i] - want_db));
        }
        line_block_free(&shot.block);
        snprintf(regime[0], sizeof regime[0], "retro-reflector at %g m", away_m[k]);
        double foil = detect_amplitude(&signal, away_m[k], RETRO), paper = detect_amplitude(&signal, away_m[k], WHITE);
        table_row(regime[0], "leading edge at the threshold", edge_before_m(foil) - edge_before_m(paper), off_m, 1e-6,
                  "m");
        if (k == 0)
            table_row("its reflectance", "fraction of white, 0 to 1", 10.0 * log10(RETRO), off_db, 0.0051, "dB");
        else
            assert_true(off_db < 0.0051);
        if (k > 2) continue; /* further away noise is not at its floor */
        detect.noise_by_signal = 1;
        shoot(planes(&away_m[k], 1), &table, &detect, &shot, 50, add_spread, &spread);
        line_block_free(&shot.block);
        double mean = spread.sum / (double)spread.n, sigma = sqrt(spread.sum2 / (double)spread.n - mean * mean);
        double no_floor_m = 0.005 * detect_amplitude(&signal, 100.0, WHITE) / foil;
        snprintf(regime[1], sizeof regime[1], "its range noise at %g m, off the floor", away_m[k]);
        table_row(regime[1], "inverse of the signal", fabs(no_floor_m / 0.002 - 1.0), fabs(sigma / 0.002 - 1.0), 0.02,
                  "of it");
    }
    surface_table_free(&table);
    table_check();
}

/* ---- a pane in front of a wall */

/* Gaps go up to one and a half times the pulse's width. Up to the resolution there is one echo at the mean, weighted by
 * the returned light. Beyond it there are two, each where it is. Naive: each surface has an echo of its own, however
 * near. */
static void a_pane_runs_into_the_wall(void **state)
{
    (void)state;
    const double resolution_m = 0.5 * LIGHT_M_S * PULSE_S, pane_m = 12.0, glass = 0.9, pane = 0.08, wall = 0.4;
    const struct cast_detect detect = {.depth = CAST_MAX_DEPTH, .max_echoes = 15, .separation_m = resolution_m};
    struct surface_table table;
    struct sh_err err;
    uint32_t wrong = 0, naive_wrong = 0, pulses = 0, back = 0;
    double off = 0.0, off_first = 0.0, before_m = 0.0;
    assert_int_equal(surface_table_alloc(2, &table, &err), SH_OK);
    table.surface[0] = (struct surface){.reflectance = pane, .glass = glass};
    table.surface[1] = (struct surface){.reflectance = wall};
    table.has_optics = 1;
    for (int k = 0; k <= 60; k++) {
        static struct shot shot;
        double gap_m = k == 0 ? 0.001 : 0.015 * k;
        const double away_m[2] = {pane_m, pane_m + gap_m};
        shoot(planes(away_m, 2), &table, &detect, &shot, 1, NULL, NULL);
        for (uint32_t i = 0, at = 0; i < RIG_LINE_PULSES; i++) {
            uint32_t n = shot.block.echo[at] >> 4, want = gap_m / shot.along[i] > resolution_m ? 2 : 1;
            double first_m = 1e-6 * shot.block.a[at], front_m = pane_m / shot.along[i];
            double share = wall * glass * glass / (pane + wall * glass * glass); /* of the wall; through and back */
            double mean_m = front_m + (want == 1 ? share * gap_m / shot.along[i] : 0.0);
            pulses++;
            wrong += n != want;
            naive_wrong += want != 2;
            off = fmax(off, fabs(first_m - mean_m));
            off_first = fmax(off_first, fabs(front_m - mean_m));
            if (want == 2) off = fmax(off, fabs(1e-6 * shot.block.a[at + n - 1] - front_m - gap_m / shot.along[i]));
            if (i == 0 && want == 1) {
                back += first_m <= before_m;
                before_m = first_m;
            }
            at += n == 0 ? 1 : n;
        }
        line_block_free(&shot.block);
    }
    surface_table_free(&table);
    assert_int_equal(back, 0);
    table_row("a pane 1 mm to 0.9 m before a wall: echo counts", "an echo for each surface", naive_wrong, wrong, 0.0,
              "pulses");
    table_note("of %u pulses, 61 gaps", pulses);
    table_row("the same: range", "an echo for each surface", off_first, off, 1e-6, "m");
    table_check();
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_foil_is_where_it_is),
                                       cmocka_unit_test(a_pane_runs_into_the_wall)};
    table_head("Signals: retro-reflectors, and a pane close to a wall");
    return cmocka_run_group_tests(tests, NULL, NULL);
}
