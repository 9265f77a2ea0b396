/* SPDX-License-Identifier: MIT */
/* One scene seen from one station by ours and by the reference, and what rays of it come to. */
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
    /* Rays: add with rig_aim or rig_direct, then rig_look. */
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

/* Takes the scene. Fails the running test where anything can't be had. */
void rig_open(struct rig *rig, struct scene *scene, const double station_m[3]);
void rig_close(struct rig *rig);
/* Another BVH over the same scene and rays. */
void rig_rebuild(struct rig *rig, unsigned threads);

/* A ray from the station towards a point, or along a direction of any length. */
void rig_aim(struct rig *rig, const double point_m[3]);
void rig_direct(struct rig *rig, double x, double y, double z);
void rig_aim_at_sphere(struct rig *rig, uint32_t n, uint64_t seed); /* all directions alike */
void rig_clear(struct rig *rig);

/* The true ranges. */
void rig_look(struct rig *rig);
/* Casts all rays: range_m, triangle. By the BVH, and once more by a sight of the station (core/sight.h): the
 * running test fails where a bit differs. */
void rig_cast(struct rig *rig);
void rig_cast_naive(struct rig *rig, const double origin_m[3], int robust, unsigned packet);
/* Of the last cast. judge: leave out what double precision can't tell (for ours alone: no mercy for the naive
 * method). */
struct rig_errors rig_errors_of(const struct rig *rig, int judge);

/* Casts both ways: ours, and float packets of 16 (robust) about naive_origin_m; a row of the largest errors
 * in metres. */
void rig_row_of_ranges(struct rig *rig, const char *regime, const double naive_origin_m[3], double bound_m);
/* The same as a row of the number of rays: ours that are off by more than a micrometre; of the naive ones
 * only those which are off by more than a centimetre, so that they count as another surface and not for their
 * float range. */
void rig_row_of_rays(struct rig *rig, const char *regime, const double naive_origin_m[3]);

/* A line of pulses straight ahead (y), half a degree up and down. */
enum { RIG_LINE_PULSES = 400 };
void rig_line_ahead(struct schedule_segment *segment, struct schedule_line *line, struct schedule_run *run);

/* Uniform in 0..1, from a counter. */
double rig_unit(uint64_t seed, uint64_t i);

#endif
