/* SPDX-License-Identifier: MIT */
/* Private to this folder: the steps of loading a site (load.c), and types that they share. */
#ifndef FIRMWARE_SIM_SITE_SITE_INSIDE_H
#define FIRMWARE_SIM_SITE_SITE_INSIDE_H

#include "firmware_sim/site/site.h"

/* ---- load.c */
enum site_purpose {
    SITE_FOR_SCANS,
    SITE_FOR_PLAN, /* site_load_plan */
    SITE_MOVED,    /* site_load_moved */
    SITE_WRITTEN_OUT,
};
int site_create(const struct config *cfg, enum site_purpose purpose, const struct site *other,
                const struct sh_report *report, struct site **out, struct sh_err *err);

/* ---- said.c: warnings given while loading. */
struct site_listener {
    struct sh_report report; /* pass this one to the steps of loading */
    const struct sh_report *to;
    struct site_said *said;
    const struct site_said *before;
};
/* Warnings go into `said`, and to `to` unless they are in `before` (NULL: it has none). */
void site_listen(struct site_listener *listener, const struct sh_report *to, struct site_said *said,
                 const struct site_said *before);
void site_free_said(struct site_said *said);

/* ---- colours.c: the quantity that colours show. After the scene, detection, the stations and a head's path. Warns of
 * textures that can't be read. */
int site_set_up_colours(struct site *site, const struct sh_report *report, struct sh_err *err);

/* ---- detection.c: the steps of scans from a hit to a point (signal, surfaces, instrument, noise),
 * made once from the configuration and the loaded scene. */

/* After the scene and its movers are loaded. With mirrors, site->n_surfaces grows by the labels of
 * ghosts. Warns of entries of `surfaces` that fit no surface. */
int site_set_up_detect(struct site *site, const struct sh_report *report, struct sh_err *err);
void site_free_detect(struct site *site);
/* Makes the parts of detection again that depend on ranges and noise. site is a copy of one that is set up, with
 * another cfg; what it points to stays that of the original. */
int site_vary_detect(struct site *site, struct sh_err *err);

/* Sets the number of surfaces of glass or mirrors that pulses are followed through. */
void site_set_depth(struct site *site, uint32_t depth);

/* site_noise_m: how far noise may take a point, whether it is on or not. The others: its part that is ball noise; ten
 * sigma of the range noise. */
double site_noise_m(const struct site *site);
double site_ball_m(const struct site *site);
double site_range_noise_m(const struct site *site);

/* ---- platform.c: a head that moves while it scans, or that scans where its platform stops (platform.kind: stops).
 * In: the configured trajectory and times. Out: its poses (scene frame, metres), or a
 * station for each stop, placed in the scene. */

/* Replaces the configuration's only station by the stops. After that station is placed: without an
 * anchor it gives the scene's place on the Earth, as an anchor at its position with the scene's y axis to
 * true north would. */
int site_load_stops(struct site *site, const struct sh_report *report, struct sh_err *err);

/* Reads the trajectory, and cuts the path into stretches. */
int site_load_platform(struct site *site, const struct sh_report *report, struct sh_err *err);

/* ---- world.c: the world that sites share. */

/* Joins the world of `other` (NULL: none) where its scene is the same; else makes a new, empty one. */
int site_enter_world(struct site *site, const struct site *other, struct sh_err *err);
/* Leaves the world; the last site frees it. */
void site_leave_world(struct site *site);

/* ---- target.c: scene.target. */

/* Reads where the copies of a mesh stand. The caller frees places->place in any case; NULL: the mesh has no copies. */
int site_read_copies(const struct config *cfg, uint32_t number, const struct sh_report *report,
                     struct scene_places *places, struct sh_err *err);

/* The meshes are loaded, each with labels of its own: leaves out what is no target, or notes it. SH_EINPUT where a pattern fits nothing, or nothing is
 * left. */
int site_select_target(struct site *site, struct sh_err *err);
/* Notes which labels give no echo. After the labels of ghosts are known. */
int site_set_up_silent(struct site *site, struct sh_err *err);

/* ---- bvhs.c: a BVH of what stands still, and one of each body that moves. */
int site_build_bvhs(struct site *site, const struct sh_report *report, struct sh_err *err);

/* ---- tripod.c: the tripods under stations' heads. In: the placed stations and their BVHs. Out: each tripod's opening,
 * the directions that it hides, and its legs where they are in view. */

/* Makes labels for legs, if there are any. After the scene and its movers are loaded. */
int site_name_legs(struct site *site, struct sh_err *err);
/* Warns of tripods that hover, and of those without a ground. */
int site_set_up_tripods(struct site *site, const struct sh_report *report, struct sh_err *err);
void site_free_tripod(struct site_tripod *tripod);

/* ---- georeference.c: georeferencing of a site's stations: heights, CRS, method, and how many metres a
 * count is on the wire. */

/* After stations are placed and the path of a moving head is known. Fills the stations' georef, plan, scale and leg,
 * and site->scale_m. Warns where a tolerance is not met. */
int site_georeference(struct site *site, const struct sh_report *report, struct sh_err *err);
/* The same for one station without a georeference, and for the scale, which depends on all stations. No warnings. */
int site_georeference_one(struct site *site, uint32_t station, struct sh_err *err);
void site_free_georeference(struct site *site, uint32_t station);

/* ---- look.c: the places that pulses are fired from, with setups like the run's. For trying methods on the head's own
 * pulses (core/plan draws them), and for measuring what methods cost. */

enum { SITE_LOOK_STATIONS = 4 }; /* most stations of a look */

struct site_look {
    struct plan_place place[SITE_LOOK_STATIONS];
    struct site_look_at {
        const struct site *site;
        uint32_t station;
    } at[SITE_LOOK_STATIONS];
    uint32_t n;
};

/* Opens a look from up to SITE_LOOK_STATIONS stations, evenly chosen, with the beams that they have by then. It
 * must not be moved or copied: its places point into it. */
void site_look_open(struct site_look *look, const struct site *site);

/* ---- beam_choice.c: the beam of a pulse, and how far pulses are followed through glass and mirrors:
 * measured on the scene where the configuration leaves them open. */

/* After all else of the site. Sets beam, rings and depth of site->plan.methods and the rows of beam and
 * optics, and makes the stations' beams. Warns where no method holds the tolerances. For `plan`
 * (site->measures) the error of forced methods is measured, too. */
int site_choose_methods(struct site *site, const struct sh_report *report, struct sh_err *err);

/* ---- view.c: the directions that a station's rays may go to. */

enum { SITE_VIEW_BANDS = EMITTER_MAX_BEAMS };
struct site_view {
    double rotation[9]; /* socs -> prcs */
    double margin_rad;  /* how far beyond the bands rays may go */
    uint32_t n;
    struct site_band {
        double low_rad, high_rad;           /* elevation, socs */
        double azimuth_rad, azimuth_to_rad; /* middle, and how far to both sides; pi: all around */
    } band[SITE_VIEW_BANDS];
};

/* For the settings at power-up. */
void site_view_of(const struct site *site, uint32_t station, struct site_view *view);
/* The function for sight_spec's `sees`; ctx: the view. */
int site_view_sees(const void *ctx, const double dir[3], double radius_rad);
/* The share of all directions that are within radius_rad of the view. */
double site_view_share(const struct site_view *view, double radius_rad);

/* ---- sights.c: visibility maps of the stations: decides whether to make them, and makes them. */

/* After beam and optics are chosen. Sets site->plan.methods.sight and the row. */
int site_plan_sight(struct site *site, const struct sh_report *report, struct sh_err *err);
void site_close_sights(struct site *site);
/* Takes over the maps of another site's stations that stand as they did. Then site_open_sights makes the others. */
void site_share_sights(struct site *site, const struct site *from);

/* ---- doubts.c: plausibility checks: values that are allowed, but hardly meant. After the scene has its BVHs. */

/* Warns, with figures, of a scene of an unlikely size, of stations that see nothing or little, of lines
 * without a pulse, and of attributes that nothing fills. */
int site_warn_doubts(const struct site *site, const struct sh_report *report, struct sh_err *err);

#endif
