/* SPDX-License-Identifier: MIT */
/* For tests of recorded meshes: streams of lines whose hits are given in metres from the head. */
#ifndef TESTS_UNIT_GRID_RIG_H
#define TESTS_UNIT_GRID_RIG_H

#include "tests/unit/recorder_rig.h"

enum { PULSES = 1000, FULL = 10 }; /* of a line; lines of a full turn */

/* Stations stand at this place of the scene; polar and geo points are in millimetres from it. */
extern const double grid_rig_head_m[3];

extern uint64_t grid_rig_first_pulse; /* of line 0 */

/* There is 1 line a second of 1000 pulses, of which a tenth is cast. The pan turns by 36 degrees a second: ten lines a
 * turn. */
struct native_descriptor grid_rig_descriptor(uint32_t scan);

void grid_rig_put_descriptor(const struct native_descriptor *d);

/* In the scene's own frame the station is the anchor. */
struct native_anchor grid_rig_anchor(uint32_t station);

void grid_rig_begin_scan(uint32_t scan, uint32_t station);

void grid_rig_put_line(uint32_t line, uint32_t row, const struct rig_point *p, uint32_t n);

/* A shot with a hit at x y z metres from the head. */
struct rig_point grid_rig_hit(double x, double y, double z, uint16_t label);

/* The wall with a step of tests/unit/test_scan_mesh.c: 4 lines of 3 shots, 12 triangles, mean edge 1.18972 m. With a
 * factor of 1.2 the four triangles of the step go, and 4 m2 are left. */
void grid_rig_put_step(uint32_t first_line);

#endif
