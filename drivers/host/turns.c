/* SPDX-License-Identifier: MIT */
/* Sines of angles. Angles are in turns, so that none has to be reduced by an inexact pi. */
#include <math.h>

#include "core/vecmath.h"
#include "drivers/host/host.h"

#define TWO_PI 6.283185307179586476925

void host_turn_table(struct scanhead *sh)
{
    for (int i = 0; i < HOST_TURN_PARTS; i++) {
        double a = TWO_PI * i / HOST_TURN_PARTS;
        sh->turn_part[i] = (struct host_turn_part){sin(a), cos(a)};
    }
}

/* Returns the largest whole number that is not above x. |x| < 2^51. */
VEC_INLINE double floor_of(double x, uint64_t *bits)
{
    const double near = vec_round(x, bits);
    const uint64_t above = near > x;
    *bits -= above;
    return near - (double)(int)above;
}

/* Finds the entry of the table that is nearest to u[i] >= 0 turns, and the rest of the angle in radians. */
VEC_CLONES static void split_turns(const double *restrict u, int n, uint32_t *restrict part, double *restrict rest_rad)
{
    for (int i = 0; i < n; i++) {
        const double parts = u[i] * HOST_TURN_PARTS;
        uint64_t k;
        const double whole = floor_of(parts + 0.5, &k);
        part[i] = (uint32_t)k & (HOST_TURN_PARTS - 1);
        rest_rad[i] = (parts - whole) * (TWO_PI / HOST_TURN_PARTS);
    }
}

/* |r| <= pi/256, so the first terms left out, r^7/7! and r^8/8!, are below 2^-56 and 2^-66. The rounding of the angle
 * itself is far larger. */
VEC_CLONES static void add_rests(const struct host_turn_part *restrict part, const double *restrict rest_rad, int n,
                                 double *restrict s, double *restrict c)
{
    for (int i = 0; i < n; i++) {
        const double r = rest_rad[i], r2 = r * r;
        const double sin_r = r + r * r2 * (-1.0 / 6 + r2 * (1.0 / 120));
        const double cos_r_1 = r2 * (-0.5 + r2 * (1.0 / 24 - r2 * (1.0 / 720)));
        const double sk = part[i].sine, ck = part[i].cosine;
        s[i] = sk + (ck * sin_r + sk * cos_r_1);
        c[i] = ck + (ck * cos_r_1 - sk * sin_r);
    }
}

/* The table is read between the loops of vectors, one whole part at a time. Reading so costs less than gathering the
 * table's figures into vectors. */
void host_sincos_turns(const struct host_turn_part *table, const double *u, int n, double *s, double *c)
{
    uint32_t k[HOST_BLOCK];
    double rest_rad[HOST_BLOCK];
    struct host_turn_part part[HOST_BLOCK];
    split_turns(u, n, k, rest_rad);
    for (int i = 0; i < n; i++)
        part[i] = table[k[i]];
    add_rests(part, rest_rad, n, s, c);
}

VEC_CLONES void host_fold_turns(const double *restrict u, int n, double lo, double *restrict rad)
{
    for (int i = 0; i < n; i++) {
        uint64_t unused;
        rad[i] = TWO_PI * (u[i] - floor_of(u[i] - lo, &unused));
    }
}
