/* SPDX-License-Identifier: MIT */
/* Numbers as text, for files with a line a point. In: a number. Out: the bytes that printf writes in the C locale,
 * without a NUL, and many times as fast. Each function returns the end of the text, and may write up to 8 bytes beyond it.
 * They lie in the room that it names. Pure; any thread. */
#ifndef CORE_DECIMAL_H
#define CORE_DECIMAL_H

#include <stdint.h>

enum {
    DECIMAL_WHOLE_ROOM = 28,
    DECIMAL_GENERAL_ROOM = 40,
    DECIMAL_FIXED_ROOM = 352, /* the largest double has 309 digits before its point */
};

/* "%llu" in DECIMAL_WHOLE_ROOM. */
char *decimal_put_whole(char *to, uint64_t v);
/* "%.*f" in DECIMAL_FIXED_ROOM. decimals <= 20. */
char *decimal_put_fixed(char *to, double v, unsigned decimals);
/* "%.*g" in DECIMAL_GENERAL_ROOM. 1 <= digits <= 17. */
char *decimal_put_general(char *to, double v, unsigned digits);
/* n such numbers, each with a comma after it, in n times that room. */
char *decimal_put_cells(char *to, const double *v, int n, unsigned digits);
/* v / 10^decimals, without the zeros at its end, in DECIMAL_GENERAL_ROOM. 1 <= decimals <= 20. */
char *decimal_put_short(char *to, uint64_t v, unsigned decimals);

#endif
