/* SPDX-License-Identifier: MIT */
/* The XML section of an E57 file (ASTM E2807): what is in the file, and where. Facts go in (e57.c gathers
 * them), text comes out. Pure. */
#ifndef DRIVERS_RECORD_E57_XML_H
#define DRIVERS_RECORD_E57_XML_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"
#include "drivers/record/station_pose.h"

/* One scan, which is an entry of data3D. Coordinates are in the head's frame. */
struct e57_scan {
    uint64_t note;        /* logical offset of the note before it (e57_note.h) */
    uint64_t section;     /* of its binary section */
    uint64_t section_len; /* logical */
    uint64_t n_records, n_points;
    uint32_t number; /* in the file, from 1 */
    uint32_t station;
    char idn[96], profile[32];
    struct station_pose pose;
    double scale_m;
    int have_start;         /* start_gps_s is known */
    double start_gps_s;     /* seconds since 1980-01-06, GPS time, of the scan's start */
    int32_t min[3], max[3]; /* counts of scale_m; only with points */
    int have_intensity;
    int16_t intensity_min_cdb, intensity_max_cdb;
    uint32_t row_min, row_max, column_min, column_max; /* only with records */
    unsigned return_max;
    uint32_t crc; /* of all its packets */
};

struct e57_facts {
    int epsg, geoid_heights; /* of the file's CRS; epsg 0: none */
    int empty_shots, has_colours;
    int is_incomplete; /* the end of its last scan, and what came after it, is missing */
    struct e57_scan *scan;
    uint32_t n_scans;
};

/* Free *text. SH_ENOMEM. */
int e57_xml(const struct e57_facts *facts, char **text, size_t *len, struct sh_err *err);

#endif
