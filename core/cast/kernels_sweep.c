/* SPDX-License-Identifier: MIT */
/* Directions of a run whose axes turn evenly, by the addition theorems: sine and cosine are computed in the middle of
 * each block of a line, and turned from there by whole steps, whose sines are in a table. Blocks are counted from the
 * line's first pulse. So a pulse's direction depends only on its place in the line, however runs are cut.
 *
 * sin(a + b) = sin a + (sin a (cos b - 1) + cos a sin b): what is in brackets is small, and so is its rounding. With
 * the middle's sine in two doubles the sum is good to its last bit; tests/unit/test_sweep.c compares with
 * vec_sincos_turn. */
#include "core/cast/kernels_sweep.h"

#include <math.h>

#include "core/cast/aim_inline.h"

enum { BLOCK = KERNEL_BLOCK, MIDDLE = BLOCK / 2 };
/* Where blocks turn further than a sixteenth of a turn the bracket is no longer small. */
static const double MOST_TURN = 1.0 / 16.0;

VEC_CLONES
static void make_table(double step_turn, double *restrict sine, double *restrict cosine1)
{
    for (int k = 0; k < BLOCK; k++) {
        double s, c, half_s, half_c, turn = (double)(k - MIDDLE) * step_turn;
        vec_sincos_turn(turn, &s, &c);
        vec_sincos_turn(0.5 * turn, &half_s, &half_c);
        sine[k] = s;
        cosine1[k] = -2.0 * half_s * half_s;
    }
}

int kernel_sweep_steps(struct kernel_steps *steps, const struct schedule_run *run)
{
    const double mirror = (double)run->num * run->mirror_turn_per_r, pan = run->pan_step_turn;
    if (run->firing != NULL || !(fabs(mirror) * BLOCK <= MOST_TURN && fabs(pan) * BLOCK <= MOST_TURN)) return 0;
    if (steps->ready && steps->mirror_turn == mirror && steps->pan_turn == pan) return 1;
    make_table(mirror, steps->sm, steps->cm);
    make_table(pan, steps->sp, steps->cp);
    steps->mirror_turn = mirror;
    steps->pan_turn = pan;
    steps->ready = 1;
    return 1;
}

/* Sines and cosines of an axis in the middles of blocks: two doubles each. */
enum { ROOM = BVH_CHUNK / BLOCK + 2 };
struct middles {
    double sine[ROOM], sine1[ROOM], cosine[ROOM], cosine1[ROOM];
};

/* Finds the sines and cosines for block b at the turn zero + (count + b * more) * unit. The counts are whole numbers
 * below 2^53, so that a block's middle doesn't depend on which block comes first. */
VEC_INLINE void find_middles(double zero, double count, double more, double unit, uint32_t blocks, struct middles *m)
{
    for (uint32_t b = 0; b < blocks; b++) {
        double s[2], c[2];
        const double at = count + (double)(int32_t)b * more, turned = at * unit, turn = zero + turned;
        const double rest = vec_sum_rest(zero, turned, turn) + vec_product_rest(at, unit, turned);
        vec_sincos_turn_fine(turn, rest, s, c);
        m->sine[b] = s[0];
        m->sine1[b] = s[1];
        m->cosine[b] = c[0];
        m->cosine1[b] = c[1];
    }
}

/* The part of a line that the kernels work on. */
struct part {
    uint32_t blocks, skip; /* blocks that the pulses lie in; places in the first block before the first pulse */
    struct middles mirror, pan;
};

VEC_INLINE void begin(const struct kernel_pulses *sweep, struct part *p)
{
    const struct schedule_run *run = sweep->run;
    const uint32_t place = run->in_line + sweep->first, block = place / BLOCK;
    const double num = (double)run->num, middle = (double)block * BLOCK + MIDDLE;
    const double r = (double)run->r + (middle - (double)run->in_line) * num;
    p->skip = place % BLOCK;
    p->blocks = (p->skip + sweep->turns.n + BLOCK - 1) / BLOCK;
    find_middles(run->mirror0_turn, r, BLOCK * num, run->mirror_turn_per_r, p->blocks, &p->mirror);
    find_middles(run->pan0_turn, middle, BLOCK, run->pan_step_turn, p->blocks, &p->pan);
}

/* Turns by a step of the table from the middle of block b. */
VEC_INLINE void turn_on(const struct middles *m, uint32_t b, double s, double c1, double *sine, double *cosine)
{
    *sine = m->sine[b] + (m->sine1[b] + (m->sine[b] * c1 + m->cosine[b] * s));
    *cosine = m->cosine[b] + (m->cosine1[b] + (m->cosine[b] * c1 - m->sine[b] * s));
}

/* Callers pass a pointer or the constant NULL for `reading`, so that the compiler makes a loop for each case. */
VEC_INLINE void sweep_blocks(const struct kernel_steps *steps, const struct kernel_pulses *sweep,
                             const double rotation[9], const struct vec3_out *out, const struct kernel_reading *reading)
{
    const struct aim_reading r = reading != NULL ? aim_reading(reading) : (struct aim_reading){.mirror = {0.0, 0.0}};
    const struct aim_matrix m = aim_matrix(rotation);
    const struct vec3_out *read = reading != NULL ? &reading->e : out;
    const double *sin_m = steps->sm, *cos_m = steps->cm, *sin_p = steps->sp, *cos_p = steps->cp;
    const uint32_t n = sweep->turns.n;
    struct part p;
    begin(sweep, &p);
    for (uint32_t b = 0, at = 0, k = p.skip; b < p.blocks; b++, k = 0) {
        const uint32_t count = n - at < BLOCK - k ? n - at : BLOCK - k;
        const double *mirror_turn = sweep->turns.mirror + at, *pan_turn = sweep->turns.pan + at;
        const struct vec3_out d = VEC3_OUT(*out, at), e = VEC3_OUT(*read, at);
        VEC_LOOP
        for (uint32_t i = 0; i < count; i++) {
            struct aim_axes a;
            turn_on(&p.mirror, b, sin_m[k + i], cos_m[k + i], &a.sm, &a.cm);
            turn_on(&p.pan, b, sin_p[k + i], cos_p[k + i], &a.sp, &a.cp);
            aim_direction(m, a, d, i);
            if (reading != NULL) aim_direction_read(r, mirror_turn[i], pan_turn[i], a, e, i);
        }
        at += count;
    }
}

VEC_CLONES
void kernel_sweep(const struct kernel_steps *steps, const struct kernel_pulses *sweep, const double rotation[9],
                  const struct vec3_out *out, const struct kernel_reading *reading)
{
    if (reading != NULL)
        sweep_blocks(steps, sweep, rotation, out, reading);
    else
        sweep_blocks(steps, sweep, rotation, out, NULL);
}
