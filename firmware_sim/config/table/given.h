/* SPDX-License-Identifier: MIT */
/* For checks between keys: whether keys were given and read without a diagnostic; and diagnostics of these checks. */
#ifndef FIRMWARE_SIM_CONFIG_TABLE_GIVEN_H
#define FIRMWARE_SIM_CONFIG_TABLE_GIVEN_H

#include <stddef.h>
#include <stdint.h>

struct cfg_reader;

/* Functions with `item` in their name are for keys of a list: the path has [], and item is the element's number, from
 * 0. Functions without `item` in their name are for keys outside of lists. */

/* Returns whether the key was given. */
int cfg_is_given(const struct cfg_reader *rd, const char *path);
int cfg_is_item_given(const struct cfg_reader *rd, const char *path, uint32_t item);
/* Returns whether the head profile was read without a diagnostic. */
int cfg_has_profile(const struct cfg_reader *rd);
/* Returns the word of a key for its value. */
const char *cfg_word(const struct cfg_reader *rd, const char *path, int value);
/* Returns whether all of these keys (of sections: all keys in them) were read without a diagnostic, so that a check can
 * use their values. `item` counts only for paths with []. */
int cfg_are_sound(const struct cfg_reader *rd, uint32_t item, const char *const *paths, size_t n);
#define CFG_ITEM_SOUND(rd, item, ...)                               \
    cfg_are_sound((rd), (item), (const char *const[]){__VA_ARGS__}, \
                  sizeof((const char *const[]){__VA_ARGS__}) / sizeof(const char *))
#define CFG_SOUND(rd, ...) CFG_ITEM_SOUND(rd, 0, __VA_ARGS__)

/* Adds a diagnostic, "FILE:LINE: KEY: text", at the key's own line, or at the section's where the key is missing.
 * Returns SH_EINPUT; reading goes on after it. Nothing is added where the key, or a section around it, has a diagnostic
 * already: the new one may only be its consequence. */
int cfg_fail_key(struct cfg_reader *rd, const char *path, const char *fmt, ...) __attribute__((format(printf, 3, 4)));
int cfg_fail_item(struct cfg_reader *rd, const char *path, uint32_t item, const char *fmt, ...)
    __attribute__((format(printf, 4, 5)));
/* Does the same for a key that is not given and has no default. item: 0 where the path has no []. */
void cfg_fail_missing(struct cfg_reader *rd, const char *path, uint32_t item);
/* Cuts a text for an error. Control characters are replaced when the error is made (sh_fail). buf holds CFG_SHOW_MAX.
 */
enum { CFG_SHOW_MAX = 64 };
const char *cfg_show(const char *text, char *buf);

#endif
