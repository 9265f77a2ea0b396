/* SPDX-License-Identifier: MIT */
/* A source that makes its ticks itself, without frames: what a loop needs of one, and no more. */
#ifndef TESTS_UNIT_PLAIN_SOURCE_H
#define TESTS_UNIT_PLAIN_SOURCE_H

#include "firmware_sim/loop/source.h"

struct plain_source {
    struct device_counters counters;
    uint64_t n_scans;
    int n_reports, n_closed;
    void (*closed)(struct plain_source *self); /* called when its files are closed, after all threads; NULL: none */
    _Atomic int ending;
    /* Makes a tick, as source.h says; NULL: the run is over at once. */
    enum loop_source_tick (*next)(struct plain_source *self, uint64_t tick, int again, struct ring_tick *out);
};

extern const struct loop_source_ops plain_source_ops;

#endif
