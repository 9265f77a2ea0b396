/* SPDX-License-Identifier: MIT */
/* The rig holds one scene, seen from one station by our cast and by the reference, and the errors of its rays. */
#ifndef TESTS_STABILITY_RIG_H
#define TESTS_STABILITY_RIG_H

#include <stdint.h>

#include "core/cast.h"
#include "tests/common/reference.h"
#include "tests/stability/mesh.h"
#include "tests/stability/naive.h"
#include "tests/stability/table.h"

#define RIG_MICROMETRE 1e-6

struct rig {
    struct scene *scene;
    struct bvh *bvh;
    struct caster *caster;
    struct reference *reference;
    double station_m[3];
    /* Rays are added with rig_aim or rig_direct. rig_look comes after them. */
    uint32_t n, capacity;
    double *dx, *dy, *dz, *range_m;
    uint32_t *triangle;
    struct reference_hit *truth;
};

struct rig_errors {
    double max_m;         /* largest error of a range */
    uint64_t missed;      /* met nothing where there is something, or the other way round */
    uint64_t wrong;       /* missed, or off by more than a micrometre */
    uint64_t coarse;      /* missed, or off by more than a centimetre: another surface */
    uint64_t undecidable; /* would be wrong, but double precision can't tell; in no figure above */
};

/* Takes the scene over. Fails the running test where anything can't be made. */
void rig_open(struct rig *rig, struct scene *scene, const double station_m[3]);
void rig_close(struct rig *rig);
/* Makes another BVH of the same scene, for the same rays. */
void rig_rebuild(struct rig *rig, unsigned threads);

/* Adds a ray from the station towards a point, or along a direction of any length. */
void rig_aim(struct rig *rig, const double point_m[3]);
void rig_direct(struct rig *rig, double x, double y, double z);
void rig_aim_at_sphere(struct rig *rig, uint32_t n, uint64_t seed); /* directions equally likely */
void rig_clear(struct rig *rig);

/* Finds the true ranges. */
void rig_look(struct rig *rig);
/* Casts all rays and writes range_m and triangle, by the BVH and once more by a sight of the station (core/sight.h).
 * The running test fails where a bit differs. */
void rig_cast(struct rig *rig);
void rig_cast_naive(struct rig *rig, const double origin_m[3], int robust, unsigned packet);
/* Returns the errors of the last cast. With `judge` it leaves out the rays that double precision can't decide. `judge`
 * is for our cast; the naive method is counted in full. */
struct rig_errors rig_errors_of(const struct rig *rig, int judge);

/* Casts both ways: with ours, and with float packets of 16 (robust) about naive_origin_m. Prints a row of the largest
 * errors in metres. */
void rig_row_of_ranges(struct rig *rig, const char *regime, const double naive_origin_m[3], double bound_m);
/* The same as a row of the number of wrong rays. Ours are wrong by more than a micrometre. Naive rays count only if
 * they are wrong by more than a centimetre: they met another surface, and it is not their float range that makes them
 * wrong. */
void rig_row_of_rays(struct rig *rig, const char *regime, const double naive_origin_m[3]);

/* A line of pulses straight ahead (y), half a degree up and down. */
enum { RIG_LINE_PULSES = 400 };
void rig_line_ahead(struct schedule_segment *segment, struct schedule_line *line, struct schedule_run *run);

/* Returns a number that is uniform in 0..1, from a counter. */
double rig_unit(uint64_t seed, uint64_t i);

#endif
