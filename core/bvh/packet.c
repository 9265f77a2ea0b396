/* Packets of 4, 8 and 16 rays into Embree: the same code by width. */
#include <string.h>

#include "core/bvh/bvh_inside.h"

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

/* Of packets that were cut, those that are left with as many as this are not worth it. */
enum { FEW = 4 };

/* Numbers of 4 bytes of rays at .. at + n, whole packets of them wherever the arrays go on: what is beyond n
 * belongs to packets that come later, or to none. */
static inline __attribute__((always_inline)) void copy(void *to, const void *from, uint32_t at, uint32_t n,
                                                       uint32_t width)
{
    if (at + width <= BVH_CHUNK)
        memcpy(to, from, 4 * width);
    else
        for (uint32_t i = 0; i < n; i++)
            memcpy((char *)to + 4 * i, (const char *)from + 4 * i, 4);
}

/* Packet p takes rays first[p] .. first[p + 1] - 1.
 * The planes of what a packet has hit are asked for when the next one has been cast: to read them at once
 * would mean to wait for what Embree has only just written. */
#define PACKET_FUNCTION(W)                                                                                         \
    static void set_up_##W(struct RTCRayHit##W *packet, const struct bvh_batch *rays)                              \
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
    static void place_##W(struct RTCRayHit##W *packet, const struct bvh_batch *rays, const uint32_t *first,        \
                          uint32_t packets)                                                                        \
    {                                                                                                              \
        for (uint32_t p = 0; p < packets; p++) {                                                                   \
            const uint32_t n = first[p + 1] - first[p];                                                            \
            copy(packet[p].ray.org_x, rays->own.x + first[p], first[p], n, W);                                     \
            copy(packet[p].ray.org_y, rays->own.y + first[p], first[p], n, W);                                     \
            copy(packet[p].ray.org_z, rays->own.z + first[p], first[p], n, W);                                     \
        }                                                                                                          \
    }                                                                                                              \
    static void prefetch_##W(const struct bvh *bvh, const struct RTCRayHit##W *packet)                             \
    {                                                                                                              \
        const uint32_t last = bvh->scene->n_triangles;                                                             \
        for (uint32_t i = 0; i < W; i++)                                                                           \
            __builtin_prefetch(&bvh->triangle[packet->hit.primID[i] < last ? packet->hit.primID[i] : last], 0, 2); \
    }                                                                                                              \
    static void one_by_one_##W(const struct bvh *bvh, struct RTCRayHit##W *packet, uint32_t n)                     \
    {                                                                                                              \
        for (uint32_t i = 0; i < n; i++) {                                                                         \
            const float org[3] = {packet->ray.org_x[i], packet->ray.org_y[i], packet->ray.org_z[i]};               \
            const float dir[3] = {packet->ray.dir_x[i], packet->ray.dir_y[i], packet->ray.dir_z[i]};               \
            struct bvh_one one = {.t_min = packet->ray.tnear[i], .t_max = packet->ray.tfar[i]};                    \
            bvh_intersect_one(bvh, org, dir, &one);                                                                \
            packet->hit.primID[i] = one.prim;                                                                      \
            packet->ray.tfar[i] = one.t;                                                                           \
            packet->hit.u[i] = one.u;                                                                              \
            packet->hit.v[i] = one.v;                                                                              \
        }                                                                                                          \
    }                                                                                                              \
    static void intersect_##W(const struct bvh *bvh, struct RTCRayHit##W *packet, const struct bvh_batch *rays,    \
                              const uint32_t *first, uint32_t packets)                                             \
    {                                                                                                              \
        PACKET_CONTEXT(context);                                                                                   \
        int valid[W] __attribute__((aligned(64)));                                                                 \
        for (uint32_t p = 0; p < packets; p++) {                                                                   \
            const uint32_t n = first[p + 1] - first[p];                                                            \
            copy(packet[p].ray.dir_x, rays->dir.x + first[p], first[p], n, W);                                     \
            copy(packet[p].ray.dir_y, rays->dir.y + first[p], first[p], n, W);                                     \
            copy(packet[p].ray.dir_z, rays->dir.z + first[p], first[p], n, W);                                     \
            for (uint32_t i = 0; i < W; i++)                                                                       \
                packet[p].ray.tfar[i] = rays->t_max;                                                               \
            memset(packet[p].hit.geomID, 0xff, sizeof packet->hit.geomID);                                         \
            memset(packet[p].hit.primID, 0xff, sizeof packet->hit.primID);                                         \
        }                                                                                                          \
        for (uint32_t i = 0; i < W; i++)                                                                           \
            valid[i] = -1;                                                                                         \
        for (uint32_t p = 0, was = W; p < packets; p++) {                                                          \
            const uint32_t n = first[p + 1] - first[p];                                                            \
            if (n != was)                                                                                          \
                for (uint32_t i = 0; i < W; i++)                                                                   \
                    valid[i] = i < n ? -1 : 0;                                                                     \
            was = n;                                                                                               \
            if (n <= FEW && rays->begins != NULL)                                                                  \
                one_by_one_##W(bvh, &packet[p], n);                                                                \
            else                                                                                                   \
                PACKET_CALL(W, valid, bvh->rtc, &context, &packet[p]);                                             \
            if (p > 0) prefetch_##W(bvh, &packet[p - 1]);                                                          \
        }                                                                                                          \
        prefetch_##W(bvh, &packet[packets - 1]);                                                                   \
        for (uint32_t p = 0; p < packets; p++) {                                                                   \
            const uint32_t n = first[p + 1] - first[p];                                                            \
            copy(rays->prim + first[p], packet[p].hit.primID, first[p], n, W);                                     \
            copy(rays->t + first[p], packet[p].ray.tfar, first[p], n, W);                                          \
            copy(rays->u + first[p], packet[p].hit.u, first[p], n, W);                                             \
            copy(rays->v + first[p], packet[p].hit.v, first[p], n, W);                                             \
        }                                                                                                          \
    }

PACKET_FUNCTION(4)
PACKET_FUNCTION(8)
PACKET_FUNCTION(16)

static struct RTCRayHit one_ray(const float org[3], const float dir[3], float t_min, float t_max)
{
    struct RTCRayHit ray = {.ray = {.org_x = org[0],
                                    .org_y = org[1],
                                    .org_z = org[2],
                                    .tnear = t_min,
                                    .dir_x = dir[0],
                                    .dir_y = dir[1],
                                    .dir_z = dir[2],
                                    .tfar = t_max,
                                    .mask = 0xffffffffU},
                            .hit = {.geomID = RTC_INVALID_GEOMETRY_ID, .primID = RTC_INVALID_GEOMETRY_ID}};
    ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    return ray;
}

void bvh_intersect_one(const struct bvh *bvh, const float org[3], const float dir[3], struct bvh_one *one)
{
    PACKET_CONTEXT(context);
    struct RTCRayHit ray = one_ray(org, dir, one->t_min, one->t_max);
    PACKET_ONE(bvh->rtc, &context, &ray);
    one->prim = ray.hit.primID;
    one->t = ray.ray.tfar;
    one->u = ray.hit.u;
    one->v = ray.hit.v;
}

/* A ray that looks at all that Embree proposes on its way. Embree hands its context to the filter. */
#if RTC_VERSION_MAJOR >= 4
struct walk {
    struct RTCRayQueryContext context;
    const struct bvh_walk *walk;
};
#else
struct walk {
    struct RTCIntersectContext context;
    const struct bvh_walk *walk;
};
#endif

static void on_proposal(const struct RTCFilterFunctionNArguments *args)
{
    const struct bvh_walk *walk = ((const struct walk *)(const void *)args->context)->walk;
    const struct RTCHit *hit = (const void *)args->hit; /* of one ray */
    if (args->valid[0] != 0 && !walk->is_met(walk->ctx, hit->primID)) args->valid[0] = 0;
}

void bvh_walk_along(const struct bvh *bvh, const float org[3], const float dir[3], float t_max,
                    const struct bvh_walk *walk)
{
    struct walk own = {.walk = walk};
    struct RTCRayHit ray = one_ray(org, dir, 0.0f, t_max);
#if RTC_VERSION_MAJOR >= 4
    struct RTCIntersectArguments how;
    rtcInitRayQueryContext(&own.context);
    rtcInitIntersectArguments(&how);
    how.flags = RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER;
    how.context = &own.context;
    how.filter = on_proposal;
    rtcIntersect1(bvh->rtc, &ray, &how);
#else
    rtcInitIntersectContext(&own.context);
    own.context.filter = on_proposal;
    rtcIntersect1(bvh->rtc, &own.context, &ray);
#endif
}

static void intersect_1(const struct bvh *bvh, const struct bvh_batch *rays, uint32_t n)
{
    const uint32_t last = bvh->scene->n_triangles;
    for (uint32_t i = 0; i < n; i++) {
        const float dir[3] = {rays->dir.x[i], rays->dir.y[i], rays->dir.z[i]};
        struct bvh_one one = {.t_min = rays->t_min, .t_max = rays->t_max};
        const float own[3] = {rays->own.x != NULL ? rays->own.x[i] : rays->org[0],
                              rays->own.x != NULL ? rays->own.y[i] : rays->org[1],
                              rays->own.x != NULL ? rays->own.z[i] : rays->org[2]};
        bvh_intersect_one(bvh, own, dir, &one);
        rays->prim[i] = one.prim;
        rays->t[i] = one.t;
        __builtin_prefetch(&bvh->triangle[one.prim < last ? one.prim : last], 0, 2);
        rays->u[i] = one.u;
        rays->v[i] = one.v;
    }
}

static void set_up(struct bvh_packets *packets, const struct bvh_batch *rays, uint32_t width)
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

/* Cuts rays at .. n into packets, `most` at most; gives how many, and where they begin and the last one ends.
 */
static uint32_t cut(const struct bvh_batch *rays, uint32_t width, uint32_t at, uint32_t n, uint32_t most,
                    uint32_t *first)
{
    uint32_t packets = 0;
    first[0] = at;
    while (at < n && packets < most) {
        uint32_t end = n - at < width ? n : at + width;
        for (uint32_t i = at + 1; rays->begins != NULL && i < end; i++)
            if (rays->begins[i]) end = i;
        first[++packets] = at = end;
    }
    return packets;
}

/* Packets with origins of their own are kept apart from those with a common one (bvh_inside.h), which would
 * have to be set up again. */
void bvh_intersect(const struct bvh *bvh, struct bvh_packets *packets, const struct bvh_batch *rays, uint32_t n)
{
    const uint32_t width = bvh->info.packet;
    uint32_t first[BVH_CHUNK / 4 + 1];
    if (n == 0) return;
    if (width == 1 || rays->scattered) {
        intersect_1(bvh, rays, n);
        return;
    }
    set_up(packets, rays, width);
    for (uint32_t at = 0, k; at < n; at = first[k]) {
        k = cut(rays, width, at, n, BVH_CHUNK / width, first);
        if (width == 16) {
            if (rays->own.x != NULL) place_16(packets->at.by16, rays, first, k);
            intersect_16(bvh, packets->at.by16, rays, first, k);
        } else if (width == 8) {
            if (rays->own.x != NULL) place_8(packets->at.by8, rays, first, k);
            intersect_8(bvh, packets->at.by8, rays, first, k);
        } else {
            if (rays->own.x != NULL) place_4(packets->at.by4, rays, first, k);
            intersect_4(bvh, packets->at.by4, rays, first, k);
        }
    }
}
