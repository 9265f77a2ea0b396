/* SPDX-License-Identifier: MIT */
/* .ply: little-endian, or text. Vertices, then faces. */
#include <math.h>
#include <string.h>

#include "core/decimal.h"
#include "core/studio/mesh/inside.h"

enum { MAX_SCALARS = 8 };
enum { ROW = (3 + 3 + 3 + 2 + MAX_SCALARS) * (DECIMAL_GENERAL_ROOM + 1) }; /* bytes of a vertex; a face has less */

static const char *const type_name[] = {"double", "float", "ushort"};

static void put_header(FILE *out, const struct mesh *m)
{
    fprintf(out, "ply\nformat %s 1.0\n", m->ascii ? "ascii" : "binary_little_endian");
    for (uint32_t i = 0; i < m->n_comments; i++)
        mesh_put_line(out, "comment ", m->comment[i]);
    if (m->texture != NULL) mesh_put_line(out, "comment TextureFile ", m->texture);
    fprintf(out, "element vertex %u\nproperty double x\nproperty double y\nproperty double z\n", m->n_vertices);
    if (m->normal != NULL) fputs("property float nx\nproperty float ny\nproperty float nz\n", out);
    if (m->rgb != NULL) fputs("property uchar red\nproperty uchar green\nproperty uchar blue\n", out);
    if (m->uv != NULL) fputs("property float s\nproperty float t\n", out);
    for (uint32_t i = 0; i < m->n_scalars; i++)
        fprintf(out, "property %s %s\n", type_name[m->scalar[i].type], m->scalar[i].name);
    if (m->face != NULL) fprintf(out, "element face %u\nproperty list uchar int vertex_indices\n", m->n_faces);
    if (m->face != NULL && m->face_rgb != NULL)
        fputs("property uchar red\nproperty uchar green\nproperty uchar blue\n", out);
    fputs("end_header\n", out);
}

/* Bytes of a row, in the byte order of the machine, which is little-endian (core needs x86 or ARM). */
struct row {
    uint8_t byte[ROW];
    size_t n;
    int ascii;
};

static void put_bytes(struct row *r, const void *data, size_t n)
{
    memcpy(r->byte + r->n, data, n);
    r->n += n;
}

/* Returns the place of the next figure in a row of text. end_text takes the figure's end. */
static char *begin_text(struct row *r)
{
    if (r->n > 0) r->byte[r->n++] = ' ';
    return (char *)r->byte + r->n;
}

static void end_text(struct row *r, const char *end)
{
    r->n = (size_t)(end - (const char *)r->byte);
}

static void put_double(struct row *r, double v)
{
    if (!r->ascii)
        put_bytes(r, &v, sizeof v);
    else if (isfinite(v))
        end_text(r, mesh_put_number(begin_text(r), v));
    else
        end_text(r, stpcpy(begin_text(r), isnan(v) ? "nan" : v < 0 ? "-inf" : "inf"));
}

static void put_float(struct row *r, float v)
{
    if (!r->ascii)
        put_bytes(r, &v, sizeof v);
    else if (isnan(v))
        end_text(r, stpcpy(begin_text(r), "nan"));
    else
        end_text(r, decimal_put_general(begin_text(r), (double)v, 9));
}

/* Puts a whole number of `size` bytes: 1, 2 or 4. */
static void put_whole(struct row *r, uint32_t v, size_t size)
{
    if (r->ascii)
        end_text(r, decimal_put_whole(begin_text(r), v));
    else
        put_bytes(r, &v, size);
}

static void put_scalar(struct row *r, const struct mesh_scalar *s, uint32_t i)
{
    if (s->type == MESH_DOUBLE)
        put_double(r, ((const double *)s->value)[i]);
    else if (s->type == MESH_FLOAT)
        put_float(r, ((const float *)s->value)[i]);
    else
        put_whole(r, ((const uint16_t *)s->value)[i], 2);
}

static void put_rgb(struct row *r, const uint8_t rgb[3])
{
    for (int k = 0; k < 3; k++)
        put_whole(r, rgb[k], 1);
}

static void put_vertex(struct row *r, const struct mesh *m, uint32_t i)
{
    for (int k = 0; k < 3; k++)
        put_double(r, m->xyz_m[i][k]);
    for (int k = 0; k < 3 && m->normal != NULL; k++)
        put_float(r, m->normal[i][k]);
    if (m->rgb != NULL) put_rgb(r, m->rgb[i]);
    for (int k = 0; k < 2 && m->uv != NULL; k++)
        put_float(r, m->uv[i][k]);
    for (uint32_t k = 0; k < m->n_scalars; k++)
        put_scalar(r, &m->scalar[k], i);
}

static void put_face(struct row *r, const struct mesh *m, uint32_t i)
{
    put_whole(r, 3, 1);
    for (int k = 0; k < 3; k++)
        put_whole(r, m->face[i][k], 4);
    if (m->face_rgb != NULL) put_rgb(r, m->face_rgb[i]);
}

static int put_rows(struct mesh_file *file, const struct mesh *m, uint32_t n,
                    void (*put)(struct row *r, const struct mesh *m, uint32_t i), struct mesh_work *work,
                    struct sh_err *err)
{
    struct row r = {.ascii = m->ascii};
    int rc = SH_OK;
    for (uint32_t i = 0; rc == SH_OK && i < n; i++) {
        r.n = 0;
        put(&r, m, i);
        if (r.ascii) r.byte[r.n++] = '\n';
        rc = mesh_file_write(file, r.byte, r.n, err);
        if (rc == SH_OK) rc = mesh_work_step(work, err);
    }
    return rc;
}

int mesh_write_ply(const struct mesh_format *format, struct mesh_output *out, const struct mesh *mesh,
                   struct mesh_work *work, struct sh_err *err)
{
    struct mesh_file *file;
    (void)format;
    if (mesh->n_scalars > MAX_SCALARS)
        return sh_fail(err, SH_EINPUT, "%s: %u figures per vertex; allowed are up to %d", out->path, mesh->n_scalars,
                       MAX_SCALARS);
    int rc = mesh_output_open(out, out->path, &file, err);
    if (rc != SH_OK) return rc;
    put_header(file->file, mesh);
    rc = put_rows(file, mesh, mesh->n_vertices, put_vertex, work, err);
    return rc == SH_OK && mesh->face != NULL ? put_rows(file, mesh, mesh->n_faces, put_face, work, err) : rc;
}
