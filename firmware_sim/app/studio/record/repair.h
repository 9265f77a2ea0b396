/* SPDX-License-Identifier: MIT */
/* `scanhead record --repair`: repairs each file by drivers/record/repair.h, and prints the result. */
#ifndef FIRMWARE_SIM_APP_STUDIO_RECORD_REPAIR_H
#define FIRMWARE_SIM_APP_STUDIO_RECORD_REPAIR_H

/* Repairs one file after the other; one that can't be repaired does not stop the others. Prints a line for each, and a
 * second one where PATH.part keeps its name. quiet: prints only errors. stats: a file for JSON; NULL: none. Returns the
 * worst exit status. */
int record_repair(const char *const *paths, int n, const char *stats, int quiet);

#endif
