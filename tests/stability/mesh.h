/* SPDX-License-Identifier: MIT */
/* Meshes for the casting tests, put together from parts. */
#ifndef TESTS_STABILITY_MESH_H
#define TESTS_STABILITY_MESH_H

#include <stdint.h>

#include "core/scene.h"

/* A mesh grows as parts are added, and begins as all zero. Labels are up to MESH_LABELS - 1. */
struct mesh {
    double (*vertex)[3];
    uint32_t (*triangle)[3];
    uint16_t *label;
    uint32_t n_vertices, n_triangles, cap_vertices, cap_triangles;
};

enum { MESH_LABELS = 8 };

/* These functions fail the running test where there is no memory. */
uint32_t mesh_vertex(struct mesh *mesh, double x, double y, double z);
void mesh_triangle(struct mesh *mesh, uint32_t i, uint32_t j, uint32_t k, uint16_t label);
/* Adds a parallelogram at a corner, spanned by u and v, of nu x nv cells of two triangles. */
void mesh_sheet(struct mesh *mesh, const double corner[3], const double u[3], const double v[3], uint32_t nu,
                uint32_t nv, uint16_t label);
/* Adds a closed box of 12 triangles and 8 vertices. */
void mesh_box(struct mesh *mesh, const double min[3], const double max[3], uint16_t label);
/* Adds a closed sphere: an icosahedron whose sides are cut in four `times` times, with 20 * 4^times triangles. Each
 * vertex is at radius_m times 1 +- rough, hashed from its number. */
void mesh_sphere(struct mesh *mesh, const double centre[3], double radius_m, double rough, unsigned times,
                 uint16_t label);
/* Copies a scene's triangles. */
void mesh_add_scene(struct mesh *mesh, const struct scene *scene, uint16_t label);

/* Moves the vertices from `first` on: p -> rotation p + offset. */
void mesh_move(struct mesh *mesh, uint32_t first, const double rotation[9], const double offset[3]);
/* Gives each triangle vertices of its own. */
void mesh_unweld(struct mesh *mesh);
/* Writes a rotation about an axis that is parallel to nothing in the scenes. */
void mesh_any_rotation(double rotation[9]);

/* Makes the scene of the mesh. Fails the running test where that is not possible. */
struct scene *mesh_scene(const struct mesh *mesh);
void mesh_free(struct mesh *mesh);

#endif
