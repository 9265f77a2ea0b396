/* SPDX-License-Identifier: MIT */
/* Computes the planes of triangles in double, and from them the ranges and the steepness of hits. Also finds the labels
 * of hits. Compilers turn the loops over arrays into vector code. */
#include <math.h>

#include "core/bvh/leaves.h"
#include "core/huge_pages.h"
#include "core/vec3.h"
#include "core/vecmath.h"

_Static_assert(sizeof(struct bvh_plane) == 4 * sizeof(double), "gathered as doubles");

/* a b - c d, rounded about once: otherwise a needle's normal would lose all digits (W. Kahan). */
static double difference(double a, double b, double c, double d)
{
    const double ab = a * b, cd = c * d;
    return (ab - cd) + (vec_product_rest(a, b, ab) - vec_product_rest(c, d, cd));
}

/* Sets the triangle's plane so that it passes through the triangle's centre. */
void bvh_set_plane(const struct bvh *bvh, uint32_t triangle, struct bvh_plane *plane)
{
    const struct scene *scene = bvh->scene;
    const uint32_t *corner = scene->triangle[triangle];
    double v[3], e1[3], e2[3], centre[3];
    vec3_sub(scene->vertex_m[corner[0]], bvh->origin_m, v);
    vec3_sub(scene->vertex_m[corner[1]], scene->vertex_m[corner[0]], e1);
    vec3_sub(scene->vertex_m[corner[2]], scene->vertex_m[corner[0]], e2);
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        plane->n[i] = difference(e1[j], e2[k], e1[k], e2[j]);
        centre[i] = v[i] + (e1[i] + e2[i]) / 3.0;
    }
    plane->d = vec3_dot(plane->n, centre);
}

int bvh_find_planes(struct bvh *bvh, const struct sh_report *report, struct sh_err *err)
{
    const uint32_t n = bvh->scene->n_triangles, n_leaves = bvh->n_leaves;
    if (n_leaves > INT32_MAX) return sh_fail(err, SH_EINPUT, "bvh: %u leaves; allowed are %d", n_leaves, INT32_MAX);
    bvh->at_plane = huge_pages_alloc(((size_t)n + 1) * sizeof *bvh->at_plane);
    if (bvh->at_plane == NULL) return sh_fail(err, SH_ENOMEM, "bvh: no memory for %u triangles", n);
    for (uint32_t i = 0; i < n_leaves; i++) {
        if ((i & 0xffff) == 0 && sh_check_stop(report, err) != SH_OK) return SH_ESTOPPED;
        /* A triangle that is alone in its leaf is entered twice: its first plane, entered last, counts. */
        for (uint32_t which = 2; which-- > 0;)
            bvh->at_plane[bvh_leaf_triangle(&bvh->leaf[i], (int)which)] = 2 * i + which;
    }
    bvh->at_plane[n] = 2 * n_leaves;
    bvh->leaf[n_leaves].plane[0] = (struct bvh_plane){.n = {NAN, NAN, NAN}, .d = NAN};
    return SH_OK;
}

const struct bvh_plane *bvh_plane(const struct bvh *bvh, uint32_t triangle)
{
    const uint32_t at = bvh->at_plane[triangle];
    return &bvh->leaf[at / 2].plane[at % 2];
}

/* Returns the index at which a triangle's plane begins, when the leaves are read as one array of doubles. */
VEC_INLINE int64_t doubles_before(const uint32_t *at_plane, uint32_t triangle, uint32_t n_triangles)
{
    _Static_assert(sizeof(struct bvh_leaf) == 16 * sizeof(double), "four planes");
    _Static_assert(offsetof(struct bvh_leaf, plane) == 8 * sizeof(double), "the last two are the planes");
    const int64_t at = at_plane[triangle < n_triangles ? triangle : n_triangles];
    return 16 * (at / 2) + 8 + 4 * (at % 2);
}

VEC_CLONES
void bvh_to_float(const struct vec3_in *dir, uint32_t n, float *restrict x, float *restrict y, float *restrict z)
{
    const struct vec3_in d = *dir;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        x[i] = embree_direction(d.x[i]);
        y[i] = embree_direction(d.y[i]);
        z[i] = embree_direction(d.z[i]);
    }
}

static void find_labels(const struct bvh *bvh, const struct bvh_rays *rays)
{
    const struct scene *scene = bvh->scene;
    for (uint32_t i = 0; i < rays->n; i++) {
        const uint32_t t = rays->triangle[i];
        rays->label[i] = t < scene->n_triangles ? scene->label[t]
                         : t < scene->n_all     ? scene_label(scene, t)
                                                : BVH_NO_LABEL;
    }
}

/* A miss has the highest number there is and reads the plane after the last leaf, which is all NaN. */
VEC_CLONES
static void find_steepness(const struct bvh *bvh, const struct bvh_rays *rays)
{
    const double *tri = (const double *)bvh->leaf, *dx = rays->dir.x, *dy = rays->dir.y, *dz = rays->dir.z;
    const uint32_t n_triangles = bvh->scene->n_triangles, n = rays->n, *prim = rays->triangle,
                   *at_plane = bvh->at_plane;
    float *steep = rays->steep;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        const int64_t at = doubles_before(at_plane, prim[i], n_triangles);
        const double nx = tri[at], ny = tri[at + 1], nz = tri[at + 2];
        const double along = nx * dx[i] + ny * dy[i] + nz * dz[i];
        steep[i] = (float)(nx * nx + ny * ny + nz * nz) / (float)(along * along);
    }
}

void bvh_refine(const struct bvh *bvh, const struct bvh_rays *rays)
{
    if (rays->label != NULL) find_labels(bvh, rays);
    if (rays->steep == NULL) return;
    if (bvh->scene->n_copies > 0)
        bvh_steepness_copies(bvh, rays);
    else
        find_steepness(bvh, rays);
}

enum { LANES = 8 };
typedef double lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef float float_lanes __attribute__((vector_size(LANES * sizeof(float))));
typedef uint32_t number_lanes __attribute__((vector_size(LANES * sizeof(uint32_t))));

/* A plane, with the figures that are the same for all rays from the point o. */
struct one_plane {
    double nx, ny, nz, nn, above; /* above: d - n . o */
    uint32_t triangle, label;
};

VEC_INLINE void range_of_one(const struct one_plane *p, const struct bvh_rays *rays, uint32_t i)
{
    const double along = p->nx * rays->dir.x[i] + p->ny * rays->dir.y[i] + p->nz * rays->dir.z[i];
    rays->range_m[i] = p->above / along;
    rays->triangle[i] = p->triangle;
    if (rays->label != NULL) rays->label[i] = p->label;
    if (rays->steep != NULL) rays->steep[i] = (float)p->nn / (float)(along * along);
}

/* Lanes are written by hand: compilers don't vectorise so short a loop. */
VEC_INLINE void ranges_of_lanes(const struct one_plane *p, const struct bvh_rays *rays, uint32_t at)
{
    const number_lanes triangle = (number_lanes){0} + p->triangle, label = (number_lanes){0} + p->label;
    lanes x, y, z;
    memcpy(&x, rays->dir.x + at, sizeof x);
    memcpy(&y, rays->dir.y + at, sizeof y);
    memcpy(&z, rays->dir.z + at, sizeof z);
    const lanes along = p->nx * x + p->ny * y + p->nz * z, range_m = p->above / along;
    memcpy(rays->range_m + at, &range_m, sizeof range_m);
    memcpy(rays->triangle + at, &triangle, sizeof triangle);
    if (rays->label != NULL) memcpy(rays->label + at, &label, sizeof label);
    if (rays->steep == NULL) return;
    const float_lanes steep = (float)p->nn / __builtin_convertvector(along * along, float_lanes);
    memcpy(rays->steep + at, &steep, sizeof steep);
}

double bvh_range_of(const struct bvh *bvh, uint32_t triangle, const double at_m[3], const double dir[3])
{
    struct bvh_plane tri;
    double o[3];
    bvh_get_plane(bvh, triangle, &tri);
    vec3_sub(at_m, bvh->origin_m, o);
    return (tri.d - vec3_dot(tri.n, o)) / vec3_dot(tri.n, dir);
}

/* Sets rays that hit nothing, without arithmetic. */
static void say_nothing(const struct bvh_rays *rays, uint32_t from, uint32_t to)
{
    for (uint32_t i = from; i < to; i++)
        rays->range_m[i] = (double)NAN;
    for (uint32_t i = from; i < to; i++)
        rays->triangle[i] = BVH_NO_TRIANGLE;
    for (uint32_t i = from; rays->label != NULL && i < to; i++)
        rays->label[i] = BVH_NO_LABEL;
    for (uint32_t i = from; rays->steep != NULL && i < to; i++)
        rays->steep[i] = NAN;
}

VEC_INLINE void set_one(struct one_plane *p, const struct bvh *bvh, uint32_t triangle, const double o[3])
{
    const struct bvh_plane *tri = bvh_plane(bvh, triangle);
    *p = (struct one_plane){.nx = tri->n[0],
                            .ny = tri->n[1],
                            .nz = tri->n[2],
                            .nn = vec3_dot(tri->n, tri->n),
                            .above = tri->d - vec3_dot(tri->n, o),
                            .triangle = triangle,
                            .label = bvh->scene->label[triangle]};
}

VEC_CLONES
void bvh_ranges_of(const struct bvh *bvh, uint32_t triangle, const struct bvh_rays *rays, uint32_t from, uint32_t to)
{
    struct one_plane p;
    double o[3];
    if (triangle == BVH_NO_TRIANGLE) {
        say_nothing(rays, from, to);
        return;
    }
    vec3_sub(rays->from.at_m, bvh->origin_m, o);
    set_one(&p, bvh, triangle, o);
    const struct bvh_rays r = *rays; /* a copy: writing to the arrays cannot change it */
    for (; from < to && r.n - from >= LANES; from += LANES)
        ranges_of_lanes(&p, &r, from);
    for (; from < to; from++)
        range_of_one(&p, &r, from);
}

void bvh_ranges_each(const struct bvh *bvh, const uint32_t *triangle, const struct bvh_rays *rays, uint32_t from,
                     uint32_t to)
{
    struct one_plane p;
    double o[3];
    vec3_sub(rays->from.at_m, bvh->origin_m, o);
    for (uint32_t i = from; i < to; i++) {
        if (triangle[i - from] == BVH_NO_TRIANGLE) {
            say_nothing(rays, i, i + 1);
        } else if (triangle[i - from] < bvh->scene->n_triangles) {
            set_one(&p, bvh, triangle[i - from], o);
            range_of_one(&p, rays, i);
        }
    }
}

VEC_CLONES
static void find_cosines(const struct bvh *bvh, const uint32_t *restrict triangle, const struct vec3_in *dir,
                         uint32_t n, double *restrict cosine)
{
    const double *tri = (const double *)bvh->leaf, *dx = dir->x, *dy = dir->y, *dz = dir->z;
    const uint32_t n_triangles = bvh->scene->n_triangles, *at_plane = bvh->at_plane;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        const int64_t at = doubles_before(at_plane, triangle[i], n_triangles);
        double nx = tri[at], ny = tri[at + 1], nz = tri[at + 2];
        double c = fabs(nx * dx[i] + ny * dy[i] + nz * dz[i]) / sqrt(nx * nx + ny * ny + nz * nz);
        cosine[i] = c > 1.0 ? 1.0 : c;
    }
}

void bvh_cosines(const struct bvh *bvh, const uint32_t *triangle, const struct vec3_in *dir, uint32_t n, double *cosine)
{
    if (bvh->scene->n_copies > 0)
        bvh_cosines_copies(bvh, triangle, dir, n, cosine);
    else
        find_cosines(bvh, triangle, dir, n, cosine);
}
