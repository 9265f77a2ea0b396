/* Which beam, how far through glass and mirrors, and how exactly rays are cast (site_plan.c). */
#ifndef FIRMWARE_SIM_SITE_BEAM_CHOICE_H
#define FIRMWARE_SIM_SITE_BEAM_CHOICE_H

#include "firmware_sim/site/site.h"

/* With all else of the site in place: fills site->plan's methods and the rows of both, and makes what they need. */
int site_choose_methods(struct site *site, const struct sh_report *report, struct sh_err *err);
/* ---- site_cast.c */
/* Before anything is built: whether what is forced can be had. */
int site_check_cast(const struct site *site, struct sh_err *err);
/* A BVH as it is planned by then; site_choose_cast may replace those of site->bvh. Where *out is not NULL it is the
 * caller's, be there an error or not. */
int site_build_bvh(const struct site *site, const struct scene *scene, const double origin_m[3], double reach_m,
                   const struct sh_report *report, struct bvh **out, struct sh_err *err);
/* With beam and detection chosen: whether rays are refined. measure: also what the choice does not hang on. */
int site_choose_cast(struct site *site, int measure, const struct sh_report *report, struct sh_err *err);

/* Bounds also of what is forced. */
int site_measure_forced(struct site *site, const struct sh_report *report, struct sh_err *err);

#endif
