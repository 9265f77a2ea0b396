/* SPDX-License-Identifier: MIT */
/* The repair of .ply (repair.h): points, binary or text, with any columns of one number each. The count in the header
 * is corrected within the header's room: lines of blank comment make place.
 *
 * A mesh is written in one piece at the end. So a mesh is kept only if it is complete, as after a kill just before the
 * file got its name. */
#ifndef DRIVERS_RECORD_PLY_REPAIR_H
#define DRIVERS_RECORD_PLY_REPAIR_H

#include "drivers/record/repair.h"

int ply_repair(struct repair *repair, struct sh_err *err);

#endif
