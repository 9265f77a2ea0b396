/* SPDX-License-Identifier: MIT */
/* The elements of a page: its head and foot, lengths as text, charts. In: figures in metres. Out: HTML 5 and SVG that
 * need no script and no other file. Pages are light or dark as the reader's system is, and fit for printing. */
#ifndef FIRMWARE_SIM_APP_STUDIO_REPORT_PAGE_H
#define FIRMWARE_SIM_APP_STUDIO_REPORT_PAGE_H

#include <stdint.h>
#include <stdio.h>

#include "core/studio/figures.h"

/* Everything before the first section, and after the last. */
void page_begin(FILE *out, const char *title);
void page_end(FILE *out);

/* A length in the unit that suits it, nm to m: four digits, with three decimals at most; NaN: a dash.
 * is_signed: with a sign also where it is positive. */
void page_length(FILE *out, double m, int is_signed);
/* A number with commas between thousands. */
void page_count(FILE *out, uint64_t n);
/* A number of up to four significant digits, without zeros at its end; from 1000 on a whole number as page_count writes
 * it. NaN: a dash. */
void page_number(FILE *out, double v);

/* Counts the characters of UTF-8. */
int page_letters(const char *text);

/* Returns a unit for all figures of an axis; *per_m: how many of it make a metre. */
const char *page_unit(double largest_m, double *per_m);

/* Draws bars. curve(ctx, from, to): how many are expected from..to, drawn as a line; NULL: none. */
void page_histogram(FILE *out, const char *title, const struct figures_histogram *h,
                    double (*curve)(const void *ctx, double from, double to), const void *ctx);

/* Groups of bars side by side, one group for each place on the axis. value_m: [n_groups], NaN: none. The last series is
 * the expected value, drawn as a line across its group. */
enum { PAGE_SERIES = 4 };
struct page_bars {
    const char *title, *axis; /* what the groups are, with their unit */
    const char *series[PAGE_SERIES];
    uint32_t n_groups;
    const char (*group)[32];
    const double (*value_m)[PAGE_SERIES];
};
void page_bars(FILE *out, const struct page_bars *bars);

#endif
