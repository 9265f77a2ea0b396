/* SPDX-License-Identifier: MIT */
#include "tests/accuracy/slanted.h"

const struct beam_view AHEAD = {0.0, 0.001, -0.001, 0.001, 4, 4};

double spread(const struct beam *beam, const double dir[3], const struct face *f, double *mean, double *variance)
{
    enum { RAYS = 40000 };
    double e1[3], e2[3], sum = 0.0, sum2 = 0.0, first = NAN;
    int met = 0;
    beam_axes(dir, e1, e2);
    for (int i = 0; i < RAYS; i++) {
        double inside = (i + 0.5) / RAYS * (1.0 - exp(-2.0)), rho = sqrt(-0.5 * log(1.0 - inside));
        double x = rho * cos(2.399963229728653 * i), y = rho * sin(2.399963229728653 * i);
        double o[3], v[3], along = 0.0, at = 0.0, v2 = 0.0;
        for (int k = 0; k < 3; k++) {
            o[k] = beam->exit_radius_m * (x * e1[k] + y * e2[k]);
            v[k] = dir[k] + beam->slope * (x * e2[k] - y * e1[k]);
            along += f->n[k] * v[k];
            at += f->n[k] * o[k];
            v2 += v[k] * v[k];
        }
        double t = (f->d - at) / along, range_m = t * sqrt(v2);
        int is_on = 1;
        for (int c = 0; c < f->n_cuts; c++) {
            const double *cut = f->cut[c];
            is_on &= cut[0] * (o[0] + t * v[0]) + cut[1] * (o[1] + t * v[1]) + cut[2] * (o[2] + t * v[2]) >= cut[3];
        }
        if (!is_on) continue;
        if (met++ == 0) first = range_m;
        sum += range_m - first;
        sum2 += (range_m - first) * (range_m - first);
    }
    *mean = first + sum / met;
    *variance = sum2 / met - sum / met * sum / met;
    return (double)met / RAYS;
}

double width_of(double pulse_m, double variance)
{
    return CNS_PER_M * sqrt(pulse_m * pulse_m + FULL2 * variance);
}

struct scene *slanted(double range_m, double i, double about, const double u[2], const double v[2], struct face *face)
{
    const double across[3] = {sin(about), 0.0, cos(about)}; /* in the plane, across the beam */
    const double up[3] = {cos(about) * cos(i), sin(i), -sin(about) * cos(i)};
    double vertex[4][3];
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {0, 2, 3}};
    static const uint16_t label[2] = {0, 0};
    static const struct scene_surface surface = {.object = "wall"};
    for (int k = 0; k < 4; k++)
        for (int x = 0; x < 3; x++)
            vertex[k][x] = (x == 1 ? range_m : 0.0) + u[k == 1 || k == 2] * across[x] + v[k >= 2] * up[x];
    *face = (struct face){.n = {across[1] * up[2] - across[2] * up[1], across[2] * up[0] - across[0] * up[2],
                                across[0] * up[1] - across[1] * up[0]}};
    face->d = face->n[1] * range_m;
    return made_scene(&(struct scene_arrays){(const double(*)[3])vertex, 4, triangle, 2, label, &surface, 1});
}

void open_attributes(struct beam_rig *rig, struct scene *scene, const struct beam_view *view, double pulse_s)
{
    struct sh_err err;
    made_beam_rig(rig, scene, view);
    beam_init(&rig->beam.beam, 0.007, 0.35e-3, pulse_s);
    rig->setup.pulse_m = rig->beam.beam.resolution_m;
    rig->setup.range_max_m = 3000.0;
    if (line_block_alloc_attributes(&rig->block, &err) != 0) fail_msg("%s", err.text);
}

void check_width(double told_cns, double want_cns, double b, double slack)
{
    if (!(fabs(told_cns - want_cns) < 0.5 + (2e-4 + slack + 0.7 * b * b) * want_cns))
        fail_msg("width %.0f, not %.3f of 0.01 ns", told_cns, want_cns);
}

double excess(double told_cns, double want_cns)
{
    return fmax(0.0, fabs(told_cns - want_cns) - 0.5) / want_cns;
}
