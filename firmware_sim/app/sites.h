/* SPDX-License-Identifier: MIT */
/* The sites of all scanners of a configuration, in one scene (site_load_for). For commands that ask each station
 * what its own scanner sees from there. */
#ifndef FIRMWARE_SIM_APP_SITES_H
#define FIRMWARE_SIM_APP_SITES_H

#include "firmware_sim/app/scanner_report.h"

struct sites {
    struct site *first; /* of the configuration itself: the scanner of head.station */
    /* inner state */
    struct sites_one {
        struct config *cfg;
        struct site *site;
        uint32_t scanner;
        struct scanner_report report;
    } other[CONFIG_MAX_STATIONS];
    uint32_t n;
    int first_is_lent;
    struct scanner_warnings warnings;
};

/* sites begins as zeros, and is to be freed, also after an error. cfg must live on, and so must the settings of
 * --set that it was loaded with. */
int sites_load(const struct config *cfg, enum site_purpose purpose, const struct sh_report *report, struct sites *sites,
               struct sh_err *err);
/* Does the same for a head that runs. `first` is the site of that head, and stays the caller's. */
int sites_load_beside(const struct config *cfg, const struct site *first, const struct sh_report *report,
                      struct sites *sites, struct sh_err *err);
/* Returns the site of the scanner at a station, from 0. */
struct site *sites_of(const struct sites *sites, uint32_t station);
void sites_free(struct sites *sites);

#endif
