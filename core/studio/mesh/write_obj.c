/* SPDX-License-Identifier: MIT */
/* .obj, and .mtl beside it where there is a texture or a part with one. A colour of a vertex follows its coordinates, as
 * fractions: many readers take that, though the format does not name it. */
#include <stdlib.h>

#include "core/studio/mesh/inside.h"

struct obj {
    const struct mesh *mesh;
    struct mesh_file *file;
    struct mesh_work *work;
    struct mesh_part whole; /* the only part where the mesh has none */
    char whole_name[MESH_NAME_LEN];
};

static uint32_t n_parts(const struct obj *o)
{
    return o->mesh->n_parts > 0 ? o->mesh->n_parts : 1;
}

static const struct mesh_part *part(const struct obj *o, uint32_t i)
{
    return o->mesh->n_parts > 0 ? &o->mesh->part[i] : &o->whole;
}

static int has_textures(const struct obj *o)
{
    for (uint32_t i = 0; i < n_parts(o); i++)
        if (part(o, i)->texture != NULL) return 1;
    return 0;
}

/* A name ends its line. Most readers accept blanks within it, but not all. */
static void put_name(FILE *out, const char *key, const char *name)
{
    fprintf(out, "%s ", key);
    for (; *name != '\0'; name++)
        fputc((unsigned char)*name < 0x20 || *name == 0x7f ? '?' : *name, out);
    fputc('\n', out);
}

static int write_materials(const struct obj *o, struct mesh_output *out, const char *path, struct sh_err *err)
{
    struct mesh_file *file;
    int rc = mesh_output_open(out, path, &file, err);
    if (rc != SH_OK) return rc;
    for (uint32_t i = 0; i < n_parts(o); i++) {
        const struct mesh_part *p = part(o, i);
        put_name(file->file, "newmtl", p->name);
        fputs("Ka 0 0 0\nKd 1 1 1\nKs 0 0 0\nd 1\nillum 1\n", file->file);
        if (p->texture != NULL) put_name(file->file, "map_Kd", p->texture);
    }
    return mesh_file_finish(file, err);
}

static int put_vertices(const struct obj *o, uint32_t first, uint32_t n, struct sh_err *err)
{
    const struct mesh *m = o->mesh;
    int rc = SH_OK;
    for (uint32_t i = first; rc == SH_OK && i < first + n; i++) {
        char text[3 * MESH_NUMBER_LEN + 256], *p = text;
        *p++ = 'v';
        for (int k = 0; k < 3; k++) {
            *p++ = ' ';
            p += mesh_put_number(p, m->xyz_m[i][k]);
        }
        for (int k = 0; k < 3 && m->rgb != NULL; k++)
            p += sprintf(p, " %.4g", m->rgb[i][k] / 255.0);
        if (m->uv != NULL) p += sprintf(p, "\nvt %.9g %.9g", (double)m->uv[i][0], (double)m->uv[i][1]);
        if (m->normal != NULL) {
            const float *v = m->normal[i];
            p += sprintf(p, "\nvn %.6g %.6g %.6g", (double)v[0], (double)v[1], (double)v[2]);
        }
        *p++ = '\n';
        rc = mesh_file_write(o->file, text, (size_t)(p - text), err);
        if (rc == SH_OK) rc = mesh_work_step(o->work, err);
    }
    return rc;
}

/* Vertex, texture coordinate and normal have one number. */
static int put_faces(const struct obj *o, uint32_t first, uint32_t n, struct sh_err *err)
{
    const struct mesh *m = o->mesh;
    int rc = SH_OK;
    for (uint32_t i = first; rc == SH_OK && i < first + n; i++) {
        char text[160];
        int len = 1;
        text[0] = 'f';
        for (int k = 0; k < 3; k++) {
            const uint32_t v = m->face[i][k] + 1;
            len += sprintf(text + len, " %u", v);
            if (m->uv != NULL) len += sprintf(text + len, "/%u", v);
            if (m->normal != NULL) len += sprintf(text + len, m->uv != NULL ? "/%u" : "//%u", v);
        }
        text[len++] = '\n';
        rc = mesh_file_write(o->file, text, (size_t)len, err);
        if (rc == SH_OK) rc = mesh_work_step(o->work, err);
    }
    return rc;
}

/* Points that no face uses. */
static int put_points(const struct obj *o, uint32_t first, uint32_t n, struct sh_err *err)
{
    int rc = SH_OK;
    for (uint32_t i = first; rc == SH_OK && i < first + n; i++) {
        char text[32];
        rc = mesh_file_write(o->file, text, (size_t)sprintf(text, "p %u\n", i + 1), err);
    }
    return rc;
}

static int put_parts(const struct obj *o, int materials, struct sh_err *err)
{
    uint32_t vertex = 0, face = 0;
    int rc = SH_OK;
    for (uint32_t i = 0; rc == SH_OK && i < n_parts(o); i++) {
        const struct mesh_part *p = part(o, i);
        put_name(o->file->file, "o", p->name);
        rc = put_vertices(o, vertex, p->n_vertices, err);
        if (materials) put_name(o->file->file, "usemtl", p->name);
        if (rc == SH_OK && o->mesh->face != NULL) rc = put_faces(o, face, p->n_faces, err);
        if (rc == SH_OK && o->mesh->face == NULL) rc = put_points(o, vertex, p->n_vertices, err);
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
        put_name(o->file->file, "#", o->mesh->comment[i]);
    size_t len;
    if (materials != NULL) put_name(o->file->file, "mtllib", mesh_stem(materials, &len));
    rc = put_parts(o, materials != NULL, err);
    if (rc == SH_OK) rc = mesh_file_check(o->file, err);
    if (rc == SH_OK && materials != NULL) rc = write_materials(o, out, materials, err);
    return rc == SH_OK ? mesh_output_images(out, o->mesh, err) : rc;
}

int mesh_write_obj(const struct mesh_format *format, struct mesh_output *out, const struct mesh *mesh,
                   struct mesh_work *work, struct sh_err *err)
{
    struct obj o = {.mesh = mesh, .work = work};
    size_t len;
    char *materials = NULL;
    (void)format;
    const char *name = mesh_stem(out->path, &len);
    snprintf(o.whole_name, sizeof o.whole_name, "%.*s", (int)len, name);
    o.whole = (struct mesh_part){o.whole_name, mesh->n_vertices, mesh->n_faces, mesh->texture, NULL};
    if (has_textures(&o) && (materials = mesh_beside(out->path, ".mtl")) == NULL)
        return sh_fail(err, SH_ENOMEM, "%s: no memory to write it", out->path);
    int rc = write_main(&o, out, materials, err);
    free(materials);
    return rc;
}
