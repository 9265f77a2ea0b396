/* SPDX-License-Identifier: MIT */
/* Scans and commands ask these functions about a loaded site. Nothing here changes the site. */
#include "firmware_sim/site/site.h"

#include <math.h>
#include <string.h>

#include "core/angle.h"
#include "core/locate.h"
#include "core/rng.h"
#include "core/vec3.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/profile.h"
#include "firmware_sim/site/waves.h"

void site_fill_spec(const struct site *site, const struct head_settings *settings, struct schedule_spec *spec)
{
    config_fill_spec(&site->cfg->profile, settings, spec);
    if (spec->emitter != NULL) spec->emitter = &site->emitter;
}

const char *site_file(const struct site *site)
{
    return site->cfg->file;
}

const struct config_profile *site_profile(const struct site *site)
{
    return &site->cfg->profile;
}

const struct head_settings *site_settings(const struct site *site)
{
    return &site->cfg->head.settings;
}

int site_serves(const struct site *site, uint32_t i)
{
    return config_serves(site->cfg, i);
}

uint32_t site_n_served(const struct site *site)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < site->n_stations; i++)
        n += site_serves(site, i) != 0;
    return n;
}

/* Noise and long pulses make echoes of their own. So samples may hold more echoes than the pulse has returns. */
uint32_t site_points_per_pulse(const struct site *site)
{
    const struct plan_methods *methods = &site->plan.methods;
    const int finds = site->waves != NULL && site->waves->cast.finds;
    uint32_t most = methods->beam != BEAM_SINGLE || finds ? LINE_MAX_ECHOES : 1 + methods->depth;
    return most < site->cfg->profile.max_echoes ? most : site->cfg->profile.max_echoes;
}

uint32_t site_most_points_per_pulse(const struct site *site)
{
    const struct config *cfg = site->cfg;
    uint32_t most = site_points_per_pulse(site);
    if (site_why_fixed(site) != NULL) return most;
    if (site->detect.surfaces.has_optics && !cfg->optics.depth_given && most < 1 + CAST_MAX_DEPTH)
        most = 1 + CAST_MAX_DEPTH;
    if (config_has_footprint(cfg) && cfg->beam.mode == BEAM_AUTO) most = LINE_MAX_ECHOES;
    return most < cfg->profile.max_echoes ? most : cfg->profile.max_echoes;
}

/* Returns the mesh that a label of a real surface belongs to. *label becomes the surface's number there. */
static const struct scene *find_mesh(const struct site *site, uint32_t *label)
{
    const struct scene *scene = site->scene;
    for (uint32_t i = 0; *label >= scene->n_surfaces; i++) {
        *label -= scene->n_surfaces;
        scene = site->mover[i].scene;
    }
    return scene;
}

const struct scene_surface *site_surface(const struct site *site, uint32_t label)
{
    if (site->detect.ghost != NULL && label >= site->detect.n_real)
        return &site->detect.ghost[label - site->detect.n_real];
    if (site->legs != NULL && label == site->legs_label) return site->legs;
    const struct scene *scene = find_mesh(site, &label);
    return &scene->surface[label];
}

const struct scene_texture *site_texture(const struct site *site, uint32_t label)
{
    if (site->legs != NULL && label == site->legs_label) return NULL;
    const struct scene *scene = find_mesh(site, &label);
    uint32_t number = scene->surface[label].texture;
    return number != 0 ? &scene->texture[number - 1] : NULL;
}

void site_move(const struct site *site, uint32_t station, double scan_s, struct cast_setup *setup)
{
    const double t_s = site->stop != NULL ? site->station[station].t_s : scan_s;
    setup->n_movers = site->n_movers;
    for (uint32_t k = 0; k < site->n_movers; k++) {
        const struct site_mover *m = &site->mover[k];
        struct cast_mover *out = &setup->mover[k];
        const struct config_mesh *mesh = &site->cfg->scene.mesh[m->number];
        double t = t_s;
        if (mesh->cycle_s > 0.0) { /* back and forth */
            t = fmod(t_s, mesh->cycle_s);
            if (t > 0.5 * mesh->cycle_s) t = mesh->cycle_s - t;
        }
        pose_heading(angle_rad(fmod(mesh->turn_deg_s * t, 360.0)), out->rotation);
        out->bvh = m->bvh;
        out->radius_m = m->radius_m;
        memcpy(out->centre_m, m->centre_m, sizeof out->centre_m);
        for (int i = 0; i < 3; i++) {
            const double *row = out->rotation + 3 * i;
            out->shift_m[i] = mesh->pivot_m[i] - vec3_dot(row, mesh->pivot_m) + mesh->move_m_s[i] * t;
        }
    }
}

void site_grid(const struct site *site, int *zone, int *side)
{
    const struct geoframe *frame = &site->anchor.frame;
    const struct site_station *first = &site->station[0];
    struct locate_grid utm;
    *zone = site->cfg->output.utm_zone;
    *side = 0;
    if (first->station->place == PLACE_UTM) *side = first->station->north ? 1 : -1;
    if (!site->anchor.known) return;
    int tangent = frame->kind == GEOFRAME_TANGENT;
    if (frame->kind == GEOFRAME_GRID) {
        if (*zone == 0) *zone = frame->zone == 0 ? GEOREF_UPS : frame->zone;
        *side = frame->north ? 1 : -1;
        return;
    }
    const struct georef_place at = {tangent ? frame->lat_deg : first->at.place.lat_deg,
                                    tangent ? frame->lon_deg : first->at.place.lon_deg, 0.0};
    if (locate_in_grid(&at, *zone, &utm, NULL) != SH_OK) return;
    *zone = utm.zone == 0 ? GEOREF_UPS : utm.zone;
    if (*side == 0) *side = utm.north ? 1 : -1;
}

const struct georef *site_georef(const struct site *site, uint32_t station, size_t stretch, const double **centre_m,
                                 const double **scale)
{
    const struct site_station *s = &site->station[station];
    const struct site_on_stretch *on = s->on_stretch != NULL ? &s->on_stretch[stretch] : NULL;
    *centre_m = on != NULL ? site->stretch[stretch].centre_m : s->at.position_m;
    *scale = on != NULL ? on->scale : s->scale;
    return on != NULL ? on->georef : s->georef;
}

static double counts_or_ideal(double counts)
{
    return counts > 0.0 ? counts : 4294967296.0;
}

void site_set_program(const struct site *site, int64_t prr_uhz, struct cast_setup *setup)
{
    const struct config_profile *profile = &site->cfg->profile;
    const uint32_t i = config_program_of(profile, prr_uhz);
    setup->range_min_m = profile->program[i].range_min_m;
    setup->range_max_m = profile->program[i].range_max_m;
    setup->max_echoes = profile->program[i].max_echoes;
    setup->detect = site->detect.on ? &site->detect.program[i] : NULL;
}

void site_cast_setup(const struct site *site, uint32_t station, struct cast_setup *setup)
{
    const struct config_profile *profile = &site->cfg->profile;
    const struct site_station *s = &site->station[station];
    memset(setup, 0, sizeof *setup);
    setup->bvh = site->bvh;
    setup->sight = s->sight;
    setup->silent = site->silent;
    setup->georef = s->georef;
    memcpy(setup->station_m, s->at.position_m, sizeof setup->station_m);
    memcpy(setup->rotation, s->at.rotation, sizeof setup->rotation);
    setup->noise_on = site->cfg->noise.range == RANGE_NOISE_ON;
    setup->range_sigma_m = profile->range_sigma_m;
    setup->range_sigma_ppm = profile->range_sigma_ppm;
    setup->noise_key = rng_key(site->cfg->noise.seed, RNG_RANGE);
    setup->mirror_counts = counts_or_ideal(profile->mirror_counts);
    setup->pan_counts = counts_or_ideal(profile->pan_counts);
    site_set_program(site, site->cfg->head.settings.prr_uhz, setup);
    setup->layout = site->cfg->output.layout;
    setup->tripod = s->tripod.from != NULL ? &s->tripod.cast : NULL;
    setup->beam = s->beam;
    setup->echoes = (enum beam_select)site->cfg->head.settings.echoes;
    setup->pulse_m = site->detect.cast.separation_m;
    setup->range_scale_m = site->scale_m;
    memcpy(setup->xyz_scale, s->scale, sizeof setup->xyz_scale);
    setup->waves = site->waves != NULL ? &site->waves->cast : NULL;
    setup->colour = site->cfg->output.colour != COLOUR_NONE ? &s->colour : NULL;
}

size_t site_stretch_at(const struct site *site, int64_t t_ns)
{
    size_t i = 0;
    while (i + 1 < site->n_stretches && t_ns >= site->stretch[i].until_ns)
        i++;
    return i;
}

void site_enter(const struct site *site, uint32_t station, size_t stretch, struct cast_setup *setup)
{
    const double *centre_m, *scale;
    setup->georef = site_georef(site, station, stretch, &centre_m, &scale);
    memcpy(setup->station_m, centre_m, sizeof setup->station_m);
    memcpy(setup->xyz_scale, scale, sizeof setup->xyz_scale);
}
