/* SPDX-License-Identifier: MIT */
/* The site: everything that a configuration loads once and all scans share. In: a checked configuration. Out:
 * the scene, its BVHs, the stations' places (scene frame, metres) and georeferences, and the planned methods.
 * load.c makes it, site.c reads it. A site is constant once loaded: any thread. Moving a station makes another
 * site beside this one (site_load_moved). */
#ifndef FIRMWARE_SIM_SITE_SITE_H
#define FIRMWARE_SIM_SITE_SITE_H

#include <stdint.h>

#include "core/cast.h"
#include "core/colour.h"
#include "core/detect.h"
#include "core/instrument.h"
#include "core/plan.h"
#include "core/pose.h"
#include "core/scene.h"
#include "core/surface.h"
#include "firmware_sim/command/head.h"
#include "firmware_sim/site/placement.h"

struct config;
struct site_waves;

/* Georeference and scale of the points of one stretch of a head's path, geo layout. Points are relative to the
 * stretch's centre. */
struct site_on_stretch {
    struct georef *georef;
    double scale[3]; /* as below */
};

/* A station's tripod, once its height above the ground is known (tripod.c). */
struct site_tripod {
    const struct config_tripod *from; /* NULL: none, or the station has another scanner */
    double head_m;      /* the head's origin above the ground, along the plumb line; NaN: no ground below */
    double height_m;    /* the tripod's top, likewise */
    double opening_rad; /* of a leg, from the vertical */
    double gap_m;       /* between feet and ground: above 0 where the tripod hovers */
    struct cast_tripod cast;
    struct scene *legs; /* NULL: not in view */
    struct bvh *bvh;
};

struct site_station {
    const struct config_station *station; /* of the configuration, or of stops */
    struct sight *_Atomic sight;          /* its visibility map; NULL: rays go to the BVH (site_open_sights) */
    struct georef *georef;
    struct placement at;
    struct site_tripod tripod;
    struct cast_beam *beam; /* with outlines of its own where it is adaptive; NULL: one ray per pulse */
    double scale[3];        /* of geo points on the wire, units of the CRS per count */
    struct site_on_stretch
        *on_stretch;      /* [n_stretches] of a trajectory, in the geo layout; else, or with another scanner, NULL */
    struct plan_row plan; /* how the georef's method was chosen; of the worst stretch */
    struct cast_colour colour; /* of its points; where output.colour is not none */
    double t_s, frame; /* of a stop: its time after the trajectory's first sample; the trajectory's frame scalar */
};

struct site_mover {
    uint32_t number; /* of the mesh in the configuration: all sites of a world have the same meshes */
    struct scene *scene;
    struct bvh *bvh;
    double centre_m[3], radius_m;
};

/* The steps of a scan from a hit to a point (detection.c). */
struct site_detect {
    int on;                                     /* 0: no such step, and no cost */
    struct cast_detect cast;                    /* of the program that the configuration has; the others below */
    struct cast_detect program[HEAD_MAX_RATES]; /* by program of the head profile: each has a signal of its own */
    struct detect_signal signal[HEAD_MAX_RATES];
    struct surface_table surfaces;
    struct instrument instrument;
    struct detect_ball ball;
    uint32_t n_real;             /* labels of real surfaces; as many labels of ghosts follow */
    struct scene_surface *ghost; /* [n_real]; NULL: no mirrors */
    uint16_t *kind;              /* [n_real] of surfaces, for outlines; NULL: not modelled */
};

/* Colours of points (colours.c): output.colour, with its limits. */
struct site_colours {
    struct colour_scale scale;
    struct surface_colours surfaces; /* texture */
};

/* The plan. Scans take their methods from here alone. */
struct site_plan {
    struct plan_methods methods;
    struct plan_row sight, beam, optics;
    double sight_rays;    /* rays that a map's cells are sized for (sight_spec) */
    struct plan_row *row; /* `plan`: all stages in their order, then the total; else NULL */
    size_t n;
};

/* The world: the meshes and their BVHs, which the sites of one scene share (world.c). The last of these
 * sites frees it. One thread loads and frees sites; others may cast meanwhile. */
struct site_world {
    uint32_t n_users;
    int written_out; /* copies are triangles of the scene */
    struct scene *scene;
    struct site_mover mover[CAST_MAX_MOVERS];
    uint32_t n_movers, n_surfaces;
    struct site_target {
        uint8_t *is_target;                   /* [n_surfaces] scene.target fits; NULL: all are scanned */
        uint32_t surfaces, triangles;         /* scanned ones */
        uint32_t all_surfaces, all_triangles; /* those in the files */
    } target;
    struct bvh *bvh; /* of what stands still, for rays from anywhere */
};

/* A stretch of a moving head's path: positions on the wire are relative to its centre. */
struct site_stretch {
    int64_t until_ns;            /* since the scan's start: whole milliseconds; INT64_MAX: the last one */
    double centre_m[3], reach_m; /* the whole stretch is within reach_m of its centre */
};

/* Warnings given while loading, so that a site beside this one only gives new ones. */
enum { SITE_MAX_WARNINGS = 64 };
struct site_warnings {
    char *text[SITE_MAX_WARNINGS];
    uint32_t n;
    uint32_t n_new;  /* warnings that the site before did not have */
    char first[160]; /* the first of these */
};

struct site {
    const struct config *cfg;
    struct config *own_cfg; /* of site_load_moved; else NULL */
    struct site_warnings warnings;
    struct emitter emitter; /* the profile's, with its list of directions */
    struct emitter_firing *direction;
    struct site_world *world;
    struct scene *scene; /* what stands still; of the world, as movers and BVHs are */
    struct placement_anchor anchor;
    struct site_mover *mover;
    uint32_t n_movers, n_surfaces; /* surfaces of the scene, of the movers, of legs, then the ghosts of all */
    struct scene_surface *legs;    /* the surface of tripods' legs, with the label legs_label; NULL: no legs */
    uint32_t legs_label;
    uint8_t *silent; /* by label: hides and gives no echo; NULL: none (scene.target) */
    struct site_detect detect;
    struct site_waves *waves; /* waveforms (waves.h); NULL: none */
    struct site_colours colours;
    struct site_plan plan;
    uint32_t planned_frames; /* head.frames that the site was planned for; a run may scan longer (--duration) */
    int measures;    /* for `plan`: footprints are cast to measure the error of a forced beam, even of single rays */
    struct bvh *bvh; /* the world's */
    struct site_station *station;
    uint32_t n_stations;
    struct config_station *stop; /* a station for each stop of the platform; NULL: it does not stop */
    struct georef_geoid *geoid;  /* NULL: heights are ellipsoidal */
    /* A moving head; the stations then only give the scene's place on the Earth. */
    int moving;
    struct pose mount;            /* of the head on the platform */
    struct pose_knot *knot;       /* trajectory: the head's poses from the scan's start on */
    size_t n_knots;               /* 0: live */
    double knot_error_m;          /* largest distance of the head's path from the trajectory */
    struct site_stretch *stretch; /* in order of time */
    size_t n_stretches;
    double live_reach_m; /* of a live head from its station */
    double scale_m;      /* of positions and ranges on the wire, metres per count */
};

/* A path is cut into stretches whose poses are within this distance of a centre. In the geo layout loading takes about
 * 1 ms for each stretch and each station of the site's own scanner. So the limit keeps it at 1 s for one station. */
#define SITE_STRETCH_M 1000.0
enum { SITE_MAX_STRETCHES = 1024 };

/* Extents are this many times the head's largest range, for noise. */
#define SITE_MARGIN 1.01

enum site_purpose {
    SITE_FOR_SCANS,
    SITE_FOR_PLAN,    /* site->plan.row is filled, too, with bounds even of methods that the configuration forces */
    SITE_WRITTEN_OUT, /* for tools that look at triangles one by one: copies of meshes are written out as triangles */
    SITE_MOVED,       /* only for site_load_moved */
};
#define SITE_MOST_WRITTEN_OUT 10000000 /* triangles; SH_EINPUT: there would be more */
/* cfg must outlive the site. */
int site_load(const struct config *cfg, const struct sh_report *report, struct site **out, struct sh_err *err);
/* Does the same for a purpose. other: the site of another scanner of the same file; NULL: none is loaded. Where both
 * have the same scene, scene and BVHs are shared, not loaded again. `other` may be freed before or after. */
int site_load_for(const struct config *cfg, enum site_purpose purpose, const struct site *other,
                  const struct sh_report *report, struct site **out, struct sh_err *err);
void site_free(struct site *site);

/* Whether two settings differ in values that a site is planned for: ranges, noise, step of a sphere. */
int site_varies(const struct head_settings *a, const struct head_settings *b);
/* Makes the site of a configuration with the ranges, the noise and the sphere's step of the settings. Detection, the
 * station's georeference and the scale on the wire are made again, by the steps of loading. All else is that
 * of `from`, which must outlive it: scene, BVHs, maps, and the methods that were chosen by trying them on the scene
 * (beam, optics). The new site serves scans from that station alone; maps are looked up in `from`. Takes milliseconds.
 * SH_EINPUT: there is no plan for these settings. Freed by site_vary_free. */
int site_vary(const struct site *from, const struct head_settings *settings, uint32_t station, struct site **out,
              struct sh_err *err);
void site_vary_free(struct site *site);
/* A station's place, as its keys in the configuration give it: the head's origin in the scene frame, metres; its
 * attitude, degrees. */
struct site_place {
    double position_m[3], heading_deg, pitch_deg, roll_deg;
};
void site_get_place(const struct site *site, uint32_t station, struct site_place *out);
/* Why no station of a site can be moved; NULL: they can. */
const char *site_why_fixed(const struct site *site);
/* A station (0..) of a scanner, and the place that the station moves to. `to` NULL: the station goes back to its place
 * in `first`, the site that was loaded from the configuration. */
struct site_station_move {
    const struct site *first;
    uint32_t station;
    const struct site_place *to;
};
/* Makes the site beside `from` in which the station stands at its new place. The result is as from a configuration with
 * that place. Maps of from's stations that still hold are kept; all others that are planned are made. Meshes and BVHs
 * are shared. from and move->first may be cast from meanwhile; sites of one world are loaded and freed by one thread at
 * a time. report gets the warnings that loading `from` did not give; out->warnings counts them. SH_EINPUT: no head can
 * stand there. */
int site_load_moved(const struct site *from, const struct site_station_move *move, const struct sh_report *report,
                    struct site **out, struct sh_err *err);
/* Frees the site's maps, once nobody casts from it any more. The owner still has to free the site. */
void site_retire(const struct site *site);
/* How many stations a site of this configuration will have, before it is loaded; with stops, the number of these.
 * Errors as of site_load. */
int site_count_stations(const struct config *cfg, const struct sh_report *report, uint32_t *n, struct sh_err *err);

/* A site holds the maps of so many stations at a time. Where the site serves more stations, a run has no maps, and a
 * recording has that of the station at hand. Whether a map is used changes no hit. */
enum { SITE_MAX_SIGHTS = 16 };

/* Makes the maps of n stations from `first` on, where the plan says so, and gives back those of others. The function
 * must be called before these stations are scanned, and while no scan runs: casters take the map with the station's
 * setup. */
int site_open_sights(struct site *site, uint32_t first, uint32_t n, const struct sh_report *report, struct sh_err *err);

/* These functions give parts of the site's configuration: the file, for messages; the head profile; the head's settings
 * at power-up. */
const char *site_file(const struct site *site);
const struct config_profile *site_profile(const struct site *site);
const struct head_settings *site_settings(const struct site *site);

/* Whether this scanner scans from station i, from 0 (config_serves), and how many such stations there are; the others
 * only have a place. */
int site_serves(const struct site *site, uint32_t i);
uint32_t site_n_served(const struct site *site);

/* Sets zone and side of the grid of output.crs utm, as georef_spec has them. output.utm_zone decides where it is given.
 * Else an anchored scene has one grid for all its stations: the scene's own, or that of the anchor, or that of the
 * first station. Without an anchor zone is 0: each station has the grid of its position. side is the hemisphere from
 * which northings count: that of the scene's own grid; else of the first station, if its place is given in UTM; else of
 * the place that gave the zone; 0: by position. */
void site_grid(const struct site *site, int *zone, int *side);

/* Fills the schedule of its head with these settings. */
void site_fill_spec(const struct site *site, const struct head_settings *settings, struct schedule_spec *spec);

/* Entries that a pulse may need in a block: its echoes, at most as many as the plan allows. */
uint32_t site_points_per_pulse(const struct site *site);
/* The same for any plan that moving a station may lead to. */
uint32_t site_most_points_per_pulse(const struct site *site);

/* The names of a label, which must be below n_surfaces. */
const struct scene_surface *site_surface(const struct site *site, uint32_t label);
/* The texture of a real surface; NULL: none. */
const struct scene_texture *site_texture(const struct site *site, uint32_t label);

/* ---- clear.c: surfaces that their file calls transparent and for which there is no rule. Zero-initialise. */
#define SITE_CLEAR_LEAST 0.01 /* less transparency than this may be a file's rounding */
struct site_clear {
    uint32_t n, n_left_out; /* surfaces; rules that had no room */
    size_t room;            /* for the rules; 0: all of them */
    /* "{material: "Glas", glass: 0.7}, ...", for `surfaces`. Where room is 0, one rule always fits. */
    char rules[8 * SCENE_NAME_LEN];
};
void site_clear_add(struct site_clear *c, const struct scene_surface *s, const struct surface_rule *rule, uint32_t n);

/* The stretch that a moving head is on at a time of the scan. */
size_t site_stretch_at(const struct site *site, int64_t t_ns);
/* Sets the members of the station's setup that casters need on that stretch: georeference, centre, scale. */
void site_enter(const struct site *site, uint32_t station, size_t stretch, struct cast_setup *setup);

/* The georeference of a station's points on a stretch, the point of the scene that they are relative to, and the scale.
 * The stretch matters only along a trajectory. */
const struct georef *site_georef(const struct site *site, uint32_t station, size_t stretch, const double **centre_m,
                                 const double **scale);

/* ---- tripod.c: the tripod under a station's head */
/* The tripod of a station (0..) as it would be at another place, without warnings. The site stays as it is. Any thread.
 * SH_EINPUT: the head would be too near the ground. site_free_tripod is due in any case. */
int site_tripod_at(const struct site *site, uint32_t station, const double position_m[3], struct site_tripod *out,
                   struct sh_err *err);
void site_free_tripod(struct site_tripod *tripod);
/* "legs of 1.8 m, top 1.6 m above the ground; opening 27.3 deg, ...", for a station with a tripod. */
void site_describe_tripod(const struct site_station *station, char *text, size_t len);

/* Sets the poses of all movers at scan_s, a time of the scan from that station; at a stop movers stand still, so at the
 * time of the stop. */
void site_move(const struct site *site, uint32_t station, double scan_s, struct cast_setup *setup);

/* Whether a direction, socs, lies within what the head of a station scans with the settings at power-up. Heads that
 * turn without a pan count with their whole field of view, as do spheres and lists. */
int site_scans(const struct site *site, uint32_t station, const double dir_socs[3]);

/* Fills in what casters need to scan from a station (0..n_stations-1), at the configured pulse rate. */
void site_cast_setup(const struct site *site, uint32_t station, struct cast_setup *setup);
/* Sets the members that depend on the pulse rate: reach, smallest range, echoes, detection. Allocates nothing. */
void site_set_program(const struct site *site, int64_t prr_uhz, struct cast_setup *setup);

#endif
