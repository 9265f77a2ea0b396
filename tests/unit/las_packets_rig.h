/* SPDX-License-Identifier: MIT */
/* For tests of the repair of LAS files with waveforms: such a file as a kill leaves it, and as it is when completed. */
#ifndef TESTS_UNIT_LAS_PACKETS_RIG_H
#define TESTS_UNIT_LAS_PACKETS_RIG_H

#include <sys/stat.h>

#include "tests/unit/repair_rig.h"
#include "tests/unit/waves_rig.h"

enum { N = 40, N_SAMPLES = 12, POINT = 61, PACKET = 2 * N_SAMPLES, EVLR = 60, WAVE_AT = 30 };

/* 2 N points. As a kill leaves them; completed, with the packets inside. */
extern struct bytes left, left_wdp, whole;
extern char wdp[168], wdp_part[176];

int packets_set_up(void **state);
int packets_tear_down(void **state);
/* Lines of N points each, with a packet for each point. */
void packets_put_stream(uint32_t lines, uint16_t n_samples);
/* Returns where the points begin. */
size_t packets_front_of(const struct bytes *las);
size_t packets_len_of(const char *path);

#endif
