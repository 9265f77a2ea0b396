/* SPDX-License-Identifier: MIT */
/* Adds the triangles of a mesh's primitives to the builder. Points and lines are left out and counted. A vertex is
 * added when a triangle first uses it, since primitives may share accessors that are much larger than themselves. */
#include "core/import/gltf/gltf_mesh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/colour.h"
#include "core/import/gltf/gltf.h"
#include "core/import/gltf/gltf_at.h"
#include "core/import/gltf/gltf_json.h"
#include "core/import/gltf/gltf_material.h"
#include "core/import/gltf/gltf_pose.h"
#include "core/scene/build_surfaces.h"

enum { POINTS, LINES, LINE_LOOP, LINE_STRIP, TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN, N_MODES };

struct part {
    struct gltf *g;
    struct gltf_pose pose;
    struct gltf_look look;
    struct gltf_view index, uv, colour; /* count GLTF_NONE: there is none */
    bool has_alpha;                     /* colour has opacities */
    const double (*world)[4];
    uint32_t *vertex; /* [pose.position.count] 1 + its number in the scene; 0: not added yet */
};

static int add_vertex(struct part *p, uint32_t i)
{
    struct gltf *g = p->g;
    double v[3];
    int rc = gltf_pose_vertex(g, &p->pose, i, v);
    if (rc == SH_OK && p->pose.joint == NULL) gltf_apply(p->world, v, v);
    if (rc == SH_OK) rc = build_vertex(g->b, v, g->err);
    if (rc == SH_OK) p->vertex[i] = g->b->scene->n_vertices;
    return rc;
}

static void add_uv(struct part *p, uint32_t i, float out[2])
{
    const double u = gltf_value(&p->uv, i, 0), v = gltf_value(&p->uv, i, 1);
    const double(*m)[3] = (const double(*)[3])p->look.uv;
    out[0] = (float)(m[0][0] * u + m[0][1] * v + m[0][2]);
    out[1] = (float)(1.0 - (m[1][0] * u + m[1][1] * v + m[1][2])); /* rows count from below in a scene */
}

/* COLOR_0 is linear light. */
static void add_rgb(const struct part *p, uint32_t i, uint8_t out[4])
{
    double rgb[3];
    for (uint32_t k = 0; k < 3; k++)
        rgb[k] = (double)colour_srgb_encode(gltf_value(&p->colour, i, k));
    build_rgb(p->g->b, rgb, 255.0, out);
}

/* Finds the vertex of a corner: place `at` in the list of indices, or without that list, in the list of vertices. */
static int find_vertex(const struct part *p, uint32_t at, uint32_t *vertex)
{
    const double number = p->index.count != GLTF_NONE ? gltf_value(&p->index, at, 0) : at;
    if (number >= (double)p->pose.position.count)
        return gltf_fail(p->g, "index %.0f out of range; there are %u vertices", number, p->pose.position.count);
    *vertex = (uint32_t)number;
    return SH_OK;
}

/* Sets corner c of the next triangle to vertex i. */
static int take_corner(struct part *p, uint32_t i, int c)
{
    struct scene_build *b = p->g->b;
    int rc = p->vertex[i] == 0 ? add_vertex(p, i) : SH_OK;
    if (rc != SH_OK) return rc;
    b->corner[c] = p->vertex[i] - 1;
    if (b->has_uv) add_uv(p, i, b->corner_uv[c]);
    if (b->has_rgb) add_rgb(p, i, b->corner_rgb[c]);
    return SH_OK;
}

/* Whether an opacity of corners makes a hole. Those of glTF have single precision, and so has the comparison: 0.9f is
 * below 0.9 of the JSON, but the file means the same number. */
static bool is_below(const struct part *p, double alpha)
{
    return (float)(alpha * p->look.opacity) < (float)p->look.cutoff;
}

/* Whether a triangle is a hole all over: no point of it has more opacity than its corners. Other opacities of corners
 * have no place in a scene. They are counted. */
static bool is_hole(struct part *p, const uint32_t vertex[3])
{
    double most = 0.0, least = 1.0;
    if (!(p->look.cutoff > 0.0)) return false;
    for (int c = 0; c < 3; c++) {
        const double alpha = p->has_alpha ? fmin(fmax(gltf_value(&p->colour, vertex[c], 3), 0.0), 1.0) : 1.0;
        most = fmax(most, alpha);
        least = fmin(least, alpha);
    }
    const bool is = is_below(p, most);
    if (is) p->g->n_holes++;
    if (!is && least < 1.0 && (p->look.has_texture || is_below(p, least))) p->g->n_faded++;
    return is;
}

/* glTF 2.0, 3.7.4: where the transform's determinant is negative, the front is clockwise. build_polygon takes the front
 * as counter-clockwise, so the triangle is turned over. Where joints disagree, those of two corners decide. */
static bool is_turned_over(const struct part *p, const uint32_t vertex[3])
{
    int n = 0;
    for (int c = 0; c < 3; c++)
        n += gltf_pose_is_mirrored(&p->pose, p->world, vertex[c]);
    return n >= 2;
}

/* corner has three places as find_vertex has them. */
static int add_triangle(struct part *p, const uint32_t corner[3])
{
    struct scene_build *b = p->g->b;
    uint32_t vertex[3];
    int rc = SH_OK;
    b->has_uv = p->uv.count != GLTF_NONE;
    b->has_rgb = p->colour.count != GLTF_NONE && build_wants_colours(b);
    for (int c = 0; c < 3 && rc == SH_OK; c++)
        rc = find_vertex(p, corner[c], &vertex[c]);
    if (rc == SH_OK && (p->g->n_done++ & 0xffff) == 0)
        rc = build_progress(b, (double)p->g->n_drawn / ((double)p->g->n_nodes + 1.0), p->g->err);
    if (rc != SH_OK || is_hole(p, vertex)) return rc;
    for (int c = 0; c < 3 && rc == SH_OK; c++)
        rc = take_corner(p, vertex[c], c);
    if (rc != SH_OK) return rc;
    if (is_turned_over(p, vertex)) build_turn_over(b, 3);
    return build_polygon(b, 3, p->look.label, p->g->err);
}

/* Left-over corners that make no whole triangle count as one triangle left out. */
static int add_triangles(struct part *p, uint32_t mode, uint32_t n)
{
    const uint32_t n_triangles = mode == TRIANGLES ? n / 3 : n > 2 ? n - 2 : 0;
    int rc = SH_OK;
    for (uint32_t i = 0; i < n_triangles && rc == SH_OK; i++) {
        const uint32_t odd = i & 1;
        const uint32_t list[3] = {3 * i, 3 * i + 1, 3 * i + 2}, strip[3] = {i, i + 1 + odd, i + 2 - odd},
                       fan[3] = {i + 1, i + 2, 0};
        rc = add_triangle(p, mode == TRIANGLES ? list : mode == TRIANGLE_STRIP ? strip : fan);
    }
    if (mode == TRIANGLES ? n % 3 != 0 : n > 0 && n < 3) p->g->b->counts.not_triangles++;
    return rc;
}

static int add_elements(struct part *p, uint64_t mode, const char *at)
{
    const uint32_t n = p->index.count != GLTF_NONE ? p->index.count : p->pose.position.count;
    uint64_t *left_out = &p->g->b->counts.not_triangles;
    switch (mode) {
    case POINTS:
    case LINE_LOOP:
        *left_out += n;
        return SH_OK;
    case LINES:
        *left_out += n / 2;
        return SH_OK;
    case LINE_STRIP:
        *left_out += n > 0 ? n - 1 : 0;
        return SH_OK;
    case TRIANGLES:
    case TRIANGLE_STRIP:
    case TRIANGLE_FAN:
        return add_triangles(p, (uint32_t)mode, n);
    }
    return gltf_fail(p->g, "%s.mode is %llu; allowed are 0 to %d", at, (unsigned long long)mode, N_MODES - 1);
}

static int open_index(struct part *p, const json_t *primitive, const char *at)
{
    uint32_t accessor;
    p->index.count = GLTF_NONE;
    int rc = gltf_index(p->g, primitive, "indices", at, &accessor);
    if (rc != SH_OK || accessor == GLTF_NONE) return rc;
    rc = gltf_view_open(p->g, accessor, "SCALAR", &p->index);
    const enum gltf_component is = p->index.component;
    if (rc == SH_OK && ((is != GLTF_U8 && is != GLTF_U16 && is != GLTF_U32) || p->index.is_normalized))
        rc = gltf_fail(p->g, "%s.indices: accessors[%u] has numbers that are not whole or below 0", at, accessor);
    return rc;
}

/* A material may ask for coordinates that a primitive doesn't have: then it has no texture there. */
static int open_uv(struct part *p, const json_t *attributes, const char *at)
{
    uint32_t accessor;
    p->uv.count = GLTF_NONE;
    if (!p->look.has_texture) return SH_OK;
    int rc = gltf_index(p->g, attributes, gltf_at("TEXCOORD_%u", p->look.uv_set).text, at, &accessor);
    if (rc == SH_OK && accessor == GLTF_NONE) p->g->n_unmapped++;
    if (rc != SH_OK || accessor == GLTF_NONE) return rc;
    rc = gltf_view_open(p->g, accessor, "VEC2", &p->uv);
    if (rc == SH_OK && p->uv.count < p->pose.position.count)
        rc = gltf_fail(p->g, "%s: %u texture coordinates for %u vertices", at, p->uv.count, p->pose.position.count);
    return rc;
}

static int open_colour(struct part *p, const json_t *attributes, const char *at)
{
    uint32_t accessor;
    json_t *of = NULL;
    p->colour.count = GLTF_NONE;
    if (!build_wants_colours(p->g->b) && !(p->look.cutoff > 0.0)) return SH_OK;
    int rc = gltf_index(p->g, attributes, "COLOR_0", at, &accessor);
    if (rc != SH_OK || accessor == GLTF_NONE) return rc;
    rc = gltf_object(p->g, "accessors", accessor, &of);
    if (rc != SH_OK) return rc;
    const char *type = gltf_text(of, "type");
    p->has_alpha = type == NULL || strcmp(type, "VEC3") != 0;
    if (!p->has_alpha && !build_wants_colours(p->g->b)) return SH_OK; /* it would not be read */
    rc = gltf_view_open(p->g, accessor, p->has_alpha ? "VEC4" : "VEC3", &p->colour);
    if (rc == SH_OK && p->colour.count < p->pose.position.count)
        rc = gltf_fail(p->g, "%s: %u colours for %u vertices", at, p->colour.count, p->pose.position.count);
    return rc;
}

static int gltf_mesh_add_part(struct part *p, const json_t *primitive, const char *at)
{
    struct scene_build *b = p->g->b;
    uint64_t mode = TRIANGLES;
    int rc = gltf_whole(p->g, primitive, "mode", at, &mode);
    if (rc == SH_OK) rc = open_index(p, primitive, at);
    if (rc == SH_OK) rc = open_uv(p, json_object_get(primitive, "attributes"), at);
    if (rc == SH_OK) rc = open_colour(p, json_object_get(primitive, "attributes"), at);
    if (rc == SH_OK) rc = build_corners(b, 3, p->g->err);
    if (rc != SH_OK) return rc;
    p->vertex = calloc(p->pose.position.count + (size_t)1, sizeof *p->vertex);
    if (p->vertex == NULL)
        return build_fail(b, SH_ENOMEM, p->g->err, "no memory for %u vertices", p->pose.position.count);
    b->mesh_vertex0 = b->scene->n_vertices;
    rc = add_elements(p, mode, at);
    free(p->vertex);
    b->scene->n_meshes++;
    if (rc == SH_OK) gltf_pose_error(p->g, &p->pose, p->world);
    return rc;
}

/* A mesh, as a node draws it. */
struct drawn {
    const json_t *node, *mesh;
    const char *object; /* the node's name */
    const double (*world)[4];
};

static int add_primitive(struct gltf *g, const struct drawn *d, const json_t *primitive, const char *at)
{
    struct part p = {.g = g, .world = d->world};
    if (json_object_get(json_object_get(primitive, "attributes"), "POSITION") == NULL) {
        g->n_shapeless++;
        return SH_OK;
    }
    int rc = gltf_pose_open(g, d->node, d->mesh, primitive, at, &p.pose);
    if (rc == SH_OK) rc = gltf_look_open(g, d->object, primitive, at, &p.look);
    if (rc == SH_OK) rc = gltf_mesh_add_part(&p, primitive, at);
    gltf_pose_close(&p.pose);
    return rc;
}

int gltf_add_mesh(struct gltf *g, uint32_t node, const char *object, const gltf_matrix world)
{
    json_t *of = json_array_get(json_object_get(g->root, "nodes"), node), *mesh = NULL, *primitives = NULL;
    uint32_t number = GLTF_NONE;
    int rc = gltf_index(g, of, "mesh", gltf_at("nodes[%u]", node).text, &number);
    if (rc == SH_OK) rc = gltf_object(g, "meshes", number, &mesh);
    const struct gltf_at at = gltf_at("meshes[%u]", number);
    const struct drawn drawn = {of, mesh, object, world};
    const char *name = gltf_text(mesh, "name");
    if (rc == SH_OK) rc = gltf_list(g, mesh, "primitives", at.text, &primitives);
    g->b->mesh = name != NULL && *name != '\0' ? name : object;
    for (size_t i = 0; i < json_array_size(primitives) && rc == SH_OK; i++)
        rc = add_primitive(g, &drawn, json_array_get(primitives, i), gltf_at("%s.primitives[%zu]", at.text, i).text);
    g->b->mesh = NULL;
    return rc;
}
