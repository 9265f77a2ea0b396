/* SPDX-License-Identifier: MIT */
/* Files that come with the program. */
#ifndef FIRMWARE_SIM_CONFIG_SHARED_H
#define FIRMWARE_SIM_CONFIG_SHARED_H

/* Where a file that comes with the program ("heads", "scenes/x.obj") may be, for i from 0: beside an
 * installed program, beside one in its build folder, in config/ of the working directory. buf holds CONFIG_PATH_LEN.
 * 0: there is no i-th place. */
int cfg_shared_path(int i, const char *name, char *buf);
/* The first of these places that has it; 0: none. */
int cfg_find_shared(const char *name, char *buf);
/* The file of a scenario: a path (with a slash, or an ending), or the name of one that comes with the program. buf
 * holds CONFIG_PATH_LEN. 0: there is none of that name. */
int cfg_find_scenario(const char *name, char *buf);

#endif
