/* SPDX-License-Identifier: MIT */
/* A picture of points as seen from a place: a pinhole camera, hidden points removed, shading by depth. In: any
 * number of points, one after the other, in prcs (metres), each with a figure or a colour. Out: an image.
 *
 * Camera: at eye, looking at look_at, z up in the picture. A point p with right, up and ahead coordinates (r, u, d)
 * from the eye is at
 *     column = width / 2 + f r / d,  row = height / 2 - f u / d,  f = width / 2 / tan(fov / 2)
 * in pixels, d > 0. fov is the angle across the width.
 *
 * Each point is a disc: point_m wide, and at least point_px. Where discs overlap, that of the nearer point counts. A
 * disc is deeper at its rim than at its centre, so that on a surface each place shows the disc whose centre is nearest.
 * Memory depends on the image alone: 12 bytes for each place, and 32 while the image is drawn. A pixel has 2 x 2 places
 * (VIEW_SUB).
 *
 * Shading: surfaces that face the light from the upper left of the eye are bright; places whose neighbours are
 * nearer are dark (eye-dome lighting, C. Boucheny: Visualisation scientifique de grands volumes de donnees: pour
 * une approche perceptive, thesis, Grenoble 2009), at several distances in the image. Normals come from the depths,
 * which are smoothed within surfaces.
 *
 * Ownership: view_create allocates, view_free releases. One thread at a time. Not real-time safe. */
#ifndef CORE_STUDIO_VIEW_H
#define CORE_STUDIO_VIEW_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"
#include "core/studio/picture.h"

enum {
    VIEW_MIN_PX = 16,
    VIEW_MAX_SIDE_PX = 8192,
    VIEW_MAX_PIXELS = 16777216, /* 2.05 GiB while it is drawn: 32 bytes a place, 3 a pixel */
};

struct view_camera {
    double eye_m[3], look_at_m[3];
    double fov_rad; /* across the width; 0.01 to 2.8 */
    uint32_t width, height;
};

struct view_spec {
    struct view_camera camera;
    double point_m;  /* width of a point in the scene; 0: point_px alone counts */
    double point_px; /* its least width in the image */
};

struct view;

/* SH_EINPUT: a size or angle out of its limits, an eye at the place it looks at, figures that are not finite. Looked
 * at straight from above, y is up in the picture; from below, -y. */
int view_create(const struct view_spec *spec, struct view **out, struct sh_err *err);
void view_free(struct view *view);

/* Adds n points in prcs. Each has a colour (rgb, may be NULL) or else a figure (value; NaN: not known). Points that
 * are not finite are shots without echo and left out. */
void view_add_points(struct view *view, size_t n, const double (*xyz_m)[3], const float *value,
                     const uint8_t (*rgb)[3]);

struct view_counts {
    uint64_t drawn;  /* points whose disc touches the image: some of them are hidden */
    uint64_t beyond; /* outside of the image, or behind the eye */
    uint64_t empty;  /* not finite */
};
void view_get_counts(const struct view *view, struct view_counts *counts);

/* Finds where a place of the scene is in the image, and its depth_m ahead of the eye. Returns 0 where it is not in
 * front of the eye. */
int view_project(const struct view *view, const double p_m[3], double place_px[2], double *depth_m);

/* Gives the smallest and largest visible figure, without the lowest and highest half percent of the places. Returns
 * 0 where none is visible. */
int view_range(const struct view *view, double *low, double *high);

/* Colours of figures. */
struct view_colours {
    void (*colour)(const void *ctx, double value, uint8_t rgb[3]);
    const void *ctx;
    double shade;                   /* 0: none, 1: usual strength */
    uint8_t background[3];          /* where nothing is */
    const struct sh_report *report; /* of the work, line by line; NULL: none */
};

/* Makes the image, which the caller frees with picture_free. SH_ESTOPPED where report asks to stop; there is no
 * image then. */
int view_draw(const struct view *view, const struct view_colours *colours, struct picture *out, struct sh_err *err);

/* ---- marks and legends */

/* Gives even steps of CIE L*a*b* from blue (0) over green and yellow to red (1): like the map's heights, but stronger.
 * NaN: colour_unknown. */
void view_ramp(double part, uint8_t rgb[3]);

/* Draws marks of the stations that lie in front of the eye and in the image, and their names where these cover no other
 * name or mark. Returns how many stations have a mark but no name. */
struct view_station {
    double p_m[3];
    const char *name;
};
uint32_t view_draw_stations(const struct view *view, struct picture *picture, const struct view_station *station,
                            uint32_t n);

/* Draws a scale below on the left: colours from low to high, and round figures under them. title has the unit. */
void view_draw_scale(struct picture *picture, const char *title, double low, double high,
                     const struct view_colours *colours);

struct view_entry {
    uint8_t rgb[3];
    char name[64];
};
enum { VIEW_MAX_NAMES = 12 };
/* Draws a legend below on the left, of n things with names; entry has the first VIEW_MAX_NAMES of them. Where there is
 * no room for all, it ends with the number of the others. */
void view_draw_names(struct picture *picture, const char *title, const struct view_entry *entry, uint32_t n);

/* ---- where to look from */

/* Chooses an eye from which a box fills the image. azimuth and elevation say in which direction from the box the eye
 * stands: azimuth clockwise from y, seen from above; elevation above the horizon, below 90 degrees. fov, width and
 * height are given; eye and look_at are set. */
void view_frame(const double min_m[3], const double max_m[3], double azimuth_rad, double elevation_rad,
                struct view_camera *camera);

#endif
