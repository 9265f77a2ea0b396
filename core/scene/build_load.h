/* SPDX-License-Identifier: MIT */
/* Begins and ends the load of a scene, and of each of its files. */
#ifndef CORE_SCENE_BUILD_LOAD_H
#define CORE_SCENE_BUILD_LOAD_H

#include "core/scene/build.h"

int build_init(struct scene_build *b, double tolerance_m, const struct sh_report *report, struct sh_err *err);
void build_begin_file(struct scene_build *b, const struct scene_mesh_spec *spec);
/* Warns of what was left out; SH_EINPUT when the file gave no triangle. */
int build_end_file(struct scene_build *b, struct sh_err *err);
/* Hands the scene over. may_be_empty: it needs no triangles, since copied meshes will be added. build_release must be
 * called in any case. */
int build_finish(struct scene_build *b, int may_be_empty, struct scene **out, struct sh_err *err);
void build_release(struct scene_build *b);

#endif
