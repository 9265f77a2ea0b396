/* The plan of a site as rows for people to read. core/plan chooses, the site applies it (site->plan); nothing else decides on methods. */
#ifndef FIRMWARE_SIM_SITE_PLAN_ROWS_H
#define FIRMWARE_SIM_SITE_PLAN_ROWS_H

#include "firmware_sim/site/site.h"

/* Fills site->plan.row: stage by stage, then what this machine computes of it (firmware_sim/site/rate.h). */
int site_plan_rows(struct site *site, struct sh_err *err);
/* In one line: the methods that a run uses. */
void site_plan_text(const struct site *site, char *text, size_t room);

#endif
