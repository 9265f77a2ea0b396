/* The site: what a configuration loads once and all scans share. In goes a checked configuration; out come
 * the scene, its BVHs, the stations' places (scene frame, metres) and georeferences, and the planned methods.
 * load.c makes it, site.c reads it. It is constant once loaded: any thread. */
#ifndef FIRMWARE_SIM_SITE_SITE_H
#define FIRMWARE_SIM_SITE_SITE_H

#include "core/cast.h"
#include "core/georef.h"
#include "core/plan.h"
#include "core/pose.h"
#include "core/scene.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/site/placement.h"

/* Points of the geo layout along one stretch of a head's path: about its centre. */
struct site_leg {
    struct georef *georef;
    double scale[3]; /* as below */
};

struct site_station {
    const struct config_station *station; /* of the configuration, or of stops */
    struct bvh *bvh;                      /* shared where stations are near each other */
    struct sight *_Atomic sight;          /* what it sees; NULL: rays go to the BVH (site_open_sights) */
    struct georef *georef;
    struct placement at;
    struct cast_beam *beam;         /* NULL: one ray per pulse */
    struct beam_outlines *outlines; /* an adaptive one's */
    double scale[3];                /* of geo points on the wire, units of the CRS per count */
    struct site_leg *leg;           /* one for each stretch of a trajectory, in the geo layout; else NULL */
    struct plan_row plan;           /* how the georef's method was chosen; of the worst leg */
    double t_s, frame; /* a stop: when it is, after the trajectory's first sample; frame scalar of the trajectory */
};

struct site_mover {
    const struct config_mesh *mesh;
    struct scene *scene;
    struct bvh *bvh;
    double centre_m[3], radius_m;
};

/* What scans do between a hit and a point (detection.c). */
struct site_detect {
    int on;                                     /* 0: nothing of it, and it costs nothing */
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

/* What was planned. Scans take their methods from here alone. */
struct site_plan {
    struct plan_methods methods;
    struct plan_row sight, order, beam, optics;
    double sight_rays;    /* of a map: what its cells follow (sight_spec) */
    struct plan_row *row; /* `plan`: all stages in their order, then the total; else NULL */
    size_t n;
};

/* A stretch of a moving head's path. Its BVH reaches all of it. */
struct site_stretch {
    int64_t until_ns; /* since the scan's start: whole milliseconds; INT64_MAX: the last one */
    struct bvh *bvh;
    double centre_m[3], reach_m; /* all of it lies so near to that */
};

struct site {
    const struct config *cfg;
    struct emitter emitter; /* the profile's, with its list of directions */
    struct emitter_firing *direction;
    struct scene *scene; /* what stands still */
    struct placement_anchor anchor;
    struct site_mover mover[CAST_MAX_MOVERS];
    uint32_t n_movers, n_surfaces; /* surfaces of the scene, then of the movers, then their ghosts */
    struct site_detect detect;
    struct site_plan plan;
    int measures; /* for `plan`: footprints are cast to find the error of a forced beam, even of single rays */
    struct bvh *bvh[CONFIG_MAX_STATIONS];
    uint32_t n_bvh;
    struct site_station *station;
    uint32_t n_stations;
    struct config_station *stop; /* the stations where the platform stops; NULL: the configuration's are */
    struct georef_geoid *geoid;  /* NULL: heights are ellipsoidal */
    /* A moving head; the stations then only say where on Earth the scene lies. */
    int moving;
    struct pose mount;            /* of the head on the platform */
    struct pose_knot *knot;       /* trajectory: the head's poses from the scan's start on */
    size_t n_knots;               /* 0: live */
    double knot_error_m;          /* largest distance of the head's path from the trajectory */
    struct site_stretch *stretch; /* in order of time */
    size_t n_stretches;
    double live_reach_m; /* of a live head from any station */
    double scale_m;      /* of positions and ranges on the wire, metres per count */
};

/* Stations further than this from a BVH's origin get a BVH of their own, and so do those further than the
 * scene's size: there a float has steps of 0.06 mm. */
#define SITE_BVH_REACH_M 1000.0

/* Room left beyond the head's largest range, for noise. */
#define SITE_MARGIN 1.01

/* cfg must outlive the site. */
int site_load(const struct config *cfg, const struct sh_report *report, struct site **out, struct sh_err *err);
/* The same for `plan`: site->plan.row is filled, with bounds also of what is forced. */
int site_load_plan(const struct config *cfg, const struct sh_report *report, struct site **out, struct sh_err *err);
void site_free(struct site *site);

/* A site holds the maps of so many stations at a time. Where there are more, a run has none, and a recording
 * that of the station at hand; whether a map is used then changes no hit. */
enum { SITE_MAX_SIGHTS = 16 };

/* Makes the maps of n stations from `first` on, where the plan says so, and gives back those of others. Before
 * their scans, and while none is on: casters take the map with the station's setup. */
int site_open_sights(struct site *site, uint32_t first, uint32_t n, const struct sh_report *report, struct sh_err *err);

/* The grid of output.crs utm, as georef_spec has it: one for all stations of an anchored scene, that of the
 * anchor or of the first station, unless output.utm_zone or the scene's own grid says it; else by position.
 * The hemisphere of the false northing is that in which the first station is given, if it is given in UTM. */
void site_grid(const struct site *site, int *zone, int *side);

/* The schedule of its head with some settings. */
void site_fill_spec(const struct site *site, const struct head_settings *settings, struct schedule_spec *spec);

/* Entries that a pulse may need in a block: its echoes, as far as the plan allows for more than one. */
uint32_t site_points_per_pulse(const struct site *site);

/* Names of a label below n_surfaces. */
const struct scene_surface *site_surface(const struct site *site, uint32_t label);
/* The texture of a real surface; NULL: none. */
const struct scene_texture *site_texture(const struct site *site, uint32_t label);

/* On which stretch a moving head is at a time of the scan; and what the casters need there, in a setup for
 * the station.
 */
size_t site_stretch_at(const struct site *site, int64_t t_ns);
void site_enter(const struct site *site, uint32_t station, size_t stretch, struct cast_setup *setup);

/* The georeference of a station's points on a stretch, what the anchor is in the scene, and its scale. The
 * stretch counts only along a trajectory. */
const struct georef *site_georef(const struct site *site, uint32_t station, size_t stretch, const double **centre_m,
                                 const double **scale);

/* Poses of all movers at a time of the scan; at a stop they stand as at the stop's own (site_mover_time). */
void site_move(const struct site *site, double t_s, struct cast_setup *setup);
double site_mover_time(const struct site *site, uint32_t station, double scan_s);

/* What the casters need to scan from a station (0..n_stations-1), at the configured pulse rate. */
void site_cast_setup(const struct site *site, uint32_t station, struct cast_setup *setup);
/* What of it depends on the pulse rate: reach, echoes, smallest range. Allocates nothing. */
void site_set_program(const struct site *site, int64_t prr_uhz, struct cast_setup *setup);

#endif
