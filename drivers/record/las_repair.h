/* SPDX-License-Identifier: MIT */
/* The repair of .las (repair.h): LAS 1.2 and 1.4 as las.c writes them. It counts points, returns and bounds again from
 * the records, by the code that counts them in a recording. */
#ifndef DRIVERS_RECORD_LAS_REPAIR_H
#define DRIVERS_RECORD_LAS_REPAIR_H

#include "drivers/record/repair.h"

int las_repair(struct repair *repair, struct sh_err *err);

#endif
