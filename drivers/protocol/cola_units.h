/* SPDX-License-Identifier: MIT */
/* The head's geometry, rates and signals in SICK's units; COLA.md has the scales. Angles: 0 is right, 90 degrees
 * forward, counted counter-clockwise seen from above. Beam 0 has the smallest angle; beams are numbered as the
 * places of planar_scan.h, from 0 to n - 1. Pure. */
#ifndef DRIVERS_PROTOCOL_COLA_UNITS_H
#define DRIVERS_PROTOCOL_COLA_UNITS_H

#include "drivers/protocol/planar_scan.h"

/* Rounded to 1/10000 deg. */
int32_t cola_beam_angle(const struct planar_head *head, uint32_t beam);
/* The beam that is nearest to an angle; below 0, or n and more: the head has no such beam. */
int64_t cola_beam_at(const struct planar_head *head, int32_t angle_e4);
/* The exact direction of a beam, in quarters of a step. */
int64_t cola_beam_quarters(const struct planar_head *head, uint32_t beam);
/* The beam that is nearest to a direction in turns; below 0, or n and more, as above. */
int64_t cola_beam_near(const struct planar_head *head, double turns);
uint32_t cola_step_angle(const struct planar_head *head);
uint32_t cola_scan_chz(const struct planar_head *head);    /* scans, 1/100 Hz */
uint32_t cola_meas_100hz(const struct planar_head *head);  /* pulses, 100 Hz */
uint32_t cola_head_scale(const struct planar_head *head);  /* mm of a distance's count: 2 beyond 65.535 m, else 1 */
uint16_t cola_echo_signal(const struct planar_echo *echo); /* RSSI of 16 bit; 0: not modelled */

#endif
