/* SPDX-License-Identifier: MIT */
/* Hands rays to Embree, in packets of 4, 8 or 16, or one by one. */
#include "core/bvh/packet.h"

#include <math.h>

#include "core/bvh/bvh_inside.h"
#include "core/bvh/nearest.h"
#include "core/vecmath.h"

struct packet {
    struct RTCRayHit16 at; /* a packet of 4 or 8 rays, or one ray, lies at its beginning */
    int valid[BVH_PACKET];
} __attribute__((aligned(64)));

void bvh_begin_query(struct bvh_query *query, const struct bvh *bvh)
{
#if RTC_VERSION_MAJOR >= 4
    rtcInitRayQueryContext(&query->context);
#else
    rtcInitIntersectContext(&query->context);
    query->context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
#endif
    query->bvh = bvh;
    query->first_leaf = bvh->leaf;
    query->may_pass = bvh->scene->cutout != NULL;
}

#if RTC_VERSION_MAJOR >= 4
void bvh_call_embree(const struct bvh *bvh, struct bvh_query *query, const int *valid, void *rays, uint32_t width)
{
    struct RTCIntersectArguments how;
    rtcInitIntersectArguments(&how);
    how.flags = RTC_RAY_QUERY_FLAG_COHERENT;
    how.context = &query->context;
    if (width == 16)
        rtcIntersect16(valid, bvh->rtc, rays, &how);
    else if (width == 8)
        rtcIntersect8(valid, bvh->rtc, rays, &how);
    else if (width == 4)
        rtcIntersect4(valid, bvh->rtc, rays, &how);
    else
        rtcIntersect1(bvh->rtc, rays, &how);
}
#else
void bvh_call_embree(const struct bvh *bvh, struct bvh_query *query, const int *valid, void *rays, uint32_t width)
{
    if (width == 16)
        rtcIntersect16(valid, bvh->rtc, &query->context, rays);
    else if (width == 8)
        rtcIntersect8(valid, bvh->rtc, &query->context, rays);
    else if (width == 4)
        rtcIntersect4(valid, bvh->rtc, &query->context, rays);
    else
        rtcIntersect1(bvh->rtc, &query->context, rays);
}
#endif

/* Sets the fields that stay the same from packet to packet. Embree changes only tfar. */
static void begin_packet(struct packet *packet, const struct bvh_batch *batch, uint32_t width)
{
    float *org = bvh_field(&packet->at, width, org_x);
    memset(&packet->at, 0, sizeof packet->at);
    memset(bvh_field(&packet->at, width, mask), 0xff, width * sizeof(uint32_t));
    for (uint32_t i = 0; i < 3 * width; i++)
        org[i] = (float)batch->local.at_m[i / width];
}

/* Sets the rays from `first` to first + n - 1. A lane without a ray gets the origin and direction of lane 0. Such a
 * lane is not valid, so it gets no hit. */
VEC_INLINE void set_floats(struct packet *packet, const struct bvh_batch *batch, uint32_t first, uint32_t n,
                           uint32_t width)
{
    const float *const org[3] = {batch->org.x, batch->org.y, batch->org.z};
    const float *const dir[3] = {batch->dir.x, batch->dir.y, batch->dir.z};
    float *to_org = bvh_field(&packet->at, width, org_x), *to_dir = bvh_field(&packet->at, width, dir_x),
          *tfar = bvh_field(&packet->at, width, tfar);
    for (uint32_t j = 0; j < 3; j++) {
        memcpy(to_dir + j * width, dir[j] + first, n * sizeof(float));
        if (org[j] != NULL) memcpy(to_org + j * width, org[j] + first, n * sizeof(float));
        for (uint32_t i = n; i < width; i++)
            to_dir[j * width + i] = to_dir[j * width];
        for (uint32_t i = n; i < width; i++)
            to_org[j * width + i] = to_org[j * width];
    }
    for (uint32_t i = 0; i < width; i++)
        tfar[i] = batch->t_max;
    for (uint32_t i = 0; i < width; i++)
        packet->valid[i] = i < n ? -1 : 0;
}

/* Returns the numbers of a packet's n rays as an array of which BVH_PACKET elements may be read: `from`, or a copy in
 * `room`. */
VEC_INLINE const double *whole_packet(const double *from, uint32_t n, double room[BVH_PACKET])
{
    if (n == BVH_PACKET) return from;
    memcpy(room, from, n * sizeof *room);
    return room;
}

VEC_INLINE void set_doubles(struct bvh_query *query, const struct bvh_batch *batch, uint32_t first, uint32_t n)
{
    const struct bvh_rays *rays = batch->rays;
    const double *const dir[3] = {rays->dir.x, rays->dir.y, rays->dir.z};
    const double *const own[3] = {rays->from.own.x, rays->from.own.y, rays->from.own.z};
    const double *const local[3] = {batch->local.own.x, batch->local.own.y, batch->local.own.z};
    for (uint32_t i = 0; i < BVH_PACKET; i++) {
        query->range_m[i] = query->most_m;
        query->hit_m[i] = NAN;
    }
    if (query->most_m != INFINITY && batch->start_m != NULL)
        for (uint32_t i = 0; i < n; i++)
            query->range_m[i] += batch->start_m[first + i];
    for (uint32_t i = 0; i < BVH_PACKET; i++)
        query->triangle[i] = BVH_NO_TRIANGLE;
    query->unsure = 0;
    if (batch->start_m != NULL) memcpy(query->start_m, batch->start_m + first, n * sizeof(double));
    for (int j = 0; j < 3; j++) {
        query->dir[j] = whole_packet(dir[j] + first, n, query->room[j]);
        if (!query->has_own) continue;
        query->org[j] = whole_packet(own[j] + first, n, query->room[3 + j]);
        query->local[j] = whole_packet(local[j] + first, n, query->room[6 + j]);
    }
}

static void take_near(struct bvh_query *query, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++) {
        if (query->near[i] == BVH_NO_TRIANGLE || query->hit_m[i] <= query->near_m[i]) continue;
        if (query->near_m[i] > query->most_m + query->start_m[i]) continue;
        query->triangle[i] = query->near[i];
        query->hit_m[i] = query->near_m[i];
    }
    bvh_forget_near(query);
}

/* Casts the unsure rays again, with their nearest range known. No hit makes that range smaller now. So of the triangles
 * that count as equally near, the one of lowest number is found, in whatever order Embree meets them. */
static void packet_settle(struct bvh_query *query, struct packet *packet, uint32_t width)
{
    float *tfar = bvh_field(&packet->at, width, tfar);
    for (uint32_t i = 0; i < width; i++) {
        packet->valid[i] = (query->unsure >> i & 1) != 0 ? -1 : 0;
        if (packet->valid[i] == 0) continue;
        tfar[i] = tfar_of(query->range_m[i], query->start_m[i]);
        query->triangle[i] = BVH_NO_TRIANGLE;
        query->hit_m[i] = NAN;
    }
    query->unsure = 0;
    bvh_call_embree(query->bvh, query, packet->valid, &packet->at, width);
}

VEC_INLINE void cast_one(struct bvh_query *query, struct packet *packet, const struct bvh_batch *batch, uint32_t first,
                         uint32_t n, uint32_t width)
{
    const uint64_t decided = query->counters.decided;
    set_floats(packet, batch, first, n, width);
    set_doubles(query, batch, first, n);
    query->width = width;
    query->dir_float = bvh_field(&packet->at, width, dir_x);
    if (query->has_own) bvh_find_apart(query);
    bvh_call_embree(query->bvh, query, packet->valid, &packet->at, width);
    if (query->unsure != 0) packet_settle(query, packet, width);
    if (query->counters.decided != decided) take_near(query, n);
    memcpy(batch->rays->range_m + first, query->hit_m, n * sizeof *query->hit_m);
    memcpy(batch->rays->triangle + first, query->triangle, n * sizeof *query->triangle);
}

/* Whole packets of 16 are the common case: all lengths are constants there. */
VEC_CLONES
static void cast(struct bvh_query *query, struct packet *packet, const struct bvh_batch *batch, uint32_t first,
                 uint32_t n, uint32_t width)
{
    if (n == BVH_PACKET && width == BVH_PACKET)
        cast_one(query, packet, batch, first, BVH_PACKET, BVH_PACKET);
    else
        cast_one(query, packet, batch, first, n, width);
}

void bvh_intersect(const struct bvh *bvh, struct bvh_query *query, struct bvh_batch *batch)
{
    const struct bvh_rays *rays = batch->rays;
    const uint32_t width = rays->scattered ? 1 : bvh->info.packet;
    struct packet packet;
    bvh_begin_query(query, bvh);
    begin_packet(&packet, batch, width);
    query->at_origin_m = BVH_AT_ORIGIN_M;
    query->has_own = rays->from.own.x != NULL;
    query->most_m = batch->most_m;
    memcpy(query->at, rays->from.at_m, sizeof query->at);
    memcpy(query->at_local, batch->local.at_m, sizeof query->at_local);
    memset(query->start_m, 0, sizeof query->start_m);
    bvh_forget_near(query);
    for (uint32_t at = 0; at < rays->n; at += width)
        cast(query, &packet, batch, at, rays->n - at < width ? rays->n - at : width, width);
}
