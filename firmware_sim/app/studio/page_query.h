/* SPDX-License-Identifier: MIT */
/* This reads the query of a page's request: NAME=NUMBER with & between them. In: the text after '?', and the names
 * that are allowed. Out: their values, or one line that says what is allowed. Pure; any thread. */
#ifndef FIRMWARE_SIM_APP_STUDIO_PAGE_QUERY_H
#define FIRMWARE_SIM_APP_STUDIO_PAGE_QUERY_H

#include "core/err.h"

/* A value that a query may have. */
struct page_word {
    const char *name; /* NULL ends a list of words */
    double min, max;
    int whole;
    double value; /* at first the default, which may be beyond the limits; NaN: the query must give the value */
};

int page_read_query(struct page_word *words, const char *query, struct sh_err *err);

#endif
