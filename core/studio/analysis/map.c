/* SPDX-License-Identifier: MIT */
#include "core/studio/map.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/studio/analysis/map_inside.h"
#include "core/grow.h"

/* The least height of a height level (map_pixel.levels). The noise of points, and the rise of a floor within one pixel,
 * are smaller. So a floor fills at most two levels. */
#define LEVEL_MIN_M 0.1

enum { MARGIN_PX = 24, CAPTION_PX = 72 };

static int check_area(const struct map_spec *spec, struct sh_err *err)
{
    for (int i = 0; i < 2; i++) {
        if (!isfinite(spec->min_m[i]) || !isfinite(spec->max_m[i]) || !isfinite(spec->max_m[i] - spec->min_m[i]))
            return sh_fail(err, SH_EINPUT, "map: the limits in %c are not finite numbers of metres", "xy"[i]);
        if (spec->max_m[i] < spec->min_m[i])
            return sh_fail(err, SH_EINPUT, "map: %c from %g m to %g m; the second must not be smaller", "xy"[i],
                           spec -> min_m[i], spec -> max_m[i]);
    }
    if (!(spec->pixel_m >= 0) || !isfinite(spec->pixel_m))
        return sh_fail(err, SH_EINPUT, "map: pixel size %g m; allowed are sizes above 0, or 0: by the area",
                       spec->pixel_m);
    if (spec->max_m[0] <= spec->min_m[0] && spec->max_m[1] <= spec->min_m[1])
        return sh_fail(err, SH_EINPUT, "map: the area is a point (x %g m, y %g m); it needs an extent", spec->min_m[0],
                       spec->min_m[1]);
    return SH_OK;
}

/* Returns the pixels along a side; a place on the upper limit belongs to the last one. The number may be beyond any
 * integer. */
static double side_px(const struct map_spec *spec, int axis, double pixel_m)
{
    return fmax(1, ceil((spec->max_m[axis] - spec->min_m[axis]) / pixel_m - 1e-9));
}

int map_create(const struct map_spec *spec, struct map **out, struct sh_err *err)
{
    int rc = check_area(spec, err);
    if (rc != SH_OK) return rc;
    const double w_m = spec->max_m[0] - spec->min_m[0], h_m = spec->max_m[1] - spec->min_m[1];
    const double pixel_m = spec->pixel_m > 0 ? spec->pixel_m : fmax(w_m, h_m) / MAP_DEFAULT_PX;
    const double width = side_px(spec, 0, pixel_m), height = side_px(spec, 1, pixel_m);
    if (!(width <= MAP_MAX_SIDE_PX) || !(height <= MAP_MAX_SIDE_PX) || !(width * height <= MAP_MAX_PIXELS)) {
        const double least_m = fmax(fmax(w_m, h_m) / (MAP_MAX_SIDE_PX - 1), sqrt(w_m * h_m / (0.99 * MAP_MAX_PIXELS)));
        return sh_fail(err, SH_EINPUT, "map: %g x %g m at %g m per pixel are %.0f x %.0f pixels; use %.2g m or more",
                       w_m, h_m, pixel_m, width, height, least_m * 1.05);
    }
    struct map *map = calloc(1, sizeof *map);
    if (map == NULL) return sh_fail(err, SH_ENOMEM, "map: no memory");
    memcpy(map->min_m, spec->min_m, sizeof map->min_m);
    memcpy(map->max_m, spec->max_m, sizeof map->max_m);
    map->pixel_m = pixel_m;
    map->level_m = fmax(LEVEL_MIN_M, pixel_m);
    map->width = (uint32_t)width;
    map->height = (uint32_t)height;
    map->pixel = calloc((size_t)map->width * map->height, sizeof *map->pixel);
    if (map->pixel == NULL) {
        map_free(map);
        return sh_fail(err, SH_ENOMEM, "map: no memory for %.0f x %.0f pixels", width, height);
    }
    *out = map;
    return SH_OK;
}

void map_free(struct map *map)
{
    if (map == NULL) return;
    free(map->pixel);
    for (int kind = 0; kind < MAP_LINES; kind++)
        free(map->line[kind]);
    free(map);
}

/* Finds the pixel of a place. Columns and rows are numbered from min_m on. Returns 0 outside the area, and for NaN. */
static int locate(const struct map *map, double x_m, double y_m, uint32_t *column, uint32_t *row)
{
    if (!(x_m >= map->min_m[0] && x_m <= map->max_m[0] && y_m >= map->min_m[1] && y_m <= map->max_m[1])) return 0;
    const double c = (x_m - map->min_m[0]) / map->pixel_m, r = (y_m - map->min_m[1]) / map->pixel_m;
    *column = c < map->width ? (uint32_t)c : map->width - 1;
    *row = r < map->height ? (uint32_t)r : map->height - 1;
    return 1;
}

void map_add_points(struct map *map, size_t n, const double *x_m, const double *y_m, const double *z_m)
{
    for (size_t i = 0; i < n; i++) {
        uint32_t column, row;
        if (!isfinite(x_m[i]) || !isfinite(y_m[i]) || !isfinite(z_m[i])) {
            map->counts.empty++;
            continue;
        }
        if (!locate(map, x_m[i], y_m[i], &column, &row) || fabs(z_m[i]) > MAP_MAX_Z_M) {
            map->counts.outside++;
            continue;
        }
        if (map->counts.drawn++ == 0) map->z0_m = z_m[i];
        struct map_pixel *pixel = &map->pixel[(size_t)row * map->width + column];
        const double height_m = z_m[i] - map->z0_m;
        const double level = fmod(floor(height_m / map->level_m), 64);
        pixel->levels |= (uint64_t)1 << (unsigned)(level < 0 ? level + 64 : level);
        if (!pixel->hit || (float)height_m < pixel->low_m) pixel->low_m = (float)height_m;
        pixel->hit = 1;
    }
}

int map_add_station(struct map *map, const struct map_station *station, struct sh_err *err)
{
    uint32_t column, row;
    if (map->n_stations == MAP_MAX_STATIONS)
        return sh_fail(err, SH_EINPUT, "map: more than %d stations", (int)MAP_MAX_STATIONS);
    if (!locate(map, station->x_m, station->y_m, &column, &row))
        return sh_fail(err, SH_EINPUT, "map: station at x %g m, y %g m; allowed x %g to %g, y %g to %g", station->x_m,
                       station->y_m, map->min_m[0], map->max_m[0], map->min_m[1], map->max_m[1]);
    map->station[map->n_stations++] = *station;
    return SH_OK;
}

int map_add_line(struct map *map, enum map_line kind, const double a[2], const double b[2], struct sh_err *err)
{
    uint64_t *n = &map->counts.lines[kind];
    if (*n == MAP_MAX_LINES) {
        map->counts.lines_left_out[kind]++;
        return SH_OK;
    }
    if (!grow(&map->line[kind], &map->room_lines[kind], *n + 1, sizeof *map->line[kind]))
        return sh_fail(err, SH_ENOMEM, "map: no memory for %d lines", (int)MAP_MAX_LINES);
    double(*ends)[2] = map->line[kind][(*n)++];
    for (int k = 0; k < 2; k++) {
        ends[0][k] = fmin(fmax(a[k], map->min_m[k]), map->max_m[k]);
        ends[1][k] = fmin(fmax(b[k], map->min_m[k]), map->max_m[k]);
    }
    return SH_OK;
}

void map_get_counts(const struct map *map, struct map_counts *counts)
{
    *counts = map->counts;
}

void map_get_layout(const struct map *map, struct map_layout *layout)
{
    const uint32_t inner = map->width + 2 * MARGIN_PX;
    layout->width = inner > MAP_MIN_WIDTH_PX ? inner : MAP_MIN_WIDTH_PX;
    layout->height = map->height + MARGIN_PX + CAPTION_PX;
    layout->left = (layout->width - map->width) / 2;
    layout->top = MARGIN_PX;
    layout->map_width = map->width;
    layout->map_height = map->height;
    layout->pixel_m = map->pixel_m;
}

int map_write_png(const struct map *map, const char *path, struct sh_err *err)
{
    struct picture picture = {0};
    int rc = map_draw_pixels(map, &picture, err);
    struct pen pen = picture_pen(&picture);
    if (rc == SH_OK) rc = map_draw_marks(map, &pen, err);
    if (rc == SH_OK) rc = picture_write_png(&picture, "map", path, err);
    picture_free(&picture);
    return rc;
}

int map_write_svg(const struct map *map, const char *path, struct sh_err *err)
{
    struct picture picture = {0};
    struct svg *svg = NULL;
    struct map_layout at;
    map_get_layout(map, &at);
    int rc = map_draw_pixels(map, &picture, err);
    const struct picture_part pixels = {&picture, at.left, at.top, at.map_width, at.map_height, NULL};
    if (rc == SH_OK) rc = svg_begin(at.width, at.height, "Scan map", &svg, err);
    if (rc == SH_OK) rc = svg_image(svg, &pixels, err);
    struct pen pen = svg_pen(svg);
    if (rc == SH_OK) rc = map_draw_marks(map, &pen, err);
    if (rc == SH_OK) rc = svg_write(svg, "map", path, err);
    svg_end(svg);
    picture_free(&picture);
    return rc;
}
