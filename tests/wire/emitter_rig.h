/* SPDX-License-Identifier: MIT */
/* Direction and time of the shots of some heads, by the formulas of their data sheets. Nothing of the program is
 * used. */
#ifndef TESTS_WIRE_EMITTER_RIG_H
#define TESTS_WIRE_EMITTER_RIG_H

#include "tests/wire/wire.h"

enum { VLP_BEAMS = 16 };

/* This is direction and time of a pulse of the scan. Angles are in degrees: elevation, and azimuth clockwise from y. */
struct shot {
    int64_t t_ns;
    double elevation_deg, azimuth_deg;
    int cast;
};

/* Write pulse k of a scan. */
void shot_utm(uint64_t k, struct shot *out);    /* Hokuyo UTM-30LX and UST-20LX */
void shot_urg(uint64_t k, struct shot *out);    /* Hokuyo URG-04LX */
void shot_tim(uint64_t k, struct shot *out);    /* SICK TiM5xx */
void shot_vlp(uint64_t k, struct shot *out);    /* Velodyne VLP-16 at 10 turns a second */
void shot_sphere(uint64_t k, struct shot *out); /* rings 10 deg apart of 36 steps, 20 a second */
void shot_list(uint64_t k, struct shot *out);   /* the directions of list_deg, 10 lists a second */

extern const int vlp_deg[VLP_BEAMS]; /* elevations in the order of firing */
extern const double list_deg[5][2];  /* azimuth, elevation */

/* Half a count of 2^-32 of a turn is 8e-10 rad. */
static const double ANGLE_RAD = 1e-9;

/* Writes own.yaml in the folder: a head that sees 0.01 to 50 m, with these keys of its emitter. */
void emitter_write_profile(const struct wire *wire, const char *emitter);

#endif
