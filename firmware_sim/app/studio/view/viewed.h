/* SPDX-License-Identifier: MIT */
/* A recording that is shown: its points, its meshes, and what the file says of itself. In: a file (.shs, .pcapng, .ply,
 * .las). Out: arrays, in metres, in one coordinate frame with z up.
 *
 * Shots without echo are counted, not held. Meshes are those of `scanhead record --mesh` before the long-edge filter.
 * Each triangle has its edge ratio, by which the filter decides, so that any factor can be shown at once.
 * README.md says how much memory they take. Constant after viewed_load; any thread. */
#ifndef FIRMWARE_SIM_APP_STUDIO_VIEW_VIEWED_H
#define FIRMWARE_SIM_APP_STUDIO_VIEW_VIEWED_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"
#include "core/studio/cloud.h"

struct viewed_mesh {
    uint32_t station, scan, sweep;  /* scan: its number in the stream; sweep: its pan sweep */
    uint32_t first_point, n_points; /* its corners are among these points of the recording */
    uint32_t n_faces;
    uint32_t (*face)[3]; /* [n_faces] points, from first_point on; in the order of the grid */
    float *ratio;        /* [n_faces] longest edge over mean edge, rounded upwards: a factor f keeps faces up to f */
    uint32_t *order;     /* [n_faces] faces by rising ratio */
    double mean_edge_m;
    uint64_t n_edges, n_flat;
};

struct viewed_station {
    uint32_t number;
    int placed; /* 1: its place is known: */
    double p_m[3], heading_rad, pitch_rad, roll_rad;
};

struct viewed_surface {
    uint32_t label;
    char *object, *material;
};

struct viewed {
    const char *path;
    const char *format;           /* "shs" (also of a .pcapng), "ply", "las" */
    struct cloud points;          /* up to UINT32_MAX, without shots that have no echo; its epsg is that of the file */
    uint64_t n_empty, n_left_out; /* shots without echo; echoes that could not be placed */
    int complete;                 /* .shs, .pcapng: nothing is missing, as far as the stream says; else 1 */
    int turned;                   /* 1: points were turned to east, north, up of this place: */
    double lat_deg, lon_deg, height_m;
    struct viewed_mesh *mesh;
    size_t n_meshes, room_meshes;
    char why_no_mesh[512];
    struct viewed_station *station;
    size_t n_stations, room_stations;
    struct viewed_surface *surface;
    size_t n_surfaces, room_surfaces;
    char idn[128], profile[64]; /* empty: not known */
    /* of all points: */
    double min_m[3], max_m[3], origin_m[3], t0_s;
    double low[CLOUD_COLUMNS], high[CLOUD_COLUMNS]; /* over values that are known; NaN: none */
};

/* Loads by the file's ending and first bytes. Errors name the file: SH_EINPUT where it is no recording, SH_EIO,
 * SH_ENOMEM, SH_ESTOPPED. viewed_free is due in any case. path must live on. */
int viewed_load(struct viewed *viewed, const char *path, const struct sh_report *report, struct sh_err *err);
void viewed_free(struct viewed *viewed);

/* ---- the steps of viewed_load */

/* Returns SH_OK where recordings with the ending of this path can be shown. */
int viewed_check_ending(const char *path, struct sh_err *err);
int viewed_load_cloud(struct viewed *viewed, const struct sh_report *report, struct sh_err *err);
int viewed_load_stream(struct viewed *viewed, const struct sh_report *report, struct sh_err *err);
/* Whether a point of a file in this CRS has a place that can be shown: within 10^12 m, or in degrees with a latitude
 * within 90. Broken files hold larger numbers, which would not stay finite when they are turned. */
int viewed_can_show(int64_t epsg, const double p[3]);
/* Finds bounds, origin, and the columns' limits. */
void viewed_measure(struct viewed *viewed);
/* SH_ENOMEM. The text is copied. */
int viewed_add_surface(struct viewed *viewed, uint32_t label, const char *object, const char *material,
                       struct sh_err *err);
/* Returns the station of that number, a new one where there was none. NULL: no memory, with err filled. */
struct viewed_station *viewed_add_station(struct viewed *viewed, uint32_t number, struct sh_err *err);

#endif
