/* Packets of 4, 8 and 16 rays into Embree: the same code by width. */
#include "core/cast/bvh.h"

#if RTC_VERSION_MAJOR >= 4
#define PACKET_CONTEXT(name)                                                                                           \
    struct RTCIntersectArguments name;                                                                                 \
    rtcInitIntersectArguments(&name);                                                                                  \
    name.flags = RTC_RAY_QUERY_FLAG_COHERENT
#define PACKET_CALL(w, valid, scene, ctx, rays) rtcIntersect##w(valid, scene, rays, ctx)
#define PACKET_ONE(scene, ctx, ray)             rtcIntersect1(scene, ray, ctx)
#else
#define PACKET_CONTEXT(name)                                                                                           \
    struct RTCIntersectContext name;                                                                                   \
    rtcInitIntersectContext(&name);                                                                                    \
    name.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT
#define PACKET_CALL(w, valid, scene, ctx, rays) rtcIntersect##w(valid, scene, ctx, rays)
#define PACKET_ONE(scene, ctx, ray)             rtcIntersect1(scene, ctx, ray)
#endif

/* What Embree leaves as it is is set once; directions, far end and the mark of a miss anew for each packet. */
#define PACKET_FUNCTION(W)                                                                                            \
    static void intersect_##W(const struct bvh *bvh, const struct bvh_rays *rays, uint32_t n)                         \
    {                                                                                                                 \
        PACKET_CONTEXT(context);                                                                                      \
        struct RTCRayHit##W packet __attribute__((aligned(64)));                                                      \
        int valid[W] __attribute__((aligned(64)));                                                                    \
        for (uint32_t i = 0; i < W; i++) {                                                                            \
            valid[i] = -1;                                                                                            \
            packet.ray.org_x[i] = rays->org[0];                                                                       \
            packet.ray.org_y[i] = rays->org[1];                                                                       \
            packet.ray.org_z[i] = rays->org[2];                                                                       \
            packet.ray.tnear[i] = rays->t_min;                                                                        \
            packet.ray.time[i] = 0.0f;                                                                                \
            packet.ray.mask[i] = 0xffffffffU;                                                                         \
            packet.ray.id[i] = 0;                                                                                     \
            packet.ray.flags[i] = 0;                                                                                  \
            packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;                                                        \
        }                                                                                                             \
        for (uint32_t base = 0; base < n; base += W) {                                                                \
            for (uint32_t i = 0; i < W; i++) {                                                                        \
                packet.ray.dir_x[i] = rays->dx[base + i];                                                             \
                packet.ray.dir_y[i] = rays->dy[base + i];                                                             \
                packet.ray.dir_z[i] = rays->dz[base + i];                                                             \
                packet.ray.tfar[i] = rays->t_max;                                                                     \
                packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;                                                       \
                packet.hit.primID[i] = RTC_INVALID_GEOMETRY_ID;                                                       \
            }                                                                                                         \
            if (n - base < W)                                                                                         \
                for (uint32_t i = 0; i < W; i++)                                                                      \
                    valid[i] = i < n - base ? -1 : 0;                                                                 \
            PACKET_CALL(W, valid, bvh->rtc, &context, &packet);                                                       \
            for (uint32_t i = 0; i < W; i++) {                                                                        \
                rays->prim[base + i] = packet.hit.primID[i];                                                          \
                rays->t[base + i] = packet.ray.tfar[i];                                                               \
                rays->u[base + i] = packet.hit.u[i];                                                                  \
                rays->v[base + i] = packet.hit.v[i];                                                                  \
            }                                                                                                         \
        }                                                                                                             \
    }

PACKET_FUNCTION(4)
PACKET_FUNCTION(8)
PACKET_FUNCTION(16)

void bvh_intersect(const struct bvh *bvh, const struct bvh_rays *rays, uint32_t n)
{
    if (bvh->info.packet == 16)
        intersect_16(bvh, rays, n);
    else if (bvh->info.packet == 8)
        intersect_8(bvh, rays, n);
    else
        intersect_4(bvh, rays, n);
}

void bvh_intersect_one(const struct bvh *bvh, const float org[3], const float dir[3], float t_min, float t_max,
                       uint32_t *prim, float *t)
{
    PACKET_CONTEXT(context);
    struct RTCRayHit one = {.ray = {.org_x = org[0], .org_y = org[1], .org_z = org[2], .tnear = t_min, .dir_x = dir[0],
                                    .dir_y = dir[1], .dir_z = dir[2], .tfar = t_max, .mask = 0xffffffffU},
                            .hit = {.geomID = RTC_INVALID_GEOMETRY_ID, .primID = RTC_INVALID_GEOMETRY_ID}};
    one.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    PACKET_ONE(bvh->rtc, &context, &one);
    *prim = one.hit.primID;
    *t = one.ray.tfar;
}
