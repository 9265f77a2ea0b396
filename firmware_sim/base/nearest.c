/* SPDX-License-Identifier: MIT */
#include "firmware_sim/base/nearest.h"

#include <string.h>

/* V. I. Levenshtein, 1966: the table of distances between all beginnings of both words, row by row. */
size_t nearest_distance(const char *a, const char *b)
{
    size_t row[NEAREST_MAX], len_b = strlen(b);
    if (strlen(a) >= NEAREST_MAX || len_b >= NEAREST_MAX) return NEAREST_MAX;
    for (size_t j = 0; j <= len_b; j++)
        row[j] = j;
    for (size_t i = 1; a[i - 1] != '\0'; i++) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= len_b; j++) {
            size_t best = diagonal + (a[i - 1] != b[j - 1]);
            if (row[j] + 1 < best) best = row[j] + 1;
            if (row[j - 1] + 1 < best) best = row[j - 1] + 1;
            diagonal = row[j];
            row[j] = best;
        }
    }
    return row[len_b];
}

int nearest_is_near(const char *word, const char *known)
{
    const size_t len = strlen(word), len_known = strlen(known), distance = nearest_distance(word, known);
    const size_t shorter = len < len_known ? len : len_known;
    if (shorter >= 3 && strncmp(word, known, shorter) == 0) return 1;
    return distance <= 2 && distance < len;
}
