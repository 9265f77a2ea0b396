/* SPDX-License-Identifier: MIT */
/* For tests of the schedule, whose models are fractions in 128-bit integers. */
#ifndef TESTS_UNIT_SCHEDULE_RIG_H
#define TESTS_UNIT_SCHEDULE_RIG_H

#include "core/schedule.h"
#include "tests/common/cases.h"

__extension__ typedef __int128 i128;
__extension__ typedef unsigned __int128 u128;

#define HZ  INT64_C(1000000)
#define DEG INT64_C(1000000)

/* A head that fires 300,000 pulses and turns 100 lines a second, over half a turn of the pan. */
static inline struct schedule_spec plain_schedule(uint32_t frames)
{
    return (struct schedule_spec){.prr_uhz = 300000 * HZ,
                                  .lines_uhz = 100 * HZ,
                                  .pan_udeg_s = 18 * DEG,
                                  .fov_min_udeg = -40 * DEG,
                                  .sweep_udeg = 240 * DEG,
                                  .line_start_udeg = -40 * DEG,
                                  .line_stop_udeg = 60 * DEG,
                                  .pan_start_udeg = 0,
                                  .pan_stop_udeg = 180 * DEG,
                                  .frames = frames};
}

/* Takes the segment's lines up to pulse k: each pulse once, in order. */
static inline void take_lines(const struct schedule_segment *seg, uint64_t *next, uint64_t *cast, uint64_t k)
{
    while (*next < k) {
        struct schedule_line line;
        schedule_get_line(seg, schedule_line_of(seg, *next), &line);
        assert_true(line.pulse0 <= *next && *next < line.pulse_end);
        const uint64_t end = line.pulse_end < k ? line.pulse_end : k;
        *cast += end - *next;
        *next = end;
    }
}

#endif
