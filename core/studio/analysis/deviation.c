/* SPDX-License-Identifier: MIT */
/* Deviations along the beam; definitions in core/studio/deviation.h. */
#include "core/studio/deviation.h"

#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "core/distance.h"
#include "core/together.h"
#include "core/vec3.h"

enum { CHUNK = 16 * BVH_CHUNK, PLACES_AROUND = 12 };

/* Tolerances of "on a smooth face" (core/studio/deviation.h): the share of the distance, and a length. */
static const double SAME_SHARE = 0.01, SAME_M = 2e-6;

/* PLACES_AROUND rays run around a footprint, at this many radii from its centre. So an outline that cuts the footprint
 * can't pass between two of these rays. */
static const double AROUND = 1.1;

/* Smaller balls are not searched: surfaces so near to each other can't be told apart, however small the noise. */
static const double LEAST_CLEAR_M = 2e-5;

struct work {
    const struct cloud_compared *of;
    const struct deviation_head *head;
    const struct deviation_points *out;
    const struct sh_report *report;
    size_t every; /* sigma is computed for one of this many points */
    atomic_size_t next;
    atomic_int failed;
};

/* Rays of one station, and the points that they lead to. */
struct batch {
    struct bvh_work *bvh;
    uint32_t n;
    size_t point[BVH_CHUNK];
    double x[BVH_CHUNK], y[BVH_CHUNK], z[BVH_CHUNK], range_m[BVH_CHUNK], hit_m[BVH_CHUNK];
    uint32_t triangle[BVH_CHUNK];
    uint8_t is_cut[BVH_CHUNK];   /* the footprint meets something else, too */
    double around[4][BVH_CHUNK]; /* of rays along the footprint's border: directions, ranges */
    uint32_t triangle_around[BVH_CHUNK];
};

int deviation_points_create(size_t n, struct deviation_points *out, struct sh_err *err)
{
    float **array[] = {&out->along_m, &out->sigma_m, &out->counts_m, &out->cosine, &out->range_m};
    *out = (struct deviation_points){0};
    for (int k = 0; k < 5; k++)
        if ((*array[k] = malloc((n + 1) * sizeof(float))) == NULL) {
            deviation_points_free(out);
            return sh_fail(err, SH_ENOMEM, "no memory for the deviations of %zu points", n);
        }
    return SH_OK;
}

void deviation_points_free(struct deviation_points *points)
{
    free(points->along_m);
    free(points->sigma_m);
    free(points->counts_m);
    free(points->cosine);
    free(points->range_m);
    free(points->met);
    *points = (struct deviation_points){0};
}

/* Whether a place in the plane of a triangle is within the triangle. Barycentric coordinates from -1e-9 on count. */
static int crosses(const struct scene *scene, uint32_t triangle, const double at_m[3])
{
    const double *corner[3];
    double n[3];
    for (int k = 0; k < 3; k++)
        corner[k] = scene->vertex_m[scene->triangle[triangle][k]];
    vec3_normal(corner[0], corner[1], corner[2], n);
    const double least = -1e-9 * vec3_dot(n, n);
    for (int k = 0; k < 3; k++) {
        double c[3];
        vec3_normal(corner[k], corner[(k + 1) % 3], at_m, c);
        if (!(vec3_dot(c, n) >= least)) return 0;
    }
    return 1;
}

/* Sets the normal, and returns the cosine of the incidence. */
static double normal_of(const struct bvh *bvh, uint32_t triangle, struct deviation_hit *hit)
{
    const double *n = bvh_plane(bvh, triangle)->n;
    const double length = vec3_length(n);
    for (int k = 0; k < 3; k++)
        hit->normal[k] = n[k] / length;
    return fabs(vec3_dot(hit->normal, hit->beam));
}

/* Whether the nearest surface is the one that the beam hits: the distance is then the deviation times the cosine. */
static int deviation_is_same(double distance_m, double along_m, double cosine)
{
    const double across_m = fabs(along_m) * cosine;
    return fabs(distance_m - across_m) <= SAME_SHARE * across_m + SAME_M;
}

/* Whether nothing else lies around the place where the beam meets a face: within the balls of radius_m that touch it
 * there, in front and behind. */
static int is_alone(const struct bvh *bvh, const double at_m[3], const double normal[3], double radius_m)
{
    struct distance_hit hit;
    for (int side = -1; side <= 1; side += 2) {
        double middle[3];
        for (int k = 0; k < 3; k++)
            middle[k] = at_m[k] + side * radius_m * normal[k];
        if (distance_query(bvh, middle, 0.999 * radius_m, &hit)) return 0;
    }
    return 1;
}

/* Fibonacci hashing takes points evenly, whatever their order. */
static int is_sampled(const struct work *w, size_t i)
{
    return w->every <= 1 || ((uint64_t)i * 0x9e3779b97f4a7c15ULL >> 32) % w->every == 0;
}

static void deviation_judge(const struct work *w, const struct deviation_head *head, size_t i, const double at_m[3],
                            const struct deviation_hit *hit)
{
    if (!is_sampled(w, i)) return;
    double counts_m;
    const double sigma_m = deviation_sigma_m(head, hit, &counts_m),
                 radius_m = DEVIATION_CLEAR * hypot(sigma_m, counts_m);
    if (radius_m > LEAST_CLEAR_M && !is_alone(w->of->site->bvh, at_m, hit->normal, radius_m)) return;
    w->out->sigma_m[i] = (float)sigma_m;
    w->out->counts_m[i] = (float)counts_m;
}

/* Keeps a deviation on a smooth face: the beam hits the nearest surface, along_m before the point. */
static void deviation_keep(const struct work *w, const struct deviation_head *head, size_t i, double along_m,
                           const struct deviation_hit *hit)
{
    double at_m[3];
    for (int k = 0; k < 3; k++)
        at_m[k] = head->setup.station_m[k] + (hit->range_m - along_m) * hit->beam[k];
    w->out->along_m[i] = (float)along_m;
    deviation_judge(w, head, i, at_m, hit);
}

static void deviation_settle(const struct work *w, const struct batch *b, uint32_t k, const struct deviation_head *head)
{
    const struct bvh *bvh = head->setup.bvh;
    const struct scene *scene = bvh_scene(bvh);
    const size_t i = b->point[k];
    const double *from = head->setup.station_m;
    const uint32_t first = b->triangle[k], nearest = w->of->triangle[i];
    struct deviation_hit hit = {.range_m = b->range_m[k], .beam = {b->x[k], b->y[k], b->z[k]}, .label = -1};
    double along_m = (double)NAN, cosine = (double)NAN;
    int same = 0;
    if (first != BVH_NO_TRIANGLE && !isnan(b->hit_m[k])) {
        along_m = b->range_m[k] - b->hit_m[k];
        cosine = normal_of(bvh, first, &hit);
        hit.label = (int32_t)(scene->label[first] - scene->label0);
        same = deviation_is_same(w->of->distance_m[i], along_m, cosine);
    }
    if (same && w->out->met != NULL) w->out->met[i] = first;
    /* A later echo, or a point beyond glass, belongs to another surface than the first hit. */
    if (!same && nearest != first) {
        const double range_m = bvh_range_of(bvh, nearest, from, hit.beam);
        const double at_m[3] = {from[0] + range_m * hit.beam[0], from[1] + range_m * hit.beam[1],
                                from[2] + range_m * hit.beam[2]};
        if (range_m > 0.0 && crosses(scene, nearest, at_m)) {
            along_m = b->range_m[k] - range_m;
            cosine = normal_of(bvh, nearest, &hit);
            hit.label = -1; /* the share of the power that got there is not known */
            same = deviation_is_same(w->of->distance_m[i], along_m, cosine);
        }
    }
    w->out->cosine[i] = (float)cosine;
    if (same && b->is_cut[k] == 0) deviation_keep(w, head, i, along_m, &hit);
}

/* Whether a ray around the footprint hits the same plane as the ray in its middle. */
static int is_on_plane(const struct batch *b, uint32_t k, const struct bvh *bvh)
{
    if (b->triangle[k] == BVH_NO_TRIANGLE || b->triangle_around[k] == BVH_NO_TRIANGLE) return 0;
    const double *n = bvh_plane(bvh, b->triangle[k])->n;
    const double u[3] = {b->x[k], b->y[k], b->z[k]};
    const double v[3] = {b->around[0][k], b->around[1][k], b->around[2][k]};
    const double range_m = b->hit_m[k] * vec3_dot(n, u) / vec3_dot(n, v);
    return fabs(b->around[3][k] - range_m) <= 1e-6 * range_m + SAME_M;
}

/* Casts rays along the border of each footprint. Where one of them does not hit the plane of the middle, the footprint
 * is cut. */
static void look_around(struct batch *b, const struct deviation_head *head, const struct bvh_rays *central)
{
    struct bvh_rays rays = *central;
    rays.dir = (struct vec3_in){b->around[0], b->around[1], b->around[2]};
    rays.range_m = b->around[3];
    rays.triangle = b->triangle_around;
    for (int place = 0; place < PLACES_AROUND; place++) {
        const double turn = 2.0 * M_PI * place / PLACES_AROUND;
        for (uint32_t k = 0; k < b->n; k++) {
            const double u[3] = {b->x[k], b->y[k], b->z[k]};
            const double slope = AROUND * beam_radius(&head->setup.beam->beam, b->range_m[k]) / b->range_m[k];
            double e1[3], e2[3], v[3];
            beam_axes(u, e1, e2);
            for (int j = 0; j < 3; j++)
                v[j] = u[j] + slope * (cos(turn) * e1[j] + sin(turn) * e2[j]);
            const double length = vec3_length(v);
            for (int j = 0; j < 3; j++)
                b->around[j][k] = v[j] / length;
        }
        bvh_hits(b->bvh, head->setup.bvh, &rays);
        for (uint32_t k = 0; k < b->n; k++)
            b->is_cut[k] |= !is_on_plane(b, k, head->setup.bvh);
    }
}

static void cast(const struct work *w, struct batch *b, const struct deviation_head *head)
{
    if (b->n == 0) return;
    double far_m = 0.0;
    for (uint32_t k = 0; k < b->n; k++)
        far_m = fmax(far_m, b->range_m[k]);
    struct bvh_rays rays = {.n = b->n,
                            .dir = {b->x, b->y, b->z},
                            .range_max_m = 2.0 * far_m + 1.0,
                            .range_m = b->hit_m,
                            .triangle = b->triangle};
    memcpy(rays.from.at_m, head->setup.station_m, sizeof rays.from.at_m);
    bvh_hits(b->bvh, head->setup.bvh, &rays);
    memset(b->is_cut, 0, b->n);
    if (head->setup.beam != NULL) look_around(b, head, &rays);
    for (uint32_t k = 0; k < b->n; k++)
        deviation_settle(w, b, k, head);
    b->n = 0;
}

/* Adds the point's ray. Shots without echo, points far from the scene, and points on moving bodies have no ray. */
static void deviation_add(const struct work *w, struct batch *b, size_t i, const struct deviation_head *head)
{
    double p[3], d[3];
    const struct deviation_points *out = w->out;
    out->along_m[i] = out->sigma_m[i] = out->counts_m[i] = out->cosine[i] = out->range_m[i] = (float)NAN;
    if (out->met != NULL) out->met[i] = w->of->triangle[i];
    if (isnan(w->of->cloud->xyz_m[i][0])) return;
    cloud_to_scene(w->of->cloud, w->of->site, i, p);
    vec3_sub(p, head->setup.station_m, d);
    const double range_m = vec3_length(d);
    out->range_m[i] = (float)range_m;
    if (!isfinite(w->of->distance_m[i]) || w->of->triangle[i] == CLOUD_TRIANGLE_NONE || !(range_m > 0.0)) return;
    const uint32_t k = b->n++;
    b->point[k] = i;
    b->x[k] = d[0] / range_m;
    b->y[k] = d[1] / range_m;
    b->z[k] = d[2] / range_m;
    b->range_m[k] = range_m;
}

static void work_on(void *ctx, int reports)
{
    struct work *w = ctx;
    struct batch *b = malloc(sizeof *b);
    const size_t n = w->of->cloud->n;
    size_t first;
    if (b == NULL || bvh_work_create(&b->bvh, NULL) != SH_OK) {
        free(b);
        atomic_store(&w->failed, 1);
        return;
    }
    b->n = 0;
    while ((first = atomic_fetch_add(&w->next, CHUNK)) < n && !sh_stopped(w->report)) {
        const size_t end = n - first < CHUNK ? n : first + CHUNK;
        unsigned station = 0;
        for (size_t i = first; i < end; i++) {
            const unsigned its = cloud_station(w->of->cloud, i);
            if (b->n == BVH_CHUNK || (its != station && station != 0)) cast(w, b, &w->head[station - 1]);
            station = its;
            deviation_add(w, b, i, &w->head[station - 1]);
        }
        if (station != 0) cast(w, b, &w->head[station - 1]);
        if (reports) sh_progress(w->report, "following the beams", (double)end / (double)n);
    }
    bvh_work_free(b->bvh);
    free(b);
}

int deviation_along(const struct cloud_compared *compared, const struct deviation_head *head,
                    const struct sh_report *report, const struct deviation_points *out, struct sh_err *err)
{
    struct work w = {.of = compared,
                     .head = head,
                     .out = out,
                     .report = report,
                     .every = (compared->cloud->n + DEVIATION_SAMPLE - 1) / DEVIATION_SAMPLE};
    together(compared->site->threads, work_on, &w);
    if (atomic_load(&w.failed)) return sh_fail(err, SH_ENOMEM, "no memory to follow the beams");
    return sh_check_stop(report, err);
}
