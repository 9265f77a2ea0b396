/* SPDX-License-Identifier: MIT */
#include "core/instrument.h"

#include <math.h>

#include "core/rng.h"

static int reads_true(const struct instrument_encoder *e)
{
    return e->index_rad == 0.0 && e->scale == 0.0 && e->eccentricity_rad == 0.0;
}

int instrument_has_offset(const struct instrument *k)
{
    return k->transit_offset_m != 0.0 || k->mirror_offset_m != 0.0;
}

int instrument_is_ideal(const struct instrument *k)
{
    return k->collimation_rad == 0.0 && k->trunnion_rad == 0.0 && !instrument_has_offset(k) && reads_true(&k->mirror) &&
           reads_true(&k->pan) && k->range_offset_m == 0.0 && k->range_scale == 0.0 && k->mirror_sigma_rad == 0.0 &&
           k->pan_sigma_rad == 0.0;
}

VEC_CLONES
static void directions(const struct instrument *k, const struct instrument_turns *turns, const struct vec3_out *out)
{
    const double st = sin(k->trunnion_rad), ct = cos(k->trunnion_rad), sc = sin(k->collimation_rad);
    const double cc = cos(k->collimation_rad);
    const double mirror_sigma = k->mirror_sigma_rad / VEC_TURN_RAD, pan_sigma = k->pan_sigma_rad / VEC_TURN_RAD;
    const uint64_t mirror_key = k->mirror_key ^ turns->scan_key, pan_key = k->pan_key ^ turns->scan_key;
    const struct instrument_turns t = *turns;
    const struct vec3_out s = *out;
    VEC_LOOP
    for (uint32_t i = 0; i < t.n; i++) {
        double sm, cm, sp, cp;
        vec_sincos_turn(t.mirror[i] + mirror_sigma * rng_normal(mirror_key, t.pulse0 + i), &sm, &cm);
        vec_sincos_turn(t.pan[i] + pan_sigma * rng_normal(pan_key, t.pulse0 + i), &sp, &cp);
        double x = sc * ct + cc * sm * st, y = cc * cm, z = cc * sm * ct - sc * st;
        s.x[i] = cp * x + sp * y;
        s.y[i] = cp * y - sp * x;
        s.z[i] = z;
    }
}

VEC_CLONES
static void origins(const struct instrument *k, const struct instrument_turns *turns, const struct vec3_out *out)
{
    const double right_m = k->mirror_offset_m, ahead_m = k->transit_offset_m;
    const struct instrument_turns t = *turns;
    const struct vec3_out o = *out;
    VEC_LOOP
    for (uint32_t i = 0; i < t.n; i++) {
        double sp, cp;
        vec_sincos_turn(t.pan[i], &sp, &cp);
        o.x[i] = cp * right_m + sp * ahead_m;
        o.y[i] = cp * ahead_m - sp * right_m;
        o.z[i] = 0.0;
    }
}

void instrument_aim(const struct instrument *k, const struct instrument_turns *turns, const struct vec3_out *s,
                    const struct vec3_out *o)
{
    directions(k, turns, s);
    if (o->x != NULL) origins(k, turns, o);
}

VEC_CLONES
static void read_encoder(const struct instrument_encoder *e, uint32_t n, double *restrict turn)
{
    const double index = e->index_rad / VEC_TURN_RAD, scale = e->scale, phase = e->phase_rad / VEC_TURN_RAD;
    const double eccentricity = e->eccentricity_rad / VEC_TURN_RAD;
    for (uint32_t i = 0; i < n; i++) {
        double s, c;
        vec_sincos_turn(turn[i] - phase, &s, &c);
        turn[i] += index + scale * turn[i] + eccentricity * s;
    }
}

void instrument_read(const struct instrument *k, uint32_t n, double *mirror_turn, double *pan_turn)
{
    if (!reads_true(&k->mirror)) read_encoder(&k->mirror, n, mirror_turn);
    if (!reads_true(&k->pan)) read_encoder(&k->pan, n, pan_turn);
}

VEC_CLONES
void instrument_range(const struct instrument *k, uint32_t n, double *restrict range_m)
{
    const double offset_m = k->range_offset_m, scale = k->range_scale;
    for (uint32_t i = 0; i < n; i++)
        range_m[i] += offset_m + scale * range_m[i];
}
