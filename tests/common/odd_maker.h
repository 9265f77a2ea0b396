/* SPDX-License-Identifier: MIT */
/* Private to odd_scenes: the tools that parts are made with. */
#ifndef TESTS_COMMON_ODD_MAKER_H
#define TESTS_COMMON_ODD_MAKER_H

#include "tests/common/odd_scenes.h"

#define ODD_PI 3.14159265358979323846

/* The place of a part: a point, three axes and a size; and the random numbers it is made of. */
struct odd_maker {
    struct odd_scene *odd;
    uint32_t at_most;
    uint64_t random;
    double centre[3], axis[3][3], size_m;
    uint16_t label;
};

/* ---- odd_maker.c: numbers */
double odd_unit(struct odd_maker *m);
double odd_between(struct odd_maker *m, double lo, double hi);
/* Returns a number that is spread evenly among the powers of ten. */
double odd_decades(struct odd_maker *m, double lo, double hi);
int odd_pick(struct odd_maker *m, int n);
double odd_sign(struct odd_maker *m);
void odd_direction(struct odd_maker *m, double d[3]);
/* Draws three axes at right angles. One time in three the axes are the frame's own, in any order. */
void odd_axes(struct odd_maker *m);
/* ---- and triangles */
void odd_point(const struct odd_maker *m, double x, double y, double z, double p[3]);
/* Adds a triangle with its corners in random order. */
void odd_add(struct odd_maker *m, const double a[3], const double b[3], const double c[3]);

/* ---- odd_parts.c */
/* Adds a part of any kind, anywhere. */
void odd_add_part(struct odd_maker *m);
/* Adds walls around everything. */
void odd_add_room(struct odd_maker *m);
/* Adds a simple part, so that no scene is empty. */
void odd_add_behind(struct odd_maker *m);

#endif
