/* cast_floor: of all triangles only those around the vertical line become a scene, with a BVH where the ray
 * begins. */
#include "core/cast.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/vec3.h"

struct column {
    const struct scene *scene;
    double from_m[3], u[3], v[3]; /* the line, and two directions across it */
    uint32_t *prim;               /* triangles around it */
    uint32_t *vertex;             /* their vertices in the scene, sorted, each once */
    size_t n, n_vertices, capacity;
};

static void directions_across(const double down[3], double u[3], double v[3])
{
    int least = fabs(down[0]) < fabs(down[1]) ? 0 : 1;
    if (fabs(down[2]) < fabs(down[least])) least = 2;
    double axis[3] = {0.0, 0.0, 0.0};
    axis[least] = 1.0;
    vec3_cross(down, axis, u);
    double length = sqrt(vec3_dot(u, u));
    for (int i = 0; i < 3; i++)
        u[i] /= length;
    vec3_cross(down, u, v);
}

/* Does the line pass through the triangle's bounds across it? Rounding stays below a millionth of a
 * coordinate. */
static int is_around(const struct column *c, uint32_t prim)
{
    double min[2] = {INFINITY, INFINITY}, max[2] = {-INFINITY, -INFINITY}, far_m = 0.0;
    for (int k = 0; k < 3; k++) {
        const double *p = c->scene->vertex_m[c->scene->triangle[prim][k]];
        double d[3] = {p[0] - c->from_m[0], p[1] - c->from_m[1], p[2] - c->from_m[2]};
        double across[2] = {vec3_dot(d, c->u), vec3_dot(d, c->v)};
        for (int i = 0; i < 2; i++) {
            min[i] = fmin(min[i], across[i]);
            max[i] = fmax(max[i], across[i]);
        }
        far_m = fmax(far_m, fabs(d[0]) + fabs(d[1]) + fabs(d[2]));
    }
    double slack_m = 1e-6 * far_m;
    return min[0] <= slack_m && max[0] >= -slack_m && min[1] <= slack_m && max[1] >= -slack_m;
}

static int collect(struct column *c, struct sh_err *err)
{
    for (uint32_t i = 0; i < c->scene->n_triangles; i++) {
        if (!is_around(c, i)) continue;
        if (!grow(&c->prim, &c->capacity, c->n + 1, sizeof *c->prim))
            return sh_fail(err, SH_ENOMEM, "cast: no memory to look for the floor");
        c->prim[c->n++] = i;
    }
    return SH_OK;
}

static int compare(const void *a, const void *b)
{
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* The holes of the triangles around the line. */
static int keep_cutouts(const struct column *c, struct scene *around, struct sh_err *err)
{
    const struct scene *all = c->scene;
    around->uv = malloc(c->n * sizeof *around->uv);
    around->cutout = malloc(all->n_surfaces * sizeof *around->cutout);
    if (around->uv == NULL || around->cutout == NULL)
        return sh_fail(err, SH_ENOMEM, "cast: no memory to look for the floor");
    memcpy(around->cutout, all->cutout, all->n_surfaces * sizeof *around->cutout);
    around->label0 = all->label0;
    for (size_t i = 0; i < c->n; i++) {
        memcpy(around->uv[i], all->uv[c->prim[i]], sizeof *around->uv);
        around->label[i] = all->label[c->prim[i]];
    }
    return SH_OK;
}

/* Neighbours keep their common vertices: the exact stage finds neighbours by them. */
static int make_scene(struct column *c, struct scene **out, struct sh_err *err)
{
    const struct scene *all = c->scene;
    c->vertex = malloc(3 * c->n * sizeof *c->vertex);
    double(*vertex_m)[3] = malloc(3 * c->n * sizeof *vertex_m);
    uint32_t(*triangle)[3] = malloc(c->n * sizeof *triangle);
    int rc = SH_ENOMEM;
    if (c->vertex == NULL || vertex_m == NULL || triangle == NULL) {
        sh_fail(err, rc, "cast: no memory to look for the floor");
        goto done;
    }
    for (size_t i = 0; i < c->n; i++)
        memcpy(c->vertex + 3 * i, all->triangle[c->prim[i]], sizeof *triangle);
    qsort(c->vertex, 3 * c->n, sizeof *c->vertex, compare);
    for (size_t i = 0; i < 3 * c->n; i++)
        if (i == 0 || c->vertex[i] != c->vertex[c->n_vertices - 1]) c->vertex[c->n_vertices++] = c->vertex[i];
    for (size_t i = 0; i < c->n_vertices; i++)
        memcpy(vertex_m[i], all->vertex_m[c->vertex[i]], sizeof *vertex_m);
    for (size_t i = 0; i < c->n; i++)
        for (int k = 0; k < 3; k++) {
            const uint32_t *at = bsearch(&all->triangle[c->prim[i]][k], c->vertex, c->n_vertices, sizeof *at, compare);
            triangle[i][k] = (uint32_t)(at - c->vertex);
        }
    rc = scene_from_arrays(&(struct scene_arrays){(const double(*)[3])vertex_m, (uint32_t)c->n_vertices,
                                                  (const uint32_t(*)[3])triangle, (uint32_t)c->n, NULL, NULL, 0},
                           out, err);
    if (rc == SH_OK && all->cutout != NULL) rc = keep_cutouts(c, *out, err);
done:
    free(vertex_m);
    free(triangle);
    return rc;
}

static int cast_down(const struct column *c, const struct scene *scene, const double down[3], double *range_m,
                     struct sh_err *err)
{
    struct bvh *bvh = NULL;
    struct caster *caster = NULL;
    uint32_t triangle;
    double far_m = 1.0;
    for (int i = 0; i < 3; i++)
        far_m += fmax(fabs(scene->min_m[i] - c->from_m[i]), fabs(scene->max_m[i] - c->from_m[i]));
    int rc = bvh_create(scene, 1, NULL, &bvh, err);
    if (rc == SH_OK) rc = caster_create(&caster, err);
    const struct bvh_rays ray = {.n = 1,
                                 .from.at_m = {c->from_m[0], c->from_m[1], c->from_m[2]},
                                 .dir = {&down[0], &down[1], &down[2]},
                                 .range_max_m = far_m,
                                 .range_m = range_m,
                                 .triangle = &triangle};
    if (rc == SH_OK) caster_hits(caster, bvh, &ray);
    caster_free(caster);
    bvh_free(bvh);
    return rc;
}

/* Whether a copy's bounds reach as far as the line. */
static int may_be_below(const struct column *c, const struct scene_copy *copy)
{
    double off[3], half[3];
    for (int k = 0; k < 3; k++) {
        half[k] = 0.5 * (copy->max_m[k] - copy->min_m[k]);
        off[k] = copy->min_m[k] + half[k] - c->from_m[k];
    }
    const double across2 = vec3_dot(off, c->u) * vec3_dot(off, c->u) + vec3_dot(off, c->v) * vec3_dot(off, c->v);
    const double reach_m = vec3_length(half) + 1e-6 * vec3_length(off);
    return across2 <= reach_m * reach_m;
}

/* The same in the frame of each copy. */
static int look_at_copies(const struct column *c, const double down[3], double *range_m, struct sh_err *err)
{
    const struct scene *scene = c->scene;
    for (uint32_t i = 0; i < scene->n_copied; i++)
        for (uint32_t k = 0; k < scene->copied[i].n; k++) {
            const struct scene_copy *copy = &scene->copied[i].copy[k];
            double from_m[3], dir[3], here_m;
            if (!may_be_below(c, copy)) continue;
            scene_copy_put_back(copy, c->from_m, from_m);
            scene_copy_turn_back(copy, down, dir);
            const int rc = cast_floor(scene->copied[i].mesh, from_m, dir, &here_m, err);
            if (rc != SH_OK) return rc;
            if (!isnan(here_m)) *range_m = fmin(here_m * copy->scale, isnan(*range_m) ? INFINITY : *range_m);
        }
    return SH_OK;
}

int cast_floor(const struct scene *scene, const double from_m[3], const double down[3], double *range_m,
               struct sh_err *err)
{
    struct column c = {.scene = scene};
    struct scene *around = NULL;
    memcpy(c.from_m, from_m, sizeof c.from_m);
    directions_across(down, c.u, c.v);
    *range_m = NAN;
    int rc = collect(&c, err);
    if (rc == SH_OK && c.n > 0) rc = make_scene(&c, &around, err);
    if (rc == SH_OK && c.n > 0) rc = cast_down(&c, around, down, range_m, err);
    if (rc == SH_OK) rc = look_at_copies(&c, down, range_m, err);
    scene_free(around);
    free(c.vertex);
    free(c.prim);
    return rc;
}
