/* Two plates, one behind the other, in one beam: what each echo must bring back, written down. For tests of footprints
 * with detection. */
#ifndef TESTS_ACCURACY_LIT_PLATES_H
#define TESTS_ACCURACY_LIT_PLATES_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/surface.h"
#include "tests/accuracy/beam_reference.h"

static const double STATION[3] = {0.0, 0.0, 0.0};

static inline void open_rig(struct beam_rig *rig, struct scene *scene, const struct beam_view *view)
{
    struct sh_err err;
    if (beam_rig_open(rig, scene, STATION, view, &err) != 0) fail_msg("%s", err.text);
}

/* ---- an edge between two plates */

/* Energy beyond a line at h of the unit disc: the Gaussian's strips across, each an error function long, by Simpson's
 * rule over x = -cos a, which has no corner at the disc's border. */
static inline double energy_beyond(double h)
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

enum { FRONT, BACK };

/* Left of x = 0 a plate at near_m, behind it another one, or on the right only. */
static inline struct scene *plates(double near_m, double far_m, int whole_back)
{
    double vertex[8][3], half = 0.1 * far_m;
    static const uint32_t triangle[4][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
    static const uint16_t label[4] = {FRONT, FRONT, BACK, BACK};
    static const struct scene_surface surface[2] = {{.object = "front"}, {.object = "back"}};
    struct scene *scene;
    struct sh_err err;
    for (int v = 0; v < 8; v++) {
        int back = v / 4, right = v % 4 == 1 || v % 4 == 2;
        vertex[v][0] = right ? (back ? half : 0.0) : back && !whole_back ? 0.0 : -half;
        vertex[v][1] = back ? far_m : near_m;
        vertex[v][2] = v % 4 >= 2 ? half : -half;
    }
    if (scene_from_arrays(&(struct scene_arrays){(const double(*)[3])vertex, 8, triangle, 4, label, surface, 2}, &scene,
                          &err) != 0)
        fail_msg("%s", err.text);
    return scene;
}

/* A rig with a signal: reflectances of both plates, and rho_min at 1 m (0: everything is seen). */
struct lit {
    struct beam_rig rig;
    struct surface_table table;
    struct detect_signal signal;
    struct cast_detect detect;
    double near_m, far_m, rho[2];
};

static inline void open_lit(struct lit *l, struct scene *scene, const struct beam_view *view, double least_at_1_m)
{
    struct sh_err err;
    const struct detect_signal_spec spec = {
        .n_reaches = 1, .reach = {{0.9, sqrt(0.9 / fmax(least_at_1_m, 1e-12))}}, .threshold_snr = 8.0, .sharp = 1};
    open_rig(&l->rig, scene, view);
    if (surface_table_alloc(2, &l->table, &err) != 0 || detect_signal_set_up(&spec, &l->signal, &err) != 0)
        fail_msg("%s", err.text);
    for (int i = 0; i < 2; i++)
        l->table.surface[i].reflectance = l->rho[i];
    l->detect = (struct cast_detect){
        .surfaces = &l->table, .signal = &l->signal, .ghost_label = 2, .max_echoes = LINE_MAX_ECHOES};
    l->rig.setup.detect = &l->detect;
}

static inline void close_lit(struct lit *l)
{
    surface_table_free(&l->table);
    beam_rig_close(&l->rig);
}

/* What a pulse along d meets: energy on the front plate, and what comes back of both, slope included. */
struct edge {
    double front, back[2], range_m[2];
};

static inline struct edge at_edge(const struct lit *l, double dx, double dy)
{
    struct edge e;
    e.front = energy_beyond(dx / dy * l->near_m / beam_radius(&l->rig.beam.beam, l->near_m));
    e.back[FRONT] = e.front * l->rho[FRONT] * dy;
    e.back[BACK] = (1.0 - e.front) * l->rho[BACK] * dy;
    e.range_m[FRONT] = l->near_m / dy;
    e.range_m[BACK] = l->far_m / dy;
    return e;
}

static inline double linear(const struct line_block *b, uint32_t i)
{
    return pow(10.0, 1e-3 * b->refl_cdb[i]);
}

/* Reflectances are told in 0.01 dB: 0.12 % of themselves. The edge lies off its place in the footprint by a part in
 * 1,000 of the radius (the view's slopes). Of 18 rings' 1,027 sub-rays, 37 lie on one line through the centre: an edge
 * along it has half of them on the wrong side, 1.8 %. */
#define PARTS_OFF 1e-3
#define RINGS_OFF 0.02
static inline void near_energy(double told, double want, double rho, double slack)
{
    if (!(fabs(told - want) < 0.0012 * want + slack * rho)) fail_msg("reflectance %.5f, not %.5f", told, want);
}

static const struct beam_view ACROSS = {0.0, 0.01, -0.03, 0.03, 60, 16};

#endif
