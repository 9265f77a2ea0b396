/* SPDX-License-Identifier: MIT */
/* Private to this folder: the results of `scanhead coverage`, and how they are shown. */
#ifndef FIRMWARE_SIM_APP_STUDIO_COVERAGE_COVERAGE_H
#define FIRMWARE_SIM_APP_STUDIO_COVERAGE_COVERAGE_H

#include "core/studio/coverage.h"
#include "firmware_sim/base/json.h"
#include "firmware_sim/site/site.h"

struct coverage_result {
    const struct site *site; /* of the scanner of head.station */
    uint32_t base;           /* head.station, counted from 0; with stops it counts these */
    double cell_m;
    struct coverage_sums sums;
    struct coverage_result_station {
        double seen_m2, alone_m2; /* by this station; by no other one */
        struct coverage_pulses pulses;
    } * station;                     /* [site->n_stations] */
    struct coverage_of_label *label; /* [surfaces of the scene]; NULL: not asked for */
};

void coverage_print_text(const struct coverage_result *result);
/* Members of an open object. */
void coverage_put(struct json *json, const struct coverage_result *result);

/* Returns 100 part / whole; 0 where whole is 0. */
double coverage_percent(double part, double whole);

/* The scan of a station with the settings at power-up. A scan without end counts as one pan sweep. The struct points
 * into itself, so it must not be moved or copied. */
struct coverage_scan_at {
    const struct site *site;
    uint32_t station;
    struct coverage_scan scan;
};
void coverage_scan_of(const struct site *site, uint32_t station, struct coverage_scan_at *at);

#endif
