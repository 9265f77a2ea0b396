/* SPDX-License-Identifier: MIT */
/* Deviations of recorded points from the places where their beams hit the scene, and the expected
 * deviations. In: a cloud (core/studio/cloud.h) with its distances, and each station's head. Out: per point the
 * deviation along the beam, its expected sigma, range and incidence, in metres and as cosines.
 *
 * Along the beam: the line from the station through the point is followed to the scene. The deviation is the measured
 * minus the exact range, so it is positive where the point lies beyond the surface. The exact range is that of the
 * BVH's first hit. Where the point belongs to another surface (a later echo, a point beyond glass), the exact range is
 * that of the nearest triangle, if the line crosses it.
 *
 * A point is on a smooth face where its distance from the nearest triangle equals the deviation times the cosine of
 * the incidence, to 1 % and 2 um. Then the surface that the beam hits is also the nearest one, and no edge or corner is
 * between. With a footprint, twelve rays along its border have to hit the same plane, too. Only such points have a
 * deviation along the beam: at an edge it may be any number, however good the point.
 *
 * A point is judged where noise alone causes its deviation: on a smooth face with no other surface near. Two balls of
 * DEVIATION_CLEAR sigma (with counts) touch the face at the hit, in front and behind; nothing else reaches into them.
 * Otherwise large deviations would be taken for small ones of the other surface. Up to about DEVIATION_SAMPLE points
 * of a cloud are judged, evenly taken.
 *
 * Expected sigma of that deviation, to first order. u: the beam, n: the face's normal, i: the incidence, R: the
 * range; with cos i = |n u| a move of the point by m changes the deviation by (n m) / (n u):
 *     range noise      sigma0 + sigma1 R, or by the signal (core/detect.h)
 *     angle noise      R sigma |n e| / cos i, e: the direction in which the angle moves the beam
 *     ball             f_k |n_k| radius / sqrt(5) / cos i for each axis k of the ball: points that fill a ball evenly
 *                      have the variance r^2 / 5 along an axis
 * The steps of counts add to that. These steps are summed separately, since they are no noise:
 *     of encoders      as angle noise of sigma = step / sqrt(12)
 *     of positions     step / sqrt(12) / cos i; of polar ranges without the cosine
 * The two formulas hold where all places within a count are equally likely. The angles of a schedule may repeat a few
 * places: then the sigma of their rounding is from 0 to sqrt(3) times that of the formula.
 * Sigma is NaN where it is not known: noise by the signal on surfaces with a texture or colours of vertices, and of
 * later echoes; errors of the instrument.
 *
 * The distance has a bound where the only random effect is a ball. The bound is the sum of:
 *   the plan's errors of cast and georeferencing;
 *   half the diagonal of a count: sqrt(3)/2 counts of the coordinates, and of the file's where it rounds them again;
 *   half of sqrt(r^2 + (R a)^2 + (R b)^2): r is the count of a polar range, else 0; a and b are those of the encoders;
 *   the ball's radius at that range, times its largest factor. */
#ifndef CORE_STUDIO_DEVIATION_H
#define CORE_STUDIO_DEVIATION_H

#include "core/cast.h"
#include "core/studio/cloud.h"

enum { DEVIATION_CLEAR = 8, DEVIATION_SAMPLE = 400000 };

/* The head of a station. */
struct deviation_head {
    struct cast_setup setup;             /* as the scan's: station, BVH, noise, counts */
    double angle_sigma_rad[2];           /* noise of mirror and pan */
    double georef_error_m, cast_error_m; /* bounds of the plan */
    double count_m;                      /* the longest count of a coordinate; polar: 0 */
    double file_count_m;                 /* of the file's coordinates, where it rounds them again; else 0 */
    int has_instrument_errors;           /* nothing is expected then */
};

/* [n] each. */
struct deviation_points {
    float *along_m;  /* measured minus exact. NaN: the point is not on a smooth face, is far from the scene, is on a
                      * body that moves, or is a shot without echo */
    float *sigma_m;  /* expected; NaN: not known, the point isn't judged, or along_m is NaN */
    float *counts_m; /* the counts' part of it; NaN where sigma_m is */
    float *cosine;   /* of the incidence where the beam hits; NaN: it hits nothing, or the station moves */
    float *range_m;  /* from the station; NaN: a shot without echo */
    uint32_t *met;   /* the triangle that the beam hits there, as the BVH has it, or else the nearest one;
                      * CLOUD_TRIANGLE_NONE: neither. NULL: not asked for (deviation_points_create) */
};
int deviation_points_create(size_t n, struct deviation_points *out, struct sh_err *err);
void deviation_points_free(struct deviation_points *points);

/* Fills `out`. head: [compared->site->n_stations]. Points without a triangle of the scene, such as points on bodies
 * that move (cloud_compare), get ranges alone. The function uses compared->site->threads threads; the result doesn't
 * depend on their number. Returns SH_ESTOPPED after a stop. */
int deviation_along(const struct cloud_compared *compared, const struct deviation_head *head,
                    const struct sh_report *report, const struct deviation_points *out, struct sh_err *err);

/* The hit of a beam on a face. */
struct deviation_hit {
    double range_m, beam[3], normal[3]; /* unit vectors, prcs */
    int32_t label;                      /* of the surface; -1: the power that comes back is not known */
};
/* Returns the expected sigma there, by noise. *counts_m: the part of counts, for equally likely places in a count. */
double deviation_sigma_m(const struct deviation_head *head, const struct deviation_hit *hit, double *counts_m);

/* These figures give a client the same sigma. Amplitudes count in units of the threshold. */
struct deviation_terms {
    double range_sigma_m, range_sigma_per_m; /* sigma of the range, and its part per distance */
    double range_floor_m, range_jitter_m;    /* by the signal: at any amplitude, and at 1; NaN: range_sigma_m holds */
    double range_step_m, place_step_m;       /* counts of a polar range, and of coordinates */
    double angle_sigma_rad[2], angle_step_rad[2]; /* of mirror and pan: noise, and counts */
    double ball_m, ball_per_m, ball_factor[3];    /* its radius and factors, as in core/detect.h */
    int ball_local;
};
/* Returns 0 where no error is expected, since the instrument has errors of its own. */
int deviation_terms_of(const struct deviation_head *head, struct deviation_terms *out);

/* Returns the bound of the distance at a range. INFINITY: there is none, as for Gaussian noise. */
double deviation_bound_m(const struct deviation_head *head, double range_m);

#endif
