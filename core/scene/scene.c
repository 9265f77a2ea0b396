/* SPDX-License-Identifier: MIT */
#include "core/scene.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "core/grow.h"
#include "core/scene/build.h"

const struct scene_import_limits scene_import_defaults = {.memory_mib = 8192, .time_s = 300, .files = 64};

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
    struct stat st;
    if (stat(spec->file, &st) != 0) return build_fail(b, SH_EINPUT, err, "%s", strerror(errno));
    if (!S_ISREG(st.st_mode)) return build_fail(b, SH_EINPUT, err, "not a file");
    return SH_OK;
}

static int load_file(struct scene_build *b, const struct scene_mesh_spec *spec, struct sh_err *err)
{
    build_begin_file(b, spec);
    size_t len = strlen(spec->file);
    for (size_t i = 0; i < sizeof readers / sizeof readers[0]; i++) {
        size_t ending_len = strlen(readers[i].ending);
        if (len <= ending_len || strcasecmp(spec->file + len - ending_len, readers[i].ending) != 0) continue;
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

/* Whether the mesh is one of the scene's own. */
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

static int copy_surfaces(struct scene_build *b, const struct scene_arrays *arrays, struct sh_err *err)
{
    static const struct scene_surface only = {.object = "object", .material = "material"};
    const struct scene_surface *surface = arrays->surface != NULL ? arrays->surface : &only;
    uint32_t n = arrays->surface != NULL ? arrays->n_surfaces : 1;
    if (n == 0 || n > SCENE_MAX_SURFACES)
        return build_fail(b, SH_EINPUT, err, "%u surfaces; allowed are 1 to %d", n, SCENE_MAX_SURFACES);
    if (!grow(&b->scene->surface, &b->cap_surfaces, n, sizeof *surface))
        return build_fail(b, SH_ENOMEM, err, "no memory for %u surfaces", n);
    memcpy(b->scene->surface, surface, n * sizeof *surface);
    for (uint32_t i = 0; i < n; i++) {
        if (memchr(surface[i].object, '\0', SCENE_NAME_LEN) == NULL ||
            memchr(surface[i].material, '\0', SCENE_NAME_LEN) == NULL)
            return build_fail(b, SH_EINPUT, err, "surface %u: a name has no end", i);
        b->scene->surface[i].texture = b->scene->surface[i].opacity = b->scene->surface[i].vertex_colours = 0;
    }
    b->scene->n_surfaces = n;
    return SH_OK;
}

static int copy_triangles(struct scene_build *b, const struct scene_arrays *arrays, struct sh_err *err)
{
    int rc = build_reserve(b, 0, arrays->n_triangles, err);
    if (rc == SH_OK) rc = build_corners(b, 3, err);
    for (uint32_t i = 0; i < arrays->n_triangles && rc == SH_OK; i++) {
        const uint32_t *corner = arrays->triangle[i];
        uint16_t label = arrays->label != NULL ? arrays->label[i] : 0;
        for (int k = 0; k < 3; k++)
            if (corner[k] >= b->scene->n_vertices)
                return build_fail(b, SH_EINPUT, err, "triangle %u: index %u out of range; there are %u vertices", i,
                                  corner[k], b->scene->n_vertices);
        if (label >= b->scene->n_surfaces)
            return build_fail(b, SH_EINPUT, err, "triangle %u: label %u out of range; there are %u surfaces", i, label,
                              b->scene->n_surfaces);
        memcpy(b->corner, corner, sizeof arrays->triangle[i]);
        rc = build_polygon(b, 3, label, err);
    }
    return rc;
}

int scene_from_arrays(const struct scene_arrays *arrays, struct scene **out, struct sh_err *err)
{
    static const struct scene_mesh_spec spec = {.file = "arrays", .scale = 1};
    struct scene_build b;
    *out = NULL;
    int rc = build_init(&b, 0, NULL, err);
    if (rc == SH_OK) {
        build_begin_file(&b, &spec);
        rc = copy_surfaces(&b, arrays, err);
    }
    if (rc == SH_OK) rc = build_reserve(&b, arrays->n_vertices, 0, err);
    for (uint32_t i = 0; i < arrays->n_vertices && rc == SH_OK; i++)
        rc = build_vertex(&b, arrays->vertex_m[i], err);
    if (rc == SH_OK) rc = copy_triangles(&b, arrays, err);
    if (rc == SH_OK) {
        b.scene->n_meshes = 1;
        rc = build_end_file(&b, err);
    }
    if (rc == SH_OK) rc = build_finish(&b, 0, out, err);
    build_release(&b);
    return rc;
}

void scene_free(struct scene *scene)
{
    if (scene == NULL) return;
    for (uint32_t i = 0; i < scene->n_copied; i++) {
        scene_free(scene->copied[i].mesh);
        free(scene->copied[i].copy);
    }
    free(scene->copied);
    free(scene->vertex_m);
    free(scene->triangle);
    free(scene->label);
    free(scene->surface);
    free(scene->uv);
    free(scene->rgb);
    for (uint32_t i = 0; i < scene->n_textures; i++) {
        free(scene->texture[i].file);
        free(scene->texture[i].bytes);
    }
    free(scene->texture);
    for (uint32_t i = 0; i < scene->n_masks; i++)
        free(scene->mask[i]);
    free(scene->mask);
    free(scene->cutout);
    free(scene);
}
