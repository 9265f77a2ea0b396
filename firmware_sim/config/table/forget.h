/* SPDX-License-Identifier: MIT */
/* Drops values as if they had not been given: for --set, which replaces them, and for the section `scanner` of a
 * station, which replaces those of the file. */
#ifndef FIRMWARE_SIM_CONFIG_TABLE_FORGET_H
#define FIRMWARE_SIM_CONFIG_TABLE_FORGET_H

#include <stdint.h>

struct cfg_key;
struct cfg_reader;

/* Returns whether a scanner may have the section, or the key in it. */
int cfg_is_of_scanner(const char *path);
extern const char cfg_sections_of_scanner[];
/* Drops the file's value of a key that is about to be read in a scanner. */
void cfg_take_over(struct cfg_reader *rd, const struct cfg_key *key);
/* To be called when the scanner has been read. If it has a head profile of its own, the keys of the file's
 * sections `head` and `instrument` are dropped. */
void cfg_end_scanner(struct cfg_reader *rd);
/* Resets a list as if it had not been given. */
void cfg_forget_list(struct cfg_reader *rd, const char *path);
/* Does the same for the value of one key. */
void cfg_forget_value(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item);
/* Does the same for a list, a section, or an element of a list. */
void cfg_forget(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item);

#endif
