/* SPDX-License-Identifier: MIT */
/* Instrument errors: the geometry of a scanner that is not quite as designed. The scanner's mechanics determine the
 * true direction of the beam, its encoders the direction that the head reports. In: scheduled angles in turns, errors.
 * Out: directions and origins of beams (socs, metres), and what the encoders read (turns).
 *
 * Terms as in D. Lichti, Error modelling, calibration and analysis of an AM-CW terrestrial laser scanner
 * system (2007), and B. Muralikrishnan et al., Volumetric performance evaluation of a laser scanner based on
 * geometric error model (2015). In this module the terms are exact geometry, not its first-order expansion. For line
 * angle m (elevation) and pan p, both true angles of the axes, the beam is, in the frame that turns with the pan (x
 * right, along the mirror's axis; y ahead; z up):
 *
 *     direction = Ry(trunnion) (sin c, cos c cos m, cos c sin m)      c: collimation
 *     origin    = (mirror_offset, transit_offset, 0)
 *
 * collimation: the beam points to the right of the plane that is perpendicular to the mirror's axis, by the angle c;
 * pan changes by c / cos m.
 * trunnion: the mirror's axis is not level, its right end sinks; pan changes by trunnion tan m.
 * transit offset: the mirror's axis passes this far ahead of the pan's axis; for each metre of it, range changes by
 * cos m, and line angle by -sin m / R.
 * mirror offset: the beam leaves this far to the right of the pan's axis; for each metre of it, pan changes by
 * 1 / (R cos m).
 *
 * Encoders, each: reading = a + index + scale a + eccentricity sin(a - phase); a: true angle, as scheduled.
 * Range: reading = (1 + range_scale) R + range_offset.
 * Angle noise is independent for each pulse: the beam goes to m + n_m, p + n_p, and the encoders don't see it.
 *
 * Pure; any thread; allocates nothing. */
#ifndef CORE_INSTRUMENT_H
#define CORE_INSTRUMENT_H

#include <stdint.h>

#include "core/vec3.h"
#include "core/vecmath.h"

struct instrument_encoder {
    double index_rad, scale, eccentricity_rad, phase_rad;
};

struct instrument {
    double collimation_rad, trunnion_rad;
    double transit_offset_m, mirror_offset_m;
    struct instrument_encoder mirror, pan;
    double range_offset_m, range_scale;
    double mirror_sigma_rad, pan_sigma_rad; /* of the angle noise */
    uint64_t mirror_key, pan_key;           /* rng_key(seed, RNG_MIRROR), RNG_PAN */
};

/* True when all errors are zero: such an instrument is best left out. */
int instrument_is_ideal(const struct instrument *instrument);
/* True when beams begin beside the head's origin. */
int instrument_has_offset(const struct instrument *instrument);

/* Pulses from pulse0 on: angles of the axes, in turns. */
struct instrument_turns {
    uint64_t pulse0;
    uint32_t n;
    double *mirror, *pan;
    uint64_t scan_key; /* rng_scan */
};
/* Scheduled angles -> direction s of the beam and, unless o->x is NULL, its origin o (m), both in socs. */
void instrument_aim(const struct instrument *instrument, const struct instrument_turns *turns, const struct vec3_out *s,
                    const struct vec3_out *o);

/* Turns scheduled angles into the readings of the encoders, in place. */
void instrument_read(const struct instrument *instrument, uint32_t n, double *mirror_turn, double *pan_turn);
void instrument_range(const struct instrument *instrument, uint32_t n, double *range_m);

/* Encoder reading of an angle: whole counts, modulo a turn. Points and line ends get their readings from here. */
VEC_INLINE uint32_t instrument_encoder_count(double turn, double counts_per_turn)
{
    uint64_t bits;
    double below = vec_round(turn - 0.5, &bits); /* floor; of a whole number it may be one less */
    double within = turn - below;
    within = within >= 1.0 ? within - 1.0 : within;
    double count = vec_round(within * counts_per_turn, &bits);
    bits = count >= counts_per_turn ? 0 : bits;
    return (uint32_t)bits;
}

#endif
