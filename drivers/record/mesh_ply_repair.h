/* SPDX-License-Identifier: MIT */
/* The repair of a .ply that is a mesh (repair.h). Such a file is written in one piece at the end. So the repair keeps
 * it only if it is complete, as after a kill just before the file got its name. */
#ifndef DRIVERS_RECORD_MESH_PLY_REPAIR_H
#define DRIVERS_RECORD_MESH_PLY_REPAIR_H

#include "drivers/record/repair.h"

int mesh_ply_repair(struct repair *repair, struct sh_err *err);

#endif
