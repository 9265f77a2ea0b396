/* SPDX-License-Identifier: MIT */
/* Plausibility checks: warns of values that are allowed, but hardly meant. */
#ifndef FIRMWARE_SIM_SITE_PLAUSIBILITY_H
#define FIRMWARE_SIM_SITE_PLAUSIBILITY_H

struct sh_err;
struct sh_report;
struct site;

/* After the scene has its BVHs. Warns, with figures, of a scene of an unlikely size, of a step of a sphere that is
 * rounded, of stations that see nothing or little, of lines without a pulse, of fields that nothing evaluates, of
 * transparent surfaces without a rule, and of attributes and colours that nothing fills. */
int site_check_plausibility(const struct site *site, const struct sh_report *report, struct sh_err *err);

#endif
