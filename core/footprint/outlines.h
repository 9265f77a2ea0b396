/* SPDX-License-Identifier: MIT */
/* Private to core/footprint: outlines of a scene from a station, and the cells of direction that lead to
 * them.
 *
 * A direction belongs to a cell on a face of a cube, with n x n cells each. Let z be its largest component:
 * the cell follows from x / |z| and y / |z|, both from -1 to 1. */
#ifndef CORE_FOOTPRINT_OUTLINES_H
#define CORE_FOOTPRINT_OUTLINES_H

#include "core/footprint.h"

enum { OUTLINE_CELLS = 512 }; /* along a face: 3.9 mrad in its middle, about half of that in its corners */

/* A group of pulses is looked up by its middle one, where all others are within this angle of it. */
#define OUTLINE_AROUND_RAD 4e-3

/* An edge's ends, relative to the station. */
struct outline_edge {
    float a[3], b[3];
};

struct outline_entry {
    float range_m;   /* of the nearest point of the edge, in or near the cell */
    float normal[3]; /* of unit length, of the plane through the station and the edge */
    uint32_t edge;
};

struct beam_outlines {
    uint32_t n_edges;
    struct outline_edge *edge;
    uint32_t *first;             /* entries of cell c: first[c] .. first[c + 1] */
    uint32_t *any;               /* a bit for each cell: it has entries */
    uint32_t *around;            /* a bit for each cell: some cell within OUTLINE_AROUND_RAD of it has entries */
    struct outline_entry *entry; /* by range */
    uint64_t n_entries;
};

/* Part of an edge that counts as an outline, relative to the station. */
struct outline_stretch {
    double p[3], q[3];
    uint32_t edge;
};

/* probe.c: looks along both sides of a piece of an edge. */
enum { PROBE_MOST = BEAM_PROBE_MOST / 2 };
struct outline_prober {
    const struct beam_probe *probe; /* NULL: everything counts */
    const struct beam *beam;
    struct {
        double x[2 * PROBE_MOST], y[2 * PROBE_MOST], z[2 * PROBE_MOST];
    } dir;
    double range_m[2 * PROBE_MOST];
    uint16_t kind[2 * PROBE_MOST];
    uint8_t counts[PROBE_MOST];
};
/* Divides the piece from p to q into equal parts, each about a footprint's radius, or longer where PROBE_MOST parts
 * would not be enough. Returns the number n of parts. Sets prober->counts[0] .. [n - 1]: 1 where the part counts as an
 * outline. */
uint32_t outline_probe(struct outline_prober *prober, const double p[3], const double q[3], double range_m);

/* weld.c: finds the outlines among the edges of a scene, and sets o->edge and o->n_edges. */
int outline_find(const struct beam_outlines_spec *spec, struct beam_outlines *o, struct sh_err *err);

/* Cells lie in tiles of 4 x 4: `first` of a tile is one cache line. */
static inline uint32_t outline_place(uint32_t face, uint32_t i, uint32_t j)
{
    const uint32_t tiles = OUTLINE_CELLS / 4;
    return ((face * tiles + j / 4) * tiles + i / 4) * 16 + j % 4 * 4 + i % 4;
}

/* Float is enough: cells also list edges up to a hundredth of a cell beside them. */
static inline __attribute__((always_inline)) uint32_t outline_cell(float dx, float dy, float dz)
{
    const float ax = __builtin_fabsf(dx), ay = __builtin_fabsf(dy), az = __builtin_fabsf(dz);
    const float half = 0.5f * OUTLINE_CELLS;
    uint32_t is_x = (ax >= ay) & (ax >= az), is_y = (ay >= az) & !is_x;
    float along = is_x ? dx : is_y ? dy : dz;
    float u = is_x ? dy : is_y ? dz : dx, v = is_x ? dz : is_y ? dx : dy;
    uint32_t face = (is_x ? 0U : is_y ? 2U : 4U) + (along < 0.0f);
    float scale = half / __builtin_fabsf(along);
    int32_t i = (int32_t)(u * scale + half), j = (int32_t)(v * scale + half);
    i = i < OUTLINE_CELLS ? i : OUTLINE_CELLS - 1;
    j = j < OUTLINE_CELLS ? j : OUTLINE_CELLS - 1;
    return outline_place(face, (uint32_t)i, (uint32_t)j);
}

/* Whether the footprint is clear of the plane through the station and the edge, as most are. The footprint is widest,
 * as an angle, where the edge is nearest. */
static inline int outline_is_clear(const struct beam *beam, const struct outline_entry *entry, const float d[3])
{
    const float exit = 1.01f * (float)beam->exit_radius_m, slope = 1.01f * (float)beam->slope, range = entry->range_m;
    float away = (entry->normal[0] * d[0] + entry->normal[1] * d[1] + entry->normal[2] * d[2]) * range;
    return away * away > exit * exit + slope * slope * range * range;
}

#endif
