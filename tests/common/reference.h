/* SPDX-License-Identifier: MIT */
/* The reference of the casting tests. All that decides is in long double, independent of core/cast and of Embree.
 *
 * Corners relative to the ray's origin are formed in long double, where the difference of two doubles of a scene is
 * exact or good to 2^-64. Edge functions and the plane's range follow from them. The side of an edge is good to about
 * 2^-61 of the corner's distance, 500 times finer than double precision can tell.
 *
 * A uniform grid finds the triangles near the ray. A cell holds each triangle that touches it, with a margin of at
 * least a millionth of a cell. The margin covers the rounding of the walk through the cells. reference_brute tries all
 * triangles, for small scenes and to check the grid. */
#ifndef TESTS_COMMON_REFERENCE_H
#define TESTS_COMMON_REFERENCE_H

#include <stdint.h>

struct reference;

enum { REFERENCE_NONE = 0xffffffff };

struct reference_hit {
    long double range_m; /* NaN: none */
    uint32_t triangle;   /* REFERENCE_NONE: none */
};

/* The arrays must outlive the reference. Returns NULL where there is no memory. */
struct reference *reference_create(const double (*vertex_m)[3], const uint32_t (*triangle)[3], uint32_t n_triangles);
void reference_free(struct reference *reference);

/* Returns the nearest triangle that the ray meets, borders included. Any number of threads may call it at once. */
struct reference_hit reference_cast(const struct reference *reference, const double origin_m[3], const double dir[3]);
struct reference_hit reference_brute(const struct reference *reference, const double origin_m[3], const double dir[3]);

/* Returns the metres between a measured range (NaN: nothing met) and the true one. The error is infinite where only one
 * of the two met something. */
double reference_error(const struct reference_hit *truth, double range_m);

/* For a wrong range, returns whether the ray passes some edge so closely that double precision can't tell on which
 * side. The edge is no farther than the farther of the two hits. Edge functions in double are good to 4 roundings of
 * the farther corner's distance. A caster may be wrong by as much again, and once more for its own corners: 16 x
 * 2^-53. */
int reference_is_undecidable(const struct reference *reference, const double origin_m[3], const double dir[3],
                             const struct reference_hit *truth, double range_m);

/* Returns how far the ray passes from the nearest edge of a triangle, across the ray. Tests use it to keep away from
 * borders. */
double reference_margin_m(const struct reference *reference, const double origin_m[3], const double dir[3],
                          uint32_t triangle);

#endif
