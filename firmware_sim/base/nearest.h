/* SPDX-License-Identifier: MIT */
/* The distance between two words, used to suggest the word that a mistyped one may have meant. */
#ifndef FIRMWARE_SIM_BASE_NEAREST_H
#define FIRMWARE_SIM_BASE_NEAREST_H

#include <stddef.h>

/* Levenshtein's distance: letters that must be put in, taken out or changed to turn one word into the other. For a word
 * of NEAREST_MAX characters or more it is NEAREST_MAX. */
enum { NEAREST_MAX = 96 };
size_t nearest_distance(const char *a, const char *b);

/* Whether `known` may have been meant by `word`: at most two letters differ, and not all of them; or one is
 * the other's beginning, of three letters at least. */
int nearest_is_near(const char *word, const char *known);

#endif
