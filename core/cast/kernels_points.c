/* SPDX-License-Identifier: MIT */
#include "core/cast/kernels_points.h"

#include <math.h>

#include "core/cast/kernels_aim.h"
#include "core/light.h"
#include "core/rng.h"
#include "core/vecmath.h"

VEC_CLONES
void kernel_limit(double *restrict range_m, double min_m, double max_m, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++)
        range_m[i] = ((range_m[i] >= min_m) & (range_m[i] <= max_m)) ? range_m[i] : (double)NAN;
}

VEC_CLONES
int kernel_has_low(const double *restrict range_m, double limit_m, uint32_t n)
{
    uint64_t low = 0;
    for (uint32_t i = 0; i < n; i++)
        low += range_m[i] <= limit_m; /* not for NaN */
    return low != 0;
}

VEC_CLONES
void kernel_keys(uint64_t pulse0, const uint8_t *restrict number, uint32_t n, uint64_t *restrict key)
{
    for (uint32_t i = 0; i < n; i++)
        key[i] = rng_echo(pulse0 + i, number[i]);
}

VEC_CLONES
uint32_t kernel_entries(const double *restrict range_m, const uint32_t *restrict label, uint32_t n,
                        uint8_t *restrict echo, uint16_t *restrict out)
{
    uint32_t echoes = 0;
    for (uint32_t i = 0; i < n; i++) {
        uint32_t is_echo = range_m[i] == range_m[i];
        echo[i] = (uint8_t)(is_echo * 0x11);
        out[i] = (uint16_t)(is_echo ? label[i] : (uint32_t)LINE_LABEL_NONE);
        echoes += is_echo;
    }
    return echoes;
}

VEC_CLONES
uint32_t kernel_count_echoes(const double *restrict range_m, uint32_t n)
{
    uint64_t echoes = 0;
    for (uint32_t i = 0; i < n; i++)
        echoes += range_m[i] == range_m[i];
    return (uint32_t)echoes;
}

VEC_CLONES
void kernel_values(const int16_t *restrict value, const uint8_t *restrict echo, uint32_t n, int16_t none,
                   int16_t *restrict out)
{
    for (uint32_t i = 0; i < n; i++) {
        const int16_t its = value[i]; /* read in any case, so that there is no branch */
        out[i] = echo[i] != 0 ? its : none;
    }
}

/* Widths in range become times back and forth, in units of 0.01 ns. Floats are exact enough for the 16 bits sent. */
VEC_CLONES
void kernel_widths(const float *restrict width_m, const uint8_t *restrict echo, uint32_t n, uint16_t *restrict out)
{
    const float cns_per_m = (float)(2e11 / LIGHT_SPEED_M_S);
    for (uint32_t i = 0; i < n; i++) {
        float cns = width_m[i] * cns_per_m + 0.5f;
        int32_t count = (int32_t)(cns < (float)LINE_WIDTH_MOST ? cns : (float)LINE_WIDTH_MOST); /* NaN: most */
        out[i] = (uint16_t)(echo[i] != 0 ? count : LINE_WIDTH_NONE);
    }
}

VEC_CLONES
void kernel_polar(const struct cast_setup *setup, const double *restrict range_m, const struct kernel_turns *turns,
                  const struct kernel_wire *out)
{
    const double per_m = 1.0 / setup->range_scale_m, mirror_counts = setup->mirror_counts;
    const double pan_counts = setup->pan_counts, *restrict mirror_turn = turns->mirror, *restrict pan_turn = turns->pan;
    uint32_t *restrict a = out->a, *restrict b = out->b, *restrict c = out->c;
    const uint32_t n = turns->n;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        uint64_t bits;
        double range = range_m[i] > 0.0 ? range_m[i] : 0.0; /* NaN, and noise below zero, read 0 */
        vec_round(range * per_m, &bits);
        a[i] = (uint32_t)bits;
    }
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++)
        b[i] = instrument_encoder_count(mirror_turn[i], mirror_counts);
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++)
        c[i] = instrument_encoder_count(pan_turn[i], pan_counts);
}

VEC_CLONES
static uint32_t counts_of(const double *restrict x, double per_unit, uint32_t n, uint32_t *restrict out)
{
    uint64_t unfit = 0;
    for (uint32_t i = 0; i < n; i++) {
        uint64_t bits;
        double count = x[i] * per_unit;
        vec_round(count, &bits);
        uint64_t fits = fabs(count) < 2147483647.0; /* NaN does not */
        unfit += (uint64_t)(x[i] == x[i]) & (fits ^ 1);
        bits = fits ? bits : (uint64_t)(uint32_t)LINE_XYZ_NONE;
        out[i] = (uint32_t)bits;
    }
    return (uint32_t)unfit;
}

uint32_t kernel_geo(const struct vec3_in *p, const double scale[3], uint32_t n, const struct kernel_wire *out)
{
    return counts_of(p->x, 1.0 / scale[0], n, out->a) + counts_of(p->y, 1.0 / scale[1], n, out->b) +
           counts_of(p->z, 1.0 / scale[2], n, out->c);
}

/* All three coordinates are NaN, or none is. Where one does not fit, all three are LINE_XYZ_NONE: the
 * entry is no echo. */
VEC_CLONES
uint32_t kernel_place(const struct vec3_in *direction, const double *restrict range_m, const double scale[3],
                      uint32_t n, const struct kernel_wire *out)
{
    const double per_x = 1.0 / scale[0], per_y = 1.0 / scale[1], per_z = 1.0 / scale[2];
    const double *restrict dx = direction->x, *restrict dy = direction->y, *restrict dz = direction->z;
    uint32_t *restrict a = out->a, *restrict b = out->b, *restrict c = out->c;
    uint64_t unfit = 0;
    for (uint32_t i = 0; i < n; i++) {
        uint64_t x_bits, y_bits, z_bits;
        double x = dx[i] * range_m[i] * per_x, y = dy[i] * range_m[i] * per_y, z = dz[i] * range_m[i] * per_z;
        double most = fabs(x) > fabs(y) ? fabs(x) : fabs(y);
        most = most > fabs(z) ? most : fabs(z);
        uint64_t fits = most < 2147483647.0;
        vec_round(x, &x_bits);
        vec_round(y, &y_bits);
        vec_round(z, &z_bits);
        unfit |= (uint64_t)(range_m[i] == range_m[i]) & (fits ^ 1);
        a[i] = (uint32_t)(fits ? x_bits : (uint64_t)(uint32_t)LINE_XYZ_NONE);
        b[i] = (uint32_t)(fits ? y_bits : (uint64_t)(uint32_t)LINE_XYZ_NONE);
        c[i] = (uint32_t)(fits ? z_bits : (uint64_t)(uint32_t)LINE_XYZ_NONE);
    }
    return (uint32_t)unfit;
}

VEC_CLONES
void kernel_scale(const double *restrict range_m, uint32_t n, const struct vec3_out *position)
{
    const struct vec3_out e = *position;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        e.x[i] *= range_m[i];
        e.y[i] *= range_m[i];
        e.z[i] *= range_m[i];
    }
}
