/* SPDX-License-Identifier: MIT */
/* The georeferencing of a site's stations: heights, CRS, method, and how many metres a count is on the wire. */
#ifndef FIRMWARE_SIM_SITE_GEOREFERENCE_H
#define FIRMWARE_SIM_SITE_GEOREFERENCE_H

#include <stdint.h>

struct sh_err;
struct sh_report;
struct site;

/* After stations are placed and the path of a moving head is known. Fills the stations' georef, plan, scale and leg,
 * and site->scale_m. Warns where a tolerance is not met. */
int site_georeference(struct site *site, const struct sh_report *report, struct sh_err *err);
/* The same for one station without a georeference, and for the scale, which depends on all stations. No warnings. */
int site_georeference_one(struct site *site, uint32_t station, struct sh_err *err);
void site_free_georeference(struct site *site, uint32_t station);

#endif
