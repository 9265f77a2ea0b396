/* SPDX-License-Identifier: MIT */
/* For tests of casting: rooms and planes with known ranges, a head in them, and a scan line cast into a
 * block. */
#ifndef TESTS_UNIT_CAST_RIG_H
#define TESTS_UNIT_CAST_RIG_H

#include "tests/common/cases.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/cast.h"
#include "core/rng.h"

#define HZ  INT64_C(1000000)
#define DEG INT64_C(1000000)
enum { RIG_LINE = 6000 };

struct cast_rig {
    struct scene *scene;
    struct bvh *bvh;
    struct georef *georef;
    struct caster *caster;
    struct cast_setup setup;
    struct schedule_spec spec;
    struct schedule_segment segment;
    struct line_block block;
};

/* Makes a box from lo to hi; labels 0..5 are the walls x-, x+, y-, y+, z-, z+. */
struct scene *box_scene(const double lo[3], const double hi[3]);

/* Returns the range from o along d to the box's inside, and writes the wall. */
long double box_range(const double lo[3], const double hi[3], const double o[3], const long double d[3], int *wall);

/* Takes the scene over. The layout is polar with 10 um, ideal encoders and no noise. */
struct cast_rig *cast_rig_open(struct scene *scene, const double station_m[3]);

void cast_rig_close(struct cast_rig *rig);

/* Casts pulses k .. k+n-1 of line `line` into the rig's block. */
uint32_t cast_some(struct cast_rig *rig, const struct schedule_line *line, uint64_t k, uint64_t n);

/* Casts the whole of line n. */
uint32_t cast_line(struct cast_rig *rig, uint64_t n, struct schedule_line *line);

/* Writes the angles of pulse k of the scan in turns, from the spec alone (a scan without changes). */
void true_angles(const struct schedule_spec *spec, uint64_t k, long double *mirror, long double *pan);

/* Writes the direction in the scene of a beam at these angles, for a head with this heading: clockwise from the scene's
 * y axis. */
void true_direction(long double mirror_turn, long double pan_turn, long double heading_rad, long double d[3]);

#endif
