/* SPDX-License-Identifier: MIT */
/* These closed meshes with a station inside are private to leaks.c. */
#ifndef TESTS_BENCH_CLOSED_MESH_H
#define TESTS_BENCH_CLOSED_MESH_H

#include "core/scene.h"

struct bench_mesh {
    const char *name;
    struct scene *scene;
    double station_m[3];
    uint32_t n_aim;    /* triangles that are aimed at, from number 0 on */
    uint32_t n_inner;  /* triangles of the mesh around the station, from number 0 on; a hit on a later one is a
                          leak */
    uint32_t n_turned; /* triangles, from number 0 on, whose normal (first x second edge) points inward; the
                          rest outward */
};

/* `which` is 0 to 3. mesh->scene belongs to the caller. */
int bench_mesh_create(int which, struct bench_mesh *mesh, struct sh_err *err);

#endif
