/* SPDX-License-Identifier: MIT */
/* Colours and textures of a PLY mesh: red, green and blue of vertices or faces; textures by `comment TextureFile`, with
 * texture coordinates by vertex, or by face in a list texcoord. texnumber says which of several textures a face has. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/grow.h"
#include "core/import/read_ply.h"
#include "core/scene/build_surfaces.h"

static const struct ply_property *read_ply_colours_find(const struct ply *y, enum ply_kind kind, enum ply_use use)
{
    const struct ply_property *found = NULL;
    for (int i = 0; i < y->r.h.n_elements && found == NULL; i++)
        if (y->r.h.element[i].kind == kind) found = ply_find(&y->r.h, &y->r.h.element[i], use);
    return found;
}

static bool has_rgb(const struct ply *y, enum ply_kind kind)
{
    return read_ply_colours_find(y, kind, PLY_RED) != NULL && read_ply_colours_find(y, kind, PLY_GREEN) != NULL &&
           read_ply_colours_find(y, kind, PLY_BLUE) != NULL;
}

/* The factor that brings colours of this type to 0..255. 0: the type is floating, which leaves the factor open. */
static double scale_of(const struct ply_property *p)
{
    return p->type == NUMBER_FLOAT || p->type == NUMBER_DOUBLE ? 0.0 : p->type == NUMBER_U16 ? 255.0 / 65535.0 : 1.0;
}

/* ---- textures */

static int add_texture(struct ply *y, int i, uint32_t *missing, struct sh_err *err)
{
    struct scene_build *b = y->b;
    const struct build_image image = {.name = y->r.h.texture[i]};
    int rc = build_texture(b, &image, &y->texture[i], err);
    if (rc != SH_OK) return rc;
    struct scene_texture *texture = &b->scene->texture[y->texture[i] - 1];
    if (access(texture->file, F_OK) == 0) return SH_OK;
    texture->unreadable = 1;
    if ((*missing)++ == 0)
        sh_warn(b->report, "%s, line %llu: the texture '%.*s' is missing; put it beside the mesh", b->name,
                (unsigned long long)y->r.h.texture_line[i], (int)(image.name.n < 200 ? image.name.n : 200),
                image.name.p);
    return SH_OK;
}

static int keep_names(struct ply *y, struct sh_err *err)
{
    for (int i = 0; i < y->r.h.n_textures; i++) {
        y->texture_name[i] = strndup(y->r.h.texture[i].p, y->r.h.texture[i].n);
        if (y->texture_name[i] == NULL) return build_fail(y->b, SH_ENOMEM, err, "no memory for names of textures");
    }
    return SH_OK;
}

int ply_begin_textures(struct ply *y, struct sh_err *err)
{
    const int n = y->r.h.n_textures;
    uint32_t missing = 0;
    y->has_vertex_rgb = build_wants_colours(y->b) && has_rgb(y, PLY_VERTEX);
    y->has_texnumbers = n > 1 && read_ply_colours_find(y, PLY_FACE, PLY_TEXNUMBER) != NULL;
    y->has_vertex_uv =
        read_ply_colours_find(y, PLY_VERTEX, PLY_U) != NULL && read_ply_colours_find(y, PLY_VERTEX, PLY_V) != NULL;
    y->has_uv = n > 0 && build_wants_textures(y->b) &&
                (y->has_vertex_uv || read_ply_colours_find(y, PLY_FACE, PLY_TEXCOORDS) != NULL);
    int rc = keep_names(y, err);
    for (int i = 0; i < n && y->has_uv && rc == SH_OK; i++)
        rc = add_texture(y, i, &missing, err);
    if (rc != SH_OK) return rc;
    if (missing > 1) build_warn(y->b, "%u of %d textures are missing", missing, n);
    if (n > 1 && !y->has_texnumbers && y->has_uv)
        build_warn(y->b, "it names %d textures, but its faces have no texnumber: the first texture is used", n);
    if (n > 0 && !y->has_uv && build_wants_textures(y->b))
        build_warn(y->b, "it names a texture, but has no texture coordinates: the texture is not used");
    return SH_OK;
}

/* Sets the label of faces with texture i. PLY_MAX_TEXTURES stands for faces without one. A file with one texture has
 * one label. */
static int use_label(struct ply *y, int i, struct sh_err *err)
{
    const bool is_named = y->has_texnumbers && i < PLY_MAX_TEXTURES;
    const char *name = is_named ? y->texture_name[i] : "";
    const int texture = y->has_texnumbers ? i : 0;
    if (!y->has_label[i]) {
        int rc = build_label(y->b, build_base_name(y->b), text_span_of(name), &y->labels[i], err);
        if (rc != SH_OK) return rc;
        y->has_label[i] = true;
        struct scene_surface *surface = &y->b->scene->surface[y->labels[i]];
        if (texture < PLY_MAX_TEXTURES && surface->texture == 0) surface->texture = y->texture[texture];
    }
    y->label = y->labels[i];
    return SH_OK;
}

void ply_end_textures(struct ply *y)
{
    if (y->n_unfit > 0)
        build_warn(y->b,
                   "%llu faces have more or fewer texture coordinates than corners: these coordinates are left out",
                   (unsigned long long)y->n_unfit);
}

void ply_free_colours(struct ply *y)
{
    for (int i = 0; i < PLY_MAX_TEXTURES; i++)
        free(y->texture_name[i]);
    free(y->colour);
}

/* ---- colours */

void ply_begin_colours(struct ply *y)
{
    const struct ply_element *e = y->r.element;
    const bool by_face = e->kind == PLY_FACE && !y->has_vertex_rgb && build_wants_colours(y->b) && has_rgb(y, PLY_FACE);
    y->face_scale = by_face ? scale_of(ply_find(&y->r.h, e, PLY_RED)) : 0.0;
    if (by_face && y->face_scale == 0.0) y->face_scale = 255.0;
    y->has_face_rgb = by_face;
}

int ply_keep_vertex_colour(struct ply *y, struct sh_err *err)
{
    const double *v = y->r.scalar;
    if (!y->has_vertex_rgb && !(y->has_uv && y->has_vertex_uv)) return SH_OK;
    if (!grow(&y->colour, &y->cap_colours, y->n_colours + 1, sizeof *y->colour))
        return build_fail(y->b, SH_ENOMEM, err, "no memory for colours");
    struct ply_colour *c = &y->colour[y->n_colours++];
    for (int k = 0; k < 3; k++)
        c->rgb[k] = y->has_vertex_rgb ? (float)v[PLY_RED + k] : 0.0f;
    for (int k = 0; k < 2; k++)
        c->uv[k] = y->has_vertex_uv ? (float)v[PLY_U + k] : NAN;
    return SH_OK;
}

/* Floating numbers go up to 1, or up to 255: all of them together decide which. */
static double find_scale(const struct ply *y)
{
    const double scale = scale_of(read_ply_colours_find(y, PLY_VERTEX, PLY_RED));
    struct build_rgb_range range = {0};
    if (scale > 0.0) return scale;
    for (size_t i = 0; i < y->n_colours; i++)
        for (int k = 0; k < 3; k++)
            build_rgb_look(&range, (double)y->colour[i].rgb[k]);
    return build_rgb_scale(&range);
}

int ply_begin_face(struct ply *y, struct sh_err *err)
{
    const double number = y->r.scalar[PLY_TEXNUMBER];
    const bool is_one = y->r.element->kind == PLY_FACE && number >= 0 && number < y->r.h.n_textures;
    if (y->has_vertex_rgb && y->rgb_scale == 0.0) y->rgb_scale = find_scale(y);
    y->b->has_rgb = y->has_vertex_rgb || y->has_face_rgb;
    y->b->has_uv = y->has_uv;
    y->has_texcoords = y->has_uv && y->r.texcoords.n == 2 * y->r.corners.n;
    y->n_unfit += y->has_uv && y->r.texcoords.n > 0 && !y->has_texcoords;
    return use_label(y, !y->has_texnumbers || is_one ? (y->has_texnumbers ? (int)number : 0) : PLY_MAX_TEXTURES, err);
}

void ply_set_corner_colour(struct ply *y, size_t to, size_t from, uint32_t vertex)
{
    struct scene_build *b = y->b;
    const struct ply_colour *c = vertex < y->n_colours ? &y->colour[vertex] : NULL;
    if (b->has_rgb && y->has_face_rgb)
        build_rgb(b, &y->r.scalar[PLY_RED], y->face_scale, b->corner_rgb[to]);
    else if (b->has_rgb && c != NULL)
        build_rgb(b, (const double[3]){(double)c->rgb[0], (double)c->rgb[1], (double)c->rgb[2]}, y->rgb_scale,
                  b->corner_rgb[to]);
    for (size_t k = 0; k < 2 && b->has_uv; k++)
        b->corner_uv[to][k] = y->has_texcoords                ? (float)y->r.texcoords.value[2 * from + k]
                              : c != NULL && y->has_vertex_uv ? c->uv[k]
                                                              : NAN;
}
