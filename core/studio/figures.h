/* SPDX-License-Identifier: MIT */
/* Figures of a compared cloud, for tables and pictures: by groups, as histograms, the density of its points, and their
 * times. In: distances (core/studio/cloud.h) and deviations (core/studio/deviation.h), metres. Out: statistics. Values
 * that are NaN take no part. Pure. */
#ifndef CORE_STUDIO_FIGURES_H
#define CORE_STUDIO_FIGURES_H

#include "core/studio/cloud.h"
#include "core/studio/deviation.h"

/* Figures of one group of points. Distances are to the nearest triangle and never negative; `along` is signed
 * (measured minus exact range, on smooth faces). Figures without a point are NaN. */
struct figures {
    size_t points, far;                            /* with coordinates; of these, too far from any surface */
    double mean_m, rms_m, p95_m, max_m;            /* of the distances that are not far; nearest rank */
    size_t along;                                  /* on smooth faces, at an incidence up to FIGURES_STEEPEST */
    double along_mean_m, along_rms_m, along_max_m; /* the last: the largest without its sign */
    size_t judged;                                 /* of these, of known sigma */
    double judged_mean_m, judged_rms_m;            /* of their deviations */
    double expected_rms_m; /* that sigma_m and counts_m (deviation.h) together predict for the judged points */
    size_t noisy;          /* of these, of sigma above 0 */
    double z_mean, z_rms;  /* of their deviations over their sigmas: 0 and 1 are expected of noise alone */
    double z_counts;       /* RMS of counts_m over their sigmas */
};

/* Cosine of 80 degrees. Beyond, any small error across the beam is a large one along it, and sigma to first order is no
 * longer good to 1 %. */
#define FIGURES_STEEPEST 0.17364817766693041

struct figures_in {
    size_t n;
    const double *distance_m;
    const struct deviation_points *points; /* NULL: no deviations along beams */
};

enum { FIGURES_NO_GROUP = 0xffffffff };

/* group(ctx, i) returns the group of point i, below n_groups or FIGURES_NO_GROUP; NULL: all points are one group. Takes
 * 8 bytes a point while it works. */
int figures_by(const struct figures_in *in, uint32_t n_groups, uint32_t (*group)(void *ctx, size_t i), void *ctx,
               struct figures *out, struct sh_err *err);

/* Bins of one width; the first begins at from. */
enum { FIGURES_MAX_BINS = 80 };
struct figures_histogram {
    double from, width;
    uint32_t bins;
    uint64_t count[FIGURES_MAX_BINS], below, above;
};
/* Makes a histogram that holds at least a share of the values. Bins begin at multiples of their width (1, 2 or 5
 * times a power of ten); signed ones reach equally far to both sides. Values that are not finite don't count. No
 * value: 0 bins. */
void figures_histogram_of(const double *value, size_t n, double share, struct figures_histogram *out);
void figures_histogram_of_signed(const float *value, size_t n, double share, struct figures_histogram *out);
/* Returns the smallest of 1, 2, 5 times a power of ten that is v or more; v > 0. */
double figures_nice(double v);

/* The density of one station's points on the surfaces. The scene is cut into cells: each triangle's plane is projected
 * along the axis that it faces most, and divided into squares of cell_m there. A cell is such a square of one plane,
 * by one station; its area is cell_m^2 / |n|, n the normal's part along that axis. A cell's density is points / area.
 * Cells at a border count as whole ones, so their density is a lower limit. Percentiles are over points, by nearest
 * rank: half of the points lie where the density is p50 or more. */
struct figures_cell {
    uint64_t key;
    uint32_t n;
    float range_sum_m; /* over its points */
    double area_m2;
};
struct figures_density_row {
    size_t cells, points;
    double p5, p50, p95; /* points a square metre */
};
struct figures_density {
    double cell_m; /* as it was used: doubled where there were too many cells */
    size_t n;
    struct figures_cell *cell; /* [n] by density */
};
/* Points on the surfaces of a scene. */
struct figures_on_scene {
    const struct cloud_compared *compared;
    const struct scene *scene;
    const float *range_m; /* [cloud->n] as deviation_points has it */
};
/* Counts the points in their cells. Points without a triangle take no part. Up to 3 million cells, in 96 MiB;
 * while their table grows, in 144 MiB. */
int figures_density_of(const struct figures_on_scene *in, double cell_m, const struct sh_report *report,
                       struct figures_density *out, struct sh_err *err);
/* Does the same with a cell that it chooses: first_m is doubled until a square of that side has 16 points at the median
 * density (p50). It is not doubled beyond 50 m. all: the figures of all its cells. */
int figures_density_fit(const struct figures_on_scene *in, double first_m, const struct sh_report *report,
                        struct figures_density *out, struct figures_density_row *all, struct sh_err *err);
void figures_density_free(struct figures_density *density);
/* Sets row to the figures of the cells of one station (from 1; 0: of all) whose mean range is at least from_m and below
 * to_m. NaN: no cell. */
void figures_density_within(const struct figures_density *density, unsigned station, double from_m, double to_m,
                            struct figures_density_row *row);

/* Times of a station's points, in the order of the file. Where time goes back, another scan begins. */
struct figures_times {
    size_t points, scans;
    double first_s, last_s, span_s; /* the last: of all scans together */
    size_t gaps;                    /* longer than the station's gap_s, between points that follow each other */
    double longest_s, longest_at_s; /* where it begins */
};
/* Fills out[n_stations]. Needs cloud->time_s, and gap_s[n_stations]. */
void figures_times_of(const struct cloud *cloud, uint32_t n_stations, const double *gap_s, struct figures_times *out);

/* Counts shots by their number of echoes. Needs cloud->echo and echo_count. Shots without echo are counted where the
 * file has them. */
enum { FIGURES_MAX_ECHOES = 15 };
void figures_echoes_of(const struct cloud *cloud, uint64_t shots[FIGURES_MAX_ECHOES + 1]);

#endif
