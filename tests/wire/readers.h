/* SPDX-License-Identifier: MIT */
/* Recordings as readers see them that are not ours: the points that a stream holds, other people's programs, and how
 * what they read differs. */
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

/* One of tests/readers/, where make has put it beside what npm installed. */
void run_reader(const char *script, const char *in, const char *out);

/* The first three numbers of each line, against the stream's points from `first` on. tolerance_m is per axis, for a
 * point's station. */
size_t compare(char *text, size_t first, const double tolerance_m[N_STATIONS]);

/* ---- how a scan's points as read lie to what they should be */

struct misfit {
    double bounds_m, shift_m,
        turn_rad;    /* of the bounding box; the rigid motion that fits best, which the pose is off */
    double radius_m; /* of the scan about its middle */
};

/* A row of the table. Single points were off by tolerance_m per axis at most: so is the box, and by far the pose, but
 * for a shift that all have in common. */
void tell(const char *format, const char *reader, const double tolerance_m[N_STATIONS]);

#endif
