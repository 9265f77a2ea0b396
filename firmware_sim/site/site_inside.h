/* SPDX-License-Identifier: MIT */
/* Private to this folder: the steps of loading a site (load.c), and what they share. */
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

/* ---- said.c: warnings of loading. */
struct site_listener {
    struct sh_report report; /* to be handed on */
    const struct sh_report *to;
    struct site_said *said;
    const struct site_said *before;
};
/* What is warned of goes into `said`, and to `to` unless it is in `before` (NULL: nothing is). */
void site_listen(struct site_listener *listener, const struct sh_report *to, struct site_said *said,
                 const struct site_said *before);
void site_free_said(struct site_said *said);

/* ---- colours.c: what colours show. The scene, detection, the stations and a head's path are there. Warns of textures
 * that can't be read. */
int site_set_up_colours(struct site *site, const struct sh_report *report, struct sh_err *err);

/* ---- detection.c: what a site's scans do between a hit and a point (signal, surfaces, instrument, noise),
 * made once from the configuration and the loaded scene. */

/* The scene and its movers are loaded. Where there are mirrors, site->n_surfaces grows by the labels of
 * ghosts. Warns of entries of `surfaces` that no surface fits. */
int site_set_up_detect(struct site *site, const struct sh_report *report, struct sh_err *err);
void site_free_detect(struct site *site);
/* site is a copy of one that is set up, with another cfg: what of detection depends on ranges and noise, made again. What
 * it points to stays that of the other. */
int site_vary_detect(struct site *site, struct sh_err *err);

/* How many surfaces of glass or mirrors pulses are followed through, once that is known. */
void site_set_depth(struct site *site, uint32_t depth);

/* How far noise may take a point, whether it is on or not; of that, the ball; a range, ten sigma of its noise. */
double site_noise_m(const struct site *site);
double site_ball_m(const struct site *site);
double site_range_noise_m(const struct site *site);

/* ---- platform.c: a head that moves while it scans, or that scans where its platform stops (platform.kind: stops).
 * In: the configured trajectory and times. Out: its poses (scene frame, metres), or a
 * station for each stop, placed in the scene. */

/* Puts the stops in the place of the configuration's only station. That one has been placed: without an
 * anchor it says where on the Earth the scene lies, as an anchor at its position with the scene's y axis to
 * true north would. */
int site_load_stops(struct site *site, const struct sh_report *report, struct sh_err *err);

/* Reads the trajectory, and cuts the path into stretches. */
int site_load_platform(struct site *site, const struct sh_report *report, struct sh_err *err);

/* ---- world.c: what sites share. */

/* Joins the world of other (NULL: none) where its scene is the same, or gets a new, empty one. */
int site_enter_world(struct site *site, const struct site *other, struct sh_err *err);
/* Gives back what is used of it. */
void site_leave_world(struct site *site);

/* ---- target.c: scene.target. */

/* Where the copies of a mesh stand: places->place is to be freed in any case, and NULL where it has none. */
int site_read_copies(const struct config *cfg, uint32_t number, const struct sh_report *report,
                     struct scene_places *places, struct sh_err *err);

/* The meshes are loaded, each with labels of its own: leaves out what is no target, or notes it. SH_EINPUT where a pattern fits nothing, or nothing is
 * left. */
int site_select_target(struct site *site, struct sh_err *err);
/* Labels of ghosts are known: which give no echo. */
int site_set_up_silent(struct site *site, struct sh_err *err);

/* ---- bvhs.c: a BVH of what stands still, and one of each body that moves. */
int site_build_bvhs(struct site *site, const struct sh_report *report, struct sh_err *err);

/* ---- tripod.c: what stations' heads stand on. In: the placed stations and their BVHs. Out: each tripod's opening, what
 * it hides, and its legs where they are in view. */

/* The scene and its movers are loaded: labels for what is seen of legs, if there are any. */
int site_name_legs(struct site *site, struct sh_err *err);
/* Warns of tripods that hover, and of those without a ground. */
int site_set_up_tripods(struct site *site, const struct sh_report *report, struct sh_err *err);
void site_free_tripod(struct site_tripod *tripod);

/* ---- georeference.c: georeferencing of a site's stations: heights, CRS, method, and how many metres a
 * count is on the wire. */

/* Stations are placed, the path of a moving head is known. Fills the stations' georef, plan, scale and leg,
 * and site->scale_m. Warns where a tolerance is not met. */
int site_georeference(struct site *site, const struct sh_report *report, struct sh_err *err);
/* The same for one station, which has none, and for the scale, which all of them decide; without warnings. */
int site_georeference_one(struct site *site, uint32_t station, struct sh_err *err);
void site_free_georeference(struct site *site, uint32_t station);

/* ---- look.c: looking at the scene as the head does: the places that pulses are fired from, with setups as
 * the run's. For trying methods (core/plan draws the pulses), and for measuring what they cost. */

enum { SITE_LOOK_STATIONS = 4 }; /* at most so many stations are looked from */

struct site_look {
    struct plan_place place[SITE_LOOK_STATIONS];
    struct site_look_at {
        const struct site *site;
        uint32_t station;
    } at[SITE_LOOK_STATIONS];
    uint32_t n;
};

/* Looks from up to SITE_LOOK_STATIONS stations, evenly chosen, with the beams that they have by then. The
 * look must not be moved or copied: its places point into it. */
void site_look_open(struct site_look *look, const struct site *site);

/* ---- beam_choice.c: which beam a pulse is, and how far pulses are followed through glass and mirrors:
 * measured on the scene where the configuration leaves it open. */

/* All else of the site is in place. Sets beam, rings and depth of site->plan.methods and the rows of beam and
 * optics, and makes the stations' beams. Warns where nothing holds the tolerances. For `plan`
 * (site->measures) the error of what is forced is measured, too. */
int site_choose_methods(struct site *site, const struct sh_report *report, struct sh_err *err);

/* ---- view.c: the directions that a station's rays may go to. */

enum { SITE_VIEW_BANDS = EMITTER_MAX_BEAMS };
struct site_view {
    double rotation[9]; /* socs -> prcs */
    double margin_rad;  /* rays may go so far beyond the bands */
    uint32_t n;
    struct site_band {
        double low_rad, high_rad;           /* elevation, socs */
        double azimuth_rad, azimuth_to_rad; /* middle, and how far to both sides; pi: all around */
    } band[SITE_VIEW_BANDS];
};

/* For the settings at power-up. */
void site_view_of(const struct site *site, uint32_t station, struct site_view *view);
/* As sight_spec's sees; ctx: the view. */
int site_view_sees(const void *ctx, const double dir[3], double radius_rad);
/* Of all directions, the share within radius_rad of those that it sees. */
double site_view_share(const struct site_view *view, double radius_rad);

/* ---- sights.c: maps of what the stations see: whether one is made, and making it. */

/* Beam and optics are chosen. Sets site->plan.methods.sight and the row. */
int site_plan_sight(struct site *site, const struct sh_report *report, struct sh_err *err);
void site_close_sights(struct site *site);
/* Maps of another site's stations that stand as they did, before site_open_sights makes the others. */
void site_share_sights(struct site *site, const struct site *from);

/* ---- doubts.c: what is allowed, and hardly meant. Once the scene has its BVHs. */

/* Warns, with figures, of a scene of an unlikely size, of stations that see nothing or little, of lines
 * without a pulse, and of attributes that nothing fills. */
int site_warn_doubts(const struct site *site, const struct sh_report *report, struct sh_err *err);

#endif
