/* SPDX-License-Identifier: MIT */
#include "firmware_sim/site/steps.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/angle.h"
#include "core/light.h"
#include "core/rng.h"
#include "firmware_sim/config/config.h"

static const char GHOST[] = "ghost of ";

static uint32_t n_programs(const struct site *site)
{
    return site->cfg->profile.n_programs > 0 ? site->cfg->profile.n_programs : 1;
}

/* Prepares a signal for each program, so that a change of program in a scan has nothing to prepare. */
static int set_up_signals(struct site *site, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    const struct config_profile *p = &cfg->profile;
    struct detect_signal_spec spec;
    struct sh_err why;
    double wavelength_m = 1e-9 * p->wavelength_nm, day = detect_extinction_1_m(p->visibility_m, wavelength_m);
    for (uint32_t i = 0; i < n_programs(site); i++) {
        config_signal_spec(p, &p->program[i], &spec);
        spec.sharp = cfg->signal.sharp;
        spec.seed = cfg->noise.seed;
        if (cfg->signal.has_extinction)
            spec.extinction_1_m = 1e-3 * cfg->signal.extinction_1_km - day;
        else if (cfg->signal.visibility_m > 0.0)
            spec.extinction_1_m = detect_extinction_1_m(cfg->signal.visibility_m, wavelength_m) - day;
        if (detect_signal_set_up(&spec, &site->detect.signal[i], &why) != SH_OK)
            return sh_fail(err, SH_EINPUT, "%s: %.300s", cfg->profile_file, why.text);
    }
    return SH_OK;
}

static void set_up_encoder(struct instrument_encoder *e, double index_deg, double scale_ppm, double eccentricity_deg,
                           double phase_deg)
{
    *e = (struct instrument_encoder){angle_rad(index_deg), 1e-6 * scale_ppm, angle_rad(eccentricity_deg),
                                     angle_rad(phase_deg)};
}

static void set_up_instrument(const struct config *cfg, struct instrument *out)
{
    const struct config_instrument *k = &cfg->instrument;
    *out = (struct instrument){.collimation_rad = angle_rad(k->collimation_deg),
                               .trunnion_rad = angle_rad(k->trunnion_deg),
                               .transit_offset_m = k->transit_offset_m,
                               .mirror_offset_m = k->mirror_offset_m,
                               .range_offset_m = k->range_offset_m,
                               .range_scale = 1e-6 * k->range_scale_ppm,
                               .mirror_key = rng_key(cfg->noise.seed, RNG_MIRROR),
                               .pan_key = rng_key(cfg->noise.seed, RNG_PAN)};
    set_up_encoder(&out->mirror, k->mirror_index_deg, k->mirror_scale_ppm, k->mirror_eccentricity_deg,
                   k->mirror_phase_deg);
    set_up_encoder(&out->pan, k->pan_index_deg, k->pan_scale_ppm, k->pan_eccentricity_deg, k->pan_phase_deg);
    if (!cfg->noise.angle) return;
    out->mirror_sigma_rad = angle_rad(cfg->profile.mirror_sigma_deg);
    out->pan_sigma_rad = angle_rad(cfg->profile.pan_sigma_deg);
}

/* Adds the textures and vertex colours of surfaces whose reflectance no entry of `surfaces` gives. Warns of textures
 * that can't be read. */
static int set_up_textures(struct site *site, const uint8_t *is_given, const struct sh_report *report,
                           struct sh_err *err)
{
    struct sh_err why, first = {0};
    uint32_t failed = 0;
    int rc = SH_OK;
    for (uint32_t i = 0; i < site->n_surfaces && rc == SH_OK; i++) {
        const struct scene_texture *texture = is_given[i] ? NULL : site_texture(site, i);
        if (!is_given[i] && site_surface(site, i)->vertex_colours != SCENE_COLOURS_NONE)
            rc = surface_table_by_vertex(&site->detect.surfaces, i, &why);
        if (rc != SH_OK) break;
        if (texture == NULL || texture->unreadable) continue;
        rc = sh_check_stop(report, &why);
        if (rc == SH_OK) rc = surface_table_texture(&site->detect.surfaces, i, site_surface(site, i), texture, &why);
        if (rc != SH_EINPUT) continue;
        if (failed++ == 0) first = why;
        rc = SH_OK;
    }
    if (rc != SH_OK) return sh_fail(err, rc, "%s", why.text);
    if (failed > 0)
        sh_warn(
            report,
            "%s: %u surfaces have a texture that is not used: their colour is used, or signal.reflectance; the first: "
            "%s",
            site->cfg->file, failed, first.text);
    return rc;
}

static int lacks_colour(const struct scene_surface *s)
{
    return !s->has_colour && s->texture == 0 && s->vertex_colours != SCENE_COLOURS_ALL;
}

static int set_up_surfaces(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    uint32_t fits[CONFIG_MAX_SURFACES] = {0}, unknown = 0;
    uint8_t *is_given = calloc(site->n_surfaces, 1);
    int rc = surface_table_alloc(site->n_surfaces, &site->detect.surfaces, err);
    if (rc == SH_OK && is_given == NULL) rc = sh_fail(err, SH_ENOMEM, "no memory for %u surfaces", site->n_surfaces);
    for (uint32_t i = 0; i < site->n_surfaces && rc == SH_OK; i++) {
        int rule = surface_table_set(&site->detect.surfaces, i, site_surface(site, i), cfg->surface, cfg->n_surfaces,
                                     cfg->signal.reflectance);
        if (rule >= 0) fits[rule]++;
        int given = rule >= 0 && !isnan(cfg->surface[rule].surface.reflectance);
        is_given[i] = (uint8_t)given;
        unknown += !given && lacks_colour(site_surface(site, i));
    }
    if (rc == SH_OK && cfg->signal.on) rc = set_up_textures(site, is_given, report, err);
    free(is_given);
    if (rc == SH_OK && cfg->signal.on && unknown > 0)
        sh_warn(
            report,
            "%s: %u of %u surfaces have no reflectance, neither from the mesh's colour nor from surfaces: %g is used "
            "(signal.reflectance)",
            cfg->file, unknown, site->n_surfaces, cfg->signal.reflectance);
    for (uint32_t i = 0; i < cfg->n_surfaces && rc == SH_OK; i++)
        if (fits[i] == 0)
            sh_warn(report, "%s: surfaces[%u]: no surface of material \"%s\", object \"%s\" remains for this entry",
                    cfg->file, i, cfg->surface[i].material, cfg->surface[i].object);
    return rc;
}

/* Gives ghosts labels and names of their own. */
static int name_ghosts(struct site *site, struct sh_err *err)
{
    struct site_detect *d = &site->detect;
    uint32_t n = site->n_surfaces;
    if (2 * n > SCENE_MAX_SURFACES)
        return sh_fail(
            err, SH_EINPUT,
            "%s: surfaces: %u surfaces and a mirror: each needs a second label for its ghost points; allowed are up "
            "to %d surfaces",
            site->cfg->file, n, SCENE_MAX_SURFACES / 2);
    struct scene_surface *ghost = calloc(n, sizeof *ghost);
    if (ghost == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the names of ghosts");
    for (uint32_t i = 0; i < n; i++) {
        const struct scene_surface *of = site_surface(site, i);
        const size_t before = sizeof GHOST - 1;
        ghost[i] = *of;
        memcpy(ghost[i].object, GHOST, before);
        scene_copy_name(ghost[i].object + before, SCENE_NAME_LEN - before, of->object, strlen(of->object));
    }
    d->ghost = ghost; /* from here on site_surface finds them */
    d->n_real = n;
    site->n_surfaces = 2 * n;
    return SH_OK;
}

/* Whether a run, or `plan`, may cast footprints, so that room for them is needed. */
static int casts_footprints(const struct site *site)
{
    return site->cfg->beam.mode != BEAM_SINGLE || site->measures;
}

/* Sets the instrument with its errors and the noise of its angles, whether the noise of ranges follows the signal, and
 * the ball within which each point is moved (noise.ball). */
static void set_up_noise(const struct config *cfg, struct site_detect *d)
{
    set_up_instrument(cfg, &d->instrument);
    d->cast.instrument = instrument_is_ideal(&d->instrument) ? NULL : &d->instrument;
    d->cast.noise_by_signal = cfg->noise.range == RANGE_NOISE_SIGNAL;
    d->cast.ball = NULL;
    if (!(cfg->noise.ball.radius_m > 0.0)) return;
    d->ball = (struct detect_ball){.radius_m = cfg->noise.ball.radius_m,
                                   .per_distance_1_m = cfg->noise.ball.distance_1_m,
                                   .local = cfg->noise.ball.local};
    memcpy(d->ball.factor, cfg->noise.ball.factor, sizeof d->ball.factor);
    detect_ball_keys(&d->ball, cfg->noise.ball.seed);
    d->cast.ball = &d->ball;
}

int site_vary_detect(struct site *site, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct site_detect *d = &site->detect;
    const uint32_t in_use = config_program_of(&cfg->profile, cfg->head.settings.prr_uhz);
    int rc = cfg->signal.on ? set_up_signals(site, err) : SH_OK;
    d->cast.signal = cfg->signal.on ? &d->signal[in_use] : NULL;
    set_up_noise(cfg, d);
    site_set_depth(site, d->cast.depth);
    return rc;
}

int site_set_up_detect(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct site_detect *d = &site->detect;
    int rc = SH_OK;
    d->cast = (struct cast_detect){.max_echoes = cfg->profile.max_echoes,
                                   .separation_m = 0.5 * LIGHT_SPEED_M_S * 1e-9 * cfg->profile.pulse_width_ns,
                                   .ambiguity = cfg->head.ambiguity,
                                   .zones = cfg->head.mta_zones};
    if (cfg->signal.on || cfg->n_surfaces > 0) rc = set_up_surfaces(site, report, err);
    if (rc != SH_OK) return rc;
    d->cast.depth = d->surfaces.has_optics ? cfg->optics.depth : 0;
    d->cast.surfaces = cfg->signal.on || d->cast.depth > 0 ? &d->surfaces : NULL;
    d->cast.ghost_label = site->n_surfaces;
    if (d->cast.surfaces != NULL && casts_footprints(site)) {
        d->kind = calloc(d->surfaces.n + 1, sizeof *d->kind);
        rc = d->kind == NULL ? sh_fail(err, SH_ENOMEM, "no memory for kinds of surfaces")
                             : surface_kinds(&d->surfaces, d->kind, err);
    }
    if (rc == SH_OK && d->cast.depth > 0 && d->surfaces.has_mirror) rc = name_ghosts(site, err);
    return rc == SH_OK ? site_vary_detect(site, err) : rc;
}

void site_set_depth(struct site *site, uint32_t depth)
{
    struct site_detect *d = &site->detect;
    d->cast.depth = depth;
    d->on = d->cast.signal != NULL || d->cast.depth > 0 || d->cast.instrument != NULL || d->cast.ball != NULL ||
            d->cast.ambiguity != DETECT_AMBIGUITY_NONE;
    for (uint32_t i = 0; i < n_programs(site); i++) {
        d->program[i] = d->cast;
        if (d->cast.signal != NULL) d->program[i].signal = &d->signal[i];
    }
}

void site_free_detect(struct site *site)
{
    surface_table_free(&site->detect.surfaces);
    free(site->detect.ghost);
    free(site->detect.kind);
}

double site_ball_m(const struct site *site)
{
    const double *f = site->cfg->noise.ball.factor;
    return site->cfg->noise.ball.radius_m *
           (1.0 + site->cfg->noise.ball.distance_1_m * site->cfg->profile.range_max_m) * fmax(f[0], fmax(f[1], f[2]));
}

static double ten_sigma_m(const struct site *site)
{
    const struct config_profile *p = &site->cfg->profile;
    double sigma_m = p->range_sigma_m + 1e-6 * p->range_sigma_ppm * p->range_max_m;
    double jitter2 = 0.0; /* range variance at the threshold; the largest of all programs */
    for (uint32_t i = 0; i < n_programs(site); i++)
        jitter2 = fmax(jitter2, site->detect.signal[i].jitter2);
    if (site->cfg->noise.range == RANGE_NOISE_SIGNAL) sigma_m += sqrt(jitter2);
    return 10.0 * sigma_m;
}

double site_range_noise_m(const struct site *site)
{
    return site->cfg->noise.range == RANGE_NOISE_OFF ? 0.0 : ten_sigma_m(site);
}

double site_noise_m(const struct site *site)
{
    return ten_sigma_m(site) + site_ball_m(site);
}
