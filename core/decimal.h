/* SPDX-License-Identifier: MIT */
/* Numbers as text, for files that have a line for each point. In: a number. Out: the bytes that printf writes in the C
 * locale, without a NUL, in less time. Each function returns the end of the text. It may write up to 8 bytes beyond
 * that end, within the room that its comment names. Pure; any thread. */
#ifndef CORE_DECIMAL_H
#define CORE_DECIMAL_H

#include <stdint.h>

enum {
    DECIMAL_WHOLE_ROOM = 28,
    DECIMAL_GENERAL_ROOM = 40,
    DECIMAL_FIXED_ROOM = 352, /* the largest double has 309 digits before its point */
};

/* Writes as "%llu" does, in DECIMAL_WHOLE_ROOM bytes. */
char *decimal_put_whole(char *to, uint64_t v);
/* Writes as "%.*f" does, in DECIMAL_FIXED_ROOM bytes. decimals <= 20. */
char *decimal_put_fixed(char *to, double v, unsigned decimals);
/* Writes as "%.*g" does, in DECIMAL_GENERAL_ROOM bytes. 1 <= digits <= 17. */
char *decimal_put_general(char *to, double v, unsigned digits);
/* Writes n numbers in the same form, each with a comma after it, in n * DECIMAL_GENERAL_ROOM bytes. */
char *decimal_put_cells(char *to, const double *v, int n, unsigned digits);
/* Writes v / 10^decimals without the zeros at its end, in DECIMAL_GENERAL_ROOM bytes. 1 <= decimals <= 20. */
char *decimal_put_short(char *to, uint64_t v, unsigned decimals);

#endif
