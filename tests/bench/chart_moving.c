/* SPDX-License-Identifier: MIT */
/* This measures a head that moves, and a body that moves, and prints rows of the chart's table.
 *
 * Each ray begins at its own point, and each chunk of rays sees another pose of the body. The program is compared with
 * Embree's own means: rays in float over float triangles, and for the body an instance of it with a float transform.
 * Errors are against tests/common/reference, in long double. Rays of the body are taken into its frame in long double
 * as well. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/mat3.h"
#include "core/pose.h"
#include "tests/bench/bench.h"
#include "tests/bench/pin.h"
#include "tests/common/generate.h"
#include "tests/common/reference.h"

enum { RAYS = 64 * BVH_CHUNK, ROUNDS = 9, WIDTHS = 4, METHODS = 3 * WIDTHS, SAMPLE_EVERY = 4 };
static const uint32_t WIDTH[WIDTHS] = {1, 4, 8, 16};
static const double BODY_M = 10.0, AWAY_M = 40.0; /* its radius, and how far from the head it goes */

struct method {
    int embree, robust;
    uint32_t width;
    double ns[ROUNDS], ns_median, p999_m, max_m;
};

struct world {
    int body; /* if 0, the head moves */
    struct scene *scene;
    struct bvh *bvh;
    struct bvh_work *work;
    RTCDevice device;
    RTCScene mesh[2], top[2]; /* not robust, robust; top is the scene that rays are cast into */
    RTCGeometry instance[2];
    double *o[3], *d[3], *range_m; /* in the frame of the scene */
    uint32_t *triangle;
    double rotation[RAYS / BVH_CHUNK][9], shift_m[RAYS / BVH_CHUNK][3];
    struct method method[METHODS];
};

static RTCScene embree_mesh(RTCDevice device, const struct scene *scene, enum RTCSceneFlags flags)
{
    RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    float *v = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, scene->n_vertices);
    void *t = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, scene->n_triangles);
    RTCScene out = rtcNewScene(device);
    for (size_t i = 0; i < 3 * (size_t)scene->n_vertices; i++)
        v[i] = (float)scene->vertex_m[i / 3][i % 3];
    memcpy(t, scene->triangle, 12 * (size_t)scene->n_triangles);
    rtcCommitGeometry(g);
    rtcAttachGeometry(out, g);
    rtcReleaseGeometry(g);
    rtcSetSceneFlags(out, flags);
    rtcSetSceneBuildQuality(out, RTC_BUILD_QUALITY_HIGH);
    rtcCommitScene(out);
    return out;
}

static void open_embree(struct world *w)
{
    w->device = rtcNewDevice("threads=1");
    for (int robust = 0; robust < 2; robust++) {
        const enum RTCSceneFlags flags = robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE;
        w->mesh[robust] = embree_mesh(w->device, w->scene, flags);
        if (!w->body) continue;
        RTCGeometry g = w->instance[robust] = rtcNewGeometry(w->device, RTC_GEOMETRY_TYPE_INSTANCE);
        rtcSetGeometryInstancedScene(g, w->mesh[robust]);
        w->top[robust] = rtcNewScene(w->device);
        rtcAttachGeometry(w->top[robust], g);
        rtcSetSceneFlags(w->top[robust], flags | RTC_SCENE_FLAG_DYNAMIC);
    }
}

/* Embree takes the matrix row by row, 3 x 4. */
static void set_pose(const struct world *w, int robust, uint32_t chunk)
{
    float to[12];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            to[4 * i + j] = (float)w->rotation[chunk][3 * i + j];
        to[4 * i + 3] = (float)w->shift_m[chunk][i];
    }
    rtcSetGeometryTransform(w->instance[robust], 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, to);
    rtcCommitGeometry(w->instance[robust]);
    rtcCommitScene(w->top[robust]);
}

static void fill_packet(const struct world *w, uint32_t at, uint32_t width, float *org, float *dir, float *tfar,
                        uint32_t *geom)
{
    for (uint32_t k = 0; k < 3; k++)
        for (uint32_t i = 0; i < width; i++) {
            org[k * width + i] = (float)w->o[k][at + i];
            dir[k * width + i] = (float)w->d[k][at + i];
        }
    for (uint32_t i = 0; i < width; i++) {
        tfar[i] = (float)BENCH_RANGE_MAX_M;
        geom[i] = RTC_INVALID_GEOMETRY_ID;
    }
}

#if RTC_VERSION_MAJOR >= 4
#define CONTEXT()                     \
    struct RTCIntersectArguments how; \
    rtcInitIntersectArguments(&how);  \
    how.flags = RTC_RAY_QUERY_FLAG_COHERENT
#define CALL(w, valid, scene, rays) rtcIntersect##w(valid, scene, rays, &how)
#define CALL_ONE(scene, rays)       rtcIntersect1(scene, rays, &how)
#else
#define CONTEXT()                   \
    struct RTCIntersectContext how; \
    rtcInitIntersectContext(&how);  \
    how.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT
#define CALL(w, valid, scene, rays) rtcIntersect##w(valid, scene, &how, rays)
#define CALL_ONE(scene, rays)       rtcIntersect1(scene, &how, rays)
#endif
#define CAST_PACKETS(W)                                                                                                \
    static void cast_##W(struct world *w, RTCScene scene, uint32_t first)                                              \
    {                                                                                                                  \
        CONTEXT();                                                                                                     \
        struct RTCRayHit##W p __attribute__((aligned(64))) = {0};                                                      \
        int valid[W] __attribute__((aligned(64)));                                                                     \
        memset(valid, 0xff, sizeof valid);                                                                             \
        memset(p.ray.mask, 0xff, sizeof p.ray.mask);                                                                   \
        for (uint32_t at = first; at < first + BVH_CHUNK; at += W) {                                                   \
            fill_packet(w, at, W, p.ray.org_x, p.ray.dir_x, p.ray.tfar, p.hit.geomID);                                 \
            CALL(W, valid, scene, &p);                                                                                 \
            for (uint32_t i = 0; i < W; i++)                                                                           \
                w->range_m[at + i] = p.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID ? (double)NAN : (double)p.ray.tfar[i]; \
        }                                                                                                              \
    }
CAST_PACKETS(4)
CAST_PACKETS(8)
CAST_PACKETS(16)

static void cast_1(struct world *w, RTCScene scene, uint32_t first)
{
    CONTEXT();
    for (uint32_t at = first; at < first + BVH_CHUNK; at++) {
        struct RTCRayHit r = {.ray.mask = 0xffffffff};
        float org[3], dir[3];
        fill_packet(w, at, 1, org, dir, &r.ray.tfar, &r.hit.geomID);
        r.ray.org_x = org[0], r.ray.org_y = org[1], r.ray.org_z = org[2];
        r.ray.dir_x = dir[0], r.ray.dir_y = dir[1], r.ray.dir_z = dir[2];
        CALL_ONE(scene, &r);
        w->range_m[at] = r.hit.geomID == RTC_INVALID_GEOMETRY_ID ? (double)NAN : (double)r.ray.tfar;
    }
}

static void cast_embree(struct world *w, const struct method *m)
{
    const RTCScene scene = w->body ? w->top[m->robust] : w->mesh[m->robust];
    for (uint32_t at = 0; at < RAYS; at += BVH_CHUNK) {
        if (w->body) set_pose(w, m->robust, at / BVH_CHUNK);
        (m->width == 16 ? cast_16 : m->width == 8 ? cast_8 : m->width == 4 ? cast_4 : cast_1)(w, scene, at);
    }
}

/* Takes a ray into the body's frame as core/cast does. */
static void to_body(const struct world *w, uint32_t i, double o[3], double d[3])
{
    const uint32_t chunk = i / BVH_CHUNK;
    const double dir[3] = {w->d[0][i], w->d[1][i], w->d[2][i]};
    const double at[3] = {w->o[0][i] - w->shift_m[chunk][0], w->o[1][i] - w->shift_m[chunk][1],
                          w->o[2][i] - w->shift_m[chunk][2]};
    mat3_apply_transposed(w->rotation[chunk], at, o);
    mat3_apply_transposed(w->rotation[chunk], dir, d);
}

static void cast_ours(struct world *w, uint32_t width)
{
    static double o[3][BVH_CHUNK], d[3][BVH_CHUNK];
    bvh_set_packet(w->bvh, width);
    for (uint32_t first = 0; first < RAYS; first += BVH_CHUNK) {
        struct bvh_rays rays = {.n = BVH_CHUNK,
                                .from.own = {w->o[0] + first, w->o[1] + first, w->o[2] + first},
                                .dir = {w->d[0] + first, w->d[1] + first, w->d[2] + first},
                                .range_max_m = BENCH_RANGE_MAX_M,
                                .range_m = w->range_m + first,
                                .triangle = w->triangle + first};
        for (uint32_t i = 0; w->body && i < BVH_CHUNK; i++) {
            double at[3], dir[3];
            to_body(w, first + i, at, dir);
            for (int k = 0; k < 3; k++) {
                o[k][i] = at[k];
                d[k][i] = dir[k];
            }
        }
        if (w->body) {
            rays.from.own = (struct vec3_in){o[0], o[1], o[2]};
            rays.dir = (struct vec3_in){d[0], d[1], d[2]};
        }
        bvh_hits(w->work, w->bvh, &rays);
    }
}

static void cast(struct world *w, const struct method *m)
{
    if (m->embree)
        cast_embree(w, m);
    else
        cast_ours(w, m->width);
}

/* ---- rays */

/* Makes lines of a head that moves 10 m sideways while it casts them, to the ground or at the body. */
static void aim(struct world *w)
{
    for (uint32_t i = 0; i < RAYS; i++) {
        const uint32_t line = i / BVH_CHUNK, n = i % BVH_CHUNK;
        const double part = (i + 0.5) / RAYS, across = (n + 0.5) / BVH_CHUNK - 0.5;
        const double turn = w->body ? 0.2 * ((line + 0.5) * BVH_CHUNK / RAYS - 0.5) : 2.0 * M_PI * part;
        const double up = w->body ? 0.4 * across : M_PI * (across * 100.0 / 180.0 + 10.0 / 180.0);
        const double d[3] = {sin(turn) * cos(up), cos(turn) * cos(up), sin(up)};
        const double o[3] = {10.0 * part, 0.0, w->body ? 0.0 : 4.7};
        for (int k = 0; k < 3; k++) {
            w->o[k][i] = o[k];
            w->d[k][i] = d[k];
        }
    }
}

/* The body spins once while it goes by. */
static void move_body(struct world *w)
{
    for (uint32_t c = 0; c < RAYS / BVH_CHUNK; c++) {
        const double part = (c + 0.5) * BVH_CHUNK / RAYS;
        pose_heading(2.0 * M_PI * part, w->rotation[c]);
        w->shift_m[c][0] = 10.0 * part;
        w->shift_m[c][1] = AWAY_M + part;
        w->shift_m[c][2] = 0.3;
    }
}

/* ---- errors: a missed ray, and one that meets something where nothing is, are wrong by the whole range */

static double *true_ranges(const struct world *w)
{
    struct reference *r = reference_create((const double(*)[3])w->scene->vertex_m,
                                           (const uint32_t(*)[3])w->scene->triangle, w->scene->n_triangles);
    double *range_m = malloc(RAYS / SAMPLE_EVERY * sizeof *range_m);
    for (uint32_t i = 0; r != NULL && range_m != NULL && i < RAYS; i += SAMPLE_EVERY) {
        double o[3] = {w->o[0][i], w->o[1][i], w->o[2][i]}, d[3] = {w->d[0][i], w->d[1][i], w->d[2][i]};
        if (w->body) to_body(w, i, o, d);
        range_m[i / SAMPLE_EVERY] = (double)reference_cast(r, o, d).range_m;
    }
    reference_free(r);
    return range_m;
}

static void measure_error(struct world *w, struct method *m, const double *truth_m)
{
    static double error_m[RAYS / SAMPLE_EVERY];
    uint32_t n = 0;
    cast(w, m);
    for (uint32_t i = 0; i < RAYS / SAMPLE_EVERY; i++) {
        const double range_m = w->range_m[i * SAMPLE_EVERY];
        if (isnan(truth_m[i]) && isnan(range_m)) continue;
        error_m[n++] = isnan(range_m) ? truth_m[i] : isnan(truth_m[i]) ? range_m : fabs(range_m - truth_m[i]);
    }
    bench_sort(error_m, n);
    m->p999_m = error_m[(uint32_t)ceil(0.999 * n) - 1];
    m->max_m = error_m[n - 1];
}

/* ---- the table */

static int is_beaten(const struct method *a, const struct method *b)
{
    const int no_worse = b->ns_median <= a->ns_median && b->p999_m <= a->p999_m && b->max_m <= a->max_m;
    return no_worse && (b->ns_median < a->ns_median || b->p999_m < a->p999_m || b->max_m < a->max_m);
}

static void print_rows(const struct world *w, uint32_t native)
{
    for (int i = 0; i < METHODS; i++) {
        const struct method *m = &w->method[i];
        int front = 1;
        for (int k = 0; k < METHODS; k++)
            front &= !is_beaten(m, &w->method[k]);
        printf("moving,%s %u,%s,%.3f,%.3g,%.3g,%d,%d,,\n",
               !m->embree  ? "decided"
               : m->robust ? "robust float"
                           : "plain float",
               m->width, w->body ? "body" : "head", m->ns_median, m->p999_m, m->max_m, front,
               !m->embree && m->width == native);
    }
    fflush(stdout);
}

static void measure(struct world *w)
{
    for (int round = 0; round < ROUNDS; round++)
        for (int i = 0; i < METHODS; i++) {
            const double start_s = bench_thread_s();
            cast(w, &w->method[i]);
            w->method[i].ns[round] = 1e9 * (bench_thread_s() - start_s) / RAYS;
        }
    for (int i = 0; i < METHODS; i++)
        w->method[i].ns_median = bench_median(w->method[i].ns, ROUNDS);
}

static int set_up(struct world *w, struct sh_err *err)
{
    static const double centre_m[2] = {0.0, 0.0};
    /* The ground and the ceiling are faces of the body. */
    int rc = generate_terrain(100000, w->body ? 1.2 * BODY_M : 200.0, w->body ? 0.1 : 3.0, centre_m, 1, &w->scene, err);
    if (rc == SH_OK) rc = bvh_create(w->scene, 1, NULL, &w->bvh, err);
    if (rc == SH_OK) rc = bvh_work_create(&w->work, err);
    for (int k = 0; k < 3; k++) {
        w->o[k] = malloc(RAYS * sizeof(double));
        w->d[k] = malloc(RAYS * sizeof(double));
        if (rc == SH_OK && (w->o[k] == NULL || w->d[k] == NULL)) rc = sh_fail(err, SH_ENOMEM, "no memory");
    }
    w->range_m = malloc(RAYS * sizeof *w->range_m);
    w->triangle = malloc(RAYS * sizeof *w->triangle);
    if (rc == SH_OK && (w->range_m == NULL || w->triangle == NULL)) rc = sh_fail(err, SH_ENOMEM, "no memory");
    if (rc != SH_OK) return rc;
    open_embree(w);
    for (int i = 0; i < METHODS; i++)
        w->method[i] = (struct method){.embree = i < 2 * WIDTHS, .robust = i >= WIDTHS, .width = WIDTH[i % WIDTHS]};
    if (w->body) move_body(w);
    aim(w);
    return SH_OK;
}

static void tear_down(struct world *w)
{
    for (int robust = 0; robust < 2 && w->device != NULL; robust++) {
        if (w->body) {
            rtcReleaseGeometry(w->instance[robust]);
            rtcReleaseScene(w->top[robust]);
        }
        rtcReleaseScene(w->mesh[robust]);
    }
    if (w->device != NULL) rtcReleaseDevice(w->device);
    for (int k = 0; k < 3; k++) {
        free(w->o[k]);
        free(w->d[k]);
    }
    free(w->range_m);
    free(w->triangle);
    bvh_work_free(w->work);
    bvh_free(w->bvh);
    scene_free(w->scene);
}

static int draw(int body, struct sh_err *err)
{
    static struct world w;
    struct bvh_info info;
    memset(&w, 0, sizeof w);
    w.body = body;
    fprintf(stderr, "chart: a %s that moves\n", body ? "body" : "head");
    int rc = set_up(&w, err);
    double *truth_m = rc == SH_OK ? true_ranges(&w) : NULL;
    if (rc == SH_OK && truth_m == NULL) rc = sh_fail(err, SH_ENOMEM, "no memory");
    if (rc == SH_OK) {
        info = *bvh_get_info(w.bvh);
        for (int i = 0; i < METHODS; i++)
            measure_error(&w, &w.method[i], truth_m);
        measure(&w);
        print_rows(&w, info.packet);
    }
    free(truth_m);
    tear_down(&w);
    return rc;
}

int main(void)
{
    struct sh_err err;
    pin(NULL);
    for (int body = 0; body < 2; body++)
        if (draw(body, &err) != SH_OK) {
            fprintf(stderr, "chart: %s\n", err.text);
            return 1;
        }
    return fflush(stdout) == 0 ? 0 : 1;
}
