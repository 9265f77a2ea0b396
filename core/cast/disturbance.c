/* SPDX-License-Identifier: MIT */
/* Disturbances of the head that change what it measures. */
#include "core/cast/disturbance.h"

#include <math.h>

#include "core/cast/echoes.h"
#include "core/vecmath.h"

void cast_wobble(const struct cast_disturbance *disturbance, int64_t t_ns, double *mirror_turn, double *pan_turn)
{
    for (uint32_t i = 0; i < disturbance->n_wobbles; i++) {
        const struct cast_wobble *w = &disturbance->wobble[i];
        double sine, cosine;
        vec_sincos_turn(1e-9 * (double)(t_ns - w->begin_ns) * w->hz, &sine, &cosine);
        *mirror_turn += w->mirror_turn * sine;
        *pan_turn += w->pan_turn * sine;
    }
}

/* The pan turns clockwise, from y to x. */
void caster_slip(const struct cast_disturbance *disturbance, double slip[9])
{
    double s, c;
    vec_sincos_turn(disturbance->slip_turn, &s, &c);
    const double m[9] = {c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0};
    for (int i = 0; i < 9; i++)
        slip[i] = m[i];
}

void caster_darken(struct echo_list *l)
{
    for (uint32_t i = 0; i < l->n; i++) {
        l->range_m[i] = (double)NAN;
        l->label[i] = 0;
        l->rho[i] = 0.0;
    }
}

void caster_weaken(const struct cast_disturbance *disturbance, uint32_t n, double *rho)
{
    for (uint32_t i = 0; i < n; i++)
        rho[i] *= disturbance->share;
}
