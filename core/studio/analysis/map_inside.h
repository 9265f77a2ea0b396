/* SPDX-License-Identifier: MIT */
/* Private to core/studio/analysis: the parts of the map. Points (prcs, metres) make pixels (map.c); pixels make an
 * image (map_draw.c), with labels where they find room (map_labels.c). */
#ifndef CORE_STUDIO_ANALYSIS_MAP_INSIDE_H
#define CORE_STUDIO_ANALYSIS_MAP_INSIDE_H

#include "core/studio/map.h"
#include "core/studio/picture.h"

struct map_pixel {
    uint64_t levels; /* bit set: height levels hit, numbered modulo 64 */
    float low_m;     /* height of the lowest point above map.z0_m */
    uint32_t hit;
};

struct map {
    double min_m[2], max_m[2];
    double pixel_m, level_m; /* side of a pixel, height of a level */
    double z0_m;             /* z of the first point: heights are kept relative to it, as floats */
    uint32_t width, height;
    struct map_pixel *pixel; /* [height][width], the lowest y first */
    uint32_t n_stations;
    struct map_station station[MAP_MAX_STATIONS];
    double (*line[MAP_LINES])[2][2]; /* [counts.lines] ends, x and y */
    size_t room_lines[MAP_LINES];
    struct map_counts counts;
};

/* Returns how much the pixels about a place are like a wall, 0..1. */
double map_structure(const struct map *map, uint32_t column, uint32_t row);
/* Finds where a station is in the image. */
void map_station_place(const struct map *map, uint32_t station, double place[2]);

enum {
    MAP_STATION_PX = 9, /* from the centre of a station's mark to its corners */
    MAP_TICK_PX = 24,   /* to the end of the tick of its heading */
};
extern const struct picture_type map_name_type, map_height_type;

/* Draws all but the pixels. */
int map_draw_marks(const struct map *map, struct pen *pen, struct sh_err *err);
/* Makes the image with its pixels alone; the caller frees it. */
int map_draw_pixels(const struct map *map, struct picture *out, struct sh_err *err);

#endif
