/* SPDX-License-Identifier: MIT */
/* The world, which sites of one scene share. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/site/site.h"
#include "firmware_sim/site/world.h"

double site_enclose(const struct scene *mesh, double centre_m[3])
{
    double half2 = 0.0;
    for (int i = 0; i < 3; i++) {
        const double half = 0.5 * (mesh->max_m[i] - mesh->min_m[i]);
        centre_m[i] = mesh->min_m[i] + half;
        half2 += half * half;
    }
    return sqrt(half2) * (1.0 + 1e-9) + 1e-6;
}

double site_mesh_error_m(const struct site *site)
{
    double error_m = site->scene->error_m;
    for (uint32_t i = 0; i < site->n_movers; i++)
        error_m = fmax(error_m, site->mover[i].scene->error_m);
    return error_m;
}

/* Whether the meshes are read in the same way, with all that this configuration needs. Bytes can be compared, since
 * both structs began as zeros. */
static int is_same_scene(const struct site *site, const struct site *other)
{
    const struct config_scene *a = &site->cfg->scene, *b = &other->cfg->scene;
    return other->scene != NULL && site_mesh_error_m(other) <= a->tolerance_m && a->n_meshes == b->n_meshes &&
           memcmp(a->mesh, b->mesh, sizeof a->mesh) == 0 && a->n_copies == b->n_copies &&
           memcmp(a->copy, b->copy, sizeof a->copy) == 0 && a->cutouts == b->cutouts &&
           memcmp(&a->target, &b->target, sizeof a->target) == 0 &&
           (config_wants_textures(other->cfg) || !config_wants_textures(site->cfg));
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
    site->world->written_out = other != NULL && other->world->written_out;
    return SH_OK;
}

void site_leave_world(struct site *site)
{
    struct site_world *world = site->world;
    if (world == NULL) return;
    if (--world->n_users > 0) return;
    bvh_free(world->bvh);
    free(world->target.is_target);
    for (uint32_t i = 0; i < world->n_movers; i++) {
        bvh_free(world->mover[i].bvh);
        scene_free(world->mover[i].scene);
    }
    scene_free(world->scene);
    free(world);
}
