/* SPDX-License-Identifier: MIT */
/* Points of a batch as a LAS file has them: figures in columns, and the rows that are written from them. The compiler
 * can vectorise the loops. Coordinates and other figures are exactly those that the plain formulas give. Pure. */
#ifndef DRIVERS_RECORD_LAS_COLUMNS_H
#define DRIVERS_RECORD_LAS_COLUMNS_H

#include "drivers/record/las_header.h"

struct las_columns {
    int32_t xyz[3][TRACK_BATCH]; /* counts */
    uint16_t intensity[TRACK_BATCH], scan_angle[TRACK_BATCH];
    uint8_t returns[TRACK_BATCH]; /* number and count, as a record has them */
    double time_s[TRACK_BATCH];
    uint16_t amplitude[TRACK_BATCH], width[TRACK_BATCH], deviation[TRACK_BATCH]; /* with attributes */
    /* With waveforms: the packet, the return's time after the packet's first sample, and how coordinates change along a
     * picosecond back to the head. Zeros: the point has none. */
    struct las_packet packet[TRACK_BATCH];
    float location_ps[TRACK_BATCH], back_ps[TRACK_BATCH][3];
};

/* Sets one coordinate in counts of `scale` from `offset`, rounded. Returns the number of points before the first one
 * that is NaN or too far for 32 bits. */
int las_set_counts(const double *at, int n, double offset, double scale, int32_t *to);
/* Sets 32768 + 100 times the reflectance; 0 where it is not modelled. */
void las_set_intensities(const double *restrict reflectance_db, int n, uint16_t *restrict to);
/* Sets the scan angle of each point in the head's frame: the angle from straight down, in steps of 0.006 degrees.
 * Returns how many points have none; the angle is then 0. */
uint64_t las_set_scan_angles(const double *x, const double *y, const double *z, int n, uint16_t *to);

/* Writes n rows of las_point_len(). The track's labels, station and colours are those of the points. */
void las_put_rows(const struct las_facts *facts, const struct las_columns *columns, int n, uint8_t *to);
/* Counts n rows, as las_count_record does one. */
void las_count_rows(struct las_facts *facts, const struct las_columns *columns, int n);

#endif
