/* SPDX-License-Identifier: MIT */
/* Footprints that one ray stands for, or few: ground under grazing incidence, and edges with every step up to the
 * pulse's width and beyond. There are two naive methods: the ray in the centre alone, and sub-rays whose returns go
 * into a waveform of bins. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/common/beam_reference.h"
#include "tests/common/hits.h"
#include "tests/common/made.h"
#include "tests/stability/table.h"

enum { NAIVE_RINGS = 3, NAIVE_ROOM = 64 };
static const double STATION_M[3] = {0.0, 0.0, 0.0}, BIN_M = 0.5 * 299792458.0 * 0.25e-9;

/* Sorts 37 sub-rays into bins of 0.25 ns. Returns the energy-weighted mean of the bins up to limit_m after the
 * first. */
static double binned_mean(const struct beam_rig *rig, const struct beam_pattern *pattern, const double dir[3],
                          double limit_m)
{
    const struct beam *beam = &rig->beam.beam;
    double e1[3], e2[3], range_m[NAIVE_ROOM], first = INFINITY, sum = 0.0;
    uint32_t triangle, n = 0;
    beam_axes(dir, e1, e2);
    for (uint32_t i = 0; i < pattern->n; i++) {
        double x = (double)pattern->x[i], y = (double)pattern->y[i], p[3], d[3], length = 0.0;
        for (int k = 0; k < 3; k++) {
            p[k] = STATION_M[k] + beam->exit_radius_m * (x * e1[k] + y * e2[k]);
            d[k] = dir[k] + beam->slope * (x * e2[k] - y * e1[k]);
            length += d[k] * d[k];
        }
        for (int k = 0; k < 3; k++)
            d[k] /= sqrt(length);
        hits_from(rig->caster, rig->bvh, p, rig->setup.range_max_m, 1, &d[0], &d[1], &d[2], &range_m[i], &triangle);
        first = fmin(first, range_m[i]);
    }
    for (uint32_t i = 0; i < pattern->n; i++)
        if (range_m[i] <= first + limit_m) {
            sum += (floor(range_m[i] / BIN_M) + 0.5) * BIN_M;
            n++;
        }
    return sum / n;
}

/* ---- ground */

static struct scene *ground(double height_m)
{
    const double far_m = 3000.0, z = -height_m;
    const double vertex[4][3] = {{-far_m, -far_m, z}, {far_m, -far_m, z}, {far_m, far_m, z}, {-far_m, far_m, z}};
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {0, 2, 3}};
    return made_scene(&(struct scene_arrays){vertex, 4, triangle, 2, NULL, NULL, 0});
}

struct off {
    double ours, centre, binned; /* largest distance from the mean over the footprint, m */
};

static struct off off_on_ground(double height_m, double incidence_deg)
{
    enum { PULSES = 16 };
    static const double normal[3] = {0.0, 0.0, 1.0};
    const double down_deg = incidence_deg - 90.0;
    const struct beam_view view = {down_deg - 5e-4, down_deg + 5e-4, 0.0, 0.02, 2, PULSES};
    static struct beam_pattern pattern;
    double d[3][PULSES];
    struct beam_rig rig;
    struct cast_counters counters;
    struct off off = {0};
    made_beam_rig(&rig, ground(height_m), &view);
    beam_rings(NAIVE_RINGS, &pattern);
    beam_rig_mode(&rig, BEAM_ADAPTIVE, 4);
    for (uint32_t l = 0; l < view.lines; l++) {
        beam_rig_directions(&rig, l, d[0], d[1], d[2]);
        assert_int_equal(beam_rig_line(&rig, l), view.pulses);
        for (uint32_t i = 0; i < view.pulses; i++) {
            const double dir[3] = {d[0][i], d[1][i], d[2][i]};
            double want = beam_ref_plane_mean(&rig.beam.beam, dir, normal, -height_m);
            off.ours = fmax(off.ours, fabs(1e-6 * rig.block.a[i] - want));
            off.centre = fmax(off.centre, fabs(-height_m / dir[2] - want));
            off.binned = fmax(off.binned, fabs(binned_mean(&rig, &pattern, dir, INFINITY) - want));
        }
    }
    caster_get_counters(rig.caster, &counters);
    assert_int_equal(counters.sub_rays, 0);
    beam_rig_close(&rig);
    return off;
}

/* A head at a tripod's height above the ground: 1.8 m away at 0 deg, 1031 m at 89.9 deg. Ours casts one ray. The bound
 * is the one for a wall. If the footprint is small, the ray in the centre keeps it, too. */
static void one_ray_stands_for_the_ground(void **state)
{
    (void)state;
    static const double incidence_deg[] = {0, 30, 60, 75, 80, 85, 87, 88, 89, 89.5, 89.8, 89.9}, height_m = 1.8;
    for (size_t i = 0; i < sizeof incidence_deg / sizeof *incidence_deg; i++) {
        struct off off = off_on_ground(height_m, incidence_deg[i]);
        char regime[64];
        snprintf(regime, sizeof regime, "ground at %g deg, in %.4g m", incidence_deg[i],
                 height_m / cos(incidence_deg[i] * M_PI / 180.0));
        table_row(regime, "37 sub-rays, bins of 0.25 ns", off.binned, off.ours, 5e-5, "m");
        if (incidence_deg[i] >= 87.0) table_row(regime, "ray in the centre", off.centre, off.ours, 5e-5, "m");
    }
    table_check();
}

/* ---- an edge */

static const double DOOR_M = 20.0;

/* Returns the energy of the Gaussian footprint beyond a line h from its centre (in radii), as a sum over small
 * cells. */
static double energy_beyond(double h)
{
    enum { RADII = 400, PARTS = 720 };
    double sum = 0.0, all = 0.0;
    for (int i = 0; i < RADII; i++) {
        double r = (i + 0.5) / RADII, weight = r * exp(-2.0 * r * r);
        double half_turn = h <= -r ? M_PI : h >= r ? 0.0 : acos(h / r); /* of this circle, beyond the line */
        sum += weight * half_turn / M_PI;
        all += weight;
    }
    return sum / all;
}

enum { EDGE_PULSES = 12, EDGE_STEPS = 61 };

/* One step of the edge, with each pulse along the line across it. */
struct edge {
    double dir_y[EDGE_PULSES], behind[EDGE_PULSES]; /* energy on the surface behind */
    uint32_t n[EDGE_PULSES];
    double first_m[EDGE_PULSES], last_m[EDGE_PULSES], binned_m[EDGE_PULSES];
};

static void look_at_edge(double step_m, struct edge *e)
{
    /* A footprint is 0.04 deg wide; the outermost pulses have 3 % of their energy on the other side. */
    const struct beam_view view = {0.0, 0.001, -0.008, 0.008, EDGE_PULSES, 1};
    static struct beam_pattern pattern;
    struct beam_rig rig;
    made_beam_rig(&rig, made_door(step_m), &view);
    beam_rings(NAIVE_RINGS, &pattern);
    beam_rig_mode(&rig, BEAM_ADAPTIVE, 4);
    for (uint32_t l = 0; l < EDGE_PULSES; l++) {
        double d[3];
        beam_rig_directions(&rig, l, &d[0], &d[1], &d[2]);
        beam_rig_line(&rig, l);
        e->dir_y[l] = d[1];
        e->behind[l] = energy_beyond(-d[0] / d[1] * DOOR_M / beam_radius(&rig.beam.beam, DOOR_M));
        e->n[l] = rig.block.n_points;
        e->first_m[l] = 1e-6 * rig.block.a[0];
        e->last_m[l] = 1e-6 * rig.block.a[e->n[l] - 1];
        e->binned_m[l] = binned_mean(&rig, &pattern, d, rig.beam.beam.resolution_m);
    }
    beam_rig_close(&rig);
}

/* Steps of 1 mm, then every 15 mm up to one and a half times the pulse's width (0.60 m). */
static double edge_step_m(int k)
{
    return k == 0 ? 0.001 : 0.015 * k;
}

/* Up to the resolution there is one echo at the mean, which moves by its share of each step, without a jump. Beyond it
 * there are two, each at its surface. Bounds: footprints of neighbouring pulses differ a little between 20 m and the
 * deeper surface, by 1e-3 of the energy; and the wire's micrometre. */
static void an_edge_moves_without_a_jump(void **state)
{
    (void)state;
    static struct edge edge[EDGE_STEPS];
    const double resolution_m = 0.5 * 299792458.0 * 4e-9;
    double off = 0.0, off_binned = 0.0, jump = 0.0, jump_binned = 0.0, apart = 0.0, apart_binned = 0.0;
    uint32_t wrong = 0, back = 0, single_wrong = 0;
    for (int k = 0; k < EDGE_STEPS; k++) {
        double step_m = edge_step_m(k), off_here = 0.0, off_single = 0.0;
        look_at_edge(step_m, &edge[k]);
        for (int i = 0; i < EDGE_PULSES; i++) {
            const struct edge *e = &edge[k];
            double front_m = DOOR_M / e->dir_y[i], behind_m = (DOOR_M + step_m) / e->dir_y[i];
            uint32_t want = behind_m - front_m > resolution_m ? 2 : 1;
            assert_true(e->behind[i] > 0.02 && e->behind[i] < 0.98);
            wrong += e->n[i] != want;
            single_wrong += want != 1;
            if (want == 2) {
                apart = fmax(apart, fmax(fabs(e->first_m[i] - front_m), fabs(e->last_m[i] - behind_m)));
                apart_binned = fmax(apart_binned, fabs(e->binned_m[i] - front_m));
                continue;
            }
            double mean_m = front_m + e->behind[i] * (behind_m - front_m);
            off_here = fmax(off_here, fabs(e->first_m[i] - mean_m) / step_m);
            off_single = fmax(off_single, fabs((e->behind[i] > 0.5 ? behind_m : front_m) - mean_m) / step_m);
            off = fmax(off, fabs(e->first_m[i] - mean_m));
            off_binned = fmax(off_binned, fabs(e->binned_m[i] - mean_m));
            if (k == 0) continue;
            double moved_m = e->behind[i] * (step_m - edge_step_m(k - 1));
            back += e->first_m[i] <= edge[k - 1].first_m[i];
            jump = fmax(jump, fabs(e->first_m[i] - edge[k - 1].first_m[i] - moved_m));
            jump_binned = fmax(jump_binned, fabs(e->binned_m[i] - edge[k - 1].binned_m[i] - moved_m));
        }
        if (k % 13 != 0 || off_single == 0.0) continue;
        char regime[40];
        snprintf(regime, sizeof regime, "edge, a step of %g m", step_m);
        table_row(regime, "single ray", off_single, off_here, 1e-3 + 1e-6 / step_m, "of the step");
    }
    assert_int_equal(back, 0);
    table_row("edge, 40 steps up to the pulse's width: range", "37 sub-rays, bins of 0.25 ns", off_binned, off,
              1e-3 * resolution_m, "m");
    table_row("the same: beyond its share from step to step", "37 sub-rays, bins of 0.25 ns", jump_binned, jump,
              1e-3 * 0.015 + 1e-6, "m");
    table_row("edge, steps of 1 mm to 1.5 widths: echo counts", "single ray", single_wrong, wrong, 0.0, "pulses");
    table_row("edge, beyond the width: both ranges", "37 sub-rays, bins of 0.25 ns", apart_binned, apart, 2e-6, "m");
    table_check();
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(one_ray_stands_for_the_ground),
                                       cmocka_unit_test(an_edge_moves_without_a_jump)};
    table_head("Footprints: one ray on the ground, and edges by depth");
    return cmocka_run_group_tests(tests, NULL, NULL);
}
