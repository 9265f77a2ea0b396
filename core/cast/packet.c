/* Packets of 4, 8 and 16 rays into Embree: the same code by width. */
#include <string.h>

#include "core/cast/bvh.h"

#if RTC_VERSION_MAJOR >= 4
#define PACKET_CONTEXT(name)           \
    struct RTCIntersectArguments name; \
    rtcInitIntersectArguments(&name);  \
    name.flags = RTC_RAY_QUERY_FLAG_COHERENT
#define PACKET_CALL(w, valid, scene, ctx, rays) rtcIntersect##w(valid, scene, rays, ctx)
#define PACKET_ONE(scene, ctx, ray)             rtcIntersect1(scene, ray, ctx)
#else
#define PACKET_CONTEXT(name)         \
    struct RTCIntersectContext name; \
    rtcInitIntersectContext(&name);  \
    name.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT
#define PACKET_CALL(w, valid, scene, ctx, rays) rtcIntersect##w(valid, scene, ctx, rays)
#define PACKET_ONE(scene, ctx, ray)             rtcIntersect1(scene, ctx, ray)
#endif

/* What Embree leaves as it is is set once; directions, far end and the mark of a miss anew for each packet. */
#define PACKET_FUNCTION(W)                                                                                           \
    static void intersect_##W(const struct bvh *bvh, const struct bvh_rays *rays, uint32_t n)                        \
    {                                                                                                                \
        PACKET_CONTEXT(context);                                                                                     \
        const uint32_t last = bvh->scene->n_triangles;                                                               \
        struct RTCRayHit##W packet __attribute__((aligned(64)));                                                     \
        int valid[W] __attribute__((aligned(64)));                                                                   \
        float t_max[W] __attribute__((aligned(64)));                                                                 \
        for (uint32_t i = 0; i < W; i++) {                                                                           \
            valid[i] = -1;                                                                                           \
            t_max[i] = rays->t_max;                                                                                  \
            packet.ray.org_x[i] = rays->org[0];                                                                      \
            packet.ray.org_y[i] = rays->org[1];                                                                      \
            packet.ray.org_z[i] = rays->org[2];                                                                      \
            packet.ray.tnear[i] = rays->t_min;                                                                       \
            packet.ray.time[i] = 0.0f;                                                                               \
            packet.ray.mask[i] = 0xffffffffU;                                                                        \
            packet.ray.id[i] = 0;                                                                                    \
            packet.ray.flags[i] = 0;                                                                                 \
            packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;                                                       \
        }                                                                                                            \
        for (uint32_t base = 0; base < n; base += W) {                                                               \
            memcpy(packet.ray.dir_x, rays->dx + base, sizeof packet.ray.dir_x);                                      \
            memcpy(packet.ray.dir_y, rays->dy + base, sizeof packet.ray.dir_y);                                      \
            memcpy(packet.ray.dir_z, rays->dz + base, sizeof packet.ray.dir_z);                                      \
            memcpy(packet.ray.tfar, t_max, sizeof packet.ray.tfar);                                                  \
            memset(packet.hit.geomID, 0xff, sizeof packet.hit.geomID);                                               \
            memset(packet.hit.primID, 0xff, sizeof packet.hit.primID);                                               \
            if (n - base < W)                                                                                        \
                for (uint32_t i = 0; i < W; i++)                                                                     \
                    valid[i] = i < n - base ? -1 : 0;                                                                \
            PACKET_CALL(W, valid, bvh->rtc, &context, &packet);                                                      \
            memcpy(rays->prim + base, packet.hit.primID, sizeof packet.hit.primID);                                  \
            memcpy(rays->t + base, packet.ray.tfar, sizeof packet.ray.tfar);                                         \
            memcpy(rays->u + base, packet.hit.u, sizeof packet.hit.u);                                               \
            memcpy(rays->v + base, packet.hit.v, sizeof packet.hit.v);                                               \
            for (uint32_t i = 0; i < W; i++)                                                                         \
                __builtin_prefetch(&bvh->triangle[packet.hit.primID[i] < last ? packet.hit.primID[i] : last], 0, 2); \
        }                                                                                                            \
    }

PACKET_FUNCTION(4)
PACKET_FUNCTION(8)
PACKET_FUNCTION(16)

void bvh_intersect_one(const struct bvh *bvh, const float org[3], const float dir[3], struct bvh_one *one)
{
    PACKET_CONTEXT(context);
    struct RTCRayHit ray = {.ray = {.org_x = org[0],
                                    .org_y = org[1],
                                    .org_z = org[2],
                                    .tnear = one->t_min,
                                    .dir_x = dir[0],
                                    .dir_y = dir[1],
                                    .dir_z = dir[2],
                                    .tfar = one->t_max,
                                    .mask = 0xffffffffU},
                            .hit = {.geomID = RTC_INVALID_GEOMETRY_ID, .primID = RTC_INVALID_GEOMETRY_ID}};
    ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    PACKET_ONE(bvh->rtc, &context, &ray);
    one->prim = ray.hit.primID;
    one->t = ray.ray.tfar;
    one->u = ray.hit.u;
    one->v = ray.hit.v;
}

static void intersect_1(const struct bvh *bvh, const struct bvh_rays *rays, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++) {
        const float dir[3] = {rays->dx[i], rays->dy[i], rays->dz[i]};
        struct bvh_one one = {.t_min = rays->t_min, .t_max = rays->t_max};
        bvh_intersect_one(bvh, rays->org, dir, &one);
        rays->prim[i] = one.prim;
        rays->t[i] = one.t;
        rays->u[i] = one.u;
        rays->v[i] = one.v;
    }
}

void bvh_intersect(const struct bvh *bvh, const struct bvh_rays *rays, uint32_t n)
{
    if (bvh->info.packet == 16)
        intersect_16(bvh, rays, n);
    else if (bvh->info.packet == 8)
        intersect_8(bvh, rays, n);
    else if (bvh->info.packet == 4)
        intersect_4(bvh, rays, n);
    else
        intersect_1(bvh, rays, n);
}
