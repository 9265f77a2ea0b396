/* Private to core/analysis: the parts of the map. Points (prcs, metres) make pixels (map.c); pixels make an
 * RGB image (map_draw.c, map_image.c), and that a PNG file (map_png.c). */
#ifndef CORE_ANALYSIS_MAP_INSIDE_H
#define CORE_ANALYSIS_MAP_INSIDE_H

#include "core/map.h"

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
    double station_m[MAP_MAX_STATIONS][2];
    struct map_counts counts;
};

/* 8-bit RGB, row by row from the top. */
struct map_image {
    uint32_t width, height;
    uint8_t *rgb;
};

/* Lightness 0..1 of structure and height 0..1 -> sRGB. */
void map_colour(double structure, double height, uint8_t rgb[3]);

/* Outside the image nothing happens. */
void map_image_fill(struct map_image *image, long column, long row, long width, long height, const uint8_t rgb[3]);
/* Text of digits and "+-. mkN", 5 x 7 dots of `dot` pixels, upper left corner at column, row. */
void map_image_text(struct map_image *image, long column, long row, long dot, const uint8_t rgb[3], const char *text);
void map_image_triangle(struct map_image *image, const double corner[3][2], const uint8_t rgb[3]);

/* The whole image; the caller frees rgb. */
int map_draw(const struct map *map, struct map_image *out, struct sh_err *err);

int map_png_write(const struct map_image *image, const char *path, struct sh_err *err);

#endif
