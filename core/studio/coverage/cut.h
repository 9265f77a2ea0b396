/* SPDX-License-Identifier: MIT */
/* Private to core/studio/coverage: a triangle cut into pieces of a size. In: its corners, the size. Out: how many
 * pieces there are, the one that a point lies in, its corners, and its share of the area.
 *
 *             T            The longest edge is the base; the foot F of its height cuts the triangle into two with a
 *            /|\           right angle, A F T and B F T. Each part is cut across its longer leg into columns of one
 *           / | \          width. Columns are counted from the tip, the end of that leg that is not F. Each column is
 *          /  |  \         cut into rows by lines through the tip, evenly.
 *       A /___|___\ B
 *             F
 *
 * Columns are at most size / sqrt(5) wide, and so are rows at a column's wide end. A row leaves the longer leg at 45
 * degrees at most, so within a column it rises by no more than the column's width: no two points of a piece are farther
 * apart than size. A triangle whose longest edge is no longer than size is one piece. The number of pieces grows with
 * the area and the longest edge: needles cost no more than their length. In a part with n columns, column k (from 0)
 * has the share (2 k + 1) / n^2, and all of its pieces are equal: shares are ratios of whole numbers and sum to 1.
 * Pure; any thread. */
#ifndef CORE_STUDIO_COVERAGE_CUT_H
#define CORE_STUDIO_COVERAGE_CUT_H

#include <stdint.h>

struct cut {
    int base[2], apex; /* corners A, B, T */
    double foot;       /* place of F from A to B, 0..1 */
    struct cut_part {
        int from_apex;    /* the tip is T; else A, or B */
        uint32_t columns; /* 0: the triangle has no such part */
        double across;    /* rows of the last column, before they are rounded up */
        double share;     /* of the triangle's area */
    } part[2];
};

/* Columns are numbered through both parts, those of A first. */
void cut_set_up(const double corner[3][3], double size_m, struct cut *cut);
/* The number of pieces that cut_set_up would give, as a double, since a triangle may be of any size. For a part of more
 * than 10,000 columns the number is an upper bound. */
double cut_count(const double corner[3][3], double size_m);
uint32_t cut_columns(const struct cut *cut);
uint32_t cut_rows(const struct cut *cut, uint32_t column);

/* Finds column and row of the point with these barycentric weights (of any sum). A point that is outside by rounding
 * counts as one on the border. */
void cut_find(const struct cut *cut, const double weight[3], uint32_t *column, uint32_t *row);

/* Returns the share that a piece of that column has of the triangle's area. */
double cut_share(const struct cut *cut, uint32_t column);

/* Finds the corners of the polygon that rows first .. end of a column make: 3 or 4, counter-clockwise where the
 * triangle's are. Returns how many. */
int cut_corners(const struct cut *cut, const double corner[3][3], uint32_t column, uint32_t first, uint32_t end,
                double out[4][3]);

#endif
