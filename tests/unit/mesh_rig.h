/* SPDX-License-Identifier: MIT */
/* A small mesh, and the files that are written of it, for tests of the formats. */
#ifndef TESTS_UNIT_MESH_RIG_H
#define TESTS_UNIT_MESH_RIG_H

#include "core/studio/mesh.h"
#include "tests/unit/scene_files.h"

/* All numbers differ, so that an exchange shows. Normals are unit vectors. */
extern const double rig_xyz[4][3];
extern const uint32_t rig_face[2][3];
extern const float rig_normal[4][3], rig_uv[4][2];
extern const uint8_t rig_rgb[4][3];
extern struct sh_err rig_err;

/* Vertices and two faces. */
struct mesh rig_mesh(void);
void rig_write(const char *name, const struct mesh *mesh);
/* Takes the file out of the folder: its bytes, up to 64 KiB, to be freed. */
char *rig_take(const char *name, size_t *len);

#endif
