/* SPDX-License-Identifier: MIT */
/* Sets up the colours of points: the quantity that they show, and its limits. */
#ifndef FIRMWARE_SIM_SITE_COLOURS_H
#define FIRMWARE_SIM_SITE_COLOURS_H

struct sh_err;
struct sh_report;
struct site;

int site_set_up_colours(struct site *site, const struct sh_report *report, struct sh_err *err);

#endif
