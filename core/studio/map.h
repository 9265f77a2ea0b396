/* SPDX-License-Identifier: MIT */
/* The scan map: points seen from above, as a PNG or SVG. In: points and stations in prcs (metres). Out: an
 * image.
 *
 * x goes to the right, y (north) up. Per pixel the map keeps which height levels were hit, and the lowest
 * point.
 *   lightness  shows structure: a pixel with points on many levels (a wall) is dark, one with floor and
 *              ceiling only is light, one without points is white. Lightness does not depend on the density of
 *              points, so far walls stand out like near ones. Each point is drawn three pixels wide.
 *   hue        shows the height of the lowest point in the pixel and its neighbours. The hues spread over the
 *              heights of 99 % of the pixels, so that stray points don't take the colours from all others.
 * Lightness and hue are even steps of CIE L*a*b*. Below the map: scale bar, legend of heights, north arrow. Each
 * station has a red triangle, a tick where its heading points, and its name and height beside it. A label stands near
 * its station where it covers neither another label nor a station, and as little of walls as possible. Without such a
 * place the label is left out and counted. An SVG has the points as an image, and all else as vectors. In an SVG each
 * station has its name and height as a title, also where its label is left out.
 *
 * Ownership: map_create allocates everything, map_free releases it. Thread: one at a time. Not real-time
 * safe. */
#ifndef CORE_STUDIO_MAP_H
#define CORE_STUDIO_MAP_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"

#define MAP_MAX_Z_M 1e9 /* as the scene's limit for coordinates */

enum {
    MAP_DEFAULT_PX = 1200,     /* longer side of the map where the pixel size is not given */
    MAP_MAX_SIDE_PX = 16384,   /* longest side of the map */
    MAP_MAX_PIXELS = 16777216, /* of the map: 16 bytes each while it is made, 256 MiB */
    MAP_MAX_STATIONS = 4096,
    MAP_MAX_LINES = 100000, /* of a kind; an SVG has an element for each */
    MAP_MIN_WIDTH_PX = 512, /* of the image; a narrower map is centred */
    MAP_NAME_LEN = 96,
};

struct map_spec {
    double min_m[2], max_m[2]; /* x and y of the area, prcs; max >= min, the area may be a line but not a point */
    double pixel_m;            /* side of a pixel; 0: so that the longer side has MAP_DEFAULT_PX */
};

struct map;

/* SH_EINPUT: limits that are not finite or the wrong way round, an area that is a point, a pixel size that is
 * negative, or too small for the area. In the last case the text has a pixel size that is large enough. */
int map_create(const struct map_spec *spec, struct map **out, struct sh_err *err);
void map_free(struct map *map);

/* Adds n points in prcs. A point with a coordinate that is not finite is a shot without echo: it is left out. */
void map_add_points(struct map *map, size_t n, const double *x_m, const double *y_m, const double *z_m);

struct map_station {
    double x_m, y_m;
    double heading_rad;        /* clockwise from y; NaN: no tick */
    char name[MAP_NAME_LEN];   /* UTF-8; empty: none */
    char height[MAP_NAME_LEN]; /* text under the name; empty: none */
};

/* SH_EINPUT outside the area or beyond MAP_MAX_STATIONS. */
int map_add_station(struct map *map, const struct map_station *station, struct sh_err *err);

enum map_line { MAP_OPEN_EDGE, MAP_FIELD, MAP_LINES };

/* Adds a line from a to b, prcs: an open edge of the scene, red, or a line of a monitored field, blue. Lines are drawn
 * under the stations. Ends outside of the area are moved to its border. Beyond MAP_MAX_LINES of its kind a line is left
 * out and counted. SH_ENOMEM. */
int map_add_line(struct map *map, enum map_line kind, const double a[2], const double b[2], struct sh_err *err);

struct map_counts {
    uint64_t drawn;   /* points that lie in the area */
    uint64_t outside; /* points beyond the area, or with |z| above MAP_MAX_Z_M */
    uint64_t empty;   /* points that are not finite */
    uint64_t lines[MAP_LINES], lines_left_out[MAP_LINES];
};
void map_get_counts(const struct map *map, struct map_counts *counts);

/* The layout of the image, in pixels from its upper left corner. */
struct map_layout {
    uint32_t width, height;         /* of the image */
    uint32_t left, top;             /* of the map in the image */
    uint32_t map_width, map_height; /* of the map */
    double pixel_m;                 /* as chosen */
};
void map_get_layout(const struct map *map, struct map_layout *layout);

/* A label in the image: its box, and its station by the order in which they were added. */
struct map_label {
    double left, top, right, bottom;
    uint32_t station;
    int placed; /* 0: there was no room */
};
/* Chooses places for the labels of all stations; out has room for all. Returns how many were left out. */
uint32_t map_place_labels(const struct map *map, struct map_label *out);

/* Writes the image to path.part, which is renamed once it is complete: path never has a part of an image. A map without
 * points is drawn as well. Errors name the path. */
int map_write_png(const struct map *map, const char *path, struct sh_err *err);
int map_write_svg(const struct map *map, const char *path, struct sh_err *err);

#endif
