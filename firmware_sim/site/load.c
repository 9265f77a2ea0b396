/* SPDX-License-Identifier: MIT */
/* Loading a site: take_steps near its end has the steps in their order. */
#include <stdlib.h>
#include <string.h>

#include "core/scene_copies.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/places.h"
#include "firmware_sim/site/steps.h"
#include "firmware_sim/site/plan_rows.h"
#include "firmware_sim/site/waves.h"

static struct scene_mesh_spec mesh_spec(const struct config *cfg, const struct config_mesh *mesh)
{
    struct scene_mesh_spec spec = {
        .file = mesh->file,
        .up = mesh->up,
        .scale = mesh->scale,
        .textures = config_wants_textures(cfg),
        .cutouts = cfg->scene.cutouts,
        .limits = &cfg->scene.import,
    };
    memcpy(spec.offset_m, mesh->offset_m, sizeof spec.offset_m);
    return spec;
}

/* Adds a body by itself, in its own coordinate frame. */
static int add_mover(struct site *site, uint32_t number, const struct scene_mesh_spec *spec,
                     const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    if (site->n_movers == CAST_MAX_MOVERS)
        return sh_fail(err, SH_EINPUT, "%s: scene.meshes: too many meshes move; allowed are %d", cfg->file,
                       CAST_MAX_MOVERS);
    struct site_mover *m = &site->mover[site->n_movers++];
    m->number = number;
    int rc = scene_load(spec, 1, cfg->scene.tolerance_m, report, &m->scene, err);
    if (rc != SH_OK) return rc;
    if (site->n_surfaces + m->scene->n_surfaces > SCENE_MAX_SURFACES)
        return sh_fail(err, SH_EINPUT, "%s: too many surfaces; at most %d", spec->file, SCENE_MAX_SURFACES);
    site->n_surfaces += m->scene->n_surfaces;
    return SH_OK;
}

/* Sets the sphere around each body, and its labels, which follow those given before. */
static void place_movers(struct site *site)
{
    uint32_t label = site->scene->n_surfaces;
    for (uint32_t k = 0; k < site->n_movers; k++) {
        struct site_mover *m = &site->mover[k];
        for (uint32_t i = 0; i < m->scene->n_triangles; i++)
            m->scene->label[i] = (uint16_t)(m->scene->label[i] + label);
        m->scene->label0 = label;
        m->radius_m = site_enclose(m->scene, m->centre_m);
        label += m->scene->n_surfaces;
    }
}

static int write_out(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    int rc = scene_write_out_copies(site->scene, SITE_MOST_WRITTEN_OUT, report, err);
    for (uint32_t i = 0; i < site->n_movers && rc == SH_OK; i++)
        rc = scene_write_out_copies(site->mover[i].scene, SITE_MOST_WRITTEN_OUT, report, err);
    return rc;
}

/* spec: [n_meshes] */
static int load_meshes(struct site *site, const struct scene_mesh_spec *spec, const struct sh_report *report,
                       struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct scene_mesh_spec standing[CONFIG_MAX_MESHES];
    size_t n = 0;
    for (uint32_t i = 0; i < cfg->scene.n_meshes; i++)
        if (!config_mesh_moves(&cfg->scene.mesh[i])) standing[n++] = spec[i];
    if (n == 0)
        return sh_fail(err, SH_EINPUT, "%s: scene.meshes: all meshes move; at least one must stand still", cfg->file);
    int rc = scene_load(standing, n, cfg->scene.tolerance_m, report, &site->scene, err);
    if (rc == SH_OK) site->n_surfaces = site->scene->n_surfaces;
    for (uint32_t i = 0; i < cfg->scene.n_meshes && rc == SH_OK; i++)
        if (config_mesh_moves(&cfg->scene.mesh[i])) rc = add_mover(site, i, &spec[i], report, err);
    if (rc == SH_OK) rc = site_select_target(site, err);
    if (rc == SH_OK && site->world->written_out) rc = write_out(site, report, err);
    if (rc == SH_OK) place_movers(site);
    return rc;
}

/* Reads all lists of copies before the first mesh, so that their errors are reported soon. */
static int load_scene(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    struct scene_mesh_spec spec[CONFIG_MAX_MESHES];
    uint32_t n = 0;
    int rc = SH_OK;
    for (; n < cfg->scene.n_meshes && rc == SH_OK; n++) {
        spec[n] = mesh_spec(cfg, &cfg->scene.mesh[n]);
        rc = site_read_copies(cfg, n, report, &spec[n].places, err);
    }
    if (rc == SH_OK) rc = load_meshes(site, spec, report, err);
    for (uint32_t i = 0; i < n; i++)
        free(spec[i].places.place);
    return rc;
}

/* Loads the meshes, once in a world. */
static int load_world(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    struct site_world *world = site->world;
    if (world->scene != NULL) return SH_OK;
    int rc = load_scene(site, report, err);
    world->scene = site->scene; /* the world owns it, also after an error */
    world->n_movers = site->n_movers;
    world->n_surfaces = site->n_surfaces;
    return rc;
}

/* The sites of a world share the BVHs: the first site builds them. */
static int build_bvhs(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const unsigned threads = site->cfg->loop.threads;
    struct site_world *world = site->world;
    int rc = world->bvh != NULL ? SH_OK : bvh_create(site->scene, threads, report, &world->bvh, err);
    for (uint32_t i = 0; i < site->n_movers && rc == SH_OK; i++) {
        struct site_mover *m = &site->mover[i];
        if (m->bvh == NULL) rc = bvh_create(m->scene, threads, report, &m->bvh, err);
    }
    site->bvh = world->bvh;
    return rc;
}

/* Places the stations or stops of the head. */
static int place_stations(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    const struct config *cfg = site->cfg;
    int rc = SH_OK;
    site->station = calloc(cfg->n_stations, sizeof *site->station);
    if (site->station == NULL) return sh_fail(err, SH_ENOMEM, "no memory for %u stations", cfg->n_stations);
    site->n_stations = cfg->n_stations;
    for (uint32_t i = 0; i < cfg->n_stations && rc == SH_OK; i++) {
        site->station[i].station = &cfg->station[i];
        rc = placement_find(cfg, i, &site->anchor, site->bvh, &site->station[i].at, err);
        if (rc == SH_OK) rc = sh_check_stop(report, err);
    }
    return rc == SH_OK && cfg->platform.kind == PLATFORM_STOPS ? site_load_stops(site, report, err) : rc;
}

/* Reads a list of directions again: the configuration keeps only its length. */
static int load_emitter(struct site *site, struct sh_err *err)
{
    const struct config_profile *p = &site->cfg->profile;
    uint32_t n;
    site->emitter = p->emitter;
    if (p->emitter.kind != EMITTER_DIRECTIONS) return SH_OK;
    int rc = emitter_read_directions(p->arrangement.directions, &site->direction, &n, err);
    if (rc != SH_OK) return rc;
    if (n != p->emitter.steps)
        return sh_fail(err, SH_EINPUT, "%s: the file had %u directions when it was first read, and now has %u",
                       p->arrangement.directions, p->emitter.steps, n);
    emitter_set_directions(&site->emitter, site->direction, n);
    return SH_OK;
}

/* The anchor comes before the scene. So an error in an IFC file's site is reported, not a later error that it
 * causes. */
static int take_steps(struct site *site, const struct sh_report *report, struct sh_err *err)
{
    int rc = load_emitter(site, err);
    if (rc == SH_OK) rc = placement_find_anchor(site->cfg, report, &site->anchor, err);
    if (rc == SH_OK) rc = load_world(site, report, err);
    if (rc == SH_OK) rc = site_name_legs(site, err);
    if (rc == SH_OK) rc = site_set_up_detect(site, report, err);
    if (rc == SH_OK) rc = site_set_up_waves(site, report, err);
    if (rc == SH_OK) rc = site_set_up_silent(site, err);
    if (rc == SH_OK) rc = build_bvhs(site, report, err);
    if (rc == SH_OK) rc = place_stations(site, report, err);
    if (rc == SH_OK && site->moving) rc = site_load_platform(site, report, err);
    if (rc == SH_OK) rc = site_set_up_tripods(site, report, err);
    if (rc == SH_OK && site->cfg->output.colour != COLOUR_NONE) rc = site_set_up_colours(site, report, err);
    /* Plausibility is checked before beams are chosen, since choosing takes long if little is in view. */
    if (rc == SH_OK) rc = site_check_plausibility(site, report, err);
    if (rc == SH_OK) rc = site_georeference(site, report, err);
    if (rc == SH_OK) rc = site_choose_methods(site, report, err);
    if (rc == SH_OK) rc = site_plan_sight(site, report, err);
    return rc;
}

int site_load_for(const struct config *cfg, enum site_purpose purpose, const struct site *other,
                  const struct sh_report *report, struct site **out, struct sh_err *err)
{
    struct site *site = *out = calloc(1, sizeof *site);
    if (site == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    struct site_listener heard;
    site_listen(&heard, report, &site->warnings, purpose == SITE_MOVED ? &other->warnings : NULL);
    site->cfg = cfg;
    site->measures = purpose == SITE_FOR_PLAN;
    site->planned_frames = cfg->head.settings.frames;
    site->moving = config_head_moves(&cfg->platform);
    int rc = site_enter_world(site, other, err);
    if (rc == SH_OK && purpose == SITE_WRITTEN_OUT) site->world->written_out = 1;
    if (rc == SH_OK) rc = take_steps(site, &heard.report, err);
    if (rc == SH_OK && site->measures) rc = site_open_sights(site, 0, site->n_stations, report, err);
    if (rc == SH_OK && site->measures) rc = site_plan_rows(site, err);
    if (rc == SH_OK) return SH_OK;
    site_free(site);
    *out = NULL;
    return rc;
}

int site_load(const struct config *cfg, const struct sh_report *report, struct site **out, struct sh_err *err)
{
    return site_load_for(cfg, SITE_FOR_SCANS, NULL, report, out, err);
}

void site_free(struct site *site)
{
    if (site == NULL) return;
    site_retire(site);
    free(site->direction);
    free(site->knot);
    free(site->stop);
    for (uint32_t i = 0; i < site->n_stations; i++) {
        struct site_station *s = &site->station[i];
        site_free_georeference(site, i);
        site_free_beam(s);
        site_free_tripod(&s->tripod);
    }
    free(site->plan.row);
    free(site->station);
    free(site->silent);
    site_leave_world(site);
    georef_geoid_free(site->geoid);
    free(site->stretch);
    site_free_detect(site);
    site_free_waves(site);
    free(site->legs);
    surface_colours_free(&site->colours.surfaces);
    site_free_warnings(&site->warnings);
    free(site->own_cfg);
    free(site);
}
