/* SPDX-License-Identifier: MIT */
/* Recordings as other people's readers see them: the points of the stream, the programs, and the differences of the
 * points that they read. */
#ifndef TESTS_WIRE_READERS_H
#define TESTS_WIRE_READERS_H

#include "tests/wire/room.h"

enum { N_STATIONS = 2, MAX_POINTS = 200000 };

extern struct wire *wire;
extern double truth[MAX_POINTS][3], seen[MAX_POINTS][3]; /* the stream's points; as read last */
extern size_t n_truth, n_first;                          /* n_first of the first station */

void keep_truth(const struct scanhead_point *point, uint32_t station);

/* ---- other people's programs */

void run_well(const char *const *argv);

/* Runs one of tests/readers/, where make has put it beside npm's packages. */
void run_reader(const char *script, const char *in, const char *out);

/* Compares the first three numbers of each line with the stream's points from `first` on. tolerance_m is per axis, for
 * a point's station. */
size_t compare(char *text, size_t first, const double tolerance_m[N_STATIONS]);

/* ---- the distance of a scan's points, as read, from their true places */

struct misfit {
    double bounds_m, shift_m,
        turn_rad;    /* bounds: of the bounding box; shift and turn: the best rigid motion, the pose's error */
    double radius_m; /* of the scan about its middle */
};

/* Prints a row of the table. Fails where the box is off by more than tolerance_m, or the pose moves a point by more
 * than sqrt(3) of it. */
void tell(const char *format, const char *reader, const double tolerance_m[N_STATIONS]);

#endif
