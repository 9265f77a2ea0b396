/* SPDX-License-Identifier: MIT */
/* The repair of .ply that is a mesh (repair.h). It is written in one piece at the end: all of it is there, as after a kill
 * before the file got its name, or nothing is kept. */
#ifndef DRIVERS_RECORD_MESH_PLY_REPAIR_H
#define DRIVERS_RECORD_MESH_PLY_REPAIR_H

#include "drivers/record/repair.h"

int mesh_ply_repair(struct repair *repair, struct sh_err *err);

#endif
