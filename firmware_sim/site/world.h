/* SPDX-License-Identifier: MIT */
/* The world that sites share: the meshes and their BVHs (struct site_world). */
#ifndef FIRMWARE_SIM_SITE_WORLD_H
#define FIRMWARE_SIM_SITE_WORLD_H

struct scene;
struct sh_err;
struct site;

/* Joins the world of `other` (NULL: none) where its scene is the same; else makes a new, empty one. */
int site_enter_world(struct site *site, const struct site *other, struct sh_err *err);
/* Leaves the world; the last site frees it. */
void site_leave_world(struct site *site);

/* Returns the radius of a sphere around a mesh, a little more than that of its box; sets the sphere's centre. */
double site_enclose(const struct scene *mesh, double centre_m[3]);
/* The largest error of vertices, of the scene and of movers. */
double site_mesh_error_m(const struct site *site);

#endif
