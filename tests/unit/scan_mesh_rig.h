/* SPDX-License-Identifier: MIT */
/* For tests of the mesh of a scan's grid: a grid is put together point by point, and its mesh is looked at. */
#ifndef TESTS_UNIT_SCAN_MESH_RIG_H
#define TESTS_UNIT_SCAN_MESH_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "core/studio/scan_mesh.h"

enum { MAX_POINTS = 4096, MAX_COLUMNS = 128 };

/* A grid under construction, and the mesh that is made of it. */
extern struct mesh_grid {
    double xyz[MAX_POINTS][3];
    uint32_t row[MAX_POINTS];
    struct scan_column column[MAX_COLUMNS];
    struct scan_grid grid;
    struct scan_faces faces;
    struct sh_err err;
} t;

/* Begins an empty grid. */
void begin(void);
void add_column(uint32_t line, int is_pole);
void add_point(uint32_t row, double x, double y, double z);
/* Makes the mesh, without edges longer than long_edge times the mean (0: with all). */
void make(double long_edge);

void assert_near(double got, double want, double tolerance);

struct edges {
    uint64_t n, n_once, n_unlike; /* different; in one face alone; in more than two, or twice in one direction */
    double mean_m;
};

/* Counts the edges in another way than the module does: those of all faces in one list. */
struct edges edges_of(void);
/* The module has counted the same edges, and their mean length. */
void assert_edges_as_counted(const struct edges *edges);
void assert_faces_the_head(void);

#endif
