/* SPDX-License-Identifier: MIT */
/* Measures how many pulses per second this machine computes at a site: it casts pulses of the head to points, and
 * writes their frames. The figures hold for this machine at this moment, so no method is chosen by them. A call takes
 * about 8 ms of processor time; a few milliseconds more where pulses have many sub-rays. */
#ifndef FIRMWARE_SIM_SITE_RATE_H
#define FIRMWARE_SIM_SITE_RATE_H

#include "firmware_sim/site/site.h"

/* The plan's last row, stage total. */
int site_rate_row(const struct site *site, struct plan_row *row, struct sh_err *err);
/* Warns where the configured rate, in real time, needs more than 80 % of the processors. */
int site_warn_rate(const struct site *site, const struct sh_report *report, struct sh_err *err);

#endif
