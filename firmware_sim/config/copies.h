/* SPDX-License-Identifier: MIT */
/* Lists of copies of a mesh in the configuration itself: the rows of a copy, and their reader. */
#ifndef FIRMWARE_SIM_CONFIG_COPIES_H
#define FIRMWARE_SIM_CONFIG_COPIES_H

#include <stdint.h>

#include "firmware_sim/config/table/row.h"

struct cfg_reader;

extern const struct cfg_table cfg_copy_table;
/* Begins the next copy of a mesh, and a reader for it. `name` stands before its keys in errors. */
void cfg_begin_copy(struct cfg_reader *rd, const struct cfg_reader *of, uint32_t mesh, const char *name, int line);
/* Removes copies: all of them (scene, scene.meshes), or those of one mesh. */
void cfg_forget_copies(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item);

#endif
