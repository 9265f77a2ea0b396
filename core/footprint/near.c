/* SPDX-License-Identifier: MIT */
/* Finds pulses near outlines, by the cells of their directions. */
#include <math.h>

#include "core/bytes.h"
#include "core/footprint/outlines.h"
#include "core/vecmath.h"

enum { TOGETHER = 8 }; /* pulses on either side of the one that is looked up */

/* Square of the longest way from one direction to the next. */
VEC_CLONES
static float longest_step2(const struct vec3_floats *dir, uint32_t n)
{
    const float *dx = dir->x, *dy = dir->y, *dz = dir->z;
    uint32_t most = 0;
    for (uint32_t i = 0; i + 1 < n; i++) {
        float x = dx[i + 1] - dx[i], y = dy[i + 1] - dy[i], z = dz[i + 1] - dz[i], step2 = x * x + y * y + z * z;
        const uint32_t bits = float_bits(step2); /* they have the order of the floats, since none is negative */
        most = bits > most ? bits : most;
    }
    return bits_float(most);
}

VEC_CLONES
static void cells_of(const struct vec3_floats *dir, uint32_t n, uint32_t *restrict cell)
{
    const float *dx = dir->x, *dy = dir->y, *dz = dir->z;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++)
        cell[i] = outline_cell(dx[i], dy[i], dz[i]);
}

/* Directions looked up together. */
struct gathered {
    float x[BEAM_NEAR_MOST], y[BEAM_NEAR_MOST], z[BEAM_NEAR_MOST];
    uint32_t cell[BEAM_NEAR_MOST];
};

static void take_direction(struct gathered *all, uint32_t to, const struct vec3_floats *dir, uint32_t from)
{
    all->x[to] = dir->x[from];
    all->y[to] = dir->y[from];
    all->z[to] = dir->z[from];
}

static int is_set(const uint32_t *bits, uint32_t cell)
{
    return bits[cell / 32] >> cell % 32 & 1;
}

/* Lists pulses that may have outlines near them. Only the middle one of a group is looked up; the group has up to
 * TOGETHER pulses on either side of it. */
static uint32_t list_around(const struct beam_outlines *o, const struct vec3_floats *dir, uint32_t n,
                            struct gathered *all, uint32_t *pulse)
{
    const float reach = (float)OUTLINE_AROUND_RAD, step = sqrtf(longest_step2(dir, n)) + 1e-6f;
    const uint32_t half = step * TOGETHER > reach ? (uint32_t)(reach / step) : TOGETHER, group = 2 * half + 1;
    uint32_t found = 0, groups = 0, base = 0;
    if (n == 0) return 0;
    do {
        uint32_t middle = base + half < n ? base + half : n - 1;
        take_direction(all, groups++, dir, middle);
        base += group;
    } while (base < n);
    cells_of(&(struct vec3_floats){all->x, all->y, all->z}, groups, all->cell);
    for (uint32_t k = 0; k < groups; k++) {
        uint32_t end = (k + 1) * group < n ? (k + 1) * group : n;
        for (uint32_t i = k * group; i < end && is_set(o->around, all->cell[k]); i++)
            pulse[found++] = i;
    }
    return found;
}

/* Finds the pulses whose cells list edges; near->first: the cell. */
static uint32_t in_cells(const struct beam_outlines *o, const struct vec3_floats *dir, uint32_t n,
                         struct beam_near *near)
{
    struct gathered all;
    uint32_t pulse[BEAM_NEAR_MOST], around = list_around(o, dir, n, &all, pulse), found = 0;
    for (uint32_t k = 0; k < around; k++)
        take_direction(&all, k, dir, pulse[k]);
    cells_of(&(struct vec3_floats){all.x, all.y, all.z}, around, all.cell);
    for (uint32_t k = 0; k < around; k++) {
        near[found].pulse = pulse[k];
        near[found].first = all.cell[k];
        found += (uint32_t)is_set(o->any, all.cell[k]);
    }
    return found;
}

/* Prefetches the data that beam_find_lines will read, step by step for all pulses at once. */
static void look_up(const struct beam_outlines *o, struct beam_near *near, uint32_t n)
{
    for (uint32_t k = 0; k < n; k++)
        __builtin_prefetch(&o->first[near[k].first], 0, 3);
    for (uint32_t k = 0; k < n; k++) {
        const uint32_t *first = &o->first[near[k].first];
        near[k].first = first[0];
        near[k].end = first[1];
        __builtin_prefetch(&o->entry[first[0]], 0, 3);
    }
}

/* Most cells list no edge. A cell that lists edges is mostly wider than the footprint. So the function passes over a
 * cell's first edges as long as the footprint does not reach their planes. beam_find_lines examines the edges that are
 * left, and compares their ranges. */
uint32_t beam_near_outlines(const struct beam_outlines *o, const struct beam *beam, const struct vec3_floats *dir,
                            uint32_t n, struct beam_near *near)
{
    uint32_t left = 0;
    if (o->n_entries == 0) return 0;
    uint32_t found = in_cells(o, dir, n, near);
    look_up(o, near, found);
    for (uint32_t k = 0; k < found; k++) {
        struct beam_near one = near[k];
        const float d[3] = VEC3_AT(*dir, one.pulse);
        while (one.first < one.end && outline_is_clear(beam, &o->entry[one.first], d))
            one.first++;
        if (one.first == one.end) continue;
        __builtin_prefetch(&o->edge[o->entry[one.first].edge], 0, 3);
        near[left++] = one;
    }
    return left;
}
