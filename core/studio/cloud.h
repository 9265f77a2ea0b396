/* SPDX-License-Identifier: MIT */
/* A recorded point cloud, and its distance from the scene. In: a PLY or LAS file, for positions alone also a PCD or
 * text file; the scene's BVH, the stations' georeferences. Out: points; per point a distance in metres and a triangle;
 * statistics and coverage of them.
 *
 * PLY: ASCII, or binary of either byte order, any number types. Element vertex has the properties x, y, z
 * and, where they are there, station (from 1), echo and label, as our recorder writes them. Everything else
 * is ignored. LAS: 1.2 to 1.4, not compressed. In LAS the point source ID is the station, the return number
 * the echo, and the extra bytes "label" the label. Further columns are read where they are asked for. Colours
 * have 8 bits in PLY; of LAS's 16 bits the upper 8 count. Ownership:
 * cloud_read_columns allocates, cloud_free releases. A cloud is constant after that, any thread.
 *
 * Memory: 29 bytes a point; time 8, range, reflectance and amplitude 4 each, colours 3, the number of echoes 1. The
 * file itself is in memory while it is read. */
#ifndef CORE_STUDIO_CLOUD_H
#define CORE_STUDIO_CLOUD_H

#include <stddef.h>
#include <stdint.h>

#include "core/bvh.h"
#include "core/err.h"
#include "core/georef.h"

enum {
    CLOUD_LABEL_NONE = 0xffff,
    CLOUD_EPSG_UNKNOWN = -1,
    CLOUD_TRIANGLE_NONE = 0xffffffff,
};

struct cloud {
    size_t n;
    double (*xyz_m)[3]; /* [n] as in the file, degrees with latitude first; three times NaN: a shot without echo */
    uint16_t *station;  /* [n] from 1; NULL: the file has none */
    uint16_t *label;    /* [n] CLOUD_LABEL_NONE: none; NULL: the file has none */
    uint8_t *echo;      /* [n] 0: shot without echo; NULL: the file has none */
    /* The step that the file rounds coordinates to, in metres, also where they are degrees: the scale of LAS, 1e-6 m of
     * a PLY as text (as our recorder writes it), or two units in the last place of single precision. 0: none. */
    double count_m;
    int is_single;      /* 1: in single precision */
    int is_text;        /* 1: the file holds coordinates as decimal numbers */
    int has_own_counts; /* 1: a LAS file of ours: its first station's points have the stream's own integers */
    /* Where they were asked for and the file has them, else NULL: */
    double *time_s;        /* [n] PLY: since the scan's start; LAS: as the file counts it */
    float *range_m;        /* [n] PLY alone; NaN: a shot without echo */
    float *reflectance_db; /* [n] NaN: not modelled; LAS: of scanhead's own files, whose intensity holds it */
    float *amplitude_db;   /* [n] PLY alone; NaN: none */
    uint8_t *echo_count;   /* [n] echoes of the point's pulse; 0: shot without echo */
    uint8_t (*rgb)[3];     /* [n] sRGB */
    int64_t epsg;          /* of PLY's comment "epsg N" or LAS's WKT; 0: scene frame; CLOUD_EPSG_UNKNOWN: none */
};

/* Returns two units in the last place of v in single precision. */
static inline double cloud_single_unit(double v)
{
    return 1.2e-7 * v;
}

/* Columns beside the position. A set of columns has bit c for column c. */
enum cloud_column {
    CLOUD_RANGE,
    CLOUD_REFLECTANCE,
    CLOUD_AMPLITUDE,
    CLOUD_TIME,
    CLOUD_LABEL,
    CLOUD_STATION,
    CLOUD_ECHO,
    CLOUD_ECHO_COUNT,
    CLOUD_RGB,
    CLOUD_COLUMNS
};

/* The array of a column, or NULL; *size: bytes of one value, its components together. */
void *cloud_array(const struct cloud *cloud, enum cloud_column column, size_t *size);
/* Makes room for n points in xyz_m and in the columns of the set `has`. The array of a column is NULL until the first
 * call that names the column. SH_ENOMEM: the points are unchanged; some arrays may have the new room. */
int cloud_make_room(struct cloud *cloud, size_t n, unsigned has, struct sh_err *err);

/* Reads positions, stations, echoes and labels, and this set of columns. SH_EINPUT names the file, and line or byte:
 *   the file is missing, unreadable, truncated, or not PLY or LAS; it lacks x, y or z, or counts more than it can hold;
 *   a coordinate is infinite, or only some of the three are NaN;
 *   a station, echo or label is not a whole number in its range.
 * Warns of other elements and of bytes after the last one. SH_ESTOPPED where report asks to stop. */
int cloud_read_columns(const char *path, unsigned columns, const struct sh_report *report, struct cloud *out,
                       struct sh_err *err);
/* Reads positions alone, from files of any software: PLY and LAS; PCD (text, binary, compressed); and text, a
 * line a point, with blanks, commas or semicolons between numbers. In text a line of names may say which columns are x,
 * y and z; else they are the first three. Other lines are left out; more than one of them gives a warning. */
int cloud_read_positions(const char *path, const struct sh_report *report, struct cloud *out, struct sh_err *err);
void cloud_free(struct cloud *cloud);

/* This says how cloud_compare maps a point to the scene. */
struct cloud_site {
    const struct bvh *bvh;
    /* [n_stations], by station - 1; NULL: the cloud is in the scene frame already */
    const struct georef *const *georef;
    uint32_t n_stations;
    double max_m; /* reach of the search */
    /* For bodies that move, which are not in the scene's BVH; NULL: there are none. Turns a point with such a body's
     * label into the body's own frame, and returns the body's BVH. Returns NULL for a point of the scene. Called from
     * any thread. */
    const struct bvh *(*body)(void *ctx, unsigned station, uint16_t label, double p_prcs[3]);
    void *body_ctx;
    unsigned threads; /* at least 1; the result does not depend on it */
};

/* Sets for each point its distance from the nearest triangle (NaN: shot without echo; INFINITY: nothing within max_m)
 * and that triangle's number. The number is CLOUD_TRIANGLE_NONE where there is no triangle, and where it is one of a
 * moving body. Points without a station are of the first one. SH_EINPUT: a point's station is not among n_stations,
 * or the cloud's EPSG code is not that of the station's georef. SH_ESTOPPED. */
int cloud_compare(const struct cloud *cloud, const struct cloud_site *site, const struct sh_report *report,
                  double *distance_m, uint32_t *triangle, struct sh_err *err);

/* A cloud with what cloud_compare found of it. */
struct cloud_compared {
    const struct cloud *cloud;
    const struct cloud_site *site;
    const double *distance_m; /* [cloud->n] */
    const uint32_t *triangle; /* [cloud->n] */
};

/* These two functions return the station of point i, from 1, and its place in the scene. */
static inline unsigned cloud_station(const struct cloud *cloud, size_t i)
{
    return cloud->station != NULL ? cloud->station[i] : 1;
}
void cloud_to_scene(const struct cloud *cloud, const struct cloud_site *site, size_t i, double p_prcs[3]);
/* Maps all points to places in the scene, once for all later calls, and removes the georefs from site.
 * Errors as of cloud_compare; after one, the cloud can't be used. */
int cloud_into_scene(struct cloud *cloud, struct cloud_site *site, const struct sh_report *report, struct sh_err *err);

struct cloud_coverage {
    uint32_t surfaces_hit, triangles_hit;
};

/* Returns the surface of point i: its label, or its nearest triangle's where the file has none; CLOUD_LABEL_NONE when
 * there is no such triangle. */
uint16_t cloud_surface(const struct cloud *cloud, const struct scene *scene, const uint32_t *triangle, size_t i);

/* Counts the surfaces and the triangles that have points. n_surfaces: those of the scene and then those of bodies.
 * `triangle` is as cloud_compare sets it. SH_EINPUT: a label of n_surfaces or more. */
int cloud_cover(const struct cloud *cloud, const struct scene *scene, uint32_t n_surfaces, const uint32_t *triangle,
                struct cloud_coverage *out, struct sh_err *err);

/* A percentile is the nearest rank: the smallest value that at least that share of all values does not
 * exceed. Mean, RMS, percentiles and maximum are over the points that are not far, and NaN when there are
 * none. */
struct cloud_stats {
    size_t points; /* with coordinates, far ones included */
    size_t empty;  /* shots without echo */
    size_t far;    /* nothing within the reach of the search */
    size_t beyond; /* farther than the tolerance, far ones included */
    double mean_m, rms_m, p50_m, p95_m, p999_m, max_m;
    size_t worst; /* the first far point, or the first point at max_m if none is far; n when no point has
                     coordinates */
};

/* distance_m as cloud_compare gives it; not negative. */
void cloud_stats(const double *distance_m, size_t n, double tolerance_m, struct cloud_stats *out);
/* Returns a percentile, for example 950 for the 95th, of the finite values in v: n_finite of all n. No value is
 * negative. NaN: none is finite. */
double cloud_percentile(const double *v, size_t n, size_t n_finite, unsigned permille);

#endif
