/* SPDX-License-Identifier: MIT */
/* The repair of .obj (repair.h): all whole lines of a mesh whose recorder was killed while it wrote the file. */
#ifndef DRIVERS_RECORD_OBJ_REPAIR_H
#define DRIVERS_RECORD_OBJ_REPAIR_H

#include "drivers/record/repair.h"

int obj_repair(struct repair *repair, struct sh_err *err);

#endif
