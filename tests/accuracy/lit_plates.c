/* SPDX-License-Identifier: MIT */
#include "tests/accuracy/lit_plates.h"

const double STATION[3] = {0.0, 0.0, 0.0};

/* Returns the energy beyond a line at h of the unit disc. The disc is cut into strips along the line, and the energy of
 * each is an error function. Simpson's rule sums them over x = -cos a, which has no corner at the disc's border. */
static double energy_beyond(double h)
{
    enum { STEPS = 2000 };
    double sum[2] = {0.0, 0.0}, from = acos(-fmin(1.0, fmax(-1.0, h)));
    for (int part = 0; part < 2; part++) {
        double a0 = part == 0 ? from : 0.0, step = (M_PI - a0) / STEPS;
        for (int i = 0; i <= STEPS; i++) {
            double a = a0 + i * step, x = -cos(a);
            double strip = exp(-2.0 * x * x) * erf(sqrt(2.0) * sin(a)) * sin(a);
            sum[part] += step * strip * (i == 0 || i == STEPS ? 1.0 : i % 2 == 1 ? 4.0 : 2.0);
        }
    }
    return sum[0] / sum[1];
}

struct scene *plates(double near_m, double far_m, int whole_back)
{
    double vertex[8][3], half = 0.1 * far_m;
    static const uint32_t triangle[4][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
    static const uint16_t label[4] = {FRONT, FRONT, BACK, BACK};
    static const struct scene_surface surface[2] = {{.object = "front"}, {.object = "back"}};
    for (int v = 0; v < 8; v++) {
        int back = v / 4, right = v % 4 == 1 || v % 4 == 2;
        vertex[v][0] = right ? (back ? half : 0.0) : back && !whole_back ? 0.0 : -half;
        vertex[v][1] = back ? far_m : near_m;
        vertex[v][2] = v % 4 >= 2 ? half : -half;
    }
    return made_scene(&(struct scene_arrays){(const double(*)[3])vertex, 8, triangle, 4, label, surface, 2});
}

void open_lit(struct lit *l, struct scene *scene, const struct beam_view *view, double least_at_1_m)
{
    struct sh_err err;
    const struct detect_signal_spec spec = {
        .n_reaches = 1, .reach = {{0.9, sqrt(0.9 / fmax(least_at_1_m, 1e-12))}}, .threshold_snr = 8.0, .sharp = 1};
    made_beam_rig(&l->rig, scene, view);
    if (surface_table_alloc(2, &l->table, &err) != 0 || detect_signal_set_up(&spec, &l->signal, &err) != 0)
        fail_msg("%s", err.text);
    for (int i = 0; i < 2; i++)
        l->table.surface[i].reflectance = l->rho[i];
    l->detect = (struct cast_detect){
        .surfaces = &l->table, .signal = &l->signal, .ghost_label = 2, .max_echoes = LINE_MAX_ECHOES};
    l->rig.setup.detect = &l->detect;
}

void close_lit(struct lit *l)
{
    surface_table_free(&l->table);
    beam_rig_close(&l->rig);
}

const struct line_block *lit_line(struct lit *l, uint32_t line)
{
    beam_rig_directions(&l->rig, line, l->d[0], l->d[1], l->d[2]);
    beam_rig_line(&l->rig, line);
    return &l->rig.block;
}

struct edge at_edge(const struct lit *l, double dx, double dy)
{
    struct edge e;
    e.front = energy_beyond(dx / dy * l->near_m / beam_radius(&l->rig.beam.beam, l->near_m));
    e.back[FRONT] = e.front * l->rho[FRONT] * dy;
    e.back[BACK] = (1.0 - e.front) * l->rho[BACK] * dy;
    e.range_m[FRONT] = l->near_m / dy;
    e.range_m[BACK] = l->far_m / dy;
    return e;
}

double linear(const struct line_block *b, uint32_t i)
{
    return pow(10.0, 1e-3 * b->refl_cdb[i]);
}

void near_energy(double told, double want, double rho, double slack)
{
    if (!(fabs(told - want) < 0.0012 * want + slack * rho)) fail_msg("reflectance %.5f, not %.5f", told, want);
}

const struct beam_view ACROSS = {0.0, 0.01, -0.03, 0.03, 60, 16};
