/* SPDX-License-Identifier: MIT */
/* A coarse mesh of a fine one, for drawing. In: vertices and triangles (metres, any frame), and how many triangles
 * there may be. Out: vertices in double in the same frame, and triangles.
 *
 * Vertex clustering on a grid (Rossignac and Borrel, Multi-resolution 3D approximations for rendering complex scenes,
 * 1993): all vertices in one cell of the grid become one, their mean. A triangle whose corners then lie in fewer than
 * three cells is left out. Where several triangles have the same three cells, only the first stays, whichever way they
 * face.
 *
 * The grid: along each axis the bounds are divided into n = ceil(extent / cell_m) steps of at most cell_m. Cells are
 * centred on the ends of steps: the first on the lower bound, the last on the upper one. So the bounds move inwards by
 * at most half a cell, and a vertex by less than a cell along each axis. Surfaces in one plane along two of the axes
 * stay in it, unless another surface is nearer than a cell.
 *
 * Bounds and means are of the vertices that triangles use. Pure; any thread. Results don't depend on anything else. */
#ifndef CORE_STUDIO_DECIMATE_H
#define CORE_STUDIO_DECIMATE_H

#include <stdint.h>

#include "core/err.h"

enum { DECIMATE_LEAST = 100 }; /* fewer triangles can't be asked for */

struct decimate_mesh {
    const double (*vertex_m)[3]; /* [n_vertices] finite */
    uint32_t n_vertices;
    const uint32_t (*triangle)[3]; /* [n_triangles] indices into vertex_m */
    uint32_t n_triangles;
};

struct decimated {
    double (*vertex_m)[3]; /* [n_vertices] */
    uint32_t n_vertices;
    uint32_t (*triangle)[3]; /* [n_triangles] */
    uint32_t n_triangles;
    double cell_m; /* 0: the mesh is as it was, vertex by vertex */
};

/* Makes a mesh of at most `most` triangles. A mesh that has no more stays as it is. The cell is chosen by the area and
 * by trying, mostly in one to four passes. Memory: 4 bytes a vertex of the mesh, up to 700 bytes for each of `most`,
 * and the result. SH_EINPUT: most below DECIMATE_LEAST; SH_ESTATE: no cell gives so few; SH_ENOMEM; SH_ESTOPPED. */
int decimate(const struct decimate_mesh *mesh, uint32_t most, const struct sh_report *report, struct decimated *out,
             struct sh_err *err);
void decimated_free(struct decimated *mesh);

#endif
