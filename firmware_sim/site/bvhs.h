/* The BVHs of a site: one for each body that moves, and as many of the scene as the places of the head need.
 *
 * In: the loaded scene, and where rays begin (prcs, metres). Out: site->bvh and the BVHs of movers; the site owns
 * them. */
#ifndef FIRMWARE_SIM_SITE_BVHS_H
#define FIRMWARE_SIM_SITE_BVHS_H

#include "firmware_sim/site/site.h"

/* Where rays begin. */
struct site_sphere {
    const double *centre_m; /* [3], prcs */
    double radius_m;
};

/* Adds a BVH of the scene to site->bvh, surfaces ordered as planned. *out stays the site's. */
int site_add_bvh(struct site *site, const struct site_sphere *from, const struct sh_report *report, struct bvh **out,
                 struct sh_err *err);

/* Once the order of surfaces is planned and all stations are placed. */
int site_build_mover_bvhs(struct site *site, const struct sh_report *report, struct sh_err *err);
/* For heads that stand; stations near each other share one. */
int site_build_station_bvhs(struct site *site, const struct sh_report *report, struct sh_err *err);

#endif
