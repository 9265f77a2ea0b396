/* Which beam, how far through glass and mirrors, and how exactly rays are cast (site_plan.c). */
#ifndef FIRMWARE_SIM_SITE_CHOOSE_H
#define FIRMWARE_SIM_SITE_CHOOSE_H

#include "firmware_sim/site.h"

/* With all else of the site in place: fills site->plan's methods and the rows of both, and makes what they need. */
int site_choose_methods(struct site *site, const struct sh_report *report, struct sh_err *err);
/* site_cast.c: of that, whether ranges and triangles are refined; the rest is chosen. measure: also what the choice
 * does not hang on. */
int site_choose_cast(struct site *site, int measure, const struct sh_report *report, struct sh_err *err);
/* Bounds also of what is forced. */
int site_measure_forced(struct site *site, const struct sh_report *report, struct sh_err *err);

#endif
