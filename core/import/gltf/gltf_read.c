/* SPDX-License-Identifier: MIT */
#include "core/import/gltf/gltf_read.h"

#include <math.h>
#include <string.h>
#include <sys/stat.h>

#include "core/import/gltf/gltf.h"
#include "core/import/gltf/gltf_extensions.h"
#include "core/import/gltf/gltf_file.h"
#include "core/import/gltf/gltf_indices.h"
#include "core/import/gltf/gltf_json.h"
#include "core/import/gltf/gltf_material.h"
#include "core/import/gltf/gltf_nodes.h"

bool gltf_is_name(const char *file)
{
    return text_has_ending(file, ".gltf") || text_has_ending(file, ".glb");
}

/* Counts names with a NUL, which end there for everyone who reads them. */
static unsigned count_cut_names(const struct gltf *g)
{
    static const char *const list[] = {"nodes", "meshes", "materials"};
    unsigned n = 0;
    for (size_t i = 0; i < sizeof list / sizeof list[0]; i++) {
        const json_t *all = json_object_get(g->root, list[i]);
        for (size_t k = 0; k < json_array_size(all); k++) {
            const json_t *name = json_object_get(json_array_get(all, k), "name");
            n += json_is_string(name) && strlen(json_string_value(name)) != json_string_length(name);
        }
    }
    return n;
}

/* Warns of what was left out or changed, one line for each kind. */
static void say_counts(const struct gltf *g)
{
    const unsigned n_cut = count_cut_names(g);
    gltf_say_indices(g->b, g->root);
    if (n_cut > 0) build_warn(g->b, "%u names have a \\u0000, and are read up to there", n_cut);
    if (g->n_hidden > 0)
        build_warn(g->b, "%u nodes are hidden (KHR_node_visibility); they and their children are left out",
                   g->n_hidden);
    if (g->n_shapeless > 0) build_warn(g->b, "%u primitives without POSITION left out", g->n_shapeless);
    if (g->n_unmapped > 0)
        build_warn(g->b, "%u primitives have no texture coordinates: their texture is not used", g->n_unmapped);
    if (g->n_jointless > 0)
        build_warn(g->b, "%u primitives have a skin and no JOINTS_0: no joint moves them", g->n_jointless);
    if (g->n_unweighted > 0)
        build_warn(g->b, "%llu vertices of a skin have no weights: no joint moves them",
                   (unsigned long long)g->n_unweighted);
    if (g->n_holes > 0)
        build_warn(g->b, "%llu triangles left out: they have less opacity than their material's alphaCutoff (MASK)",
                   (unsigned long long)g->n_holes);
    if (g->n_faded > 0)
        build_warn(g->b,
                   "%llu triangles of masked materials have opacities at their corners (COLOR_0); these are not used, "
                   "and make no holes",
                   (unsigned long long)g->n_faded);
    if (g->n_images > 0)
        build_warn(g->b, "%u primitives have a texture of %s, which is not supported: their surfaces have no texture",
                   g->n_images, g->image);
    if (g->n_odd > 0)
        build_warn(g->b, "%u value%s of materials left out, since the format doesn't allow them; the first: %s",
                   g->n_odd, g->n_odd > 1 ? "s" : "", g->odd);
}

/* Warns where positions were rounded to whole numbers (quantised). The file is not refused for it, since its writer
 * chose the size of the steps. */
static int say_errors(struct gltf *g)
{
    struct scene_build *b = g->b;
    const double step_m = g->step_error * b->spec->scale;
    b->scene->error_m = fmax(b->scene->error_m, step_m);
    if (step_m > 1e-6)
        build_warn(b, "its positions are whole numbers (KHR_mesh_quantization), with errors up to %.2g m", step_m);
    return build_single(b, g->largest, g->error, true, g->err);
}

static int read_scene(struct gltf *g)
{
    g->b->scene->says = (struct scene_says){.unit_m = 1.0, .up = 2};
    int rc = gltf_name_materials(g);
    if (rc == SH_OK) rc = gltf_place_nodes(g);
    if (rc == SH_OK) rc = gltf_draw_scene(g);
    if (rc == SH_OK) rc = say_errors(g);
    if (rc == SH_OK) say_counts(g);
    return rc;
}

/* Adds advice to the error of a faulty file. */
static int say_what_to_do(int rc, struct sh_err *err)
{
    const struct sh_err said = *err;
    if (rc != SH_EINPUT || strstr(said.text, "convert it") != NULL || strstr(said.text, "copy it there") != NULL)
        return rc;
    return sh_fail(err, rc, "%.440s: export it again, or convert it to .obj or .ply", said.text);
}

static int check_extensions(struct gltf *g)
{
    json_t *required, *used;
    int rc = gltf_list(g, g->root, "extensionsRequired", "", &required);
    if (rc == SH_OK) rc = gltf_list(g, g->root, "extensionsUsed", "", &used);
    return rc == SH_OK ? gltf_check_extensions(g->b, g->root, &g->by_assimp, g->err) : rc;
}

int import_gltf(struct scene_build *b, struct sh_err *err)
{
    struct gltf g = {.b = b, .err = err};
    struct stat st;
    if (stat(b->spec->file, &st) == 0 && st.st_size > 8 << 20) build_report(b, -1);
    int rc = gltf_open(&g);
    if (rc == SH_OK && !g.by_assimp) rc = check_extensions(&g);
    const bool by_assimp = g.by_assimp;
    if (rc == SH_OK && !by_assimp) rc = read_scene(&g);
    gltf_close(&g);
    if (rc != SH_OK) return say_what_to_do(rc, err);
    return by_assimp ? sh_fail(err, SH_ESTATE, "%s: Assimp has to read it", b->name) : SH_OK;
}
