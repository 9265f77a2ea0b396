/* The header and the variable length records of a LAS 1.4 file (ASPRS LAS 1.4 R15), point data record format
 * 6. Facts go in (las.c gathers them), bytes come out. Pure. */
#ifndef DRIVERS_RECORD_LAS_HEADER_H
#define DRIVERS_RECORD_LAS_HEADER_H

#include <stddef.h>
#include <stdint.h>

#include "drivers/record/crs_wkt.h"
#include "drivers/record/track.h"

enum {
    LAS_HEADER_LEN = 375,
    LAS_VLR_HEAD_LEN = 54,
    LAS_EXTRA_LEN = 192,
    LAS_POINT_LEN = 30 + 2,                    /* format 6, and the label */
    LAS_POINT_LEN_MAX = LAS_POINT_LEN + 2 + 2, /* and amplitude and width */
    LAS_RETURNS = 15,
    LAS_NOTE_MAX = 512,
    LAS_FRONT_MAX = LAS_HEADER_LEN + 3 * LAS_VLR_HEAD_LEN + 3 * LAS_EXTRA_LEN + CRS_WKT_MAX + LAS_NOTE_MAX,
};

struct las_facts {
    const struct track *track; /* whose CRS, movement and attributes are the file's */
    int gps_time;              /* times are adjusted standard GPS time */
    char profile[32];
    double scale[3], offset[3]; /* of x, y, z; x and y are longitude and latitude in geodetic coordinates */
    double created_gps_s;       /* adjusted standard GPS time of the first point, with gps_time */
    uint64_t n_points, n_by_return[LAS_RETURNS];
    int32_t min[3], max[3]; /* counts; only with points */
};

/* Everything before the points. Returns its length, which depends on the CRS, the time's kind and attributes
 * alone, so that it can be written again when the counts are known. */
size_t las_front(const struct las_facts *facts, uint8_t to[LAS_FRONT_MAX]);

#endif
