/* SPDX-License-Identifier: MIT */
/* The tree of nodes, in double. A node has at most one parent, and is not above itself. Other files are refused, so
 * that the walk ends. No recursion: a chain may be as long as the file. */
#include "core/import/gltf/gltf_nodes.h"

#include <math.h>

#include "core/import/gltf/gltf.h"
#include "core/import/gltf/gltf_accessor.h"
#include "core/import/gltf/gltf_at.h"
#include "core/import/gltf/gltf_extensions.h"
#include "core/import/gltf/gltf_json.h"
#include "core/import/gltf/gltf_mesh.h"

/* Takes the file's columns; the last row is 0, 0, 0, 1 up to rounding to single precision. */
static int take_matrix(struct gltf *g, const double in[16], const char *at, gltf_matrix out)
{
    if (fabs(in[3]) + fabs(in[7]) + fabs(in[11]) + fabs(in[15] - 1.0) > 1e-6)
        return gltf_fail(g, "%s.matrix has the last row %g %g %g %g; allowed is 0 0 0 1", at, in[3], in[7], in[11],
                         in[15]);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 4; k++)
            out[i][k] = in[4 * k + i];
    return SH_OK;
}

static int read_local(struct gltf *g, const json_t *node, const char *at, gltf_matrix out)
{
    double m[16], t[3] = {0, 0, 0}, r[4] = {0, 0, 0, 1}, s[3] = {1, 1, 1};
    int rc = gltf_numbers(g, node, "matrix", at, 16, m);
    if (rc == SH_OK && json_object_get(node, "matrix") != NULL) return take_matrix(g, m, at, out);
    if (rc == SH_OK) rc = gltf_numbers(g, node, "translation", at, 3, t);
    if (rc == SH_OK) rc = gltf_numbers(g, node, "rotation", at, 4, r);
    if (rc == SH_OK) rc = gltf_numbers(g, node, "scale", at, 3, s);
    if (rc == SH_OK && !gltf_compose(t, r, s, out))
        rc = gltf_fail(g, "%s.rotation is 0 0 0 0, which is not a rotation", at);
    return rc;
}

int gltf_node_number(struct gltf *g, const json_t *list, size_t i, const char *key, const char *at, uint32_t *out)
{
    const json_t *value = json_array_get(list, i);
    const double number = json_number_value(value);
    if (!json_is_number(value) || !(number >= 0.0 && number < g->n_nodes) || floor(number) != number)
        return gltf_fail(g, "%s.%s[%zu] is not a node; there are %u", at, key, i, g->n_nodes);
    *out = (uint32_t)number;
    return SH_OK;
}

static int take_children(struct gltf *g, uint32_t i, const json_t *node)
{
    const struct gltf_at at = gltf_at("nodes[%u]", i);
    json_t *children;
    int rc = gltf_list(g, node, "children", at.text, &children);
    for (size_t k = 0; k < json_array_size(children) && rc == SH_OK; k++) {
        uint32_t child;
        rc = gltf_node_number(g, children, k, "children", at.text, &child);
        if (rc != SH_OK) return rc;
        struct gltf_node *below = &g->node[child];
        if (below->parent != GLTF_NONE)
            return gltf_fail(g, "nodes[%u] is a child of nodes[%u] and of nodes[%u]; allowed is one parent", child,
                             below->parent, i);
        below->parent = i;
    }
    return rc;
}

static uint32_t child_of(const json_t *children, size_t k)
{
    return (uint32_t)json_number_value(json_array_get(children, k));
}

/* Places all nodes below a node without a parent. */
static void place_tree(struct gltf *g, const json_t *nodes, uint32_t root)
{
    size_t n = 0;
    g->stack[n++] = root;
    while (n > 0) {
        struct gltf_node *node = &g->node[g->stack[--n]];
        const json_t *children = json_object_get(json_array_get(nodes, (size_t)(node - g->node)), "children");
        if (node->parent != GLTF_NONE) gltf_multiply(g->node[node->parent].world, node->world, node->world);
        node->has_world = true;
        for (size_t k = json_array_size(children); k > 0; k--)
            g->stack[n++] = child_of(children, k - 1);
    }
}

int gltf_place_nodes(struct gltf *g)
{
    const json_t *nodes = json_object_get(g->root, "nodes");
    json_t *node;
    int rc = SH_OK;
    for (uint32_t i = 0; i < g->n_nodes; i++)
        g->node[i].parent = GLTF_NONE;
    for (uint32_t i = 0; i < g->n_nodes && rc == SH_OK; i++) {
        rc = gltf_object(g, "nodes", i, &node);
        if (rc == SH_OK) rc = read_local(g, node, gltf_at("nodes[%u]", i).text, g->node[i].world);
        if (rc == SH_OK) rc = take_children(g, i, node);
    }
    for (uint32_t i = 0; i < g->n_nodes && rc == SH_OK; i++)
        if (g->node[i].parent == GLTF_NONE) place_tree(g, nodes, i);
    for (uint32_t i = 0; i < g->n_nodes && rc == SH_OK; i++)
        if (!g->node[i].has_world)
            rc = gltf_fail(g, "nodes[%u] is in a circle of children, or below one; allowed is a tree", i);
    return rc;
}

/* ---- instances */

static int open_instances(struct gltf *g, const json_t *attributes, const char *at, struct gltf_view view[3])
{
    static const char *const name[3] = {"TRANSLATION", "ROTATION", "SCALE"}, *const type[3] = {"VEC3", "VEC4", "VEC3"};
    uint32_t n = GLTF_NONE;
    for (int k = 0; k < 3; k++) {
        uint32_t accessor;
        int rc = gltf_index(g, attributes, name[k], at, &accessor);
        view[k].count = GLTF_NONE;
        if (rc == SH_OK && accessor != GLTF_NONE) rc = gltf_view_open(g, accessor, type[k], &view[k]);
        if (rc != SH_OK) return rc;
        if (view[k].count == GLTF_NONE) continue;
        if (n != GLTF_NONE && view[k].count != n)
            return gltf_fail(g, "%s has %u values of %s but %u of another property", at, view[k].count, name[k], n);
        n = view[k].count;
    }
    return n != GLTF_NONE ? SH_OK : gltf_fail(g, "%s has none of TRANSLATION, ROTATION and SCALE", at);
}

static int add_instances(struct gltf *g, uint32_t i, const char *object, const json_t *instancing)
{
    const struct gltf_at at = gltf_at("nodes[%u].extensions.EXT_mesh_gpu_instancing.attributes", i);
    struct gltf_view view[3];
    int rc = open_instances(g, json_object_get(instancing, "attributes"), at.text, view);
    for (uint32_t k = 0; rc == SH_OK; k++) {
        double trs[3][4] = {{0, 0, 0, 0}, {0, 0, 0, 1}, {1, 1, 1, 0}};
        gltf_matrix m;
        for (int a = 0; a < 3; a++) {
            if (view[a].count == GLTF_NONE) continue;
            if (k == view[a].count) return SH_OK;
            for (uint32_t c = 0; c < view[a].n_components; c++)
                trs[a][c] = gltf_value(&view[a], k, c);
        }
        if (!gltf_compose(trs[0], trs[1], trs[2], m))
            return gltf_fail(g, "%s: instance %u has the rotation 0 0 0 0, which is not a rotation", at.text, k);
        gltf_multiply(g->node[i].world, m, m);
        rc = gltf_add_mesh(g, i, object, m);
    }
    return rc;
}

/* ---- the scene */

/* A node without a name is named by its place in the file. */
static int draw_node(struct gltf *g, uint32_t i, const json_t *node)
{
    const char *name = gltf_text(node, "name");
    const struct gltf_at own = gltf_at("nodes[%u]", i);
    const json_t *instancing = gltf_extension(node, "EXT_mesh_gpu_instancing");
    if (name == NULL || *name == '\0') name = own.text;
    if (instancing != NULL && json_object_get(node, "skin") != NULL)
        return gltf_fail(g, "%s has a skin and instances; allowed is one of them", own.text);
    return instancing != NULL ? add_instances(g, i, name, instancing) : gltf_add_mesh(g, i, name, g->node[i].world);
}

/* Draws a node's own mesh first, then its children in their order. Nodes below a hidden one are hidden. */
static int draw_tree(struct gltf *g, const json_t *nodes, uint32_t root)
{
    size_t n = 0;
    int rc = SH_OK;
    g->stack[n++] = root;
    while (n > 0 && rc == SH_OK) {
        const uint32_t i = g->stack[--n];
        const json_t *node = json_array_get(nodes, i), *children = json_object_get(node, "children");
        g->node[i].is_drawn = true;
        g->n_drawn++;
        if (gltf_is_hidden(node)) {
            g->n_hidden++;
            continue;
        }
        if (json_object_get(node, "mesh") != NULL) rc = draw_node(g, i, node);
        for (size_t k = json_array_size(children); k > 0; k--)
            g->stack[n++] = child_of(children, k - 1);
    }
    return rc;
}

static int draw_roots(struct gltf *g, const json_t *roots, const char *at)
{
    const json_t *nodes = json_object_get(g->root, "nodes");
    int rc = SH_OK;
    for (size_t k = 0; k < json_array_size(roots) && rc == SH_OK; k++) {
        uint32_t i;
        rc = gltf_node_number(g, roots, k, "nodes", at, &i);
        if (rc != SH_OK) return rc;
        const struct gltf_node *node = &g->node[i];
        if (node->parent != GLTF_NONE)
            return gltf_fail(g, "%s.nodes has nodes[%u], which is a child of nodes[%u]: allowed are roots", at, i,
                             node->parent);
        if (node->is_drawn) return gltf_fail(g, "%s.nodes has nodes[%u] twice", at, i);
        rc = draw_tree(g, nodes, i);
    }
    return rc;
}

/* Without scenes all nodes are drawn. Where there are several scenes and no default, the first one is drawn. */
int gltf_draw_scene(struct gltf *g)
{
    const json_t *nodes = json_object_get(g->root, "nodes");
    json_t *scenes, *scene = NULL, *roots = NULL;
    uint32_t number = GLTF_NONE;
    int rc = gltf_list(g, g->root, "scenes", "", &scenes);
    if (rc == SH_OK) rc = gltf_index(g, g->root, "scene", "", &number);
    if (rc == SH_OK && number == GLTF_NONE && json_array_size(scenes) == 0) {
        for (uint32_t i = 0; i < g->n_nodes && rc == SH_OK; i++)
            if (g->node[i].parent == GLTF_NONE) rc = draw_tree(g, nodes, i);
        return rc;
    }
    if (rc == SH_OK && number == GLTF_NONE && json_array_size(scenes) > 1)
        build_warn(g->b, "it has %zu scenes and no default scene: the first is read", json_array_size(scenes));
    if (number == GLTF_NONE) number = 0;
    const struct gltf_at at = gltf_at("scenes[%u]", number);
    if (rc == SH_OK) rc = gltf_object(g, "scenes", number, &scene);
    if (rc == SH_OK) rc = gltf_list(g, scene, "nodes", at.text, &roots);
    return rc == SH_OK ? draw_roots(g, roots, at.text) : rc;
}
