/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/studio/analysis/map_inside.h"
#include "core/angle.h"

enum {
    WALL_LEVELS = 14, /* a pixel with points at so many height levels is as dark as it gets */
    FREE_LEVELS = 4,  /* floor and ceiling fill up to two levels each; only more levels than these are structure */
    HISTOGRAM_BINS = 1024,
    BAR_PX = 240, /* longest scale bar */
};

const struct picture_type map_name_type = {11.5, 1, 2.5}, map_height_type = {10, 0, 2.5};
static const struct picture_type caption = {11, 0, 0};

static const uint8_t ink[3] = {40, 44, 52}, red[3] = {214, 39, 40}, blue[3] = {31, 119, 180},
                     white[3] = {255, 255, 255};

/* Heights between which the hues spread. These heights hold 99 % of the pixels, so that a single stray point does not
 * take the colours from all others. */
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

/* Finds the most levels of a pixel, and the lowest point, among the 3 x 3 pixels around a place. So a wall is three
 * pixels wide and scan lines close up; where floor and ceiling alternate, the floor shows. Returns 0 where there is no
 * point. */
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

static double structure_of(int levels)
{
    return fmin(1, fmax(0, (double)(levels - FREE_LEVELS) / (WALL_LEVELS - FREE_LEVELS)));
}

double map_structure(const struct map *map, uint32_t column, uint32_t row)
{
    int levels;
    double low_m;
    return gather(map, column, row, &levels, &low_m) ? structure_of(levels) : 0;
}

/* Sets the colour of a structure and a height, both 0..1. */
static void colour_of(double structure, double height, uint8_t rgb[3])
{
    /* From blue over green and yellow to red, away from the purple that would close the circle. */
    const double hue_rad = angle_rad(255 - 205 * height);
    const double lightness = 90 - 70 * structure;
    const double chroma = (12 + 20 * height) * (1 - 0.45 * structure);
    picture_lab(lightness, chroma * cos(hue_rad), chroma * sin(hue_rad), rgb);
}

int map_draw_pixels(const struct map *map, struct picture *out, struct sh_err *err)
{
    struct map_layout at;
    map_get_layout(map, &at);
    int rc = picture_make(out, at.width, at.height, white, err);
    if (rc != SH_OK) return rc;
    const struct height_range range = find_heights(map);
    for (uint32_t row = 0; row < map->height; row++) {
        uint8_t *rgb = out->rgb + ((size_t)(at.top + map->height - 1 - row) * out->width + at.left) * 3;
        for (uint32_t column = 0; column < map->width; column++, rgb += 3) {
            int levels;
            double low_m;
            if (!gather(map, column, row, &levels, &low_m)) continue;
            colour_of(structure_of(levels), height_share(range, low_m), rgb);
        }
    }
    return SH_OK;
}

/* Finds where a place of the scene is in the image. */
static void map_draw_place_of(const struct map *map, double x_m, double y_m, double place[2])
{
    struct map_layout at;
    map_get_layout(map, &at);
    place[0] = at.left + (x_m - map->min_m[0]) / map->pixel_m;
    place[1] = at.top + map->height - (y_m - map->min_m[1]) / map->pixel_m;
}

void map_station_place(const struct map *map, uint32_t station, double place[2])
{
    map_draw_place_of(map, map->station[station].x_m, map->station[station].y_m, place);
}

static void draw_lines(const struct map *map, enum map_line kind, struct pen *pen)
{
    static const struct {
        const char *class, *title;
        const uint8_t *rgb;
    } style[MAP_LINES] = {[MAP_OPEN_EDGE] = {"edges", "open edges of the scene", red},
                          [MAP_FIELD] = {"fields", "monitored fields", blue}};
    if (map->counts.lines[kind] == 0) return;
    pen->begin(pen->on, style[kind].class, style[kind].title);
    for (uint64_t i = 0; i < map->counts.lines[kind]; i++) {
        const double(*ends)[2] = map->line[kind][i];
        double from[2], to[2];
        map_draw_place_of(map, ends[0][0], ends[0][1], from);
        map_draw_place_of(map, ends[1][0], ends[1][1], to);
        pen->line(pen->on, from, to, 2, style[kind].rgb);
    }
    pen->end(pen->on);
}

static void draw_triangle_about(struct pen *pen, const double at[2], double size, const uint8_t rgb[3])
{
    const double corner[3][2] = {
        {at[0], at[1] - size}, {at[0] + 0.87 * size, at[1] + 0.5 * size}, {at[0] - 0.87 * size, at[1] + 0.5 * size}};
    pen->triangle(pen->on, corner, rgb);
}

static void draw_station(const struct map *map, uint32_t i, struct pen *pen)
{
    const double heading_rad = map->station[i].heading_rad;
    double at[2];
    map_station_place(map, i, at);
    draw_triangle_about(pen, at, MAP_STATION_PX + 4, white);
    if (!isnan(heading_rad)) {
        const double tip[2] = {at[0] + MAP_TICK_PX * sin(heading_rad), at[1] - MAP_TICK_PX * cos(heading_rad)};
        pen->line(pen->on, at, tip, 5, white);
        pen->line(pen->on, at, tip, 2, red);
    }
    draw_triangle_about(pen, at, MAP_STATION_PX, red);
}

/* Draws a label. If it stands away from its station, a thin line leads from one to the other. */
static void draw_label(const struct map *map, const struct map_label *label, struct pen *pen)
{
    const struct map_station *station = &map->station[label->station];
    double at[2];
    map_station_place(map, label->station, at);
    const double x = fmin(label->right, fmax(label->left, at[0])), y = fmin(label->bottom, fmax(label->top, at[1]));
    const double away = hypot(x - at[0], y - at[1]);
    if (away > 2.5 * MAP_STATION_PX) {
        const double from[2] = {at[0] + (x - at[0]) * (MAP_STATION_PX + 5) / away,
                                at[1] + (y - at[1]) * (MAP_STATION_PX + 5) / away};
        const double to[2] = {x, y};
        pen->line(pen->on, from, to, 1, ink);
    }
    double base = label->top + map_name_type.size_px + 2;
    if (station->name[0] != '\0') {
        pen->text(pen->on, (const double[2]){label->left + 2, base}, PICTURE_LEFT, &map_name_type, ink, station->name);
        base += map_height_type.size_px + 6;
    }
    if (station->height[0] != '\0')
        pen->text(pen->on, (const double[2]){label->left + 2, base}, PICTURE_LEFT, &map_height_type, ink,
                  station->height);
}

static int draw_stations(const struct map *map, struct pen *pen, struct sh_err *err)
{
    struct map_label *label = malloc((map->n_stations + 1) * sizeof *label);
    if (label == NULL) return sh_fail(err, SH_ENOMEM, "map: no memory for %u labels", map->n_stations);
    map_place_labels(map, label);
    for (uint32_t i = 0; i < map->n_stations; i++) {
        char title[2 * MAP_NAME_LEN + 4];
        snprintf(title, sizeof title, "%s%s%s", map->station[i].name,
                 map->station[i].name[0] != '\0' && map->station[i].height[0] != '\0' ? ", " : "",
                 map->station[i].height);
        pen->begin(pen->on, "station", title);
        draw_station(map, i, pen);
        pen->end(pen->on);
    }
    for (uint32_t i = 0; i < map->n_stations; i++)
        if (label[i].placed) draw_label(map, &label[i], pen);
    free(label);
    return SH_OK;
}

/* Returns the longest of 1, 2, 5 x 10^n metres that takes at most max_px. */
static double bar_length(double pixel_m, double max_px)
{
    const double most_m = max_px * pixel_m, decade = pow(10, floor(log10(most_m)));
    return most_m >= 5 * decade ? 5 * decade : most_m >= 2 * decade ? 2 * decade : decade;
}

static void draw_scale(const struct map *map, long column, long row, struct pen *pen)
{
    const double length_m = bar_length(map->pixel_m, BAR_PX);
    const long length = lrint(length_m / map->pixel_m);
    char text[32];
    if (length_m >= 1000)
        snprintf(text, sizeof text, "%.0f km", length_m / 1000);
    else
        snprintf(text, sizeof text, "%.*f m", length_m < 1 ? (int)ceil(-log10(length_m)) : 0, length_m);
    pen->begin(pen->on, "scale", text);
    pen->fill(pen->on, column, row, length, 4, ink);
    pen->fill(pen->on, column, row - 6, 2, 10, ink);
    pen->fill(pen->on, column + length - 2, row - 6, 2, 10, ink);
    pen->text(pen->on, (const double[2]){(double)column, (double)row + 24}, PICTURE_LEFT, &caption, ink, text);
    pen->end(pen->on);
}

static void draw_heights(struct height_range range, long column, long row, struct pen *pen)
{
    enum { LENGTH = 160, HEIGHT = 12 };
    char text[48];
    pen->begin(pen->on, "legend", "height of each pixel's lowest point above the low end of the colours");
    for (long i = 0; i < LENGTH; i += 2) {
        uint8_t rgb[3];
        colour_of(0.15, (double)i / (LENGTH - 2), rgb);
        pen->fill(pen->on, column + i, row - 6, 2, HEIGHT, rgb);
    }
    snprintf(text, sizeof text, "+%.1f m", range.high_m - range.low_m);
    pen->text(pen->on, (const double[2]){(double)column, (double)row + 24}, PICTURE_LEFT, &caption, ink, "0");
    pen->text(pen->on, (const double[2]){(double)column + LENGTH, (double)row + 24}, PICTURE_RIGHT, &caption, ink,
              text);
    pen->end(pen->on);
}

static void draw_north(long column, long row, struct pen *pen)
{
    const double x = (double)column, y = (double)row;
    const double left[3][2] = {{x, y - 20}, {x, y + 8}, {x - 9, y + 14}};
    const double right[3][2] = {{x, y - 20}, {x, y + 8}, {x + 9, y + 14}};
    const uint8_t pale[3] = {176, 180, 188};
    pen->begin(pen->on, "north", "north");
    pen->triangle(pen->on, left, ink);
    pen->triangle(pen->on, right, pale);
    pen->text(pen->on, (const double[2]){(double)column + 13, (double)row + 2}, PICTURE_LEFT, &caption, ink, "N");
    pen->end(pen->on);
}

int map_draw_marks(const struct map *map, struct pen *pen, struct sh_err *err)
{
    struct map_layout at;
    map_get_layout(map, &at);
    const struct height_range range = find_heights(map);
    const long margin = at.left < 24 ? (long)at.left : 24, row = (long)(at.top + at.map_height) + 30;
    draw_lines(map, MAP_OPEN_EDGE, pen);
    draw_lines(map, MAP_FIELD, pen);
    draw_scale(map, margin, row, pen);
    if (range.high_m > range.low_m) draw_heights(range, margin + BAR_PX + 30, row, pen);
    draw_north((long)at.width - margin - 30, row, pen);
    return draw_stations(map, pen, err);
}
