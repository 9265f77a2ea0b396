/* SPDX-License-Identifier: MIT */
/* scanhead map --perspective: a picture of points as seen from a place. In: the options, and a configuration whose
 * stations are scanned, or a recorded cloud. With both, the cloud is shown, and the configuration says where the
 * cloud's stations are. Out: a PNG. */
#ifndef FIRMWARE_SIM_APP_STUDIO_MAP_VIEW_H
#define FIRMWARE_SIM_APP_STUDIO_MAP_VIEW_H

#include "core/err.h"
#include "core/studio/view.h"

struct config;

enum map_view_colour {
    MAP_VIEW_HEIGHT,
    MAP_VIEW_RANGE,
    MAP_VIEW_REFLECTANCE,
    MAP_VIEW_LABEL,
    MAP_VIEW_STATION,
    MAP_VIEW_RGB,
};

/* The words of --colour, and of --from: clockwise from north, 45 degrees apart. */
extern const char *const map_view_colours[6], *const map_view_winds[8];

/* As the command line says it. */
struct map_view_options {
    const char *cloud, *from, *eye, *look_at, *size, *colour, *limits;
    double elevation_deg, fov_deg, point_m, point_px, below_m, above_m, shade; /* point_m < 0: by the scene's size */
};
extern const struct map_view_options map_view_default;

/* The same, read and checked. The options must live on. */
struct map_view_plan {
    enum map_view_colour colour;
    struct view_camera camera; /* eye and look_at as given */
    int has_eye, has_look_at, has_limits;
    double azimuth_rad, elevation_rad, limit[2];
    const struct map_view_options *given; /* heights, widths of points and shade are used as given */
    const char *output;                   /* the file to write; the caller's, as is quiet */
    int quiet;
};
/* SH_EINPUT with what is wrong with which option. output and quiet become 0. */
int map_view_read(const struct map_view_options *options, struct map_view_plan *plan, struct sh_err *err);

/* Scans the stations. */
int map_view_scan(struct config *cfg, const struct map_view_plan *plan, struct sh_err *err);
/* Shows a recording. cfg NULL: its coordinates are shown as they are. */
int map_view_cloud(struct config *cfg, const char *cloud, const struct map_view_plan *plan, struct sh_err *err);

#endif
