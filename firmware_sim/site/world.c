/* SPDX-License-Identifier: MIT */
/* The world, which sites of one scene share. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/vec3.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/site/steps.h"

double site_enclose(const struct scene *mesh, double centre_m[3])
{
    double size[3];
    vec3_sub(mesh->max_m, mesh->min_m, size);
    for (int i = 0; i < 3; i++)
        centre_m[i] = mesh->min_m[i] + 0.5 * size[i];
    return 0.5 * vec3_length(size) * (1.0 + 1e-9) + 1e-6;
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

int site_enter_world(struct site *site, const struct site *other, struct sh_err *err)
{
    struct site_world *world = other != NULL && is_same_scene(site, other) ? other->world : calloc(1, sizeof *world);
    if (world == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    if (world->n_users++ == 0) world->written_out = other != NULL && other->world->written_out;
    site->world = world;
    site->scene = world->scene;
    site->mover = world->mover;
    site->n_movers = world->n_movers;
    site->n_surfaces = world->n_surfaces;
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
