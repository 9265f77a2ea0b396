/* Private to core/beam: outlines of a scene from a station, and the cells of direction that lead to them.
 *
 * Directions are cells of a cube's faces, n x n each: x / |z| and y / |z| of the axis with the largest component, from
 * -1 to 1. */
#ifndef CORE_BEAM_OUTLINES_H
#define CORE_BEAM_OUTLINES_H

#include "core/beam.h"

enum { OUTLINE_CELLS = 768 }; /* along a face: 2.6 mrad in its middle, half of that in its corners */

/* An edge's ends, from the station. */
struct outline_edge {
    float a[3], b[3];
};

struct outline_entry {
    float range_m; /* of the nearest point of the edge, in or near the cell */
    uint32_t edge;
};

struct beam_outlines {
    uint32_t n_edges;
    struct outline_edge *edge;
    uint32_t *first;     /* entries of cell c: first[c] .. first[c + 1] */
    float *nearest_m;    /* of each cell; INFINITY: it leads to none */
    struct outline_entry *entry; /* by range */
    struct beam_outlines_info info;
};

/* weld.c: the outlines among the edges of a scene. Gives *edge (malloc) and *n, and how many edges there are. */
int outline_find(const struct scene *scene, const double station_m[3], struct outline_edge **edge, uint32_t *n,
                 uint64_t *n_edges, struct sh_err *err);

static inline uint32_t outline_cell(double dx, double dy, double dz)
{
    const double ax = __builtin_fabs(dx), ay = __builtin_fabs(dy), az = __builtin_fabs(dz);
    const double half = 0.5 * OUTLINE_CELLS;
    double main, u, v;
    uint32_t face;
    if (ax >= ay && ax >= az) {
        main = ax;
        u = dy;
        v = dz;
        face = dx < 0.0;
    } else if (ay >= az) {
        main = ay;
        u = dz;
        v = dx;
        face = 2 + (dy < 0.0);
    } else {
        main = az;
        u = dx;
        v = dy;
        face = 4 + (dz < 0.0);
    }
    double scale = half / main;
    uint32_t i = (uint32_t)(u * scale + half), j = (uint32_t)(v * scale + half);
    i = i < OUTLINE_CELLS ? i : OUTLINE_CELLS - 1;
    j = j < OUTLINE_CELLS ? j : OUTLINE_CELLS - 1;
    return (face * OUTLINE_CELLS + j) * OUTLINE_CELLS + i;
}

#endif
