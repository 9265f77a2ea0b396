/* SPDX-License-Identifier: MIT */
/* A room full of surfaces that are hard for a sight, and two casts of it: one asks the BVH for each ray, one has a
 * sight. */
#ifndef TESTS_ACCURACY_SEEN_ROOM_H
#define TESTS_ACCURACY_SEEN_ROOM_H

#include "core/cast.h"
#include "core/surface.h"
#include "tests/common/cases.h"

/* Labels: walls, a pane, a mirror, and 12 kinds of things. */
enum { ROOM_WALL, ROOM_PANE, ROOM_MIRROR, ROOM_THING, ROOM_LABELS = ROOM_THING + 12 };
enum { ROOM_LINES = 24, ROOM_PULSES = 1500 };

struct seen_room {
    struct scene *scene, *body_scene; /* a box that moves */
    struct bvh *bvh, *body;
    struct sight *sight;
    struct georef *georef;
    struct surface_table table;
    uint16_t kind[ROOM_LABELS];
    struct beam_outlines *outlines;
    struct cast_beam beam;
    struct schedule_segment segment;
    struct cast_setup setup; /* single rays, polar, no noise, without sight */
    /* [0] is without the sight, and without hits ahead; [1] is with them */
    struct caster *caster[2];
    struct line_block block[2];
};

/* Makes a room around at_m: things, overlaps, needles, pairs of faces that lie closer than float resolves, and a hole
 * to the outside. */
void seen_room_open(struct seen_room *room, uint64_t seed, const double at_m[3]);
void seen_room_close(struct seen_room *room);

/* Casts all lines with and without hits that were found ahead. Hits are found for some lines at a time. Their pulses
 * are cast in pieces that begin and end anywhere. Compares the blocks as below. Returns whether this setup can look
 * ahead; else nothing is cast. */
int seen_room_compare_ahead(struct seen_room *room, const struct cast_setup *setup);

/* Casts all lines both ways and compares the blocks: each bit must be the same. Returns the number of echoes. */
uint64_t seen_room_compare(struct seen_room *room, const struct cast_setup *without, const struct cast_setup *with);

#endif
