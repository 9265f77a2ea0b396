/* SPDX-License-Identifier: MIT */
/* The mesh of a scan's grid. In: points with their places in the grid, a column a line and a row a shot. Out: triangles
 * that face the head, normals, and points spread evenly over them.
 *
 * A cell lies between two rows and two columns that follow each other. Where all four corners have a point the cell
 * gives two triangles, cut along the shorter diagonal (from the first row of the first column where both are as long).
 * Where three have one, the cell gives the triangle of these. Nothing is drawn across a missing row or column. The
 * corners of a triangle are in the order that makes its normal point to the head: counter-clockwise as the head sees
 * it. A triangle without area, or with the head in its plane, is left out and counted.
 *
 * The long-edge filter leaves out each triangle with an edge that is longer than `long_edge` times the mean edge. The
 * mean is over all edges of the mesh before the filter, each counted once: along columns, along rows, and diagonals.
 *
 * Ownership: inputs stay the caller's and are not changed, except where a function says so. Pure but for progress; any
 * thread. */
#ifndef CORE_STUDIO_SCAN_MESH_H
#define CORE_STUDIO_SCAN_MESH_H

#include <stdint.h>

#include "core/err.h"

#define SCAN_MESH_NONE UINT32_MAX

struct scan_column {
    uint32_t line;  /* in the scan: columns whose lines differ by one are neighbours */
    uint32_t first; /* its first point; the last column ends with the last point */
    int is_pole;    /* all its shots have one direction: its first point borders on all rows of both neighbours */
};

struct scan_grid {
    uint32_t n_points, n_columns;
    const double (*xyz_m)[3];         /* [n_points] column by column */
    const uint32_t *row;              /* [n_points] rising within a column */
    const struct scan_column *column; /* [n_columns] lines rising */
    double head_m[3];                 /* where the head stood */
    const float (*to_head_m)[3];      /* [n_points] head minus point; NULL: head_m */
    uint32_t rows_per_turn;           /* 3 or more: the last row of a turn borders on row 0; 0 to 2: it doesn't */
    int closes;                       /* the last column borders on the first; needs three columns */
    double long_edge;                 /* 0: no filter */
};

struct scan_faces {
    uint32_t (*face)[3]; /* indices of points */
    uint32_t n_faces;
    uint64_t n_long, n_flat; /* left out by the filter; without area, or edge-on */
    uint64_t n_edges;        /* before the filter */
    double mean_edge_m;
};

/* Makes the triangles. SH_ENOMEM; SH_ESTOPPED where report asks to stop. scan_faces_free is due in any case. Takes
 * 25 bytes a point while it works, and gives 12 a triangle. */
int scan_faces_make(const struct scan_grid *grid, struct scan_faces *faces, const struct sh_report *report,
                    struct sh_err *err);
void scan_faces_free(struct scan_faces *faces);

/* Sets unit normals of points: the sum of the normals of their triangles, weighed by area. 0 0 0: no triangle, or
 * the sum is nothing. normal: [n_points] */
void scan_normals(const double (*xyz_m)[3], uint32_t n_points, const uint32_t (*face)[3], uint32_t n_faces,
                  float (*normal)[3]);

/* Leaves out points without a triangle: to[i] is the new number of point i, or SCAN_MESH_NONE; faces get the new
 * numbers. Returns how many are left. */
uint32_t scan_drop_loose(uint32_t n_points, uint32_t (*face)[3], uint32_t n_faces, uint32_t *to);

/* Points spread over triangles, uniformly by area, each on its own: point k depends on key and k alone. */
struct scan_sampler {
    const double (*xyz_m)[3];
    const uint32_t (*face)[3];
    uint32_t n_faces;
    uint64_t key;   /* scan_sampler_key */
    double *sum_m2; /* [n_faces] area of faces 0 to i */
    double area_m2;
};
/* Returns a key that differs for each scan of each station, both counted from 1. */
uint64_t scan_sampler_key(uint64_t seed, uint32_t station, uint32_t scan);
/* Sums the areas. SH_ENOMEM. scan_sampler_free is due in any case. */
int scan_sampler_start(struct scan_sampler *sampler, const double (*xyz_m)[3], const uint32_t (*face)[3],
                       uint32_t n_faces, uint64_t key, struct sh_err *err);
/* Returns the number of points for a density per square metre: area times density, rounded. */
double scan_sampler_count(const struct scan_sampler *sampler, double per_m2);
/* Gives point k < 2^56: it lies in face *face, with corner i weighed by weight[i] (the sum is 1). */
void scan_sampler_point(const struct scan_sampler *sampler, uint64_t k, uint32_t *face, double weight[3]);
void scan_sampler_free(struct scan_sampler *sampler);

#endif
