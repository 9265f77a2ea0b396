/* SPDX-License-Identifier: MIT */
/* The fields of waveforms by tshark are compared with libscanhead's values of the same frame. */
#ifndef TESTS_WIRE_DISSECTED_WAVES_H
#define TESTS_WIRE_DISSECTED_WAVES_H

#include "drivers/host/scanhead.h"

/* Takes all values of the frame that scanhead_next returned last. points_t0_ns: time of its points since the scan's
 * start. */
void expect_waves(struct scanhead *sh, const struct scanhead_frame *frame, int64_t points_t0_ns);

#endif
