/* SPDX-License-Identifier: MIT */
/* A cloud made by hand for `scanhead report`: its points lie a known way beyond the walls of the room. The figures of
 * any of them are worked out here, by their definitions in core/studio/figures.h and deviation.h. */
#ifndef TESTS_WIRE_REPORT_RIG_H
#define TESTS_WIRE_REPORT_RIG_H

#include "tests/wire/room.h"

/* The last two points are a shot without echo, and a point of the first station far behind the east wall. */
enum { N_NEAR = 60, N_POINTS = N_NEAR + 2, N_STATIONS = 2 };

#define REPORT_TOLERANCE_M 0.001
#define REPORT_LINES_HZ    100.0

/* Cells of the density are of one square metre. */
struct made {
    int station, wall, label; /* station from 0; wall -1: a shot without echo */
    double p[3], distance_m, along_m, cosine, range_m, counts_m, t_s;
    int echo, echo_count;
    int cell[2], triangle; /* the cell along its wall and up; 0 or 1 of the wall's two triangles */
};

void report_make(struct made all[N_POINTS]);
/* Writes made.yaml, its room and made.ply. */
void report_write(const struct wire *wire, const struct made all[N_POINTS]);
/* Runs `scanhead report` on them with these arguments, to the file "out". Expects status 1: beyond the tolerance. */
void report_run(struct wire *wire, const char *const *more);

enum group { BY_NOTHING, BY_STATION, BY_LABEL, BY_RANGE, BY_INCIDENCE };

struct wanted {
    double points, far, near, mean_m, rms_m, p50_m, p95_m, p999_m, max_m;
    double along_mean_m, along_rms_m, along_max_m, expected_rms_m, z_mean, z_rms, z_counts;
};

/* Works out the figures of the points whose value (station from 0, label, m, degrees) is from `from` on and below
 * `to`. All near points are on smooth faces, and judged. */
struct wanted report_want(const struct made all[N_POINTS], enum group group, double from, double to);

struct density {
    double cells, p5, p50, p95;
};
/* station from 0; -1: all. */
struct density report_density(const struct made all[N_POINTS], int station, double from_m, double to_m);

struct times {
    double n, first_s, last_s, span_s, scans, gaps, longest_s, longest_at_s;
};
struct times report_times(const struct made all[N_POINTS], int station);

/* Returns the step of the bins of ranges, and writes how many bins there are. The step is 1, 2 or 5 times a power of
 * ten: the smallest of which 12 steps reach the farthest near point. */
double report_range_step(const struct made all[N_POINTS], int *n);

#endif
