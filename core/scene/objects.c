/* SPDX-License-Identifier: MIT */
/* Figures of objects: each mesh is cut into parts of one object each. Each part is measured once, however many copies
 * it has. */
#include "core/scene_objects.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/body.h"
#include "core/grow.h"
#include "core/rng.h"
#include "core/vec3.h"

enum { NONE = 0xffffffff };

/* A gap narrower than this share of the body doesn't count: rounding to single precision leaves 1e-7. */
#define CLOSED_SHARE 1e-5

/* An edge between two corners. In the direction from low to high it counts +1, in the other -1. */
struct edge {
    uint32_t low, high; /* low NONE: free */
    int32_t balance;
    uint32_t uses;
};

struct work {
    const struct scene *mesh;
    uint32_t *same;   /* scene_find_same */
    uint32_t *object; /* [n_surfaces of the mesh] */
    uint32_t *order;  /* triangles, by object */
    struct edge *edge;
    uint64_t mask, room;
    const struct scene_open_edges *edges; /* NULL: not asked for */
    const struct sh_report *report;
    struct sh_err *err;
};

/* ---- which surfaces are of one object */

struct named {
    const char *name;
    uint32_t surface;
};

static int by_name(const void *a, const void *b)
{
    const struct named *x = a, *y = b;
    const int order = strcmp(x->name, y->name);
    return order != 0 ? order : (x->surface > y->surface) - (x->surface < y->surface);
}

/* of[i] becomes the first surface of the same name, then the number of its object. */
static int group(const struct scene *scene, struct scene_objects *o, struct sh_err *err)
{
    const uint32_t n = scene->n_surfaces;
    struct named *named = malloc((n + 1) * sizeof *named);
    o->of = malloc((n + 1) * sizeof *o->of);
    o->object = calloc(n + 1, sizeof *o->object);
    if (named == NULL || o->of == NULL || o->object == NULL) {
        free(named);
        return sh_fail(err, SH_ENOMEM, "no memory for the objects of %u surfaces", n);
    }
    for (uint32_t i = 0; i < n; i++)
        named[i] = (struct named){scene->surface[i].object, i};
    qsort(named, n, sizeof *named, by_name);
    for (uint32_t i = 0; i < n; i++) {
        const int goes_on = i > 0 && strcmp(named[i].name, named[i - 1].name) == 0;
        o->of[named[i].surface] = goes_on ? o->of[named[i - 1].surface] : named[i].surface;
    }
    free(named);
    for (uint32_t i = 0; i < n; i++) {
        const int is_first = o->of[i] == i;
        if (is_first) o->object[o->n] = (struct scene_object){.surface = i, .state = SCENE_OBJECT_EMPTY};
        o->of[i] = is_first ? o->n++ : o->of[o->of[i]];
        o->object[o->of[i]].n_surfaces++;
    }
    return SH_OK;
}

/* ---- edges */

static struct edge *find_edge(struct work *w, uint32_t low, uint32_t high)
{
    uint64_t at = rng_mix((uint64_t)low << 32 | high) & w->mask;
    while (w->edge[at].low != NONE && (w->edge[at].low != low || w->edge[at].high != high))
        at = (at + 1) & w->mask;
    return &w->edge[at];
}

static int make_table(struct work *w, uint32_t n_triangles)
{
    const uint64_t size = grow_table(4 * (uint64_t)n_triangles);
    if (size > w->room) {
        free(w->edge);
        w->edge = malloc(size * sizeof *w->edge);
        w->room = w->edge != NULL ? size : 0;
        if (w->edge == NULL) return sh_fail(w->err, SH_ENOMEM, "no memory for the edges of %u triangles", n_triangles);
    }
    w->mask = size - 1;
    for (uint64_t i = 0; i < size; i++)
        w->edge[i].low = NONE;
    return SH_OK;
}

static int count_edges(struct work *w, const uint32_t *triangle, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++) {
        if ((i & 0xffff) == 0 && sh_check_stop(w->report, w->err) != SH_OK) return SH_ESTOPPED;
        for (int k = 0; k < 3; k++) {
            const uint32_t *v = w->mesh->triangle[triangle[i]];
            const uint32_t a = w->same[v[k]], b = w->same[v[(k + 1) % 3]];
            const uint32_t low = a < b ? a : b, high = a < b ? b : a;
            struct edge *edge = find_edge(w, low, high);
            if (edge->low == NONE) *edge = (struct edge){low, high, 0, 0};
            edge->balance += a == low ? 1 : -1;
            edge->uses++;
        }
    }
    return SH_OK;
}

/* ---- one part */

static void bounds_of(const struct work *w, const uint32_t *triangle, uint32_t n, double min[3], double max[3])
{
    vec3_bound_nothing(min, max);
    for (uint32_t i = 0; i < n; i++)
        for (int c = 0; c < 3; c++)
            vec3_bound(min, max, w->mesh->vertex_m[w->mesh->triangle[triangle[i]][c]]);
}

/* A long edge may face several short ones on the same line. None of these has a counterpart, but their sums cancel, and
 * nothing is open. Where they don't cancel, an area is open, and its mean width follows from the edges' length. */
static enum scene_object_state objects_judge(const struct work *w, struct body_sum *sum, double diagonal_m,
                                             uint64_t *n_open)
{
    double length_m = 0.0;
    *n_open = 0;
    for (uint64_t i = 0; i <= w->mask; i++) {
        const struct edge *e = &w->edge[i];
        if (e->low == NONE) continue;
        *n_open += e->uses % 2;
        const double *from = w->mesh->vertex_m[e->balance > 0 ? e->low : e->high];
        const double *to = w->mesh->vertex_m[e->balance > 0 ? e->high : e->low];
        for (int32_t k = abs(e->balance); k > 0; k--) {
            body_add_edge(sum, from, to);
            length_m += vec3_distance(from, to);
        }
    }
    if (body_open_m2(sum) <= 0.5 * CLOSED_SHARE * diagonal_m * length_m) {
        *n_open = 0;
        return SCENE_OBJECT_CLOSED;
    }
    return *n_open > 0 ? SCENE_OBJECT_OPEN : SCENE_OBJECT_TURNED;
}

static int measure(struct work *w, const uint32_t *triangle, uint32_t n, struct scene_object *part)
{
    double min[3], max[3], corner[3][3];
    struct body_sum sum;
    int rc = make_table(w, n);
    if (rc != SH_OK) return rc;
    bounds_of(w, triangle, n, min, max);
    body_begin(&sum, min, max);
    for (uint32_t i = 0; i < n; i++) {
        for (int c = 0; c < 3; c++)
            memcpy(corner[c], w->mesh->vertex_m[w->mesh->triangle[triangle[i]][c]], sizeof corner[c]);
        body_add_triangle(&sum, (const double(*)[3])corner);
    }
    rc = count_edges(w, triangle, n);
    if (rc != SH_OK) return rc;
    *part = (struct scene_object){.n_triangles = n, .area_m2 = sum.area_m2};
    part->state = objects_judge(w, &sum, vec3_distance(min, max), &part->n_open);
    part->volume_m3 = part->state == SCENE_OBJECT_CLOSED ? sum.volume_m3 : (double)NAN;
    return SH_OK;
}

/* An object has the worst state of its parts. A part without a volume makes the whole volume NaN. */
static void objects_add(struct scene_object *to, const struct scene_object *part, double scale)
{
    to->n_triangles += part->n_triangles;
    to->n_open += part->n_open;
    to->area_m2 += scale * scale * part->area_m2;
    to->volume_m3 += scale * scale * scale * part->volume_m3;
    if (part->state > to->state) to->state = part->state;
}

/* ---- one mesh */

static void objects_add_part(const struct scene_copied *copied, uint32_t label, const struct scene_object *part,
                             struct scene_objects *o)
{
    if (copied == NULL) {
        objects_add(&o->object[o->of[label]], part, 1.0);
        return;
    }
    for (uint32_t i = 0; i < copied->n; i++)
        objects_add(&o->object[o->of[copied->copy[i].label0 + label]], part, copied->copy[i].scale);
}

/* Hands over the open edges of the part that was measured last. */
static int hand_out(const struct work *w, const struct scene_copied *copied)
{
    int rc = SH_OK;
    for (uint64_t i = 0; i <= w->mask && rc == SH_OK; i++) {
        const struct edge *e = &w->edge[i];
        if (e->low == NONE || e->uses % 2 == 0) continue;
        const double *from = w->mesh->vertex_m[e->low], *to = w->mesh->vertex_m[e->high];
        if (copied == NULL) rc = w->edges->take(w->edges->ctx, from, to, w->err);
        for (uint32_t k = 0; copied != NULL && k < copied->n && rc == SH_OK; k++) {
            double a[3], b[3];
            scene_copy_put(&copied->copy[k], from, a);
            scene_copy_put(&copied->copy[k], to, b);
            rc = w->edges->take(w->edges->ctx, a, b, w->err);
        }
    }
    return rc;
}

/* Sorts the mesh's triangles by object, by counting: those of object k begin at begin[k]. */
static void sort(struct work *w, const struct scene_objects *o, const uint32_t *of_label, uint32_t *begin)
{
    const struct scene *mesh = w->mesh;
    memset(begin, 0, ((size_t)o->n + 2) * sizeof *begin);
    for (uint32_t i = 0; i < mesh->n_triangles; i++)
        begin[of_label[mesh->label[i] - mesh->label0] + 2]++;
    for (uint32_t k = 2; k < o->n + 2; k++)
        begin[k] += begin[k - 1];
    for (uint32_t i = 0; i < mesh->n_triangles; i++)
        w->order[begin[of_label[mesh->label[i] - mesh->label0] + 1]++] = i;
}

static int add_mesh(const struct scene *scene, const struct scene_copied *copied, struct work *w,
                    struct scene_objects *o)
{
    const struct scene *mesh = copied != NULL ? copied->mesh : scene;
    const uint32_t first = copied != NULL ? copied->copy[0].label0 : 0;
    uint32_t *begin = malloc(((size_t)o->n + 2) * sizeof *begin);
    w->mesh = mesh;
    w->order = malloc(((size_t)mesh->n_triangles + 1) * sizeof *w->order);
    int rc = begin != NULL && w->order != NULL
                 ? scene_find_same(mesh, w->report, &w->same, w->err)
                 : sh_fail(w->err, SH_ENOMEM, "no memory to sort %u triangles", mesh->n_triangles);
    if (rc == SH_OK) sort(w, o, o->of + first, begin);
    for (uint32_t k = 0; k < o->n && rc == SH_OK; k++) {
        const uint32_t n = begin[k + 1] - begin[k];
        struct scene_object part;
        if (n == 0) continue;
        rc = measure(w, w->order + begin[k], n, &part);
        if (rc == SH_OK) objects_add_part(copied, mesh->label[w->order[begin[k]]] - mesh->label0, &part, o);
        if (rc == SH_OK && w->edges != NULL && part.state == SCENE_OBJECT_OPEN) rc = hand_out(w, copied);
        sh_progress(w->report, "measuring objects", (double)begin[k + 1] / mesh->n_triangles);
    }
    free(begin);
    free(w->order);
    free(w->same);
    w->order = w->same = NULL;
    return rc;
}

int scene_objects_find(const struct scene *scene, const struct scene_open_edges *edges, const struct sh_report *report,
                       struct scene_objects *objects, struct sh_err *err)
{
    struct work w = {.edges = edges, .report = report, .err = err};
    *objects = (struct scene_objects){0};
    int rc = group(scene, objects, err);
    if (rc == SH_OK && scene->n_triangles > 0) rc = add_mesh(scene, NULL, &w, objects);
    for (uint32_t i = 0; i < scene->n_copied && rc == SH_OK; i++)
        if (scene->copied[i].n > 0) rc = add_mesh(scene, &scene->copied[i], &w, objects);
    free(w.edge);
    return rc;
}

void scene_objects_free(struct scene_objects *objects)
{
    free(objects->object);
    free(objects->of);
    *objects = (struct scene_objects){0};
}
