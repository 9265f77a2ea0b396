/* SPDX-License-Identifier: MIT */
/* Warnings of a configuration's scanners: one that several of them give is printed once, with their stations. In: the
 * warnings of each scanner while it is set up. Out: one warning for each text. */
#ifndef FIRMWARE_SIM_APP_SCANNER_REPORT_H
#define FIRMWARE_SIM_APP_SCANNER_REPORT_H

#include "firmware_sim/config/limits.h"
#include "firmware_sim/site/site.h"

/* The warnings begin as zeros, and are to be freed. */
struct scanner_warnings {
    uint32_t n, n_scanners;
    struct {
        char *text;
        uint8_t is_of[CONFIG_MAX_STATIONS]; /* by the scanner's first station, from 0 */
    } one[SITE_MAX_WARNINGS];
    int are_printed; /* from now on only a new warning is printed, at once */
};

/* A report that notes warnings, and hands on all else. The struct must not move. */
struct scanner_report {
    struct sh_report report;
    struct scanner_warnings *warnings;
    uint32_t station; /* from 1: the first that has the scanner */
};
void scanner_report_set_up(struct scanner_report *report, const struct sh_report *to, uint32_t station,
                           struct scanner_warnings *warnings);
/* Prints the warnings that were noted. first: the site of the first scanner, whose warnings were printed at once. */
void scanner_warnings_say(struct scanner_warnings *warnings, const struct site *first, const struct sh_report *to);
void scanner_warnings_free(struct scanner_warnings *warnings);

#endif
