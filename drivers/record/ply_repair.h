/* SPDX-License-Identifier: MIT */
/* The repair of .ply (repair.h): points, binary or text, with any columns of one number each. A mesh goes to the repair of
 * meshes. The count in the header is corrected within the header's room: lines of blank comment make place. */
#ifndef DRIVERS_RECORD_PLY_REPAIR_H
#define DRIVERS_RECORD_PLY_REPAIR_H

#include "drivers/record/repair.h"

int ply_repair(struct repair *repair, struct sh_err *err);

/* 1: the line is `head` ("element vertex "), then a count and nothing else. 0: another line. */
int ply_repair_count(const char *line, const char *head, uint64_t *count);

#endif
