/* SPDX-License-Identifier: MIT */
/* The visibility maps of stations: decides whether to make them, and makes them. */
#ifndef FIRMWARE_SIM_SITE_SIGHTS_H
#define FIRMWARE_SIM_SITE_SIGHTS_H

struct sh_err;
struct sh_report;
struct site;

/* After beam and optics are chosen. Sets site->plan.methods.sight and the row. */
int site_plan_sight(struct site *site, const struct sh_report *report, struct sh_err *err);
void site_close_sights(struct site *site);
/* Takes over the maps of another site's stations that stand as they did. Then site_open_sights makes the others. */
void site_share_sights(struct site *site, const struct site *from);

#endif
