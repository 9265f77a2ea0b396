/* SPDX-License-Identifier: MIT */
/* How near two words are, to suggest what a mistyped one may have meant. */
#ifndef FIRMWARE_SIM_BASE_NEAREST_H
#define FIRMWARE_SIM_BASE_NEAREST_H

#include <stddef.h>

/* Letters that must be put in, taken out or changed to make one of the other (Levenshtein's distance). A word
 * of NEAREST_MAX characters or more is near to none: then it is NEAREST_MAX. */
enum { NEAREST_MAX = 96 };
size_t nearest_distance(const char *a, const char *b);

/* Whether `known` may have been meant by `word`: at most two letters differ, and not all of them; or one is
 * the other's beginning, of three letters at least. */
int nearest_is_near(const char *word, const char *known);

#endif
