#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/analysis/map_inside.h"

enum {
    WALL_LEVELS = 14, /* height levels hit that make a pixel as dark as it gets */
    FREE_LEVELS = 4,  /* floor and ceiling, each across the border of two levels: not structure */
    HISTOGRAM_BINS = 1024,
    BAR_PX = 240,   /* longest scale bar */
    STATION_PX = 9, /* from the centre of a station mark to its corners */
    DOT_PX = 2,     /* of the letters */
};

static const uint8_t ink[3] = {40, 44, 52}, red[3] = {214, 39, 40}, white[3] = {255, 255, 255};

/* Heights between which the hues spread. The ends are those of 99 % of the pixels, so that a single stray
 * point does not take the colours from all others. */
struct height_range {
    double low_m, high_m;
};

static struct height_range find_heights(const struct map *map)
{
    const size_t n = (size_t)map->width * map->height;
    double low_m = INFINITY, high_m = -INFINITY;
    uint64_t used = 0, count[HISTOGRAM_BINS] = {0};
    for (size_t i = 0; i < n; i++) {
        if (!map->pixel[i].hit) continue;
        low_m = fmin(low_m, (double)map->pixel[i].low_m);
        high_m = fmax(high_m, (double)map->pixel[i].low_m);
        used++;
    }
    if (used == 0 || high_m <= low_m) return (struct height_range){used > 0 ? low_m : 0, used > 0 ? low_m : 0};
    const double bin_m = (high_m - low_m) / HISTOGRAM_BINS;
    for (size_t i = 0; i < n; i++)
        if (map->pixel[i].hit) count[(int)fmin(HISTOGRAM_BINS - 1, ((double)map->pixel[i].low_m - low_m) / bin_m)]++;
    uint64_t below = 0, above = 0;
    int first = 0, last = HISTOGRAM_BINS - 1;
    while ((below += count[first]) * 200 < used)
        first++;
    while ((above += count[last]) * 200 < used)
        last--;
    return (struct height_range){low_m + first * bin_m, low_m + (last + 1) * bin_m};
}

static double height_share(struct height_range range, double height_m)
{
    if (range.high_m <= range.low_m) return 0;
    return fmin(1, fmax(0, (height_m - range.low_m) / (range.high_m - range.low_m)));
}

/* What the 3 x 3 pixels about a place hold: the most levels and the lowest point. A wall is then three pixels
 * wide and scan lines close up; where floor and ceiling alternate, the floor shows. Returns 0 where there is
 * no point. */
static int gather(const struct map *map, uint32_t column, uint32_t row, int *levels, double *low_m)
{
    int hit = 0;
    *levels = 0;
    *low_m = INFINITY;
    for (uint32_t r = row > 0 ? row - 1 : 0; r <= row + 1 && r < map->height; r++)
        for (uint32_t c = column > 0 ? column - 1 : 0; c <= column + 1 && c < map->width; c++) {
            const struct map_pixel *pixel = &map->pixel[(size_t)r * map->width + c];
            if (!pixel->hit) continue;
            const int n = __builtin_popcountll(pixel->levels);
            if (n > *levels) *levels = n;
            *low_m = fmin(*low_m, (double)pixel->low_m);
            hit = 1;
        }
    return hit;
}

static void draw_pixels(const struct map *map, struct height_range range, const struct map_layout *at,
                        struct map_image *image)
{
    for (uint32_t row = 0; row < map->height; row++) {
        uint8_t *rgb = image->rgb + ((size_t)(at->top + map->height - 1 - row) * image->width + at->left) * 3;
        for (uint32_t column = 0; column < map->width; column++, rgb += 3) {
            int levels;
            double low_m;
            if (!gather(map, column, row, &levels, &low_m)) continue;
            const double structure = (double)(levels - FREE_LEVELS) / (WALL_LEVELS - FREE_LEVELS);
            map_colour(fmin(1, fmax(0, structure)), height_share(range, low_m), rgb);
        }
    }
}

static void draw_triangle_about(struct map_image *image, double x, double y, double size, const uint8_t rgb[3])
{
    const double corner[3][2] = {{x, y - size}, {x + 0.87 * size, y + 0.5 * size}, {x - 0.87 * size, y + 0.5 * size}};
    map_image_triangle(image, corner, rgb);
}

static void draw_stations(const struct map *map, const struct map_layout *at, struct map_image *image)
{
    for (uint32_t i = 0; i < map->n_stations; i++) {
        const double x = at->left + (map->station_m[i][0] - map->min_m[0]) / map->pixel_m;
        const double y = at->top + map->height - (map->station_m[i][1] - map->min_m[1]) / map->pixel_m;
        draw_triangle_about(image, x, y, STATION_PX + 4, white);
        draw_triangle_about(image, x, y, STATION_PX, red);
    }
}

/* The longest of 1, 2, 5 x 10^n metres that takes at most max_px. */
static double bar_length(double pixel_m, double max_px)
{
    const double most_m = max_px * pixel_m, decade = pow(10, floor(log10(most_m)));
    return most_m >= 5 * decade ? 5 * decade : most_m >= 2 * decade ? 2 * decade : decade;
}

static void draw_scale(const struct map *map, long column, long row, struct map_image *image)
{
    const double length_m = bar_length(map->pixel_m, BAR_PX);
    const long length = lrint(length_m / map->pixel_m);
    char text[32];
    map_image_fill(image, column, row, length, 4, ink);
    map_image_fill(image, column, row - 6, 2, 10, ink);
    map_image_fill(image, column + length - 2, row - 6, 2, 10, ink);
    if (length_m >= 1000)
        snprintf(text, sizeof text, "%.0f km", length_m / 1000);
    else
        snprintf(text, sizeof text, "%.*f m", length_m < 1 ? (int)ceil(-log10(length_m)) : 0, length_m);
    map_image_text(image, column, row + 12, DOT_PX, ink, text);
}

static void draw_heights(struct height_range range, long column, long row, struct map_image *image)
{
    enum { LENGTH = 120, HEIGHT = 12 };
    for (long i = 0; i < LENGTH; i++) {
        uint8_t rgb[3];
        map_colour(0.15, (double)i / (LENGTH - 1), rgb);
        map_image_fill(image, column + i, row - 6, 1, HEIGHT, rgb);
    }
    char text[32];
    snprintf(text, sizeof text, "+%.1f m", range.high_m - range.low_m);
    map_image_text(image, column, row + 12, DOT_PX, ink, "0");
    map_image_text(image, column + LENGTH - 6 * DOT_PX * (long)strlen(text), row + 12, DOT_PX, ink, text);
}

static void draw_north(long column, long row, struct map_image *image)
{
    const double x = (double)column, y = (double)row;
    const double left[3][2] = {{x, y - 20}, {x, y + 8}, {x - 9, y + 14}};
    const double right[3][2] = {{x, y - 20}, {x, y + 8}, {x + 9, y + 14}};
    const uint8_t pale[3] = {176, 180, 188};
    map_image_triangle(image, left, ink);
    map_image_triangle(image, right, pale);
    map_image_text(image, column + 14, row - 10, DOT_PX, ink, "N");
}

int map_draw(const struct map *map, struct map_image *out, struct sh_err *err)
{
    struct map_layout at;
    map_get_layout(map, &at);
    const size_t bytes = (size_t)at.width * at.height * 3;
    out->width = at.width;
    out->height = at.height;
    out->rgb = malloc(bytes);
    if (out->rgb == NULL) return sh_fail(err, SH_ENOMEM, "map: no memory for %u x %u pixels", at.width, at.height);
    memset(out->rgb, 255, bytes);
    const struct height_range range = find_heights(map);
    const long margin = at.left < 24 ? (long)at.left : 24, row = (long)(at.top + at.map_height) + 30;
    draw_pixels(map, range, &at, out);
    draw_stations(map, &at, out);
    draw_scale(map, margin, row, out);
    if (range.high_m > range.low_m) draw_heights(range, margin + BAR_PX + 30, row, out);
    draw_north((long)at.width - margin - 30, row, out);
    return SH_OK;
}
