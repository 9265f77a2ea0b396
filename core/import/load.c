/* SPDX-License-Identifier: MIT */
/* scene_load finds the reader of each file by its ending, and makes the scene of all of them. */
#include <math.h>
#include <stdbool.h>
#include <string.h>
#include <strings.h>

#include "core/import/geotiff/geotiff_beside.h"
#include "core/import/readers.h"
#include "core/infile.h"
#include "core/scene/build_load.h"
#include "core/scene/copies.h"
#include "core/scene/cutouts.h"

static const struct {
    const char *ending;
    int (*read)(struct scene_build *b, struct sh_err *err);
} readers[] = {
    {".obj", read_obj},     {".ply", read_ply},      {".stl", read_stl},     {".gltf", import_apart},
    {".glb", import_apart}, {".fbx", import_apart},  {".dae", import_apart}, {".ifc", read_ifc},
    {".tif", import_apart}, {".tiff", import_apart},
};

static int check_spec(struct scene_build *b, struct sh_err *err)
{
    const struct scene_mesh_spec *spec = b->spec;
    if (!(spec->scale > 0) || !isfinite(spec->scale))
        return build_fail(b, SH_EINPUT, err, "scale %g; allowed are numbers above 0", spec->scale);
    for (int k = 0; k < 3; k++)
        if (!isfinite(spec->offset_m[k]))
            return build_fail(b, SH_EINPUT, err, "offset %g; allowed are finite numbers", spec->offset_m[k]);
    const char *why;
    FILE *file = infile_open(spec->file, &why);
    if (file == NULL) return build_fail(b, SH_EINPUT, err, "%s", why);
    fclose(file);
    return SH_OK;
}

static bool is_only_an_ending(const char *file)
{
    const char *name = basename(file);
    for (size_t i = 0; i < sizeof readers / sizeof readers[0]; i++)
        if (strcasecmp(name, readers[i].ending) == 0) return true;
    return false;
}

static int load_file(struct scene_build *b, const struct scene_mesh_spec *spec, struct sh_err *err)
{
    build_begin_file(b, spec);
    if (is_only_an_ending(spec->file))
        return build_fail(b, SH_EINPUT, err,
                          "its name is only an ending; allowed is a name before it: rename the file");
    for (size_t i = 0; i < sizeof readers / sizeof readers[0]; i++) {
        if (!text_has_ending(spec->file, readers[i].ending)) continue;
        int rc = check_spec(b, err);
        if (rc == SH_OK) rc = readers[i].read(b, err);
        return rc == SH_OK ? build_end_file(b, err) : rc;
    }
    return build_fail(b, SH_EINPUT, err,
                      "unknown ending; allowed are .obj .ply .stl .gltf .glb .fbx .dae .ifc .tif .tiff");
}

static int has_textures(const struct scene_mesh_spec *specs, size_t n_specs)
{
    int textures = 0;
    for (size_t i = 0; i < n_specs; i++)
        textures |= specs[i].textures;
    return textures;
}

static int look_for_cutouts(struct scene *scene, const struct scene_mesh_spec *specs, size_t n_specs,
                            const struct sh_report *report, struct sh_err *err)
{
    const int textures = has_textures(specs, n_specs);
    int cutouts = 0, rc = SH_OK;
    for (size_t i = 0; i < n_specs; i++)
        cutouts |= specs[i].cutouts;
    if (cutouts && scene->n_textures > 0) rc = scene_find_cutouts(scene, report, err);
    if (!textures) scene_drop_textures(scene);
    return rc;
}

/* Whether the mesh becomes part of the scene itself. A mesh with a list of places does not: the scene gets copies of
 * it. */
static int is_own(const struct scene_mesh_spec *spec)
{
    return spec->places.place == NULL;
}

static int load_own(const struct scene_mesh_spec *specs, size_t n_specs, double tolerance_m,
                    const struct sh_report *report, struct scene **out, struct sh_err *err)
{
    struct scene_build b;
    size_t n = 0;
    int rc = build_init(&b, tolerance_m, report, err);
    for (size_t i = 0; i < n_specs && rc == SH_OK; i++) {
        if (!is_own(&specs[i])) continue;
        rc = load_file(&b, &specs[i], err);
        n++;
    }
    if (rc == SH_OK && n > 1) geotiff_warn_beside(specs, n_specs, report);
    if (rc == SH_OK) rc = build_finish(&b, n < n_specs, out, err);
    if (rc == SH_OK) rc = look_for_cutouts(*out, specs, n_specs, report, err);
    build_release(&b);
    return rc;
}

int scene_load(const struct scene_mesh_spec *specs, size_t n_specs, double tolerance_m, const struct sh_report *report,
               struct scene **out, struct sh_err *err)
{
    *out = NULL;
    int rc = load_own(specs, n_specs, tolerance_m, report, out, err);
    for (size_t i = 0; i < n_specs && rc == SH_OK; i++) {
        struct scene_mesh_spec alone = specs[i];
        struct scene *mesh = NULL;
        if (is_own(&specs[i])) continue;
        alone.places = (struct scene_places){0};
        alone.textures = has_textures(specs, n_specs);
        rc = load_own(&alone, 1, tolerance_m, report, &mesh, err);
        if (rc == SH_OK) rc = scene_add_copies(*out, mesh, &specs[i].places, report, err);
        if (rc != SH_OK) scene_free(mesh);
    }
    if (rc == SH_OK) return rc;
    scene_free(*out);
    *out = NULL;
    return rc;
}
