/* The site: what a configuration loads once and all scans share, constant afterwards. The scene, its BVHs, and per
 * station the place of the head. */
#ifndef FIRMWARE_SIM_SITE_H
#define FIRMWARE_SIM_SITE_H

#include "core/cast.h"
#include "core/georef.h"
#include "core/plan.h"
#include "core/pose.h"
#include "core/scene.h"
#include "firmware_sim/config.h"
#include "firmware_sim/placement.h"

struct site_station {
    const struct config_station *station;
    struct bvh *bvh; /* shared where stations are near each other */
    struct georef *georef;
    struct placement at;
    struct cast_beam *beam;         /* NULL: one ray per pulse */
    struct beam_outlines *outlines; /* beam.mode adaptive */
    double scale[3];                /* of geo points on the wire, units of the CRS per count */
    struct plan_row plan;           /* how the georef's method was chosen */
};

struct site_mover {
    const struct config_mesh *mesh;
    struct scene *scene;
    struct bvh *bvh;
    double centre_m[3], radius_m;
};

/* A stretch of a moving head's path, with a BVH that reaches all of it. */
struct site_stretch {
    int64_t until_ns; /* since the scan's start */
    struct bvh *bvh;
};

struct site {
    const struct config *cfg;
    struct scene *scene; /* what stands still */
    struct placement_anchor anchor;
    struct site_mover mover[CAST_MAX_MOVERS];
    uint32_t n_movers, n_surfaces; /* surfaces of the scene, then of the movers */
    struct bvh *bvh[CONFIG_MAX_STATIONS];
    uint32_t n_bvh;
    struct site_station station[CONFIG_MAX_STATIONS];
    uint32_t n_stations;
    struct georef_geoid *geoid; /* NULL: heights are ellipsoidal */
    /* A moving head; the stations then only say where on Earth the scene lies. */
    int moving;
    struct pose mount;            /* of the head on the platform */
    struct pose_knot *knot;       /* trajectory: the head's poses from the scan's start on */
    size_t n_knots;               /* 0: live */
    double knot_error_m;          /* what the head's path differs from the trajectory by, at most */
    struct site_stretch *stretch; /* in order of time */
    size_t n_stretches;
    double path_reach_m; /* from any station */
    double scale_m;      /* of positions and ranges on the wire, metres per count */
};

/* Stations further than this from a BVH's origin get one of their own: a float there has steps of 0.06 mm. */
#define SITE_BVH_REACH_M 1000.0

/* Room left beyond the head's largest range, for noise. */
#define SITE_MARGIN 1.01

/* cfg must outlive the site. */
int site_load(const struct config *cfg, const struct sh_report *report, struct site **out, struct sh_err *err);
void site_free(struct site *site);

/* UTM zone for all stations of an anchored scene: that of the anchor, or of the first station; else, and where
 * output.utm_zone or the scene's own grid says it, as the configuration has it (0: by position). */
int site_utm_zone(const struct site *site);

/* Names of a label below n_surfaces. */
const struct scene_surface *site_surface(const struct site *site, uint32_t label);

/* The BVH for a moving head at a time of the scan. */
struct bvh *site_bvh_at(const struct site *site, int64_t t_ns);

/* Poses of all movers at a time of the scan. */
void site_move(const struct site *site, double t_s, struct cast_setup *setup);

/* What the casters need to scan from a station (0..n_stations-1). */
void site_cast_setup(const struct site *site, uint32_t station, struct cast_setup *setup);

#endif
