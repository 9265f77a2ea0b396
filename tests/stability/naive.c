#include "tests/stability/naive.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/embree.h"

struct naive {
    RTCDevice device;
    RTCScene rtc;
    double origin_m[3];
};

static int fill(RTCGeometry geometry, const struct scene *scene, const double origin_m[3])
{
    float *vertex = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof *vertex,
                                            scene->n_vertices);
    uint32_t *index = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof *index,
                                              scene->n_triangles);
    if (vertex == NULL || index == NULL) return -1;
    for (size_t i = 0; i < 3 * (size_t)scene->n_vertices; i++)
        vertex[i] = (float)(scene->vertex_m[i / 3][i % 3] - origin_m[i % 3]);
    for (size_t i = 0; i < 3 * (size_t)scene->n_triangles; i++)
        index[i] = scene->triangle[i / 3][i % 3];
    return 0;
}

struct naive *naive_create(const struct scene *scene, const double origin_m[3], int robust, unsigned build_threads)
{
    struct naive *naive = calloc(1, sizeof *naive);
    char config[32];
    snprintf(config, sizeof config, "threads=%u", build_threads);
    if (naive == NULL) return NULL;
    for (int k = 0; k < 3; k++)
        naive->origin_m[k] = origin_m[k];
    naive->device = rtcNewDevice(config);
    RTCGeometry geometry = rtcNewGeometry(naive->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    int rc = fill(geometry, scene, origin_m);
    rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_HIGH);
    rtcCommitGeometry(geometry);
    naive->rtc = rtcNewScene(naive->device);
    rtcSetSceneFlags(naive->rtc, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
    rtcSetSceneBuildQuality(naive->rtc, RTC_BUILD_QUALITY_HIGH);
    rtcAttachGeometry(naive->rtc, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(naive->rtc);
    if (rc == 0 && rtcGetDeviceError(naive->device) == RTC_ERROR_NONE) return naive;
    naive_free(naive);
    return NULL;
}

void naive_free(struct naive *naive)
{
    if (naive == NULL) return;
    rtcReleaseScene(naive->rtc);
    rtcReleaseDevice(naive->device);
    free(naive);
}

#if RTC_VERSION_MAJOR >= 4
#define CALL(w, valid, rtc, rays) rtcIntersect##w(valid, rtc, rays, &context)
#define CALL_ONE(rtc, ray)        rtcIntersect1(rtc, ray, &context)
#define CONTEXT                           \
    struct RTCIntersectArguments context; \
    rtcInitIntersectArguments(&context);  \
    context.flags = RTC_RAY_QUERY_FLAG_COHERENT
#else
#define CALL(w, valid, rtc, rays) rtcIntersect##w(valid, rtc, &context, rays)
#define CALL_ONE(rtc, ray)        rtcIntersect1(rtc, &context, ray)
#define CONTEXT                         \
    struct RTCIntersectContext context; \
    rtcInitIntersectContext(&context);  \
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT
#endif

#define PACKETS_OF(W)                                                                                           \
    static void hits_##W(const struct naive *naive, const float org[3], uint32_t n, const double *dx,           \
                         const double *dy, const double *dz, double *range_m, uint32_t *triangle)               \
    {                                                                                                           \
        CONTEXT;                                                                                                \
        for (uint32_t base = 0; base < n; base += W) {                                                          \
            struct RTCRayHit##W packet __attribute__((aligned(64))) = {0};                                      \
            int valid[W] __attribute__((aligned(64)));                                                          \
            for (uint32_t i = 0; i < W; i++) {                                                                  \
                uint32_t at = base + i < n ? base + i : base;                                                   \
                valid[i] = base + i < n ? -1 : 0;                                                               \
                packet.ray.org_x[i] = org[0];                                                                   \
                packet.ray.org_y[i] = org[1];                                                                   \
                packet.ray.org_z[i] = org[2];                                                                   \
                packet.ray.dir_x[i] = (float)dx[at];                                                            \
                packet.ray.dir_y[i] = (float)dy[at];                                                            \
                packet.ray.dir_z[i] = (float)dz[at];                                                            \
                packet.ray.tfar[i] = INFINITY;                                                                  \
                packet.ray.mask[i] = 0xffffffffU;                                                               \
                packet.hit.geomID[i] = packet.hit.primID[i] = RTC_INVALID_GEOMETRY_ID;                          \
                packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;                                              \
            }                                                                                                   \
            CALL(W, valid, naive->rtc, &packet);                                                                \
            for (uint32_t i = 0; i < W && base + i < n; i++) {                                                  \
                triangle[base + i] = packet.hit.primID[i];                                                      \
                range_m[base + i] =                                                                             \
                    packet.hit.primID[i] == RTC_INVALID_GEOMETRY_ID ? (double)NAN : (double)packet.ray.tfar[i]; \
            }                                                                                                   \
        }                                                                                                       \
    }

PACKETS_OF(4)
PACKETS_OF(8)
PACKETS_OF(16)

static void hits_1(const struct naive *naive, const float org[3], uint32_t n, const double *dx, const double *dy,
                   const double *dz, double *range_m, uint32_t *triangle)
{
    CONTEXT;
    for (uint32_t i = 0; i < n; i++) {
        struct RTCRayHit ray = {.ray = {.org_x = org[0],
                                        .org_y = org[1],
                                        .org_z = org[2],
                                        .dir_x = (float)dx[i],
                                        .dir_y = (float)dy[i],
                                        .dir_z = (float)dz[i],
                                        .tfar = INFINITY,
                                        .mask = 0xffffffffU},
                                .hit = {.geomID = RTC_INVALID_GEOMETRY_ID, .primID = RTC_INVALID_GEOMETRY_ID}};
        ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
        CALL_ONE(naive->rtc, &ray);
        triangle[i] = ray.hit.primID;
        range_m[i] = ray.hit.primID == RTC_INVALID_GEOMETRY_ID ? (double)NAN : (double)ray.ray.tfar;
    }
}

void naive_hits(const struct naive *naive, unsigned packet, const double station_m[3], uint32_t n, const double *dx,
                const double *dy, const double *dz, double *range_m, uint32_t *triangle)
{
    float org[3];
    for (int k = 0; k < 3; k++)
        org[k] = (float)(station_m[k] - naive->origin_m[k]);
    if (packet == 16)
        hits_16(naive, org, n, dx, dy, dz, range_m, triangle);
    else if (packet == 8)
        hits_8(naive, org, n, dx, dy, dz, range_m, triangle);
    else if (packet == 4)
        hits_4(naive, org, n, dx, dy, dz, range_m, triangle);
    else
        hits_1(naive, org, n, dx, dy, dz, range_m, triangle);
}
