/* What a site's scans do between a hit and a point (signal, surfaces, instrument, noise), made once from the
 * configuration and the loaded scene. */
#ifndef FIRMWARE_SIM_SITE_DETECTION_H
#define FIRMWARE_SIM_SITE_DETECTION_H

#include "firmware_sim/site/site.h"

/* The scene and its movers are loaded. Where there are mirrors, site->n_surfaces grows by the labels of ghosts. Warns
 * of entries of `surfaces` that no surface fits. */
int site_set_up_detect(struct site *site, const struct sh_report *report, struct sh_err *err);
void site_free_detect(struct site *site);

/* How many surfaces of glass or mirrors pulses are followed through, once that is known. */
void site_set_depth(struct site *site, uint32_t depth);

/* Whether a run, or `plan`, may cast footprints: what is built then has room for them. */
int site_casts_footprints(const struct site *site);
/* How far from the head's origin rays may begin, given where it stands: beams beside it, and ways beyond glass. */
double site_ray_reach_m(const struct site *site, const double station_m[3]);

/* How far noise may take a point. */
double site_noise_m(const struct site *site);

#endif
