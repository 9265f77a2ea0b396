/* SPDX-License-Identifier: MIT */
/* The file of a recorded mesh: objects and textures by their names, the header's facts, columns. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/studio/mesh.h"
#include "drivers/record/mesh_recorder.h"
#include "drivers/record/mesh_sparse.h"
#include "drivers/record/ply_columns.h"

static void name_parts(struct mesh_recorder *m)
{
    const char *path = m->base.file.path, *name = basename(path);
    const int stem = (int)(strlen(name) - strlen(m->base.ops->ending));
    uint8_t seen[UINT16_MAX + 1] = {0}; /* stations */
    for (size_t i = 0; i < m->n_parts; i++) {
        struct part *p = &m->part[i];
        uint8_t *again = &seen[p->station & UINT16_MAX];
        snprintf(p->name, sizeof p->name, *again ? "station %u scan %u part %zu" : "station %u", p->station, p->scan,
                 i + 1);
        *again = 1;
        if (!is_textured(m)) continue;
        if (m->n_parts == 1)
            snprintf(p->texture, sizeof p->texture, "%.*s.png", stem, name);
        else
            snprintf(p->texture, sizeof p->texture, "%.*s.%zu.png", stem, name, i + 1);
    }
}

/* Puts the facts that a header has, a line each. */
static void put_facts(const struct mesh_recorder *m, uint32_t n_sparse, FILE *out)
{
    const struct recorder_options *o = &m->base.options;
    const struct track *t = &m->base.track;
    fprintf(out, "crs %s\nepsg %d\nidn %s\nprofile %s\n", ply_crs_text(t), t->epsg, m->idn, m->profile);
    for (size_t i = 0; m->several && i < m->n_parts; i++)
        fprintf(out, "station %u scan %u profile %s\n", m->part[i].station, m->part[i].scan, m->part[i].profile);
    fprintf(out, "x y z range in metres; reflectance in dB, nan: not modelled; label 65535: none\n");
    fprintf(out, "mesh of the scan's grid, of the first echo of each shot; triangles face the head\n");
    if (m->n_edges > 0) fprintf(out, "mean_edge_m %.9g\n", m->edges_m / (double)m->n_edges);
    fprintf(out, "long_edge %g left_out %" PRIu64 "\n", o->long_edge, m->n_long);
    fprintf(out, "points_without_triangle %" PRIu64 "\n", m->n_loose);
    if (o->sparse_per_m2 > 0)
        fprintf(out, "sparse %g points per m2, seed %" PRIu64 ": %u points on %.9g m2\n", o->sparse_per_m2,
                o->sparse_seed, n_sparse, m->area_m2);
    if (t->has_colours && (!is_ply(m) || o->columns == 0 || (o->columns & PLY_COLOUR) != 0))
        ply_put_colours(out, "", t);
    ply_put_names(out, "", t->named != NULL ? t->named : t->sh);
}

/* Cuts text, which is not empty, into its lines. NULL: no memory. */
static const char **lines_of(char *text, uint32_t *n)
{
    size_t room = 0;
    const char **line = NULL;
    *n = 0;
    for (char *rest, *p = strtok_r(text, "\n", &rest); p != NULL; p = strtok_r(NULL, "\n", &rest)) {
        if (!grow(&line, &room, *n + 1, sizeof *line)) {
            free(line);
            return NULL;
        }
        line[(*n)++] = p;
    }
    return line;
}

enum { MAX_SCALARS = 5 };

static uint32_t set_scalars(const struct mesh_recorder *m, const struct mesh_points *p, unsigned columns,
                            struct mesh_scalar scalar[MAX_SCALARS])
{
    const struct {
        unsigned part;
        const char *name, *scalar_name;
        const void *value;
        enum mesh_type type;
    } all[MAX_SCALARS] = {{PLY_RANGE, "range", "scalar_range", p->range_m, MESH_DOUBLE},
                          {PLY_REFLECTANCE, "reflectance", "scalar_reflectance", p->reflectance_db, MESH_FLOAT},
                          {PLY_LABEL, "label", "scalar_label", p->label, MESH_UINT16},
                          {PLY_STATION, "station", "scalar_station", p->station, MESH_UINT16},
                          {p->has_frame ? PLY_FRAME : 0, "frame", "scalar_frame", p->frame, MESH_DOUBLE}};
    uint32_t n = 0;
    for (int i = 0; i < MAX_SCALARS; i++)
        if ((columns & all[i].part) != 0)
            scalar[n++] = (struct mesh_scalar){m->base.options.scalar_names ? all[i].scalar_name : all[i].name,
                                               all[i].value, all[i].type};
    return n;
}

/* part NULL: the points alone, without triangles. */
static int write_mesh(const struct mesh_recorder *m, const struct mesh_points *points, const struct mesh_part *part,
                      struct sh_err *err)
{
    static const uint32_t none[1][3] = {{0, 0, 0}};
    const unsigned columns = m->base.options.columns != 0 ? m->base.options.columns : PLY_ALL;
    struct mesh_scalar scalar[MAX_SCALARS];
    struct mesh mesh = {
        .n_vertices = points->n, .xyz_m = (const double(*)[3])points->xyz_m, .ascii = m->base.options.ascii};
    char *text = NULL;
    size_t len;
    FILE *out = open_memstream(&text, &len);
    if (out != NULL) put_facts(m, points->n, out);
    if (out != NULL && fclose(out) == 0) mesh.comment = lines_of(text, &mesh.n_comments);
    if (mesh.comment == NULL) {
        free(text);
        return sh_fail(err, SH_ENOMEM, "%s: no memory for its header", m->base.track.path);
    }
    if (part != NULL) {
        mesh.part = part;
        mesh.n_parts = (uint32_t)m->n_parts;
        mesh.normal = (const float(*)[3])points->normal;
        mesh.n_faces = (uint32_t)m->n_faces;
        /* with NULL here a mesh without triangles would be written as points alone */
        mesh.face = m->n_faces > 0 ? (const uint32_t(*)[3])m->face : none;
    }
    if (is_textured(m)) mesh.uv = (const float(*)[2])points->uv;
    if (is_ply(m) && m->base.track.has_colours && (columns & PLY_COLOUR) != 0)
        mesh.rgb = (const uint8_t(*)[3])points->rgb;
    mesh.scalar = scalar;
    mesh.n_scalars = set_scalars(m, points, columns, scalar);
    int rc = mesh_write(m->base.file.path, &mesh, m->base.options.report, err);
    free((void *)(uintptr_t)mesh.comment);
    free(text);
    return rc;
}

static int write_sparse(struct mesh_recorder *m, struct sh_err *err)
{
    const struct recorder_options *o = &m->base.options;
    const struct mesh_sparse sparse = {o->sparse_per_m2, o->sparse_seed, o->report};
    struct mesh_points out = {.has_frame = m->points.has_frame};
    int rc = SH_OK;
    size_t face = 0;
    for (size_t i = 0; rc == SH_OK && i < m->n_parts; i++) {
        const struct part *p = &m->part[i];
        if (p->n_faces == 0) continue;
        const struct mesh_sparse_part part = {(const uint32_t(*)[3])m->face + face, p->n_faces, p->station,
                                              p->scan << 16 | p->sweep};
        rc = name_path(m, mesh_sparse_add(&sparse, &m->points, &part, &out, &m->area_m2, err), err);
        face += p->n_faces;
    }
    if (rc == SH_OK && out.n == 0 && m->n_faces > 0)
        sh_warn(o->report, "%s: --sparse %g: no point on %.4g m2 of mesh", m->base.track.path, o->sparse_per_m2,
                m->area_m2);
    if (rc == SH_OK) rc = write_mesh(m, &out, NULL, err);
    mesh_points_free(&out);
    return rc;
}

static int write_parts(struct mesh_recorder *m, struct sh_err *err)
{
    struct mesh_part *part = calloc(m->n_parts + 1, sizeof *part);
    if (part == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", m->base.track.path);
    for (size_t i = 0; i < m->n_parts; i++)
        part[i] =
            (struct mesh_part){m->part[i].name, m->part[i].n_points, m->part[i].n_faces,
                               is_textured(m) ? m->part[i].texture : NULL, is_textured(m) ? &m->part[i].image : NULL};
    const int rc = write_mesh(m, &m->points, part, err);
    free(part);
    return rc;
}

int mesh_recorder_write(struct mesh_recorder *m, struct sh_err *err)
{
    name_parts(m);
    return m->base.options.sparse_per_m2 > 0 && is_ply(m) ? write_sparse(m, err) : write_parts(m, err);
}
