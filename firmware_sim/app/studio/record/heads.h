/* SPDX-License-Identifier: MIT */
/* The heads of a configuration, off line: one for each scanner that its stations have, in one scene. In: a
 * configuration, and from which stations to scan. Out: the stream frames of all scans, station by station, and the sums
 * of their figures.
 *
 * The head of head.station is there from the start. Any other is opened beside it (site_load_for) when its first
 * station is due, and ends after its last. Before the first scan each is set up once, so that its errors come then.
 * The heads' clocks all begin at the same power-up. */
#ifndef FIRMWARE_SIM_APP_STUDIO_RECORD_HEADS_H
#define FIRMWARE_SIM_APP_STUDIO_RECORD_HEADS_H

#include "firmware_sim/app/studio/record/offline.h"
#include "firmware_sim/app/studio/record/recording.h"
#include "firmware_sim/app/scanner_report.h"

struct heads_one {
    struct config *cfg;
    struct offline offline;
    struct scanner_report report;
    uint32_t last_station;  /* the last of its stations */
    int is_open, is_hashed; /* it was opened; its hash was begun */
};

struct heads {
    struct offline *first; /* of head.station; it stays until the end */
    /* The caller's: asked for each station before the first scan, with the site of its scanner. NULL: not asked. */
    int (*fits)(void *ctx, const struct site *site, uint32_t station, struct sh_err *err);
    void *ctx;
    /* inner state */
    struct heads_one one[CONFIG_MAX_STATIONS]; /* one[0]: of head.station */
    uint32_t n;
    uint32_t head_of[CONFIG_MAX_STATIONS]; /* index into `one`, by station from 0 */
    struct heads_one *at;                  /* the one that scans now */
    double scan_s;
    int64_t said_ns; /* when progress was reported last */
    const struct sh_report *report;
    struct scanner_warnings warnings;
};

/* Loads the configurations of all scanners; nothing runs. heads begins as zeros, is large, and is to be closed, also
 * after an error. cfg must live on, and so must the settings of --set that it was loaded with. */
int heads_load(struct config *cfg, struct heads *heads, struct sh_err *err);
/* How many turns the heads take from station `first` to `last`: a head that scans again after another one counts again.
 * Returns 1 where `first` is 0. */
uint32_t heads_turns(const struct heads *heads, uint32_t first, uint32_t last);
/* The configuration of the i-th of the heads that scan from stations first to last (0, 0: the station that the head is
 * set to); NULL: there is no i-th. */
struct config *heads_config(const struct heads *heads, uint32_t i, uint32_t first, uint32_t last);
/* Starts the first head. scan_s means the same as in offline_open. site: the site of the head's configuration, loaded
 * by offline_load; NULL: heads_open loads one. */
int heads_open(struct heads *heads, struct site *site, double scan_s, const struct sh_report *report,
               struct sh_err *err);
/* Like recording_run, from each station with the head of its scanner. */
int heads_record(struct heads *heads, const struct recording_options *options, struct recording_result *result,
                 struct sh_err *err);
/* The site of the head that scans now. */
const struct site *heads_site(const struct heads *heads);
/* For recording_options.prepare. Stations count from 1; 0 is the station at power-up. No scan may be running. */
int heads_prepare(struct heads *heads, uint32_t station, struct sh_err *err);
void heads_close(struct heads *heads);

#endif
