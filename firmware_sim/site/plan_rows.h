/* SPDX-License-Identifier: MIT */
/* The plan of a site as rows for people to read. core/plan chooses methods, and the site applies the choice
 * (site->plan). Nothing else decides on methods. */
#ifndef FIRMWARE_SIM_SITE_PLAN_ROWS_H
#define FIRMWARE_SIM_SITE_PLAN_ROWS_H

#include "firmware_sim/site/site.h"

/* Fills site->plan.row: rows of each stage, then one with the pulses per second that this machine computes (rate.c). */
int site_plan_rows(struct site *site, struct sh_err *err);
/* Returns the processor time that the plan expects for a pulse, ns: the costs of its rows, and the work that each pulse
 * takes with any method (plan_pulse_ns). The figures are rounded: good enough to recognise an unusual cost. */
double site_planned_ns(const struct site *site);
/* Writes possible causes of a pulse that takes far more than that, by the plan, and what the user can do. */
void site_cost_reason(const struct site *site, char *text, size_t room);
/* Writes the methods that a run uses, in one line. */
void site_plan_text(const struct site *site, char *text, size_t room);

/* ---- rate.c: measures how many pulses per second this machine computes at a site. The measurement casts pulses of the
 * head to points, and writes their frames. The figures hold for this machine at this moment, so no method is chosen by
 * them. A call takes about 8 ms of processor time; a few milliseconds more where pulses have many sub-rays. */
/* The plan's last row, stage total. */
int site_rate_row(const struct site *site, struct plan_row *row, struct sh_err *err);
/* Warns where the configured rate, in real time, needs more than 80 % of the processors. */
int site_warn_rate(const struct site *site, const struct sh_report *report, struct sh_err *err);

#endif
