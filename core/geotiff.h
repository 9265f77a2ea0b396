/* SPDX-License-Identifier: MIT */
/* The place of a GeoTIFF's heights, from its tags; the raster is not read. In: a path. Out: the raster's size, the map
 * from cells to a projected system, units, and which value means that a cell has no height.
 *
 * Sources: TIFF 6.0 and BigTIFF; OGC GeoTIFF 1.1 (19-008r4), clauses 7 and B.6; GDAL's tags 42112 (scale, offset and
 * unit of the heights) and 42113 (no data). The module reads the first directory by itself, without a library: an
 * anchor needs that directory in the process of the head, where a broken file must do no harm. Any thread. */
#ifndef CORE_GEOTIFF_H
#define CORE_GEOTIFF_H

#include <stdint.h>

#include "core/err.h"

struct geotiff {
    uint32_t width, height; /* cells; at least 2 each way */
    char crs[16];           /* of easting and northing, "EPSG:25832"; empty: the file names none of the registry */
    int unit_given;         /* 0: neither system nor unit is named, so metres are assumed */
    int height_unit_given;  /* likewise of the heights */
    int above_ellipsoid;    /* GeoTIFF's own code (5001 to 5033) says that the heights count from an ellipsoid */
    double unit_m;          /* of easting and northing in the file */
    int maps_heights;       /* its scale or tie point would change heights; not used without a vertical system */
    int turns_heights;      /* its ModelTransformation would change heights; not used */
    /* [0]: at the middle of the first cell, where its height is. [1], [2]: added by each column and row. Metres, also
     * for systems in feet. */
    double easting_m[3], northing_m[3];
    double height_m, height_scale_m; /* height: height_m + height_scale_m * value */
    double no_data;                  /* a value that is no height; NaN: there is none */
    char odd_no_data[24];            /* the no-data value as the file has it, where it is not one number; else empty */
};

/* SH_EINPUT names the file: no TIFF, cut off, no place, degrees in place of metres, an unknown system or unit. Where a
 * system is named, PROJ's tables on this machine have its unit. */
int geotiff_read(const char *path, struct geotiff *geotiff, struct sh_err *err);

/* Whether the file is one, by its ending. */
int geotiff_is_name(const char *file);

/* Bounds of the cells' middles, metres: low easting, low northing, high ones. */
void geotiff_bounds(const struct geotiff *geotiff, double bounds_m[4]);

/* The EPSG code of a place's UTM zone, for advice, without the exceptions of Norway. Near a pole it is that of UPS. */
int geotiff_utm_code(double lat_deg, double lon_deg);

#endif
