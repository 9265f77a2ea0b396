/* SPDX-License-Identifier: MIT */
/* Firings of a VLP-16 for a protocol under test. Pulse k of the scan is beam k mod 16 of sequence k div 16, at the
 * times of the data sheet, at the turn's azimuth of that time. */
#ifndef TESTS_UNIT_VELODYNE_HEAD_H
#define TESTS_UNIT_VELODYNE_HEAD_H

#include "tests/common/protocol_rig.h"

enum { SEQUENCE_NS = 55296, FIRING_NS = 2304 };

/* The session of a VLP-16 at 10 turns a second that sends the strongest echo; from setup to teardown. */
extern struct protocol_rig rig;
int velodyne_head_setup(void **state);
int velodyne_head_teardown(void **state);

/* Returns data packet i, of 1206 bytes. */
const uint8_t *velodyne_head_packet(uint32_t i);

/* Returns the time of pulse k since the scan's start: 55.296 us a sequence, 2.304 us a firing. */
int64_t velodyne_head_ns(uint64_t pulse);
/* Returns how far the head has turned at a pulse, in turns. rpm: turns a minute. */
double velodyne_head_turns(uint64_t pulse, double rpm);
/* Returns the elevation of a beam in degrees. */
int velodyne_head_elevation_deg(uint32_t beam);

/* Fires one points frame of n pulses from pulse0 on, n <= 4096. turn0: the azimuth of pulse 0 of the scan. */
void velodyne_head_fire(uint64_t pulse0, uint32_t n, const struct protocol_rig_shot *shot, double rpm, double turn0);
/* Does the same with one range for all. */
void velodyne_head_fire_alike(uint64_t pulse0, uint32_t n, double range_m);
void velodyne_head_event(uint32_t code);

#endif
