/* SPDX-License-Identifier: MIT */
/* Scenes of a few triangles, put together at random from parts that are hard to cast correctly. There are needles,
 * slivers, folds, boxes in boxes, giants beside dwarfs, and faces that overlap, cross, stand twice or lie next to each
 * other. The station is now and then on a face, in its plane, or in line with an edge. */
#ifndef TESTS_COMMON_ODD_SCENES_H
#define TESTS_COMMON_ODD_SCENES_H

#include <stdint.h>

#include "core/scene.h"

enum { ODD_MOST = 400, ODD_LABELS = 5, ODD_PARTS = 18 };

struct odd_scene {
    double corner[ODD_MOST][3][3]; /* prcs */
    uint16_t label[ODD_MOST];
    uint32_t n;
    double station_m[3];
    uint32_t parts;  /* a bit for each kind of part that is in it */
    char stands[24]; /* where the station is */
};

/* Makes a scene; the same number gives the same one. at_most is its number of triangles, up to ODD_MOST; the last part
 * may be cut short. */
void odd_scene_make(uint64_t number, uint32_t at_most, struct odd_scene *out);
const char *odd_part_name(int part);
/* Makes its scene without the triangles that have no area. With `weld` equal corners become one vertex. */
int odd_scene_build(const struct odd_scene *odd, int weld, struct scene **out, struct sh_err *err);

#endif
