/* SPDX-License-Identifier: MIT */
/* The header and the variable length records of a LAS file. LAS 1.4 (ASPRS LAS 1.4 R15)
 * with point data record format 6, or 7 with colour; with waveforms 9, or 10. LAS 1.2 with format 1, or 3. Facts go in
 * (las.c gathers them), bytes come out. Pure. */
#ifndef DRIVERS_RECORD_LAS_HEADER_H
#define DRIVERS_RECORD_LAS_HEADER_H

#include <stddef.h>
#include <stdint.h>

#include "drivers/record/crs_wkt.h"
#include "drivers/record/las_waves.h"
#include "drivers/record/track.h"

enum {
    LAS_HEADER_LEN = 375,
    LAS_HEADER_12_LEN = 227,
    LAS_SOFTWARE_AT = 58, /* the name of the program that wrote the file: 32 bytes */
    LAS_VLR_HEAD_LEN = 54,
    LAS_EXTRA_LEN = 192,
    LAS_LABEL_LEN = 2,      /* extra bytes of 1.4, after the format's own: first the label, */
    LAS_ATTRIBUTES_LEN = 4, /* then amplitude and width, */
    LAS_DEVIATION_LEN = 2,  /* then the deviation */
    LAS_WAVE_LEN = 29,      /* a point's reference to its waveform; formats 9 and 10 end in it */
    LAS_POINT_LEN_MAX = 38 + LAS_WAVE_LEN + LAS_LABEL_LEN + LAS_ATTRIBUTES_LEN + LAS_DEVIATION_LEN,
    LAS_RETURNS = 15,
    LAS_12_RETURNS = 5,
    LAS_NOTE_MAX = 1024,
    LAS_KIND_LEN = LAS_VLR_HEAD_LEN + 26,
    LAS_FRONT_MAX = LAS_HEADER_LEN + 3 * LAS_VLR_HEAD_LEN + 4 * LAS_EXTRA_LEN + CRS_WKT_MAX + LAS_NOTE_MAX +
                    LAS_KINDS * LAS_KIND_LEN,
    /* the header's places for waveforms */
    LAS_ENCODING_AT = 6,
    LAS_WAVES_AT = 227,  /* where the record of packets begins in the file; 0: in a .wdp */
    LAS_EVLRS_AT = 235,  /* where records after the points begin, u64, and how many they are, u32 */
    LAS_POINTS_AT = 247, /* number of points */
    LAS_WAVES_INSIDE = 1 << 1,
    LAS_WAVES_OUTSIDE = 1 << 2,
};

#define LAS_SOFTWARE            "scanhead"
#define LAS_SOFTWARE_INCOMPLETE "scanhead, its end is missing" /* of a file that has not been completed */

struct las_facts {
    int minor;                 /* 4, or 2 */
    const struct track *track; /* whose CRS, movement, attributes and colours are the file's */
    int incomplete;            /* the recording goes on: the header says so */
    int is_growing;            /* more points may come: the header has no counts yet */
    int gps_time;              /* times are adjusted standard GPS time */
    char profile[32];
    double scale[3], offset[3]; /* of x, y, z; x and y are longitude and latitude in geodetic coordinates */
    double created_gps_s;       /* adjusted standard GPS time of the first point, with gps_time */
    uint64_t n_points, n_by_return[LAS_RETURNS];
    int32_t min[3], max[3]; /* of the coordinates' counts; valid once there are points */
    int has_waves;
    const struct las_waves *waves; /* with waveforms: their descriptors */
    uint64_t waves_at;             /* where the record of packets begins in the file; 0: it is in the .wdp */
};

/* Returns how many bytes the header takes. */
size_t las_header_len(const struct las_facts *facts);
/* Returns how many bytes a point takes; at most LAS_POINT_LEN_MAX. */
size_t las_point_len(const struct las_facts *facts);
/* Returns how many bytes a point of format 0 to 10 takes without extra bytes. */
size_t las_format_len(int format);
/* Returns how many of a point's bytes are the format's own; extra bytes follow them. */
size_t las_own_len(const struct las_facts *facts);
/* Returns where in a point's bytes the time begins; a colour may follow it. */
size_t las_time_at(const struct las_facts *facts);

/* Counts a point's record as it is in the file: its place and its return. facts->minor must be set before. */
void las_count_record(struct las_facts *facts, const uint8_t *record);
/* Writes the number of points, of returns, and the bounds into a header that has the rest. */
void las_put_counts(const struct las_facts *facts, uint8_t *header);

/* Writes everything before the points. Returns its length, which stays the same for a file: it depends on the version,
 * the CRS, the kind of time, the attributes, whether the head moves and whether there are waveforms. Therefore these
 * bytes can be written again when the counts, or more descriptors, are known. */
size_t las_front(const struct las_facts *facts, uint8_t to[LAS_FRONT_MAX]);

#endif
