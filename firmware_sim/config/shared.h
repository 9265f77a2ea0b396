/* SPDX-License-Identifier: MIT */
/* Files that come with the program. */
#ifndef FIRMWARE_SIM_CONFIG_SHARED_H
#define FIRMWARE_SIM_CONFIG_SHARED_H

#include <stddef.h>

/* Finds a file or a folder that comes with the program ("heads", "scenes/x.obj"), and sets buf to its path. Three
 * folders are searched. From the folder of the program these are ../share/scanhead (installed) and ../config (in a
 * build folder), and then config/ of the working directory. buf holds CONFIG_PATH_LEN. Returns 0 if none has it. */
int cfg_find_shared(const char *name, char *buf);
/* Returns whether a name ends in .yaml and has more than that. */
int cfg_is_yaml(const char *name);
/* Adds the names of a folder's YAML files, without .yaml, to the list "a, b, c" in buf, as far as they fit. */
void cfg_name_yaml(const char *dir, char *buf, size_t len);
/* Sets buf to the path of a scenario's file. name: a path (with a slash, or the ending .yaml), which is taken as it is,
 * or the name of a scenario that comes with the program. buf holds CONFIG_PATH_LEN. Returns 0 if no scenario has that
 * name, or if the path is too long. */
int cfg_find_scenario(const char *name, char *buf);

#endif
