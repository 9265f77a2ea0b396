/* SPDX-License-Identifier: MIT */
/* Two plates, one behind the other, in one beam. The light that each echo must bring back is worked out here. For tests
 * of footprints with detection. */
#ifndef TESTS_ACCURACY_LIT_PLATES_H
#define TESTS_ACCURACY_LIT_PLATES_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/surface.h"
#include "tests/common/made.h"

extern const double STATION[3];

/* ---- an edge between two plates */

enum { FRONT, BACK };

/* A plate at near_m is on the left of x = 0. Another one at far_m spans both sides, or with whole_back 0 the right. */
struct scene *plates(double near_m, double far_m, int whole_back);

/* A rig with a signal: reflectances of both plates, and rho_min at 1 m (0: everything is seen). */
struct lit {
    struct beam_rig rig;
    struct surface_table table;
    struct detect_signal signal;
    struct cast_detect detect;
    double near_m, far_m, rho[2];
    double d[3][16]; /* of the pulses of a line, by lit_line */
};

void open_lit(struct lit *l, struct scene *scene, const struct beam_view *view, double least_at_1_m);

void close_lit(struct lit *l);

/* Casts a line of up to 16 pulses. */
const struct line_block *lit_line(struct lit *l, uint32_t line);

/* The energy of a pulse along d on the front plate, and the light that comes back from both, slope included. */
struct edge {
    double front, back[2], range_m[2];
};

struct edge at_edge(const struct lit *l, double dx, double dy);

double linear(const struct line_block *b, uint32_t i);

/* Reflectances are reported in 0.01 dB: 0.12 % of themselves. In a footprint the edge is off by a part in 1,000 of the
 * radius (the view's slopes). 18 rings have 1,027 sub-rays, of which 37 lie on one line through the centre. An edge
 * along it has half of them on the wrong side, 1.8 %. */
#define PARTS_OFF 1e-3
#define RINGS_OFF 0.02
void near_energy(double told, double want, double rho, double slack);

extern const struct beam_view ACROSS;

#endif
