/* SPDX-License-Identifier: MIT */
#include "tests/common/embree_alone.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/base/clock.h"

#if RTC_VERSION_MAJOR >= 4
#define CONTEXT(name)                  \
    struct RTCIntersectArguments name; \
    rtcInitIntersectArguments(&name);  \
    name.flags = RTC_RAY_QUERY_FLAG_COHERENT
#define CALL(w, valid, scene, ctx, rays) rtcIntersect##w(valid, scene, rays, ctx)
#define CALL_ONE(scene, ctx, ray)        rtcIntersect1(scene, ray, ctx)
#else
#define CONTEXT(name)                \
    struct RTCIntersectContext name; \
    rtcInitIntersectContext(&name);  \
    name.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT
#define CALL(w, valid, scene, ctx, rays) rtcIntersect##w(valid, scene, ctx, rays)
#define CALL_ONE(scene, ctx, ray)        rtcIntersect1(scene, ctx, ray)
#endif

static int fill_geometry(RTCGeometry geometry, const struct scene *scene, const double origin_m[3], struct sh_err *err)
{
    float *vertex = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float),
                                            scene->n_vertices);
    uint32_t *index = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                              3 * sizeof(uint32_t), scene->n_triangles);
    if (vertex == NULL || index == NULL) return sh_fail(err, SH_ENOMEM, "Embree alone: no memory for Embree's mesh");
    for (size_t i = 0; i < scene->n_vertices; i++)
        for (int j = 0; j < 3; j++)
            vertex[3 * i + (size_t)j] = (float)(scene->vertex_m[i][j] - origin_m[j]);
    memcpy(index, scene->triangle, scene->n_triangles * sizeof *scene->triangle);
    return SH_OK;
}

int embree_alone_create(const struct scene *scene, const struct embree_alone_spec *spec, struct embree_alone *out,
                        struct sh_err *err)
{
    char threads[32];
    snprintf(threads, sizeof threads, "threads=%u", spec->threads);
    *out = (struct embree_alone){.range_max_m = spec->range_max_m};
    out->device = rtcNewDevice(threads);
    if (out->device == NULL) return embree_fail(rtcGetDeviceError(NULL), err);
    int64_t start_ns = clock_now_ns();
    RTCGeometry geometry = rtcNewGeometry(out->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    int rc = fill_geometry(geometry, scene, spec->origin_m, err);
    if (rc == SH_OK) {
        const enum RTCBuildQuality quality = spec->medium ? RTC_BUILD_QUALITY_MEDIUM : RTC_BUILD_QUALITY_HIGH;
        rtcSetGeometryBuildQuality(geometry, quality);
        rtcCommitGeometry(geometry);
        out->rtc = rtcNewScene(out->device);
        rtcSetSceneFlags(out->rtc, spec->robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
        rtcSetSceneBuildQuality(out->rtc, quality);
        rtcAttachGeometry(out->rtc, geometry);
        rtcCommitScene(out->rtc);
        if (rtcGetDeviceError(out->device) != RTC_ERROR_NONE)
            rc = sh_fail(err, SH_ENOMEM, "Embree alone: Embree's build failed");
    }
    rtcReleaseGeometry(geometry);
    out->build_s = 1e-9 * (double)(clock_now_ns() - start_ns);
    if (rc != SH_OK) embree_alone_free(out);
    return rc;
}

void embree_alone_free(struct embree_alone *e)
{
    if (e->rtc != NULL) rtcReleaseScene(e->rtc);
    if (e->device != NULL) rtcReleaseDevice(e->device);
    free(e->packets);
    free(e->prim);
    free(e->t);
    memset(e, 0, sizeof *e);
}

int embree_alone_rays(struct embree_alone *e, const float *fx, const float *fy, const float *fz, uint32_t n,
                      struct sh_err *err)
{
    free(e->packets);
    free(e->prim);
    free(e->t);
    e->packets = NULL;
    e->width = 0;
    e->n = n;
    e->fx = fx;
    e->fy = fy;
    e->fz = fz;
    e->prim = aligned_alloc(64, n * sizeof *e->prim);
    e->t = aligned_alloc(64, n * sizeof *e->t);
    return e->prim != NULL && e->t != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "Embree alone: no memory for %u rays", n);
}

/* Members that the cast of a packet does not change are set once. Misaligned packets or masks make Embree crash. */
#define PACKET_FUNCTIONS(W)                                                                                           \
    static void set_##W(struct RTCRayHit##W *p, const struct embree_alone *e)                                         \
    {                                                                                                                 \
        memset(p, 0, sizeof *p);                                                                                      \
        for (uint32_t i = 0; i < W; i++) {                                                                            \
            p->ray.org_x[i] = e->ray_origin[0];                                                                       \
            p->ray.org_y[i] = e->ray_origin[1];                                                                       \
            p->ray.org_z[i] = e->ray_origin[2];                                                                       \
            p->ray.mask[i] = 0xffffffffU;                                                                             \
            p->hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;                                                            \
        }                                                                                                             \
    }                                                                                                                 \
    static void load_##W(struct RTCRayHit##W *p, const struct embree_alone *e, uint32_t base)                         \
    {                                                                                                                 \
        for (uint32_t i = 0; i < W; i++) {                                                                            \
            p->ray.dir_x[i] = e->fx[base + i];                                                                        \
            p->ray.dir_y[i] = e->fy[base + i];                                                                        \
            p->ray.dir_z[i] = e->fz[base + i];                                                                        \
        }                                                                                                             \
    }                                                                                                                 \
    static void reset_##W(struct RTCRayHit##W *p, float range_max_m)                                                  \
    {                                                                                                                 \
        for (uint32_t i = 0; i < W; i++) {                                                                            \
            p->ray.tfar[i] = range_max_m;                                                                             \
            p->hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;                                                               \
        }                                                                                                             \
    }                                                                                                                 \
    static void pass_prepared_##W(const struct embree_alone *e, uint32_t first, uint32_t n)                           \
    {                                                                                                                 \
        CONTEXT(context);                                                                                             \
        int valid[W] __attribute__((aligned(64)));                                                                    \
        struct RTCRayHit##W *packet = (struct RTCRayHit##W *)e->packets + first / W;                                  \
        memset(valid, 0xff, sizeof valid);                                                                            \
        for (uint32_t base = 0; base < n; base += W, packet++) {                                                      \
            reset_##W(packet, e->range_max_m);                                                                        \
            CALL(W, valid, e->rtc, &context, packet);                                                                 \
        }                                                                                                             \
    }                                                                                                                 \
    static void pass_loaded_##W(const struct embree_alone *e, uint32_t first, uint32_t n)                             \
    {                                                                                                                 \
        CONTEXT(context);                                                                                             \
        int valid[W] __attribute__((aligned(64)));                                                                    \
        struct RTCRayHit##W packet __attribute__((aligned(64)));                                                      \
        memset(valid, 0xff, sizeof valid);                                                                            \
        set_##W(&packet, e);                                                                                          \
        for (uint32_t base = first; base < first + n; base += W) {                                                    \
            load_##W(&packet, e, base);                                                                               \
            reset_##W(&packet, e->range_max_m);                                                                       \
            CALL(W, valid, e->rtc, &context, &packet);                                                                \
            for (uint32_t i = 0; i < W; i++) {                                                                        \
                e->prim[base + i] =                                                                                   \
                    packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID ? RTC_INVALID_GEOMETRY_ID : packet.hit.primID[i]; \
                e->t[base + i] = packet.ray.tfar[i];                                                                  \
            }                                                                                                         \
        }                                                                                                             \
    }                                                                                                                 \
    static void refill_##W(const struct embree_alone *e)                                                              \
    {                                                                                                                 \
        struct RTCRayHit##W *packet = e->packets;                                                                     \
        for (uint32_t i = 0; i < e->n / W; i++)                                                                       \
            load_##W(packet + i, e, i * W);                                                                           \
    }                                                                                                                 \
    static void *prepare_##W(const struct embree_alone *e)                                                            \
    {                                                                                                                 \
        struct RTCRayHit##W *packet = aligned_alloc(64, e->n / W * sizeof *packet);                                   \
        for (uint32_t i = 0; packet != NULL && i < e->n / W; i++)                                                     \
            set_##W(packet + i, e);                                                                                   \
        return packet;                                                                                                \
    }

PACKET_FUNCTIONS(4)
PACKET_FUNCTIONS(8)
PACKET_FUNCTIONS(16)

/* A pass of one ray at a time only serves for comparison, so it always reads from the arrays. */
static void pass_1(const struct embree_alone *e, uint32_t first, uint32_t n)
{
    CONTEXT(context);
    struct RTCRayHit ray __attribute__((aligned(64)));
    memset(&ray, 0, sizeof ray);
    ray.ray.org_x = e->ray_origin[0];
    ray.ray.org_y = e->ray_origin[1];
    ray.ray.org_z = e->ray_origin[2];
    ray.ray.mask = 0xffffffffU;
    ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    for (uint32_t i = first; i < first + n; i++) {
        ray.ray.dir_x = e->fx[i];
        ray.ray.dir_y = e->fy[i];
        ray.ray.dir_z = e->fz[i];
        ray.ray.tfar = e->range_max_m;
        ray.hit.geomID = ray.hit.primID = RTC_INVALID_GEOMETRY_ID;
        CALL_ONE(e->rtc, &context, &ray);
        e->prim[i] = ray.hit.primID;
        e->t[i] = ray.ray.tfar;
    }
}

int embree_alone_prepare(struct embree_alone *e, uint32_t width, enum embree_feed feed, struct sh_err *err)
{
    if (width == 1 || feed == EMBREE_LOADED || e->width == width) return SH_OK;
    free(e->packets);
    e->packets = width == 4 ? prepare_4(e) : width == 8 ? prepare_8(e) : prepare_16(e);
    e->width = e->packets != NULL ? width : 0;
    embree_alone_refill(e);
    return e->packets != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "Embree alone: no memory for %u rays", e->n);
}

void embree_alone_refill(const struct embree_alone *e)
{
    if (e->width == 4) refill_4(e);
    if (e->width == 8) refill_8(e);
    if (e->width == 16) refill_16(e);
}

void embree_alone_pass(const struct embree_alone *e, uint32_t width, enum embree_feed feed, uint32_t first, uint32_t n)
{
    static void (*const pass[2][3])(const struct embree_alone *, uint32_t, uint32_t) = {
        [EMBREE_PREPARED] = {pass_prepared_4, pass_prepared_8, pass_prepared_16},
        [EMBREE_LOADED] = {pass_loaded_4, pass_loaded_8, pass_loaded_16},
    };
    if (width == 1)
        pass_1(e, first, n);
    else
        pass[feed][width == 4 ? 0 : width == 8 ? 1 : 2](e, first, n);
}
