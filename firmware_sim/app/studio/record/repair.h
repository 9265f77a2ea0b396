/* SPDX-License-Identifier: MIT */
/* `scanhead record --repair`: what drivers/record/repair.h makes of each file, printed. */
#ifndef FIRMWARE_SIM_APP_STUDIO_RECORD_REPAIR_H
#define FIRMWARE_SIM_APP_STUDIO_RECORD_REPAIR_H

/* One after the other; a file that can't be repaired does not stop the others. Prints a line each, unless quiet. stats: a JSON
 * file, NULL: none. The exit status: the worst of all. */
int record_repair(const char *const *paths, int n, const char *stats, int quiet);

#endif
