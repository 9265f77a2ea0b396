/* Amplitudes and widths of echoes, where a block has room for them. */
#include <math.h>

#include "core/cast/beam_work.h"
#include "core/vec3.h"
#include "core/vecmath.h"

/* There and back, in units of 0.01 ns. Floats hold all that is told: 16 bits. */
static const float CNS_PER_M = (float)(2e11 / 299792458.0);

VEC_CLONES
static void widths(const float *restrict width_m, const uint8_t *restrict echo, uint32_t n, uint16_t *restrict out)
{
    for (uint32_t i = 0; i < n; i++) {
        float cns = width_m[i] * CNS_PER_M + 0.5f;
        int32_t count = (int32_t)(cns < (float)LINE_WIDTH_MOST ? cns : (float)LINE_WIDTH_MOST); /* not-a-number: most */
        out[i] = (uint16_t)(echo[i] != 0 ? count : LINE_WIDTH_NONE);
    }
}

uint16_t caster_width(float width_m)
{
    const uint8_t is_echo = 1;
    uint16_t cns;
    widths(&width_m, &is_echo, 1, &cns);
    return cns;
}

void caster_widths(const struct line_block *block, uint32_t at, const float *width_m, uint32_t n)
{
    widths(width_m, block->echo + at, n, block->width_cns + at);
}

void caster_no_amplitudes(const struct line_block *block, uint32_t at, uint32_t n)
{
    int16_t *amplitude_cdb = block->amplitude_cdb + at;
    for (uint32_t i = 0; i < n; i++)
        amplitude_cdb[i] = LINE_AMPLITUDE_NONE;
}

void caster_pulse_attributes(const struct cast_setup *s, const struct line_block *block, uint32_t at, uint32_t n)
{
    const uint16_t pulse_cns = caster_width((float)s->pulse_m);
    const uint8_t *echo = block->echo + at;
    uint16_t *width_cns = block->width_cns + at;
    for (uint32_t i = 0; i < n; i++)
        width_cns[i] = echo[i] != 0 ? pulse_cns : (uint16_t)LINE_WIDTH_NONE;
    caster_no_amplitudes(block, at, n);
}

/* Beyond most the plane is along the beam. */
VEC_CLONES
static void plane_widths(float pulse2, float fixed, float per_range2, const float *restrict steep,
                         const double *restrict range_m, uint32_t n, float *restrict width_m)
{
    const float most = 1e12f;
    for (uint32_t i = 0; i < n; i++) {
        float x = (steep[i] < most ? steep[i] : most) - 1.0f, r = (float)range_m[i];
        x = x > 0.0f ? x : 0.0f;
        width_m[i] = sqrtf(pulse2 + (fixed + per_range2 * r * r) * x);
    }
}

void caster_plane_widths(const struct beam *beam, const float *steep, const double *range_m, uint32_t n, float *width_m)
{
    double term[2], full = 8.0 * M_LN2;
    beam_plane_variance(beam, term);
    plane_widths((float)(beam->resolution_m * beam->resolution_m), (float)(full * term[0]), (float)(full * term[1]),
                 steep, range_m, n, width_m);
}

/* The sub-ray at (x, y) begins at exit_radius (x e1 + y e2), with slope (x e2 - y e1): how the range changes with x and
 * y, to first order. */
float beam_part_sigma(const struct beam *beam, const double dir[3], const struct job *job, const double n[3],
                      double range_m, double xx, double xy, double yy)
{
    double along = vec3_dot(n, dir), a1 = vec3_dot(n, job->e1) / along, a2 = vec3_dot(n, job->e2) / along;
    double by_x = -beam->exit_radius_m * a1 - range_m * beam->slope * a2;
    double by_y = -beam->exit_radius_m * a2 + range_m * beam->slope * a1;
    double variance = by_x * by_x * xx + 2.0 * by_x * by_y * xy + by_y * by_y * yy;
    return (float)sqrt(variance > 0.0 ? variance : 0.0);
}

float beam_round_sigma(const struct beam *beam, double range_m, double cosine, double variance)
{
    double tan2 = 1.0 / fmax(cosine * cosine, 1e-12) - 1.0;
    return (float)(beam_radius(beam, range_m) * sqrt(fmax(0.0, variance * tan2)));
}

void caster_list_attributes(const struct echo_list *l, const struct line_block *block, uint32_t out)
{
    for (uint32_t i = 0; i < l->n; i++) {
        block->amplitude_cdb[out + i] = l->echo[i] != 0 ? l->amplitude_cdb[l->from[i]] : (int16_t)LINE_AMPLITUDE_NONE;
        block->width_cns[out + i] = l->echo[i] != 0 ? caster_width(l->width_m[l->from[i]]) : (uint16_t)LINE_WIDTH_NONE;
    }
}
