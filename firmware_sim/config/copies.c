/* SPDX-License-Identifier: MIT */
/* Copies of meshes: the list that may stand in the place of a CSV file. */
#include <string.h>

#include "core/infile.h"
#include "firmware_sim/config/check_places.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/copies.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"

/* clang-format off */
static const struct cfg_key rows[] = {
    {"offset_m", CFG_MEMBER(struct scene_place, at_m), CFG_VEC3, "m", NULL, -1e9, 1e9, .help = "Where it stands."},
    {"turn_deg", CFG_MEMBER(struct scene_place, turn_deg), CFG_REAL, "deg", "0", -360, 360,
     .help = "Turn about the vertical, clockwise seen from above; offset_m is added after it."},
    {"scale", CFG_MEMBER(struct scene_place, scale), CFG_REAL, NULL, "1", 1.0 / CONFIG_COPY_SCALES, CONFIG_COPY_SCALES,
     .help = "Scale of the copy, applied before the turn."},
};
/* clang-format on */
const struct cfg_table cfg_copy_table = {rows, CFG_LEN(rows)};

void cfg_begin_copy(struct cfg_reader *rd, const struct cfg_reader *of, uint32_t mesh, const char *name, int line)
{
    struct config_scene *scene = &((struct config *)of->base)->scene;
    struct config_copy *copy = &scene->copy[scene->n_copies++];
    copy->mesh = mesh;
    cfg_reader_init(rd, of->file, &cfg_copy_table, &copy->place, of->diagnostics);
    rd->of = name;
    rd->set = of->set;
    rd->root_line = line;
}

void cfg_forget_copies(struct cfg_reader *rd, const struct cfg_key *key, uint32_t item)
{
    struct config_scene *scene = &((struct config *)rd->base)->scene;
    const int all = strcmp(key->path, "scene") == 0 || strcmp(key->path, "scene.meshes") == 0;
    const int one = strcmp(key->path, "scene.meshes[]") == 0 || strcmp(key->path, "scene.meshes[].copies") == 0;
    uint32_t n = 0;
    if (!all && !one) return;
    for (uint32_t i = 0; i < scene->n_copies && one; i++)
        if (scene->copy[i].mesh != item) scene->copy[n++] = scene->copy[i];
    memset(&scene->copy[n], 0, (CONFIG_MAX_COPIES - n) * sizeof scene->copy[0]);
    scene->n_copies = n;
}

void cfg_check_readable(struct cfg_reader *rd, const char *key, uint32_t item, const char *path, const char *kind)
{
    const char *why;
    FILE *file = infile_open(path, &why);
    if (file != NULL)
        fclose(file);
    else
        cfg_fail_item(rd, key, item, "%.200s: %s; allowed a %s file that can be read", path, why, kind);
}

void cfg_check_copies(struct cfg_reader *rd, const struct config *cfg)
{
    static const char path[] = "scene.meshes[].copies";
    for (uint32_t i = 0; i < cfg->scene.n_meshes; i++) {
        const struct config_mesh *mesh = &cfg->scene.mesh[i];
        if (mesh->copy_labels && !cfg_is_item_given(rd, path, i))
            cfg_fail_item(rd, "scene.meshes[].copy_labels", i, "on, but the mesh has no copies; allowed with copies");
        if (mesh->copies[0] != '\0') cfg_check_readable(rd, path, i, mesh->copies, "CSV");
    }
}
