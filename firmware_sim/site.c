#include "firmware_sim/site_georef.h"
#include "firmware_sim/site_platform.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/locate.h"
#include "core/rng.h"

static int is_moving(const struct config_mesh *mesh)
{
    return mesh->turn_deg_s != 0.0 || mesh->move_m_s[0] != 0.0 || mesh->move_m_s[1] != 0.0 || mesh->move_m_s[2] != 0.0;
}

static struct scene_mesh_spec mesh_spec(const struct config_mesh *mesh)
{
    struct scene_mesh_spec spec = {.file = mesh->file, .up = mesh->up, .scale = mesh->scale};
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
    struct scene_mesh_spec spec = mesh_spec(mesh);
    double half2 = 0.0;
    m->mesh = mesh;
    int rc = scene_load(&spec, 1, cfg->scene_tolerance_m, report, &m->scene, err);
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
    rc = bvh_create(m->scene, m->centre_m, cfg->profile.range_max_m, cfg->threads, report, &m->bvh, err);
    return rc == SH_OK && cfg->order_exactly ? bvh_order_exactly(m->bvh, err) : rc;
}

static int load_scene(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct scene_mesh_spec spec[CONFIG_MAX_MESHES];
    size_t n = 0;
    for (uint32_t i = 0; i < cfg->n_meshes; i++)
        if (!is_moving(&cfg->mesh[i])) spec[n++] = mesh_spec(&cfg->mesh[i]);
    if (n == 0)
        return sh_fail(err, SH_EINPUT, "%s: scene.meshes: all of them move; at least one has to stand still",
                       cfg->file);
    int rc = scene_load(spec, n, cfg->scene_tolerance_m, report, &site->scene, err);
    if (rc == SH_OK) site->n_surfaces = site->scene->n_surfaces;
    for (uint32_t i = 0; i < cfg->n_meshes && rc == SH_OK; i++)
        if (is_moving(&cfg->mesh[i])) rc = add_mover(site, &cfg->mesh[i], report, err);
    return rc;
}

const struct scene_surface *site_surface(const struct site *site, uint32_t label)
{
    const struct scene *scene = site->scene;
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
        cast_rotation(fmod(mesh->turn_deg_s * t, 360.0) * M_PI / 180.0, out->rotation);
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

static double distance_m(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
}

/* How far the stations that will share a BVH lie from its origin. */
static double station_reach(const struct site *site, const double origin_m[3])
{
    double beam_m = site->cfg->beam_mode == BEAM_SINGLE ? 0.0 : 0.5 * site->cfg->profile.beam_exit_m, reach_m = beam_m;
    for (uint32_t i = 0; i < site->cfg->n_stations; i++) {
        double d = distance_m(site->station[i].at.position_m, origin_m);
        if (d <= SITE_BVH_REACH_M && d + beam_m > reach_m) reach_m = d + beam_m;
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
    int rc = bvh_create(site->scene, station_m, station_reach(site, station_m), site->cfg->threads, report, out, err);
    if (rc != SH_OK) return rc;
    site->bvh[site->n_bvh++] = *out;
    return site->cfg->order_exactly ? bvh_order_exactly(*out, err) : SH_OK;
}

/* All places are known before the first BVH is built. */
static int place_stations(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    int rc = placement_find_anchor(site->cfg, report, &site->anchor, err);
    for (uint32_t i = 0; i < site->cfg->n_stations && rc == SH_OK; i++)
        rc = placement_find(site->cfg, i, &site->anchor, site->scene, &site->station[i].at, err);
    return rc;
}

int site_utm_zone(const struct site *site)
{
    const struct geoframe *frame = &site->anchor.frame;
    const struct placement *first = &site->station[0].at;
    struct locate_grid utm;
    if (site->cfg->utm_zone != 0 || !site->anchor.known || frame->kind == GEOFRAME_GRID) return site->cfg->utm_zone;
    int tangent = frame->kind == GEOFRAME_TANGENT;
    const struct georef_place at = {tangent ? frame->lat_deg : first->lat_deg,
                                    tangent ? frame->lon_deg : first->lon_deg, 0.0};
    int rc = locate_in_grid(&at, 0, &utm, NULL);
    return rc == SH_OK ? utm.zone : 0;
}

/* The beam as it is from a station. */
static int make_beam(struct site *site, struct site_station *s, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    const struct config_profile *p = &cfg->profile;
    if (cfg->beam_mode == BEAM_SINGLE) return SH_OK;
    struct cast_beam *beam = s->beam = calloc(1, sizeof *beam);
    if (beam == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    beam->mode = cfg->beam_mode != BEAM_AUTO ? cfg->beam_mode : config_moves(cfg) ? BEAM_RINGS : BEAM_ADAPTIVE;
    beam->max_echoes = p->max_echoes;
    beam_init(&beam->beam, p->beam_exit_m, p->beam_divergence_rad, 1e-9 * p->pulse_width_ns);
    beam_rings(cfg->beam_rings, &beam->pattern);
    beam_rings(BEAM_FINE_RINGS, &beam->fine);
    if (beam->mode != BEAM_ADAPTIVE) return SH_OK;
    if (site->scene->n_triangles > 1000000) sh_progress(report, "looking for outlines", -1.0);
    int rc = cast_outlines(site->scene, s->bvh, s->at.position_m, &beam->beam, p->range_max_m, &s->outlines, err);
    beam->outlines = s->outlines;
    return rc;
}

static int add_station(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    uint32_t i = site->n_stations;
    struct site_station *s = &site->station[i];
    struct georef_spec spec = {.crs = cfg->crs, .utm_zone = site_utm_zone(site), .geoid = site->geoid};
    s->station = &cfg->station[i];
    int rc = placement_georef(&s->at, &site->anchor, &spec, err);
    if (site->moving)
        s->bvh = site->bvh[0];
    else if (rc == SH_OK)
        rc = find_bvh(site, s->at.position_m, report, &s->bvh, err);
    if (rc == SH_OK) rc = make_beam(site, s, report, err);
    if (rc == SH_OK) rc = georef_create(&spec, &s->georef, err);
    if (rc != SH_OK) return rc;
    site->n_stations++;
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
    site->moving = cfg->platform.kind != PLATFORM_STATIC;
    int rc = site_open_geoid(site, err);
    if (rc == SH_OK) rc = load_scene(site, report, err);
    if (rc == SH_OK) rc = place_stations(site, report, err);
    if (rc == SH_OK && site->moving) rc = site_load_platform(site, report, err);
    for (uint32_t i = 0; i < cfg->n_stations && rc == SH_OK; i++)
        rc = add_station(site, report, err);
    if (rc == SH_OK) rc = site_choose_scale(site, err);
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
    free(site->stretch);
    for (uint32_t i = 0; i < site->n_stations; i++)
        georef_free(site->station[i].georef);
    for (uint32_t i = 0; i < site->cfg->n_stations; i++) {
        free(site->station[i].beam);
        beam_outlines_free(site->station[i].outlines);
    }
    for (uint32_t i = 0; i < site->n_bvh; i++)
        bvh_free(site->bvh[i]);
    for (uint32_t i = 0; i < site->n_movers; i++) {
        bvh_free(site->mover[i].bvh);
        scene_free(site->mover[i].scene);
    }
    scene_free(site->scene);
    georef_geoid_free(site->geoid);
    free(site);
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
    setup->noise_on = site->cfg->noise_on;
    setup->range_sigma_m = profile->range_sigma_m;
    setup->range_sigma_ppm = profile->range_sigma_ppm;
    setup->noise_key = rng_key(site->cfg->seed, RNG_RANGE);
    setup->mirror_counts = counts_or_ideal(profile->mirror_counts);
    setup->pan_counts = counts_or_ideal(profile->pan_counts);
    setup->layout = site->cfg->layout;
    setup->beam = s->beam;
    setup->echoes = (enum beam_select)site->cfg->settings.echoes;
    setup->range_scale_m = site->scale_m;
    memcpy(setup->xyz_scale, s->scale, sizeof setup->xyz_scale);
}
