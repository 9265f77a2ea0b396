/* SPDX-License-Identifier: MIT */
/* Private to core/cast: disturbances of the head. Each function is called only where the setup has the disturbance. */
#ifndef CORE_CAST_DISTURBANCE_H
#define CORE_CAST_DISTURBANCE_H

#include "core/cast.h"

struct echo_list;

/* Sets `slip` to the rotation, in socs, that turns directions as the encoders read them to those of the beams, after
 * the pan has slipped. */
void caster_slip(const struct cast_disturbance *disturbance, double slip[9]);
/* Makes all shots empty, as of a laser that does not fire. */
void caster_darken(struct echo_list *l);
/* Weakens the returns by a soiled window. */
void caster_weaken(const struct cast_disturbance *disturbance, uint32_t n, double *rho);

#endif
