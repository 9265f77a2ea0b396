/* SPDX-License-Identifier: MIT */
/* Inspects a mesh file for `scanhead init`. In: its path, and what the user says of it. Out: the mesh in metres with z
 * up, the keys that make it so in a configuration, and the source of each. */
#ifndef FIRMWARE_SIM_APP_STUDIO_INIT_MESH_H
#define FIRMWARE_SIM_APP_STUDIO_INIT_MESH_H

#include "core/scene.h"

struct init_wish {
    const char *file;
    const char *up; /* "y", "z"; NULL: as the file says */
    double scale;   /* metres per unit; 0: as the file says */
};

struct init_mesh {
    enum scene_up up;
    double scale;
    char up_from[64], scale_from[176]; /* the source of each, for comments */
    char crs[16]; /* the CRS of a GeoTIFF with z up and scale 1, if PROJ finds its place on the Earth; else empty */
};

/* Loads the mesh. Warns of all that is assumed, with `name` for the file. scene_free is due where it succeeds. */
int init_load_mesh(const struct init_wish *wish, const char *name, struct scene **scene, struct init_mesh *mesh,
                   struct sh_err *err);

/* The longest side of the bounds. */
double init_largest_m(const struct scene *scene);

#endif
