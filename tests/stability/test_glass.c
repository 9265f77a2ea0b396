/* SPDX-License-Identifier: MIT */
/* These tests look at a scene behind a pane. A second ray that sets out a fixed step after a float hit meets the pane
 * again. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/surface.h"
#include "tests/common/made.h"
#include "tests/stability/rig.h"

enum { PULSES = RIG_LINE_PULSES };
static const double PANE_M = 0.004, WALL_M = 3.0;

/* Both sides of a pane that the beam ahead meets at `away_m` under the incidence i, and a wall behind, all parallel.
 * Pane and wall stand about a place on the UTM grid. */
static struct scene *make_window(double away_m, double incidence_rad, const double at[3])
{
    const double s = sin(incidence_rad), c = cos(incidence_rad), behind[3] = {0.0, PANE_M, PANE_M + WALL_M};
    const double half_m = 20.0 + 10.0 / c + 0.02 * away_m / c;
    static const uint32_t triangle[6][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}, {8, 9, 10}, {8, 10, 11}};
    static const uint16_t label[6] = {0, 0, 0, 0, 1, 1};
    static const struct scene_surface surface[2] = {{.object = "pane"}, {.object = "wall"}};
    double vertex[12][3];
    for (int p = 0; p < 3; p++)
        for (int v = 0; v < 4; v++) {
            double across = v == 1 || v == 2 ? half_m : -half_m;
            vertex[4 * p + v][0] = at[0] + behind[p] * s + across * c;
            vertex[4 * p + v][1] = at[1] + away_m + behind[p] * c - across * s;
            vertex[4 * p + v][2] = at[2] + (v >= 2 ? half_m : -half_m);
        }
    return made_scene(&(struct scene_arrays){(const double(*)[3])vertex, 12, triangle, 6, label, surface, 2});
}

/* Writes the true ranges of the three surfaces along pulse i. */
static void truth(const struct schedule_segment *segment, const struct schedule_line *line, uint32_t i, double away_m,
                  double incidence_rad, double range_m[3], double dir[3])
{
    double m = 2.0 * M_PI * schedule_mirror_turn(segment, line->cast0 + i), along = cos(incidence_rad) * cos(m);
    dir[0] = 0.0;
    dir[1] = cos(m);
    dir[2] = sin(m);
    range_m[0] = away_m * cos(incidence_rad) / along;
    range_m[1] = range_m[0] + PANE_M / along;
    range_m[2] = range_m[1] + WALL_M / along;
}

/* Returns how many pulses don't have three echoes, or have one that is wrong by more than allowed. */
static uint32_t wrong_of_ours(const struct scene *scene, double away_m, double incidence_rad, const double at[3],
                              double allowed_m)
{
    struct schedule_segment segment;
    struct schedule_line line;
    struct schedule_run run;
    struct caster *caster;
    struct line_block block;
    struct surface_table table;
    struct sh_err err;
    uint32_t wrong = 0;
    rig_line_ahead(&segment, &line, &run);
    struct bvh *bvh = made_bvh(scene);
    if (caster_create(&caster, &err) != SH_OK ||
        line_block_alloc(&block, PULSES * (1 + CAST_MAX_DEPTH), &err) != SH_OK ||
        surface_table_alloc(2, &table, &err) != SH_OK)
        fail_msg("%s", err.text);
    table.surface[0] = (struct surface){.reflectance = 0.05, .glass = 0.9};
    table.surface[1] = (struct surface){.reflectance = 0.5};
    const struct cast_detect detect = {.surfaces = &table, .depth = CAST_MAX_DEPTH, .max_echoes = 15};
    struct cast_setup setup = {.bvh = bvh,
                               .station_m = {at[0], at[1], at[2]},
                               .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                               .range_max_m = 4000.0,
                               .mirror_counts = 0x1p32,
                               .pan_counts = 0x1p32,
                               .range_scale_m = 1e-6,
                               .detect = &detect};
    caster_cast(caster, &setup, &run, &block);
    for (uint32_t i = 0, e = 0; i < PULSES; i++) {
        double range_m[3], dir[3];
        uint32_t first = e, off = 0;
        truth(&segment, &line, i, away_m, incidence_rad, range_m, dir);
        do
            e++;
        while (e < block.n_points && (block.echo[e] & 15) > 1);
        for (uint32_t k = 0; k < 3 && e - first == 3; k++)
            off += (uint32_t) !(fabs(block.a[first + k] * 1e-6 - range_m[k]) <= allowed_m + 0.5e-6);
        wrong += off > 0 || e - first != 3;
    }
    surface_table_free(&table);
    line_block_free(&block);
    caster_free(caster);
    bvh_free(bvh);
    return wrong;
}

/* The naive way: each next ray begins a tenth of a millimetre after the float hit. */
static uint32_t wrong_of_naive(const struct scene *scene, double away_m, double incidence_rad, const double at[3])
{
    struct schedule_segment segment;
    struct schedule_line line;
    struct schedule_run run;
    uint32_t wrong = 0;
    struct naive *naive = naive_create(scene, at, 1, 1);
    assert_non_null(naive);
    rig_line_ahead(&segment, &line, &run);
    for (uint32_t i = 0; i < PULSES; i++) {
        double range_m[3], dir[3], length_m = 0.0;
        uint32_t off = 0;
        truth(&segment, &line, i, away_m, incidence_rad, range_m, dir);
        for (int k = 0; k < 3; k++) {
            const double from[3] = {at[0] + length_m * dir[0], at[1] + length_m * dir[1], at[2] + length_m * dir[2]};
            double t;
            uint32_t triangle;
            naive_hits(naive, 1, from, 1, &dir[0], &dir[1], &dir[2], &t, &triangle);
            off += (uint32_t) !(fabs(length_m + t - range_m[k]) <= 0.001 / cos(incidence_rad));
            length_m += t + 1e-4;
        }
        wrong += off > 0;
    }
    naive_free(naive);
    return wrong;
}

/* Ours is right to a micrometre across the surfaces; vertices on the UTM grid are rounded to 1e-9 m. The naive way only
 * has to find the right surfaces, to a millimetre across. */
static void a_pane_is_met_once_a_side(void **state)
{
    (void)state;
    static const double at[3] = {391431.123, 5819712.456, 34.567}, here[3] = {0.0, 0.0, 0.0};
    static const struct {
        double away_m, incidence_deg;
        int row; /* the plain way fails here */
    } seen[] = {{1, 0, 0},   {1, 80, 0},   {10, 0, 0},   {10, 85, 0},  {100, 0, 0},   {100, 85, 0},  {100, 89.5, 0},
                {800, 0, 0}, {800, 60, 0}, {800, 85, 0}, {800, 89, 1}, {1500, 60, 0}, {1500, 80, 1}, {1500, 88, 0}};
    table_head("glass: pulses that don't see both sides of a 4 mm pane and the wall behind");
    for (size_t i = 0; i < sizeof seen / sizeof *seen; i++) {
        double incidence_rad = seen[i].incidence_deg * M_PI / 180.0;
        struct scene *grid = make_window(seen[i].away_m, incidence_rad, at);
        struct scene *local = make_window(seen[i].away_m, incidence_rad, here);
        uint32_t ours = wrong_of_ours(grid, seen[i].away_m, incidence_rad, at, 1e-6 / cos(incidence_rad));
        char regime[64];
        snprintf(regime, sizeof regime, "%g m, incidence %g deg", seen[i].away_m, seen[i].incidence_deg);
        if (seen[i].row)
            table_row(regime, "fixed step, local frame", wrong_of_naive(local, seen[i].away_m, incidence_rad, here),
                      ours, 0.0, "rays");
        else if (ours != 0)
            fail_msg("%s: %u pulses wrong", regime, ours);
        scene_free(grid);
        scene_free(local);
    }
    table_check();
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_pane_is_met_once_a_side)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
