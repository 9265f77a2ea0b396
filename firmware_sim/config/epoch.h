/* SPDX-License-Identifier: MIT */
/* The section `time`, and its key epoch, which gives the time of day at power-up.
 *
 * In: the key's text and a table of leap seconds. Out: where the time comes from and, for a date, TAI in ns
 * (core/utc.h). */
#ifndef FIRMWARE_SIM_CONFIG_EPOCH_H
#define FIRMWARE_SIM_CONFIG_EPOCH_H

#include "core/utc.h"

/* A follower of a PTP master (ptp.h). */
struct config_ptp {
    int follower;
    uint64_t grandmaster; /* its identity, an EUI-64 */
    uint32_t clock_class, clock_accuracy;
    int utc_valid;
    uint32_t announce_ms, sync_ms;
    uint32_t path_delay_ns, jitter_ns;
    double asymmetry_ns;
    uint64_t first_step_threshold_ns, step_threshold_ns; /* 0: never */
    double max_ppm;
};

/* Time of day (head_clock.h). */
struct config_time {
    char epoch[40]; /* of power-up: none, utc, tai, or a date as 2026-01-01T00:00:00Z */
    double offset_s, drift_ppm, jump_s, jump_at_s;
    struct config_ptp ptp;
};

enum epoch_source {
    EPOCH_NONE, /* the head does not know the time */
    EPOCH_DATE, /* the text is a date */
    EPOCH_UTC,  /* the system's clock */
    EPOCH_TAI   /* the system's TAI clock */
};

/* An empty text is `none`. A date is checked. tai0_ns is set for a date only; it may be NULL. */
int epoch_parse(const char *text, const struct utc_table *table, enum epoch_source *source, int64_t *tai0_ns,
                struct sh_err *err);

#endif
