/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/cola_units.h"

#include <math.h>

enum { TURN_E4 = 3600000, FORWARD_E4 = 900000, MOST_DISTANCE = 65535 };

/* a / b to the nearest, b > 0. */
static int64_t nearest(int64_t a, int64_t b)
{
    return a >= 0 ? (a + b / 2) / b : -((-a + b / 2) / b);
}

int32_t cola_beam_angle(const struct planar_head *head, uint32_t beam)
{
    const int64_t from_front = (int64_t)head->first + beam - head->front;
    return (int32_t)(FORWARD_E4 + nearest(from_front * TURN_E4, head->steps));
}

int64_t cola_beam_at(const struct planar_head *head, int32_t angle_e4)
{
    return nearest((int64_t)(angle_e4 - (int64_t)FORWARD_E4) * head->steps, TURN_E4) + head->front - head->first;
}

int64_t cola_beam_quarters(const struct planar_head *head, uint32_t beam)
{
    return 4 * ((int64_t)head->first + beam - head->front) + head->steps;
}

int64_t cola_beam_near(const struct planar_head *head, double turns)
{
    const double beam = floor((turns - 0.25) * head->steps + 0.5) + head->front - head->first;
    const double turned = floor((beam + 0.5 * (head->steps - head->n)) / head->steps);
    return (int64_t)(beam - turned * head->steps);
}

uint32_t cola_step_angle(const struct planar_head *head)
{
    return (TURN_E4 + head->steps / 2) / head->steps;
}

uint32_t cola_scan_chz(const struct planar_head *head)
{
    return (uint32_t)((head->lines_uhz + 5000) / 10000);
}

uint32_t cola_meas_100hz(const struct planar_head *head)
{
    return (uint32_t)((head->prr_uhz + 50000000) / 100000000);
}

uint32_t cola_head_scale(const struct planar_head *head)
{
    return head->range_max_m * 1000.0 > MOST_DISTANCE ? 2 : 1;
}

/* 1024 counts a dB, that is 0.25 dB for each count of the upper byte. Reflectances count from -64 dB. An echo has at
 * least 1, since 0 means that neither amplitude nor reflectance is modelled. */
uint16_t cola_echo_signal(const struct planar_echo *echo)
{
    int32_t cdb = echo->amplitude_cdb;
    if (cdb == NATIVE_AMPLITUDE_NONE) {
        if (echo->refl_cdb == LINE_REFL_NONE) return 0;
        cdb = echo->refl_cdb + 6400;
    }
    const int32_t v = (cdb * 1024 + 50) / 100;
    return (uint16_t)(v < 1 ? 1 : v > 65535 ? 65535 : v);
}
