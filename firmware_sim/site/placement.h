/* SPDX-License-Identifier: MIT */
/* Places the stations of a site: in the scene, and on the Earth where the scene's anchor or the station gives that.
 */
#ifndef FIRMWARE_SIM_SITE_PLACEMENT_H
#define FIRMWARE_SIM_SITE_PLACEMENT_H

#include "core/bvh.h"
#include "core/geoframe.h"

struct config;

struct placement_anchor {
    int known; /* 0: source none */
    struct geoframe frame;
};

/* Sets the scene's frame; reads the IFC or GeoTIFF meshes where they are the source. report may be NULL. */
int placement_find_anchor(const struct config *cfg, const struct sh_report *report, struct placement_anchor *anchor,
                          struct sh_err *err);

struct placement {
    double position_m[3];      /* of the head's origin, prcs */
    double rotation[9];        /* socs -> prcs */
    int on_earth;              /* 0: place is 0 */
    struct georef_place place; /* of the head's origin */
    double floor_m;            /* distance down to the floor that was looked for; NaN: it wasn't */
};

/* Station i (0...) of the configuration. A floor is a surface of the BVH; bodies that move are no floors. */
int placement_find(const struct config *cfg, uint32_t i, const struct placement_anchor *anchor, const struct bvh *bvh,
                   struct placement *out, struct sh_err *err);

/* Returns the length of the straight line between two places on the Earth, in metres. */
double placement_apart_m(const struct georef_place *a, const struct georef_place *b);

/* Sets the columns of `level`: right, forward and up at a place, in the scene frame. Without an anchor, up is z. */
int placement_level(const struct placement_anchor *anchor, const double at_m[3], double level[9], struct sh_err *err);

/* Fills the specification of a station's georeferencing, all but the CRS. */
int placement_georef(const struct placement *placement, const struct placement_anchor *anchor, struct georef_spec *spec,
                     struct sh_err *err);

#endif
