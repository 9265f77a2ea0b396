/* Georeferencing of a site (site.c): heights, method, counts. */
#ifndef FIRMWARE_SIM_SITE_GEOREFERENCE_H
#define FIRMWARE_SIM_SITE_GEOREFERENCE_H

#include "firmware_sim/site/site.h"

/* As output.heights says; site->geoid stays NULL where heights are ellipsoidal. */
int site_open_geoid(struct site *site, struct sh_err *err);

/* Chooses the method of a station's georef, says so in its plan, and warns where the tolerance is not met. */
int site_plan_georef(const struct site *site, struct site_station *s, const struct sh_report *report,
                     struct sh_err *err);

/* Metres per count, and the CRS's units per count for each station. */
int site_choose_scale(struct site *site, const struct sh_report *report, struct sh_err *err);

#endif
