/* SPDX-License-Identifier: MIT */
/* The distance between two words, used to suggest the word that a mistyped one may have meant. */
#ifndef FIRMWARE_SIM_BASE_NEAREST_H
#define FIRMWARE_SIM_BASE_NEAREST_H

#include <stddef.h>

/* Levenshtein's distance: letters that must be put in, taken out or changed to turn one word into the other. For a word
 * of NEAREST_MAX characters or more it is NEAREST_MAX. */
enum { NEAREST_MAX = 96 };
size_t nearest_distance(const char *a, const char *b);

/* Returns whether a user who wrote `word` may have meant `known`. There are two cases: the distance of the two words is
 * at most 2 and less than the length of `word`; or the shorter word has at least three letters and is the beginning of
 * the other word. */
int nearest_is_near(const char *word, const char *known);

#endif
