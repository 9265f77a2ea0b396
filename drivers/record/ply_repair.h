/* SPDX-License-Identifier: MIT */
/* The repair of .ply (repair.h): points, binary or text, with any columns of one number each. A mesh goes to the repair of
 * meshes. The count in the header is made right, in the header's own room: lines of blank comment give way. */
#ifndef DRIVERS_RECORD_PLY_REPAIR_H
#define DRIVERS_RECORD_PLY_REPAIR_H

#include "drivers/record/repair.h"

int ply_repair(struct repair *repair, struct sh_err *err);

/* "element vertex 12": what is the head of it ("element vertex "), then the count and nothing else. 0: another line. */
int ply_repair_count(const char *line, const char *head, uint64_t *count);

#endif
