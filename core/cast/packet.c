/* Packets of 4, 8 and 16 rays into Embree: the same code by width. */
#include "core/cast/bvh.h"

#if RTC_VERSION_MAJOR >= 4
#define PACKET_CONTEXT(name)                                                                                           \
    struct RTCIntersectArguments name;                                                                                 \
    rtcInitIntersectArguments(&name);                                                                                  \
    name.flags = RTC_RAY_QUERY_FLAG_COHERENT
#define PACKET_CALL(w, valid, scene, ctx, rays) rtcIntersect##w(valid, scene, rays, ctx)
#else
#define PACKET_CONTEXT(name)                                                                                           \
    struct RTCIntersectContext name;                                                                                   \
    rtcInitIntersectContext(&name);                                                                                    \
    name.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT
#define PACKET_CALL(w, valid, scene, ctx, rays) rtcIntersect##w(valid, scene, ctx, rays)
#endif

#define PACKET_FUNCTION(W)                                                                                             \
    static void intersect_##W(const struct bvh *bvh, const struct bvh_rays *rays, uint32_t n)                          \
    {                                                                                                                  \
        PACKET_CONTEXT(context);                                                                                       \
        struct RTCRayHit##W packet __attribute__((aligned(64)));                                                       \
        int valid[W] __attribute__((aligned(64)));                                                                     \
        for (uint32_t base = 0; base < n; base += W) {                                                                 \
            uint32_t live = n - base < W ? n - base : W;                                                               \
            for (uint32_t i = 0; i < W; i++) {                                                                         \
                uint32_t j = base + (i < live ? i : live - 1);                                                         \
                valid[i] = i < live ? -1 : 0;                                                                          \
                packet.ray.org_x[i] = rays->org[0];                                                                    \
                packet.ray.org_y[i] = rays->org[1];                                                                    \
                packet.ray.org_z[i] = rays->org[2];                                                                    \
                packet.ray.dir_x[i] = (float)rays->dx[j];                                                              \
                packet.ray.dir_y[i] = (float)rays->dy[j];                                                              \
                packet.ray.dir_z[i] = (float)rays->dz[j];                                                              \
                packet.ray.tnear[i] = 0.0f;                                                                            \
                packet.ray.tfar[i] = rays->t_max;                                                                      \
                packet.ray.time[i] = 0.0f;                                                                             \
                packet.ray.mask[i] = 0xffffffffU;                                                                      \
                packet.ray.flags[i] = 0;                                                                               \
                packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;                                                        \
                packet.hit.primID[i] = RTC_INVALID_GEOMETRY_ID;                                                        \
            }                                                                                                          \
            PACKET_CALL(W, valid, bvh->rtc, &context, &packet);                                                        \
            for (uint32_t i = 0; i < live; i++) {                                                                      \
                rays->prim[base + i] = packet.hit.primID[i];                                                           \
                rays->t[base + i] = packet.ray.tfar[i];                                                                \
            }                                                                                                          \
        }                                                                                                              \
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
