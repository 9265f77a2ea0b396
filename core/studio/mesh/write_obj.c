/* SPDX-License-Identifier: MIT */
/* .obj, and .mtl where the mesh or a part has a texture. A colour of a vertex follows its coordinates, as fractions:
 * many readers take that, though the format does not name it. */
#include <stdlib.h>
#include <string.h>

#include "core/decimal.h"
#include "core/studio/mesh/inside.h"

enum { ROWS_AT_ONCE = 64, ROW_ROOM = 11 * (DECIMAL_GENERAL_ROOM + 1) + 16 /* a vertex; a face has less */ };

struct obj {
    const struct mesh *mesh;
    struct mesh_file *file;
    struct mesh_work *work;
};

static int has_textures(const struct mesh *mesh)
{
    for (uint32_t i = 0; i < mesh->n_parts; i++)
        if (mesh->part[i].texture != NULL) return 1;
    return 0;
}

/* The name of a material ends at a blank: for many readers the rest of the line is something else. */
static void put_material(FILE *out, const char *key, const char *name)
{
    fputs(key, out);
    for (; *name != '\0'; name++)
        fputc(*name == ' ' ? '_' : (unsigned char)*name < 0x20 || *name == 0x7f ? '?' : *name, out);
    fputc('\n', out);
}

static int write_materials(const struct obj *o, struct mesh_output *out, const char *path, struct sh_err *err)
{
    struct mesh_file *file;
    int rc = mesh_output_open(out, path, &file, err);
    if (rc != SH_OK) return rc;
    for (uint32_t i = 0; i < o->mesh->n_parts; i++) {
        const struct mesh_part *p = &o->mesh->part[i];
        put_material(file->file, "newmtl ", p->name);
        fputs("Ka 0 0 0\nKd 1 1 1\nKs 0 0 0\nd 1\nillum 1\n", file->file);
        if (p->texture != NULL) mesh_put_line(file->file, "map_Kd ", p->texture);
    }
    return mesh_file_finish(file, err);
}

static char *put_vertex(char *p, const struct mesh *m, uint32_t i)
{
    *p++ = 'v';
    for (int k = 0; k < 3; k++) {
        *p++ = ' ';
        p = mesh_put_number(p, m->xyz_m[i][k]);
    }
    for (int k = 0; k < 3 && m->rgb != NULL; k++) {
        *p++ = ' ';
        p = decimal_put_general(p, m->rgb[i][k] / 255.0, 4);
    }
    for (int k = 0; k < 2 && m->uv != NULL; k++) {
        p = k == 0 ? stpcpy(p, "\nvt ") : stpcpy(p, " ");
        p = decimal_put_general(p, (double)m->uv[i][k], 9);
    }
    for (int k = 0; k < 3 && m->normal != NULL; k++) {
        p = k == 0 ? stpcpy(p, "\nvn ") : stpcpy(p, " ");
        p = decimal_put_general(p, (double)m->normal[i][k], 6);
    }
    *p++ = '\n';
    return p;
}

/* Writes a face. A vertex, its texture coordinate and its normal have the same number. */
static char *put_face(char *p, const struct mesh *m, uint32_t i)
{
    *p++ = 'f';
    for (int k = 0; k < 3; k++) {
        const uint32_t v = m->face[i][k] + 1;
        *p++ = ' ';
        p = decimal_put_whole(p, v);
        if (m->uv == NULL && m->normal == NULL) continue;
        *p++ = '/';
        if (m->uv != NULL) p = decimal_put_whole(p, v);
        if (m->normal == NULL) continue;
        *p++ = '/';
        p = decimal_put_whole(p, v);
    }
    *p++ = '\n';
    return p;
}

/* Writes a point that no face uses. */
static char *put_point(char *p, const struct mesh *m, uint32_t i)
{
    (void)m;
    p = decimal_put_whole(stpcpy(p, "p "), i + 1);
    *p++ = '\n';
    return p;
}

/* Writes n rows. work: counts them; NULL: they don't count. */
static int put_rows(const struct obj *o, char *(*put)(char *p, const struct mesh *m, uint32_t i), uint32_t first,
                    uint32_t n, struct mesh_work *work, struct sh_err *err)
{
    char text[ROWS_AT_ONCE * ROW_ROOM], *p = text;
    int rc = SH_OK;
    for (uint32_t i = 0; rc == SH_OK && i < n; i++) {
        p = put(p, o->mesh, first + i);
        if (i % ROWS_AT_ONCE == ROWS_AT_ONCE - 1 || i == n - 1) {
            rc = mesh_file_write(o->file, text, (size_t)(p - text), err);
            p = text;
        }
        if (rc == SH_OK && work != NULL) rc = mesh_work_step(work, err);
    }
    return rc;
}

static int put_parts(const struct obj *o, int materials, struct sh_err *err)
{
    uint32_t vertex = 0, face = 0;
    int rc = SH_OK;
    for (uint32_t i = 0; rc == SH_OK && i < o->mesh->n_parts; i++) {
        const struct mesh_part *p = &o->mesh->part[i];
        mesh_put_line(o->file->file, "o ", p->name);
        rc = put_rows(o, put_vertex, vertex, p->n_vertices, o->work, err);
        if (materials) put_material(o->file->file, "usemtl ", p->name);
        if (rc == SH_OK && o->mesh->face != NULL) rc = put_rows(o, put_face, face, p->n_faces, o->work, err);
        if (rc == SH_OK && o->mesh->face == NULL) rc = put_rows(o, put_point, vertex, p->n_vertices, NULL, err);
        vertex += p->n_vertices;
        face += p->n_faces;
    }
    return rc;
}

static int write_main(struct obj *o, struct mesh_output *out, const char *materials, struct sh_err *err)
{
    int rc = mesh_output_open(out, out->path, &o->file, err);
    if (rc != SH_OK) return rc;
    for (uint32_t i = 0; i < o->mesh->n_comments; i++)
        mesh_put_line(o->file->file, "# ", o->mesh->comment[i]);
    size_t len;
    if (materials != NULL) mesh_put_line(o->file->file, "mtllib ", mesh_stem(materials, &len));
    rc = put_parts(o, materials != NULL, err);
    if (rc == SH_OK) rc = mesh_file_check(o->file, err);
    if (rc == SH_OK && materials != NULL) rc = write_materials(o, out, materials, err);
    return rc == SH_OK ? mesh_output_images(out, o->mesh, err) : rc;
}

int mesh_write_obj(const struct mesh_format *format, struct mesh_output *out, const struct mesh *mesh,
                   struct mesh_work *work, struct sh_err *err)
{
    struct obj o = {.mesh = mesh, .work = work};
    char *materials = NULL;
    (void)format;
    if (has_textures(mesh) && (materials = mesh_with_ending(out->path, ".mtl")) == NULL)
        return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", out->path);
    int rc = write_main(&o, out, materials, err);
    free(materials);
    return rc;
}
