/* SPDX-License-Identifier: MIT */
#include "tests/unit/mesh_rig.h"

const double rig_xyz[4][3] = {{1, 2, 3}, {2.5, 2.125, 3.25}, {2.75, 4, 3.5}, {-7, 0.5, 1.75}};
const uint32_t rig_face[2][3] = {{0, 1, 2}, {3, 2, 0}};
const float rig_normal[4][3] = {{0.6f, 0, -0.8f}, {0, 0.6f, 0.8f}, {1, 0, 0}, {0, 0, -1}};
const float rig_uv[4][2] = {{0.125f, 0.25f}, {0.5f, 0}, {1, -1}, {0, 0.75f}};
const uint8_t rig_rgb[4][3] = {{255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {255, 255, 0}};

struct sh_err rig_err;

char *rig_take(const char *name, size_t *len)
{
    FILE *in = fopen(path_in(name), "rb");
    if (in == NULL) fail_msg("no %s", name);
    char *text = calloc(1, 1 << 16);
    assert_non_null(text);
    *len = fread(text, 1, (1 << 16) - 1, in);
    fclose(in);
    assert_int_equal(unlink(path_in(name)), 0);
    return text;
}

void rig_write(const char *name, const struct mesh *mesh)
{
    if (mesh_write(path_in(name), mesh, NULL, &rig_err) != SH_OK) fail_msg("%s", rig_err.text);
}

struct mesh rig_mesh(void)
{
    return (struct mesh){.n_vertices = 4, .n_faces = 2, .xyz_m = rig_xyz, .face = rig_face};
}
