/* SPDX-License-Identifier: MIT */
/* Area, volume and openness of a body. In: its triangles, in any order, and a box around them (metres). Out: figures
 * that do not depend on how its faces are divided. All sums are of doubles, from the middle of the box, so that a body
 * far from the origin loses no digits. Pure; any thread. */
#ifndef CORE_BODY_H
#define CORE_BODY_H

enum { BODY_FIELDS = 8 };

/* Sums over triangles and edges. */
struct body_sum {
    double centre_m[3], wave; /* radians a metre; 0: the box is a point */
    double area_m2;
    double volume_m3; /* signed tetrahedra: above 0 where the faces look outward; meaningless for an open body */
    double field[BODY_FIELDS];
};

void body_begin(struct body_sum *s, const double min_m[3], const double max_m[3]);
void body_add_triangle(struct body_sum *s, const double corner[3][3]);
/* An edge of a triangle in its direction. Edges that lie twice in the body, once in each direction, may be left out. */
void body_add_edge(struct body_sum *s, const double a[3], const double b[3]);
/* Returns an estimate of the area that would close the body. For a closed body, rounding leaves about
 * 1e-7 of area_m2. */
double body_open_m2(const struct body_sum *s);

#endif
