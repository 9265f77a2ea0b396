/* SPDX-License-Identifier: MIT */
/* Private to this folder: the steps of loading a site, each in the file that is named above it. take_steps in load.c
 * has them in their order. Each uses only what earlier steps have filled in. A step returns an error of core/err.h;
 * report gets its warnings. */
#ifndef FIRMWARE_SIM_SITE_STEPS_H
#define FIRMWARE_SIM_SITE_STEPS_H

#include "core/err.h"
#include "firmware_sim/site/site.h"

/* ---- warnings.c: keeps the warnings given, so that a site beside this one only gives new ones */
struct site_listener {
    struct sh_report report; /* pass this one to the steps of loading */
    struct site_warnings *given;
    const struct site_warnings *before;
};
/* Warnings go into `given`, and to `to` unless they are in `before` (NULL: it has none). */
void site_listen(struct site_listener *listener, const struct sh_report *to, struct site_warnings *given,
                 const struct site_warnings *before);
void site_free_warnings(struct site_warnings *given);

/* ---- world.c: the meshes and their BVHs, which sites share (struct site_world) */
/* Joins the world of `other` (NULL: none) where its scene is the same; else makes a new, empty one. */
int site_enter_world(struct site *site, const struct site *other, struct sh_err *err);
/* Leaves the world; the last site frees it. */
void site_leave_world(struct site *site);
/* Returns the radius of a sphere around a mesh, a little more than that of its box; sets the sphere's centre. */
double site_enclose(const struct scene *mesh, double centre_m[3]);
/* Returns the largest error of vertices, of the scene and of movers. */
double site_mesh_error_m(const struct site *site);

/* ---- anchor_geotiff.c: the scene's frame from its GeoTIFF meshes (scene.anchor.source geotiff) */
/* With a raster in UTM and an offset_m of [0, 0, scene.anchor.height_m] the scene has the coordinates of that grid,
 * without error. Else the scene is tangent to the Earth at the raster's middle. A warning says how far its corners are
 * from their place, from 1 cm on. SH_EINPUT: no such mesh, several systems, or none that PROJ knows. */
int anchor_by_geotiff(const struct config *cfg, const struct sh_report *report, struct geoframe *frame,
                      struct sh_err *err);

/* ---- copies.c: the places of the copies of a mesh, from the configuration or from a CSV file */
/* The caller frees places->place in any case; NULL: the mesh has no copies. */
int site_read_copies(const struct config *cfg, uint32_t number, const struct sh_report *report,
                     struct scene_places *places, struct sh_err *err);

/* ---- target.c: the objects that are scanned (scene.target); the others are left out, or give no echo */
/* Called after the meshes are loaded, when each mesh has labels of its own. Leaves out objects that are no target, or
 * notes which objects are targets. SH_EINPUT where a pattern fits nothing, or nothing is left. */
int site_select_target(struct site *site, struct sh_err *err);
/* Notes which labels give no echo. Called after the labels of ghosts are known. */
int site_set_up_silent(struct site *site, struct sh_err *err);

/* ---- tripod.c: the tripods under stations' heads */
/* Makes labels for legs, if there are any. Called after the scene and its movers are loaded. */
int site_name_legs(struct site *site, struct sh_err *err);
/* Called after stations are placed and the scene has its BVHs. Finds each tripod's opening and the directions that it
 * hides, and makes its legs where they are in view. Warns of tripods that hover, and of those without a ground. */
int site_set_up_tripods(struct site *site, const struct sh_report *report, struct sh_err *err);

/* ---- detection.c: from a hit to a point: signal, surfaces, instrument, noise */
/* Called after the scene and its movers are loaded. With mirrors, site->n_surfaces grows by the labels of ghosts. Warns
 * of entries of `surfaces` for which no surface remains, of textures that are not used, and of surfaces without a
 * reflectance of their own. */
int site_set_up_detect(struct site *site, const struct sh_report *report, struct sh_err *err);
void site_free_detect(struct site *site);
/* Makes the parts of detection again that depend on ranges and noise. site is a copy of one that is set up, with
 * another cfg. The original still owns the memory that the copy's pointers point to. */
int site_vary_detect(struct site *site, struct sh_err *err);
/* Sets the number of surfaces of glass or mirrors that pulses are followed through. */
void site_set_depth(struct site *site, uint32_t depth);
/* site_noise_m returns how far noise may take a point, whether noise is on or not; site_ball_m, the part of it that is
 * ball noise; site_range_noise_m, ten sigma of the range noise, or 0 while that is off. */
double site_noise_m(const struct site *site);
double site_ball_m(const struct site *site);
double site_range_noise_m(const struct site *site);

/* ---- platform.c: a head that moves while it scans, or that scans where its platform stops (platform.kind: stops) */
/* Replaces the stations, once they are placed, by the stops. Without a trajectory there is a stop for each station and
 * each time: first all stations at the first time, then all stations at the second time. Along a trajectory there is
 * one station, and the head stops on the way. If the scene has no anchor and that station has a place on the Earth, the
 * station counts as an anchor at its position, with the scene's y axis to true north. */
int site_load_stops(struct site *site, const struct sh_report *report, struct sh_err *err);
/* Reads the trajectory, and cuts the path into stretches. */
int site_load_platform(struct site *site, const struct sh_report *report, struct sh_err *err);

/* ---- colours.c: the quantity that colours of points show, and its limits */
int site_set_up_colours(struct site *site, const struct sh_report *report, struct sh_err *err);

/* ---- plausibility.c: values that are allowed, but hardly meant */
/* Called after the scene has its BVHs. Warns, with figures, of a scene of an unlikely size, of a step of a sphere that
 * is rounded, of stations that see nothing or little, of lines without a pulse, of fields that nothing evaluates, of
 * transparent surfaces without a rule, and of attributes and colours that nothing fills. */
int site_check_plausibility(const struct site *site, const struct sh_report *report, struct sh_err *err);

/* ---- georeference.c: heights, CRS, method, and how many metres a count is on the wire */
/* Stations are placed before, and the path of a moving head is known. This fills the stations' georef, on_stretch, plan
 * and scale, and site->scale_m. It warns where a tolerance is not met. */
int site_georeference(struct site *site, const struct sh_report *report, struct sh_err *err);
/* The same for one station without a georeference, and for the scale, which depends on all stations. No warnings. */
int site_georeference_one(struct site *site, uint32_t station, struct sh_err *err);
void site_free_georeference(struct site *site, uint32_t station);

/* ---- beam_choice.c: the beam of a pulse, and how far pulses are followed through glass and mirrors */
/* The site is complete before this step, except for visibility maps. The step sets beam, rings and depth of
 * site->plan.methods and the rows of beam and optics, and makes the stations' beams. Where the configuration
 * leaves beam or optics open, methods are measured on the scene. For `plan` (site->measures) the error of a method that
 * the configuration forces is measured, too. Warns where no method holds the tolerances. */
int site_choose_methods(struct site *site, const struct sh_report *report, struct sh_err *err);
/* Frees a station's beam, and its outlines. */
void site_free_beam(struct site_station *station);

/* ---- sights.c: the visibility maps of stations */
/* Called after beam and optics are chosen. Sets site->plan.methods.sight and the row. */
int site_plan_sight(struct site *site, const struct sh_report *report, struct sh_err *err);
/* Takes over another site's maps for stations that have the same position, attitude and BVH there. Then
 * site_open_sights makes the others. */
void site_share_sights(struct site *site, const struct site *from);

#endif
