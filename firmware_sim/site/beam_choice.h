/* Which beam, and how far through glass and mirrors. */
#ifndef FIRMWARE_SIM_SITE_BEAM_CHOICE_H
#define FIRMWARE_SIM_SITE_BEAM_CHOICE_H

#include "firmware_sim/site/site.h"

/* With all else of the site in place: fills site->plan's methods and the rows of both, and makes what they need. */
int site_choose_methods(struct site *site, const struct sh_report *report, struct sh_err *err);
/* Builds a BVH with the planned order of surfaces. Where *out is not NULL it is the caller's, even after an error. */
int site_build_bvh(const struct site *site, const struct scene *scene, const double origin_m[3], double reach_m,
                   const struct sh_report *report, struct bvh **out, struct sh_err *err);

/* Bounds also of what is forced. */
int site_measure_forced(struct site *site, const struct sh_report *report, struct sh_err *err);

#endif
