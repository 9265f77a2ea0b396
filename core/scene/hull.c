/* SPDX-License-Identifier: MIT */
/* The outline of a mesh seen from above. A copy is turned about the vertical: its bounds follow from this outline. */
#include <stdlib.h>
#include <string.h>

#include "core/scene/hull.h"
#include "core/vec3.h"

/* Twice the area of the triangle a, b, c: above 0 where the way from a by b to c turns left. */
static double turns(const double a[2], const double b[2], const double c[2])
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static int hull_compare(const void *a, const void *b)
{
    const double *p = a, *q = b;
    if (p[0] != q[0]) return p[0] < q[0] ? -1 : 1;
    return (p[1] > q[1]) - (p[1] < q[1]);
}

/* Adds a point to the chain from the left to the right end, or back (A. M. Andrew, 1979). */
static uint32_t add_chain(double (*hull)[2], uint32_t n, uint32_t least, const double p[2])
{
    while (n >= least + 2 && turns(hull[n - 2], hull[n - 1], p) <= 0.0)
        n--;
    memcpy(hull[n], p, sizeof hull[n]);
    return n + 1;
}

/* The convex hull of a mesh's used vertices. */
struct hull {
    double (*point)[2];
    uint32_t n;
};

static int find_hull(const struct scene *scene, struct hull *out, struct sh_err *err)
{
    uint8_t *used = calloc((size_t)scene->n_vertices + 1, 1);
    double(*point)[2] = malloc(((size_t)scene->n_vertices + 1) * sizeof *point);
    uint32_t n = 0, k = 0;
    *out = (struct hull){.point = NULL};
    for (uint32_t i = 0; used != NULL && i < scene->n_triangles; i++)
        for (int c = 0; c < 3; c++)
            used[scene->triangle[i][c]] = 1;
    for (uint32_t i = 0; used != NULL && point != NULL && i < scene->n_vertices; i++)
        if (used[i]) memcpy(point[n++], scene->vertex_m[i], sizeof *point);
    const int is_short = point == NULL || used == NULL;
    free(used);
    out->point = malloc((2 * (size_t)n + 2) * sizeof *out->point);
    if (is_short || out->point == NULL) {
        free(point);
        return sh_fail(err, SH_ENOMEM, "no memory for a mesh's outline");
    }
    qsort(point, n, sizeof *point, hull_compare);
    for (uint32_t i = 0; i < n; i++)
        k = add_chain(out->point, k, 0, point[i]);
    const uint32_t right = k > 0 ? k - 1 : 0;
    for (uint32_t i = n; i > 1; i--)
        k = add_chain(out->point, k, right, point[i - 2]);
    free(point);
    out->n = k;
    return SH_OK;
}

static void set_bounds(const struct scene *mesh, const struct hull *hull, struct scene_copy *copy)
{
    vec3_bound_nothing(copy->min_m, copy->max_m);
    for (uint32_t i = 0; i < hull->n; i++)
        for (int top = 0; top < 2; top++) {
            const double v[3] = {hull->point[i][0], hull->point[i][1], top ? mesh->max_m[2] : mesh->min_m[2]};
            double p[3];
            scene_copy_put(copy, v, p);
            vec3_bound(copy->min_m, copy->max_m, p);
        }
}

int scene_bound_copies(struct scene *scene, const struct scene *mesh, struct scene_copy *copy, size_t n,
                       const struct sh_report *report, struct sh_err *err)
{
    struct hull hull;
    int rc = find_hull(mesh, &hull, err);
    for (size_t i = 0; i < n && rc == SH_OK; i++) {
        if ((i & 0xff) == 0) rc = sh_check_stop(report, err);
        set_bounds(mesh, &hull, &copy[i]);
        vec3_bound(scene->min_m, scene->max_m, copy[i].min_m);
        vec3_bound(scene->min_m, scene->max_m, copy[i].max_m);
    }
    free(hull.point);
    return rc;
}
