/* SPDX-License-Identifier: MIT */
#include "core/studio/mesh.h"

#include <math.h>
#include <string.h>

#include "core/studio/mesh/inside.h"
#include "core/text.h"
#include "core/vec3.h"

static const struct mesh_format formats[] = {
    {.ending = ".ply", .takes_points = 1, .write = mesh_write_ply},
    {.ending = ".obj", .takes_points = 1, .write = mesh_write_obj},
    {.ending = ".gltf", .is_float = 1, .exporter = "gltf2", .write = mesh_write_assimp},
    {.ending = ".glb", .is_float = 1, .exporter = "glb2", .write = mesh_write_assimp},
    {.ending = ".fbx", .is_float = 1, .exporter = "fbx", .write = mesh_write_assimp},
};
enum { N_FORMATS = sizeof formats / sizeof formats[0] };

static const double FLOAT_HALF_STEP = 0x1p-24; /* the largest relative error of rounding to float */
static const double FLOAT_LEAST_M = 1e-6;

static const struct mesh_format *mesh_find(const char *path)
{
    for (size_t i = 0; i < N_FORMATS; i++)
        if (text_has_ending(path, formats[i].ending)) return &formats[i];
    return NULL;
}

int mesh_has_format(const char *path)
{
    return mesh_find(path) != NULL;
}

int mesh_takes_points(const char *path)
{
    const struct mesh_format *format = mesh_find(path);
    return format != NULL && format->takes_points;
}

int mesh_is_float(const char *path)
{
    const struct mesh_format *format = mesh_find(path);
    return format != NULL && format->is_float;
}

int mesh_check_box(const char *path, const double low[3], const double high[3], struct sh_err *err)
{
    const struct mesh_format *format = mesh_find(path);
    double size2 = 0, most = 0;
    if (format == NULL || !format->is_float) return SH_OK;
    for (int k = 0; k < 3; k++) {
        size2 += (high[k] - low[k]) * (high[k] - low[k]);
        most = fmax(most, fmax(fabs(low[k]), fabs(high[k])));
    }
    const double error = most * FLOAT_HALF_STEP, allowed = fmax(FLOAT_LEAST_M, MESH_FLOAT_PART * sqrt(size2));
    if (error <= allowed) return SH_OK;
    return sh_fail(
        err, SH_EINPUT,
        "%s: %s holds coordinates as float, which moves coordinates of %.0f m by up to %.2g m; allowed for a mesh of "
        "%.4g m are %.2g m: write .ply or .obj, or keep coordinates near 0 (output.crs: local)",
        path, format->ending, most, error, sqrt(size2), allowed);
}

static int check_vertices(const char *path, const struct mesh *mesh, struct sh_err *err)
{
    double low[3], high[3];
    vec3_bound_nothing(low, high);
    for (uint32_t i = 0; i < mesh->n_vertices; i++) {
        const double *v = mesh->xyz_m[i];
        if (!isfinite(v[0]) || !isfinite(v[1]) || !isfinite(v[2]))
            return sh_fail(err, SH_EINPUT, "%s: vertex %u of %u is not finite: %g %g %g", path, i + 1, mesh->n_vertices,
                           v[0], v[1], v[2]);
        vec3_bound(low, high, v);
        if (mesh->normal != NULL && !(isfinite(mesh->normal[i][0] + mesh->normal[i][1] + mesh->normal[i][2])))
            return sh_fail(err, SH_EINPUT, "%s: the normal of vertex %u is not finite", path, i + 1);
        if (mesh->uv != NULL && !isfinite(mesh->uv[i][0] + mesh->uv[i][1]))
            return sh_fail(err, SH_EINPUT, "%s: the texture coordinate of vertex %u is not finite", path, i + 1);
    }
    return mesh->n_vertices > 0 ? mesh_check_box(path, low, high, err) : SH_OK;
}

/* Faces of a part, or of the whole mesh, and the vertices that they may use. */
struct range {
    uint32_t face, face_end, vertex, vertex_end;
};

static int check_faces(const char *path, const struct mesh *mesh, const struct range *in, struct sh_err *err)
{
    for (uint32_t i = in->face; i < in->face_end; i++)
        for (int k = 0; k < 3; k++)
            if (mesh->face[i][k] < in->vertex || mesh->face[i][k] >= in->vertex_end)
                return sh_fail(err, SH_EINPUT, "%s: face %u uses vertex %u; allowed are %u to %u", path, i + 1,
                               mesh->face[i][k], in->vertex, in->vertex_end - 1);
    return SH_OK;
}

static int check_parts(const char *path, const struct mesh *mesh, struct sh_err *err)
{
    uint64_t vertex = 0, face = 0;
    if (mesh->n_parts > MESH_MAX_PARTS)
        return sh_fail(err, SH_EINPUT, "%s: %u parts; allowed are up to %d", path, mesh->n_parts, MESH_MAX_PARTS);
    for (uint32_t i = 0; i < mesh->n_parts; i++) {
        const struct mesh_part *p = &mesh->part[i];
        if (vertex + p->n_vertices > mesh->n_vertices || face + p->n_faces > mesh->n_faces) break;
        const struct range in = {(uint32_t)face, (uint32_t)face + p->n_faces, (uint32_t)vertex,
                                 (uint32_t)vertex + p->n_vertices};
        int rc = check_faces(path, mesh, &in, err);
        if (rc != SH_OK) return rc;
        vertex += p->n_vertices;
        face += p->n_faces;
    }
    if (vertex != mesh->n_vertices || face != mesh->n_faces)
        return sh_fail(err, SH_EINPUT, "%s: its parts do not add up to its %u vertices and %u faces", path,
                       mesh->n_vertices, mesh->n_faces);
    return SH_OK;
}

static int check(const char *path, const struct mesh_format *format, const struct mesh *mesh, struct sh_err *err)
{
    if (mesh->n_vertices > MESH_MAX_VERTICES)
        return sh_fail(err, SH_EINPUT, "%s: %u vertices; allowed are up to %d", path, mesh->n_vertices,
                       MESH_MAX_VERTICES);
    if ((mesh->face == NULL || mesh->n_faces == 0) && !format->takes_points)
        return sh_fail(err, SH_EINPUT, "%s: %s holds meshes, but there are no faces; allowed for points are .ply .obj",
                       path, format->ending);
    if (mesh->texture != NULL && mesh->uv == NULL)
        return sh_fail(err, SH_EINPUT, "%s: it has a texture but no texture coordinates", path);
    int rc = check_vertices(path, mesh, err);
    if (rc == SH_OK && mesh->n_parts > 0) return check_parts(path, mesh, err);
    const struct range all = {0, mesh->n_faces, 0, mesh->n_vertices};
    return rc == SH_OK && mesh->face != NULL ? check_faces(path, mesh, &all, err) : rc;
}

int mesh_write(const char *path, const struct mesh *mesh, const struct sh_report *report, struct sh_err *err)
{
    const struct mesh_format *format = mesh_find(path);
    if (format == NULL)
        return sh_fail(err, SH_EINPUT, "%s: no mesh format has this ending; allowed are .ply .obj .gltf .glb .fbx",
                       path);
    struct mesh_work work = {.report = report, .all = (uint64_t)mesh->n_vertices + mesh->n_faces};
    size_t len;
    const char *name = mesh_stem(path, &len);
    snprintf(work.what, sizeof work.what, "writing %s", name);
    int rc = mesh_check_name(path, err);
    if (rc == SH_OK) rc = check(path, format, mesh, err);
    if (rc != SH_OK) return rc;
    /* A mesh without parts is one part, named as the file. Assimp's exporter must not get that name: it would choose
     * another one for the .bin of a .gltf. */
    struct mesh_output out = {.path = path};
    struct mesh parts = *mesh;
    char stem[MESH_NAME_LEN];
    snprintf(stem, sizeof stem, "%.*s", (int)len, name);
    const struct mesh_part whole = {format->exporter != NULL ? "mesh" : stem, mesh->n_vertices, mesh->n_faces,
                                    mesh->texture, NULL};
    if (mesh->n_parts == 0) {
        parts.part = &whole;
        parts.n_parts = 1;
    }
    rc = format->write(format, &out, &parts, &work, err);
    const int closed = mesh_output_close(&out, rc == SH_OK, err);
    return rc != SH_OK ? rc : closed;
}
