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

/* The planes of what a packet has hit are asked for when the next one has been cast: to read them at once would mean to
 * wait for what Embree has only just written. */
#define PACKET_FUNCTION(W)                                                                                         \
    static void set_up_##W(struct RTCRayHit##W *packet, const struct bvh_rays *rays)                               \
    {                                                                                                              \
        for (uint32_t p = 0; p < BVH_CHUNK / W; p++)                                                               \
            for (uint32_t i = 0; i < W; i++) {                                                                     \
                packet[p].ray.org_x[i] = rays->org[0];                                                             \
                packet[p].ray.org_y[i] = rays->org[1];                                                             \
                packet[p].ray.org_z[i] = rays->org[2];                                                             \
                packet[p].ray.tnear[i] = rays->t_min;                                                              \
                packet[p].ray.time[i] = 0.0f;                                                                      \
                packet[p].ray.mask[i] = 0xffffffffU;                                                               \
                packet[p].ray.id[i] = 0;                                                                           \
                packet[p].ray.flags[i] = 0;                                                                        \
                packet[p].hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;                                              \
            }                                                                                                      \
    }                                                                                                              \
    static void place_##W(struct RTCRayHit##W *packet, const struct bvh_rays *rays, uint32_t n)                    \
    {                                                                                                              \
        for (uint32_t p = 0; p < (n + W - 1) / W; p++) {                                                           \
            memcpy(packet[p].ray.org_x, rays->ox + p * W, sizeof packet->ray.org_x);                               \
            memcpy(packet[p].ray.org_y, rays->oy + p * W, sizeof packet->ray.org_y);                               \
            memcpy(packet[p].ray.org_z, rays->oz + p * W, sizeof packet->ray.org_z);                               \
        }                                                                                                          \
    }                                                                                                              \
    static void prefetch_##W(const struct bvh *bvh, const struct RTCRayHit##W *packet)                             \
    {                                                                                                              \
        const uint32_t last = bvh->scene->n_triangles;                                                             \
        for (uint32_t i = 0; i < W; i++)                                                                           \
            __builtin_prefetch(&bvh->triangle[packet->hit.primID[i] < last ? packet->hit.primID[i] : last], 0, 2); \
    }                                                                                                              \
    static void intersect_##W(const struct bvh *bvh, struct RTCRayHit##W *packet, const struct bvh_rays *rays,     \
                              uint32_t n)                                                                          \
    {                                                                                                              \
        PACKET_CONTEXT(context);                                                                                   \
        int valid[W] __attribute__((aligned(64)));                                                                 \
        const uint32_t packets = (n + W - 1) / W;                                                                  \
        for (uint32_t p = 0; p < packets; p++) {                                                                   \
            memcpy(packet[p].ray.dir_x, rays->dx + p * W, sizeof packet->ray.dir_x);                               \
            memcpy(packet[p].ray.dir_y, rays->dy + p * W, sizeof packet->ray.dir_y);                               \
            memcpy(packet[p].ray.dir_z, rays->dz + p * W, sizeof packet->ray.dir_z);                               \
            for (uint32_t i = 0; i < W; i++)                                                                       \
                packet[p].ray.tfar[i] = rays->t_max;                                                               \
            memset(packet[p].hit.geomID, 0xff, sizeof packet->hit.geomID);                                         \
            memset(packet[p].hit.primID, 0xff, sizeof packet->hit.primID);                                         \
        }                                                                                                          \
        for (uint32_t i = 0; i < W; i++)                                                                           \
            valid[i] = -1;                                                                                         \
        for (uint32_t p = 0; p < packets; p++) {                                                                   \
            if (n - p * W < W)                                                                                     \
                for (uint32_t i = 0; i < W; i++)                                                                   \
                    valid[i] = i < n - p * W ? -1 : 0;                                                             \
            PACKET_CALL(W, valid, bvh->rtc, &context, &packet[p]);                                                 \
            if (p > 0) prefetch_##W(bvh, &packet[p - 1]);                                                          \
        }                                                                                                          \
        prefetch_##W(bvh, &packet[packets - 1]);                                                                   \
        for (uint32_t p = 0; p < packets; p++) {                                                                   \
            memcpy(rays->prim + p * W, packet[p].hit.primID, sizeof packet->hit.primID);                           \
            memcpy(rays->t + p * W, packet[p].ray.tfar, sizeof packet->ray.tfar);                                  \
            memcpy(rays->u + p * W, packet[p].hit.u, sizeof packet->hit.u);                                        \
            memcpy(rays->v + p * W, packet[p].hit.v, sizeof packet->hit.v);                                        \
        }                                                                                                          \
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
        const float own[3] = {rays->ox != NULL ? rays->ox[i] : rays->org[0],
                              rays->ox != NULL ? rays->oy[i] : rays->org[1],
                              rays->ox != NULL ? rays->oz[i] : rays->org[2]};
        bvh_intersect_one(bvh, own, dir, &one);
        rays->prim[i] = one.prim;
        rays->t[i] = one.t;
        rays->u[i] = one.u;
        rays->v[i] = one.v;
    }
}

static void set_up(struct bvh_packets *packets, const struct bvh_rays *rays, uint32_t width)
{
    if (packets->width == width && packets->t_min == rays->t_min &&
        memcmp(packets->org, rays->org, sizeof rays->org) == 0)
        return;
    if (width == 16)
        set_up_16(packets->at.by16, rays);
    else if (width == 8)
        set_up_8(packets->at.by8, rays);
    else
        set_up_4(packets->at.by4, rays);
    memcpy(packets->org, rays->org, sizeof rays->org);
    packets->t_min = rays->t_min;
    packets->width = width;
}

/* Origins of their own. Such packets are kept apart from those with a common one (caster.h), which would have to be set
 * up again. */
static void place(struct bvh_packets *packets, const struct bvh_rays *rays, uint32_t n)
{
    const uint32_t width = packets->width;
    if (width == 16)
        place_16(packets->at.by16, rays, n);
    else if (width == 8)
        place_8(packets->at.by8, rays, n);
    else
        place_4(packets->at.by4, rays, n);
}

void bvh_intersect(const struct bvh *bvh, struct bvh_packets *packets, const struct bvh_rays *rays, uint32_t n)
{
    const uint32_t width = bvh->info.packet;
    if (n == 0) return;
    if (width == 1 || rays->scattered) {
        intersect_1(bvh, rays, n);
        return;
    }
    set_up(packets, rays, width);
    if (rays->ox != NULL) place(packets, rays, n);
    if (width == 16)
        intersect_16(bvh, packets->at.by16, rays, n);
    else if (width == 8)
        intersect_8(bvh, packets->at.by8, rays, n);
    else
        intersect_4(bvh, packets->at.by4, rays, n);
}
