/* SPDX-License-Identifier: MIT */
#include "core/cast/kernels.h"

#include <math.h>

#include "core/cast/aim_inline.h"
#include "core/light.h"
#include "core/rng.h"
#include "core/vecmath.h"

VEC_CLONES
void kernel_angles(const struct schedule_run *run, uint32_t first, uint32_t n, double *restrict mirror_turn,
                   double *restrict pan_turn)
{
    const double mirror0 = run->mirror0_turn, per_r = run->mirror_turn_per_r, pan0 = run->pan0_turn;
    const double step = run->pan_step_turn, place0 = (double)(run->in_line + first);
    const double r0 = (double)(run->r + first * run->num), num = (double)run->num; /* r < 2^53 */
    for (uint32_t i = 0; i < n; i++) {
        mirror_turn[i] = mirror0 + (r0 + (double)(int32_t)i * num) * per_r;
        pan_turn[i] = pan0 + (place0 + (double)(int32_t)i) * step;
    }
}

void kernel_angles_table(const struct schedule_run *run, uint32_t first, uint32_t n, double *restrict mirror_turn,
                         double *restrict pan_turn)
{
    const uint64_t from = run->firing_at + (uint64_t)first, begin = run->firing[run->firing_at].tick;
    uint32_t at = (uint32_t)(from % run->n_firings);
    uint64_t r0 = run->r + (from / run->n_firings * run->sequence_ticks - begin) * run->num;
    for (uint32_t i = 0; i < n; i++) {
        const struct emitter_firing *f = &run->firing[at];
        mirror_turn[i] = f->mirror_turn;
        pan_turn[i] = (double)(r0 + f->tick * run->num) * run->pan_turn_per_r + f->pan_turn;
        if (++at < run->n_firings) continue;
        at = 0;
        r0 += run->sequence_ticks * run->num;
    }
}

VEC_CLONES
void kernel_directions(const struct kernel_turns *turns, const double rotation[9], const struct vec3_out *out)
{
    const struct aim_matrix m = aim_matrix(rotation);
    const struct kernel_turns t = *turns;
    const struct vec3_out d = *out;
    VEC_LOOP
    for (uint32_t i = 0; i < t.n; i++) {
        double sm, cm, sp, cp;
        vec_sincos_turn(t.mirror[i], &sm, &cm);
        vec_sincos_turn(t.pan[i], &sp, &cp);
        aim_direction(m, sm, cm, sp, cp, d, i);
    }
}

VEC_CLONES
void kernel_directions_read(const struct cast_setup *setup, const struct kernel_turns *turns, const double rotation[9],
                            const double to_crs[9], const struct vec3_out *out, const struct vec3_out *read)
{
    const struct aim_encoder mirror = aim_encoder(setup, setup->mirror_counts);
    const struct aim_encoder pan = aim_encoder(setup, setup->pan_counts);
    const struct aim_matrix m = aim_matrix(rotation), q = aim_matrix(to_crs);
    const struct kernel_turns t = *turns;
    const struct vec3_out d = *out, e = *read;
    VEC_LOOP
    for (uint32_t i = 0; i < t.n; i++) {
        double sm, cm, sp, cp;
        vec_sincos_turn(t.mirror[i], &sm, &cm);
        vec_sincos_turn(t.pan[i], &sp, &cp);
        aim_direction(m, sm, cm, sp, cp, d, i);
        aim_read(mirror, t.mirror[i], &sm, &cm);
        aim_read(pan, t.pan[i], &sp, &cp);
        aim_direction(q, sm, cm, sp, cp, e, i);
    }
}

VEC_CLONES
int kernel_meets_sphere(const struct vec3_in *dir, uint32_t n, const double v[3], double radius_m)
{
    const double x = v[0], y = v[1], z = v[2], v2 = x * x + y * y + z * z, r2 = radius_m * radius_m;
    const struct vec3_in d = *dir;
    uint64_t meets = v2 <= r2;
    for (uint32_t i = 0; i < n; i++) {
        double along = x * d.x[i] + y * d.y[i] + z * d.z[i];
        uint64_t near = v2 - along * along <= r2, ahead = along > 0.0;
        meets |= near & ahead;
    }
    return meets != 0;
}

VEC_CLONES
void kernel_turn_back(const struct vec3_in *from, const double m[9], uint32_t n, const struct vec3_out *to)
{
    const double m0 = m[0], m1 = m[1], m2 = m[2], m3 = m[3], m4 = m[4], m5 = m[5], m6 = m[6], m7 = m[7], m8 = m[8];
    const struct vec3_in d = *from;
    const struct vec3_out e = *to;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        double x = d.x[i], y = d.y[i], z = d.z[i];
        e.x[i] = m0 * x + m3 * y + m6 * z;
        e.y[i] = m1 * x + m4 * y + m7 * z;
        e.z[i] = m2 * x + m5 * y + m8 * z;
    }
}

VEC_CLONES
void kernel_limit(double *restrict range_m, double min_m, double max_m, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++)
        range_m[i] = ((range_m[i] >= min_m) & (range_m[i] <= max_m)) ? range_m[i] : (double)NAN;
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

/* Back and forth, in units of 0.01 ns. Floats hold all that is sent: 16 bits. */
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

/* Whole counts of an angle modulo a turn. */
VEC_INLINE uint32_t count_of(double turn, double counts)
{
    uint64_t bits;
    double below = vec_round(turn - 0.5, &bits); /* floor, up to a tie that the next line undoes */
    double within = turn - below;
    within = within >= 1.0 ? within - 1.0 : within;
    double count = vec_round(within * counts, &bits);
    bits = count >= counts ? 0 : bits;
    return (uint32_t)bits;
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
        b[i] = count_of(mirror_turn[i], mirror_counts);
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++)
        c[i] = count_of(pan_turn[i], pan_counts);
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

/* A sequence's firings are a few ticks apart. */
static void times_of_table(const struct schedule_run *run, uint32_t *dt_ns)
{
    const uint64_t begin = run->firing[run->firing_at].tick;
    uint64_t base = 0;
    uint32_t at = run->firing_at;
    for (uint32_t i = 0; i < run->n; i++) {
        const uint64_t d = base + run->firing[at].tick - begin;
        dt_ns[i] = (uint32_t)(d * (uint64_t)run->ns_quot + (run->ns_acc + d * run->ns_rem) / run->ns_den);
        if (++at < run->n_firings) continue;
        at = 0;
        base += run->sequence_ticks;
    }
}

/* The time of TIMES pulses: whole nanoseconds, and a rest in 1 / den, below den. */
enum { TIMES = 64 };
struct times {
    int64_t part[TIMES + 1];
    uint32_t ns[TIMES + 1];
};

/* The remainder is below the divisor, so each step adds the quotient or one more. */
static void make_times(const struct schedule_run *run, uint32_t n, struct times *t)
{
    const int64_t rem = (int64_t)run->ns_rem, den = (int64_t)run->ns_den;
    int64_t part = 0;
    uint32_t ns = 0;
    for (uint32_t i = 0; i <= n; i++) {
        t->part[i] = part;
        t->ns[i] = ns;
        part += rem;
        ns += (uint32_t)run->ns_quot + (part >= den);
        part -= part >= den ? den : 0;
    }
}

VEC_CLONES
static void add_times(const struct times *t, uint32_t begin_ns, int64_t begin_part, int64_t den, uint32_t n,
                      uint32_t *restrict dt_ns)
{
    const int64_t *restrict part = t->part;
    const uint32_t *restrict ns = t->ns;
    for (uint32_t i = 0; i < n; i++)
        dt_ns[i] = begin_ns + ns[i] + (begin_part + part[i] >= den);
}

/* Block by block. */
void kernel_times(const struct schedule_run *run, uint32_t *dt_ns)
{
    const int64_t den = (int64_t)run->ns_den; /* below 2^62, as pulse rates are */
    int64_t part = (int64_t)run->ns_acc;
    uint32_t ns = 0;
    struct times t;
    if (run->sequence_ticks != 0) {
        times_of_table(run, dt_ns);
        return;
    }
    make_times(run, run->n < TIMES ? run->n : TIMES, &t);
    for (uint32_t at = 0, n; at < run->n; at += n) {
        n = run->n - at < TIMES ? run->n - at : TIMES;
        add_times(&t, ns, part, den, n, dt_ns + at);
        part += t.part[n];
        ns += t.ns[n] + (part >= den);
        part -= part >= den ? den : 0;
    }
}
