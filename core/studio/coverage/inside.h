/* SPDX-License-Identifier: MIT */
/* Private to core/studio/coverage: cells, the pieces that they are made of, and how each was hit. */
#ifndef CORE_STUDIO_COVERAGE_INSIDE_H
#define CORE_STUDIO_COVERAGE_INSIDE_H

#include <stdatomic.h>

#include "core/studio/coverage.h"

enum { NO_CELL = COVERAGE_NO_CELL };

/* The nearest and the steepest hits of a cell, as the bits of floats. The bits of positive floats have the same
 * order as the numbers, so threads can keep the larger one without a lock. */
struct cell_hits {
    _Atomic uint32_t pulses, cosine, nearness; /* nearness: 1 / range */
};

struct cell {
    double area_m2;
    uint32_t pulses, cosine, nearness; /* of all scans that were kept */
    uint16_t stations, first_station, label;
};

struct coverage {
    struct coverage_spec spec;
    const struct scene *scene;
    double origin_m[3]; /* corner of the cubes */
    uint32_t *first;    /* [n_triangles] its first column (cut.h); NO_CELL: the triangle is left out */
    uint32_t *column;   /* [n_columns] its first piece */
    uint32_t *piece;    /* [n_pieces] its cell */
    uint64_t n_columns, n_pieces;
    uint32_t n_cells, n_stations;
    uint64_t *duplicate;            /* bits: triangles that lie on others */
    double duplicate_m2, silent_m2; /* area left out: of duplicate faces; of faces without echo */
    struct cell *cell;
    struct cell_hits *hits; /* of the last scan, until it is kept or dropped */
};

uint32_t coverage_bits(double value);

#endif
