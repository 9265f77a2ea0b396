/* SPDX-License-Identifier: MIT */
#include "core/cast/kernels_aim.h"

#include "core/cast/aim_inline.h"

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

/* Callers pass a pointer or the constant NULL, so that the compiler makes a loop for each case. */
VEC_INLINE void directions(const struct kernel_turns *turns, const double rotation[9], const struct vec3_out *out,
                           const struct kernel_reading *reading)
{
    const struct aim_reading r = reading != NULL ? aim_reading(reading) : (struct aim_reading){.mirror = {0.0, 0.0}};
    const struct aim_matrix m = aim_matrix(rotation);
    const struct kernel_turns t = *turns;
    const struct vec3_out d = *out, e = reading != NULL ? reading->e : d;
    VEC_LOOP
    for (uint32_t i = 0; i < t.n; i++) {
        struct aim_axes a;
        vec_sincos_turn(t.mirror[i], &a.sm, &a.cm);
        vec_sincos_turn(t.pan[i], &a.sp, &a.cp);
        aim_direction(m, a, d, i);
        if (reading != NULL) aim_direction_read(r, t.mirror[i], t.pan[i], a, e, i);
    }
}

VEC_CLONES
void kernel_directions(const struct kernel_turns *turns, const double rotation[9], const struct vec3_out *out,
                       const struct kernel_reading *reading)
{
    if (reading != NULL)
        directions(turns, rotation, out, reading);
    else
        directions(turns, rotation, out, NULL);
}
