#include "firmware_sim/site/beam_choice.h"
#include "firmware_sim/site/detection.h"
#include "firmware_sim/site/georeference.h"
#include "firmware_sim/site/plan_rows.h"
#include "firmware_sim/site/platform.h"
#include "firmware_sim/site/stops.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/light.h"
#include "core/locate.h"
#include "core/rng.h"

static int is_moving(const struct config_mesh *mesh)
{
    return mesh->turn_deg_s != 0.0 || mesh->move_m_s[0] != 0.0 || mesh->move_m_s[1] != 0.0 || mesh->move_m_s[2] != 0.0;
}

static struct scene_mesh_spec mesh_spec(const struct config *cfg, const struct config_mesh *mesh)
{
    struct scene_mesh_spec spec = {
        .file = mesh->file, .up = mesh->up, .scale = mesh->scale, .textures = cfg->signal.on};
    memcpy(spec.offset_m, mesh->offset_m, sizeof spec.offset_m);
    return spec;
}

/* A body by itself: its sphere, its BVH in its own frame, its labels behind those there are. */
static int add_mover(struct site *site, const struct config_mesh *mesh, const struct sh_report *report,
                     struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    if (site->n_movers == CAST_MAX_MOVERS)
        return sh_fail(err, SH_EINPUT, "%s: scene.meshes: too many that move; at most %d", cfg->file, CAST_MAX_MOVERS);
    struct site_mover *m = &site->mover[site->n_movers++];
    struct scene_mesh_spec spec = mesh_spec(cfg, mesh);
    double half2 = 0.0;
    m->mesh = mesh;
    int rc = scene_load(&spec, 1, cfg->scene.tolerance_m, report, &m->scene, err);
    if (rc != SH_OK) return rc;
    if (site->n_surfaces + m->scene->n_surfaces > SCENE_MAX_SURFACES)
        return sh_fail(err, SH_EINPUT, "%s: too many surfaces; at most %d", mesh->file, SCENE_MAX_SURFACES);
    for (uint32_t i = 0; i < m->scene->n_triangles; i++)
        m->scene->label[i] = (uint16_t)(m->scene->label[i] + site->n_surfaces);
    site->n_surfaces += m->scene->n_surfaces;
    for (int i = 0; i < 3; i++) {
        double half = 0.5 * (m->scene->max_m[i] - m->scene->min_m[i]);
        m->centre_m[i] = m->scene->min_m[i] + half;
        half2 += half * half;
    }
    m->radius_m = sqrt(half2) * (1.0 + 1e-9) + 1e-6;
    return site_build_bvh(site, m->scene, m->centre_m, cfg->profile.range_max_m, report, &m->bvh, err);
}

static int load_scene(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct scene_mesh_spec spec[CONFIG_MAX_MESHES];
    size_t n = 0;
    for (uint32_t i = 0; i < cfg->scene.n_meshes; i++)
        if (!is_moving(&cfg->scene.mesh[i])) spec[n++] = mesh_spec(cfg, &cfg->scene.mesh[i]);
    if (n == 0)
        return sh_fail(err, SH_EINPUT, "%s: scene.meshes: all of them move; at least one has to stand still",
                       cfg->file);
    int rc = scene_load(spec, n, cfg->scene.tolerance_m, report, &site->scene, err);
    if (rc == SH_OK) site->n_surfaces = site->scene->n_surfaces;
    for (uint32_t i = 0; i < cfg->scene.n_meshes && rc == SH_OK; i++)
        if (is_moving(&cfg->scene.mesh[i])) rc = add_mover(site, &cfg->scene.mesh[i], report, err);
    return rc;
}

uint32_t site_points_per_pulse(const struct site *site)
{
    const struct plan_methods *methods = &site->plan.methods;
    uint32_t most = methods->beam != BEAM_SINGLE ? LINE_MAX_ECHOES : 1 + methods->depth;
    return most < site->cfg->profile.max_echoes ? most : site->cfg->profile.max_echoes;
}

const struct scene_surface *site_surface(const struct site *site, uint32_t label)
{
    const struct scene *scene = site->scene;
    if (site->detect.ghost != NULL && label >= site->detect.n_real)
        return &site->detect.ghost[label - site->detect.n_real];
    for (uint32_t i = 0; label >= scene->n_surfaces; i++) {
        label -= scene->n_surfaces;
        scene = site->mover[i].scene;
    }
    return &scene->surface[label];
}

void site_move(const struct site *site, double t_s, struct cast_setup *setup)
{
    setup->n_movers = site->n_movers;
    for (uint32_t k = 0; k < site->n_movers; k++) {
        const struct site_mover *m = &site->mover[k];
        struct cast_mover *out = &setup->mover[k];
        const struct config_mesh *mesh = m->mesh;
        double t = t_s;
        if (mesh->cycle_s > 0.0) { /* forth and back */
            t = fmod(t_s, mesh->cycle_s);
            if (t > 0.5 * mesh->cycle_s) t = mesh->cycle_s - t;
        }
        pose_heading(fmod(mesh->turn_deg_s * t, 360.0) * M_PI / 180.0, out->rotation);
        out->bvh = m->bvh;
        out->radius_m = m->radius_m;
        memcpy(out->centre_m, m->centre_m, sizeof out->centre_m);
        for (int i = 0; i < 3; i++) {
            const double *row = out->rotation + 3 * i;
            double turned = row[0] * mesh->pivot_m[0] + row[1] * mesh->pivot_m[1] + row[2] * mesh->pivot_m[2];
            out->shift_m[i] = mesh->pivot_m[i] - turned + mesh->move_m_s[i] * t;
        }
    }
}

double site_mover_time(const struct site *site, uint32_t station, double scan_s)
{
    return site->stop != NULL ? site->station[station].t_s : scan_s;
}

static double distance_m(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
}

/* How far the stations that will share a BVH lie from its origin. */
static double station_reach(const struct site *site, const double origin_m[3])
{
    double reach_m = 0.0;
    for (uint32_t i = 0; i < site->n_stations; i++) {
        double d = distance_m(site->station[i].at.position_m, origin_m);
        if (d <= SITE_BVH_REACH_M) reach_m = fmax(reach_m, d + site_ray_reach_m(site, site->station[i].at.position_m));
    }
    return reach_m;
}

static int find_bvh(struct site *site, const double station_m[3], const struct sh_report *report, struct bvh **out,
                    struct sh_err *err)
{
    for (uint32_t i = 0; i < site->n_bvh; i++) {
        double origin_m[3];
        bvh_origin(site->bvh[i], origin_m);
        if (distance_m(origin_m, station_m) <= SITE_BVH_REACH_M) {
            *out = site->bvh[i];
            return SH_OK;
        }
    }
    if (site->n_bvh == CONFIG_MAX_STATIONS)
        return sh_fail(err, SH_EINPUT, "%s: the stations are too far apart; allowed %d groups of %.0f m across",
                       site->cfg->file, CONFIG_MAX_STATIONS, 2.0 * SITE_BVH_REACH_M);
    *out = NULL;
    int rc = site_build_bvh(site, site->scene, station_m, station_reach(site, station_m), report, out, err);
    if (*out != NULL) site->bvh[site->n_bvh++] = *out;
    return rc;
}

/* All places are known before the first BVH is built. */
static int place_stations(struct site *site, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    int rc = SH_OK;
    site->station = calloc(cfg->n_stations, sizeof *site->station);
    if (site->station == NULL) return sh_fail(err, SH_ENOMEM, "no memory for %u stations", cfg->n_stations);
    site->n_stations = cfg->n_stations;
    for (uint32_t i = 0; i < cfg->n_stations && rc == SH_OK; i++) {
        site->station[i].station = &cfg->station[i];
        rc = placement_find(cfg, i, &site->anchor, site->scene, &site->station[i].at, err);
    }
    return rc == SH_OK && cfg->platform.kind == PLATFORM_STOPS ? site_load_stops(site, err) : rc;
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
    const struct georef_place at = {tangent ? frame->lat_deg : first->at.lat_deg,
                                    tangent ? frame->lon_deg : first->at.lon_deg, 0.0};
    if (locate_in_grid(&at, *zone, &utm, NULL) != SH_OK) return;
    *zone = utm.zone == 0 ? GEOREF_UPS : utm.zone;
    if (*side == 0) *side = utm.north ? 1 : -1;
}

static int add_station(struct site *site, uint32_t i, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct site_station *s = &site->station[i];
    struct georef_spec spec = {.crs = cfg->output.crs, .geoid = site->geoid};
    site_grid(site, &spec.utm_zone, &spec.side);
    int rc = placement_georef(&s->at, &site->anchor, &spec, err);
    if (site->moving)
        s->bvh = site->bvh[0];
    else if (rc == SH_OK)
        rc = find_bvh(site, s->at.position_m, report, &s->bvh, err);
    if (rc == SH_OK) rc = georef_create(&spec, &s->georef, err);
    if (rc != SH_OK) return rc;
    int epsg = georef_epsg(s->georef), first = georef_epsg(site->station[0].georef);
    if (epsg != first)
        sh_warn(report, "%s: station %s is in EPSG %d, station %s in %d: their points do not fit together", cfg->file,
                s->station->name, epsg, site->station[0].station->name, first);
    return site_plan_georef(site, s, report, err);
}

int site_load(const struct config *cfg, const struct sh_report *report, struct site **out, struct sh_err *err)
{
    *out = NULL;
    struct site *site = calloc(1, sizeof *site);
    if (site == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    site->cfg = cfg;
    site->moving = config_head_moves(&cfg->platform);
    int rc = site_open_geoid(site, err);
    /* before the scene: what is wrong with an IFC file's site is told rather than what follows from it */
    if (rc == SH_OK) rc = placement_find_anchor(cfg, report, &site->anchor, err);
    if (rc == SH_OK) rc = load_scene(site, report, err);
    if (rc == SH_OK) rc = site_set_up_detect(site, report, err);
    if (rc == SH_OK) rc = place_stations(site, err);
    if (rc == SH_OK) rc = site_plan_order(site, err);
    if (rc == SH_OK && site->moving) rc = site_load_platform(site, report, err);
    for (uint32_t i = 0; i < site->n_stations && rc == SH_OK; i++)
        rc = add_station(site, i, report, err);
    if (rc == SH_OK) rc = site_choose_scale(site, report, err);
    if (rc == SH_OK) rc = site_choose_methods(site, report, err);
    if (rc != SH_OK) {
        site_free(site);
        return rc;
    }
    *out = site;
    return SH_OK;
}

void site_free(struct site *site)
{
    if (site == NULL) return;
    free(site->knot);
    free(site->stop);
    for (uint32_t i = 0; i < site->n_stations; i++) {
        struct site_station *s = &site->station[i];
        for (size_t k = 0; s->leg != NULL && k < site->n_stretches; k++)
            georef_free(s->leg[k].georef);
        free(s->leg);
        georef_free(s->georef);
        free(s->beam);
        beam_outlines_free(s->outlines);
    }
    free(site->plan.row);
    free(site->station);
    for (uint32_t i = 0; i < site->n_bvh; i++)
        bvh_free(site->bvh[i]);
    for (uint32_t i = 0; i < site->n_movers; i++) {
        bvh_free(site->mover[i].bvh);
        scene_free(site->mover[i].scene);
    }
    scene_free(site->scene);
    georef_geoid_free(site->geoid);
    free(site->stretch);
    site_free_detect(site);
    free(site);
}

const struct georef *site_georef(const struct site *site, uint32_t station, size_t stretch, const double **centre_m,
                                 const double **scale)
{
    const struct site_station *s = &site->station[station];
    const struct site_leg *leg = s->leg != NULL ? &s->leg[stretch] : NULL;
    *centre_m = leg != NULL ? site->stretch[stretch].centre_m : s->at.position_m;
    *scale = leg != NULL ? leg->scale : s->scale;
    return leg != NULL ? leg->georef : s->georef;
}

static double counts_or_ideal(double counts)
{
    return counts > 0.0 ? counts : 4294967296.0;
}

void site_cast_setup(const struct site *site, uint32_t station, struct cast_setup *setup)
{
    const struct config_profile *profile = &site->cfg->profile;
    const struct site_station *s = &site->station[station];
    memset(setup, 0, sizeof *setup);
    setup->bvh = s->bvh;
    setup->georef = s->georef;
    memcpy(setup->station_m, s->at.position_m, sizeof setup->station_m);
    memcpy(setup->rotation, s->at.rotation, sizeof setup->rotation);
    setup->range_min_m = profile->range_min_m;
    setup->range_max_m = profile->range_max_m;
    setup->noise_on = site->cfg->noise.range == RANGE_NOISE_ON;
    setup->range_sigma_m = profile->range_sigma_m;
    setup->range_sigma_ppm = profile->range_sigma_ppm;
    setup->noise_key = rng_key(site->cfg->noise.seed, RNG_RANGE);
    setup->mirror_counts = counts_or_ideal(profile->mirror_counts);
    setup->pan_counts = counts_or_ideal(profile->pan_counts);
    setup->detect = site->detect.on ? &site->detect.cast : NULL;
    setup->layout = site->cfg->output.layout;
    setup->beam = s->beam;
    setup->echoes = (enum beam_select)site->cfg->head.settings.echoes;
    setup->pulse_m = 0.5 * LIGHT_SPEED_M_S * 1e-9 * profile->pulse_width_ns;
    setup->range_scale_m = site->scale_m;
    memcpy(setup->xyz_scale, s->scale, sizeof setup->xyz_scale);
}
