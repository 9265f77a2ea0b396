/* The site: what a configuration loads once and all scans share, constant afterwards. The scene, its BVHs, and per
 * station the place of the head. */
#ifndef FIRMWARE_SIM_SITE_H
#define FIRMWARE_SIM_SITE_H

#include "core/cast.h"
#include "core/georef.h"
#include "core/plan.h"
#include "core/scene.h"
#include "firmware_sim/config.h"

struct site_station {
    const struct config_station *station;
    struct bvh *bvh; /* shared where stations are near each other */
    struct georef *georef;
    double rotation[9];   /* socs -> prcs */
    double scale[3];      /* of geo points on the wire, units of the CRS per count */
    struct plan_row plan; /* how the georef's method was chosen */
};

struct site_mover {
    const struct config_mesh *mesh;
    struct scene *scene;
    struct bvh *bvh;
    double centre_m[3], radius_m;
};

struct site {
    const struct config *cfg;
    struct scene *scene; /* what stands still */
    struct site_mover mover[CAST_MAX_MOVERS];
    uint32_t n_movers, n_surfaces; /* surfaces of the scene, then of the movers */
    struct bvh *bvh[CONFIG_MAX_STATIONS];
    uint32_t n_bvh;
    struct site_station station[CONFIG_MAX_STATIONS];
    uint32_t n_stations;
    struct georef_geoid *geoid; /* NULL: heights are ellipsoidal */
    double scale_m;             /* of positions and ranges on the wire, metres per count */
};

/* Stations further than this from a BVH's origin get one of their own: a float there has steps of 0.06 mm. */
#define SITE_BVH_REACH_M 1000.0

/* Room left beyond the head's largest range, for noise. */
#define SITE_MARGIN 1.01

/* cfg must outlive the site. */
int site_load(const struct config *cfg, const struct sh_report *report, struct site **out, struct sh_err *err);
void site_free(struct site *site);

/* Names of a label below n_surfaces. */
const struct scene_surface *site_surface(const struct site *site, uint32_t label);

/* Poses of all movers at a time of the scan. */
void site_move(const struct site *site, double t_s, struct cast_setup *setup);

/* What the casters need to scan from a station (0..n_stations-1). */
void site_cast_setup(const struct site *site, uint32_t station, struct cast_setup *setup);

#endif
