/* What sites of one scene share. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/site/site_inside.h"

/* Meshes that are read in the same way, with all that this configuration asks for. Both structs began as zeros. */
static int is_same_scene(const struct site *site, const struct site *other)
{
    const struct config_scene *a = &site->cfg->scene, *b = &other->cfg->scene;
    double error_m = other->scene != NULL ? other->scene->error_m : INFINITY;
    for (uint32_t i = 0; i < other->n_movers; i++)
        error_m = fmax(error_m, other->mover[i].scene->error_m);
    return a->n_meshes == b->n_meshes && memcmp(a->mesh, b->mesh, sizeof a->mesh) == 0 && a->cutouts == b->cutouts &&
           memcmp(&a->target, &b->target, sizeof a->target) == 0 &&
           (config_wants_textures(other->cfg) || !config_wants_textures(site->cfg)) && error_m <= a->tolerance_m;
}

static void take_scene(struct site *site)
{
    const struct site_world *world = site->world;
    const struct config_scene *scene = &site->cfg->scene;
    site->scene = world->scene;
    site->n_surfaces = world->n_surfaces;
    site->n_movers = world->n_movers;
    memcpy(site->mover, world->mover, sizeof site->mover);
    for (uint32_t i = 0; i < site->n_movers; i++)
        site->mover[i].mesh = &scene->mesh[site->mover[i].number];
}

int site_enter_world(struct site *site, const struct site *other, struct sh_err *err)
{
    if (other != NULL && is_same_scene(site, other)) {
        site->world = other->world;
        site->world->n_users++;
        take_scene(site);
        return SH_OK;
    }
    site->world = calloc(1, sizeof *site->world);
    if (site->world == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    site->world->n_users = 1;
    return SH_OK;
}

void site_leave_world(struct site *site)
{
    struct site_world *world = site->world;
    if (world == NULL) return;
    for (uint32_t i = 0; i < site->n_bvh; i++)
        for (uint32_t k = 0; k < world->n_bvh; k++)
            world->bvh[k].n_users -= world->bvh[k].bvh == site->bvh[i];
    if (--world->n_users > 0) return;
    for (uint32_t i = 0; i < world->n_bvh; i++)
        bvh_free(world->bvh[i].bvh);
    free(world->bvh);
    free(world->target.is_target);
    for (uint32_t i = 0; i < world->n_movers; i++) {
        bvh_free(world->mover[i].bvh);
        scene_free(world->mover[i].scene);
    }
    scene_free(world->scene);
    free(world);
}

void site_drop_bvhs(struct site *site)
{
    struct site_world *world = site->world;
    site_close_sights(site);
    for (uint32_t i = 0; i < world->n_bvh; i++)
        bvh_free(world->bvh[i].bvh);
    for (uint32_t i = 0; i < world->n_movers; i++) {
        bvh_free(world->mover[i].bvh);
        world->mover[i].bvh = site->mover[i].bvh = NULL;
    }
    site->n_bvh = world->n_bvh = 0;
}

double site_world_range_max_m(const struct site *site)
{
    return fmax(config_range_most_m(site->cfg), site->cfg->scene.shared.range_max_m);
}

double site_world_ray_reach_m(const struct site *site, const double station_m[3])
{
    const struct config_shared *all = &site->cfg->scene.shared;
    const double own_m = site_ray_reach_m(site, station_m);
    if (!all->passes_glass) return fmax(own_m, all->beside_m);
    const double beyond_m = site->n_movers > 0 ? INFINITY : site_farthest_m(site, station_m) + 1e-3;
    return fmax(own_m, all->beside_m + fmin(beyond_m, all->range_max_m));
}

int site_keep_bvh(struct site_world *world, struct bvh *bvh, double reach_m, int is_ordered, struct sh_err *err)
{
    struct site_bvh *more = realloc(world->bvh, (world->n_bvh + 1) * sizeof *more);
    if (more == NULL) return sh_fail(err, SH_ENOMEM, "no memory for a BVH");
    world->bvh = more;
    more[world->n_bvh++] = (struct site_bvh){.bvh = bvh, .reach_m = reach_m, .is_ordered = is_ordered};
    return SH_OK;
}

void site_use_bvh(struct site *site, struct site_bvh *entry)
{
    for (uint32_t i = 0; i < site->n_bvh; i++)
        if (site->bvh[i] == entry->bvh) return;
    site->bvh[site->n_bvh++] = entry->bvh;
    entry->n_users++;
}

void site_drop_unused_bvhs(const struct site *site)
{
    struct site_world *world = site->world;
    uint32_t kept = 0;
    for (uint32_t i = 0; i < world->n_bvh; i++) {
        if (world->bvh[i].n_users == 0)
            bvh_free(world->bvh[i].bvh);
        else
            world->bvh[kept++] = world->bvh[i];
    }
    world->n_bvh = kept;
}
