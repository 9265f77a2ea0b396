/* The plan of a site: what the configuration, the scene and the head ask for; core/plan chooses, the site applies it
 * (site->plan). Nothing else decides on methods. */
#ifndef FIRMWARE_SIM_SITE_PLAN_ROWS_H
#define FIRMWARE_SIM_SITE_PLAN_ROWS_H

#include "firmware_sim/site/site.h"

/* Before BVHs are built: whether surfaces are ordered exactly. */
void site_plan_order(struct site *site);
/* All rows, for people to read: with bounds of what is forced, too, which no run needs. Scans are as before. */
int site_plan_rows(struct site *site, const struct sh_report *report, struct sh_err *err);
/* In a line: what was planned for a run. */
void site_plan_text(const struct site *site, char *text, size_t room);

#endif
