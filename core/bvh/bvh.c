/* SPDX-License-Identifier: MIT */
/* Makes a BVH: the leaves, Embree's tree of them, the planes. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/bvh/meet.h"
#include "core/monotonic.h"

/* tests/check/tsan.supp has the names of this function and of the three others that Embree's threads call during a
 * build. */
static bool embree_counts_bytes(void *user, ssize_t bytes, bool post)
{
    (void)post;
    struct bvh *bvh = user;
    __atomic_add_fetch(&bvh->bytes, (int64_t)bytes, __ATOMIC_RELAXED);
    return true;
}

/* Called from Embree's threads, often; false ends the build. */
static bool embree_may_go_on(void *report, double fraction)
{
    (void)fraction;
    return !sh_stopped(report);
}

/* Fails with the error that Embree has noted since the last check. */
static int check_device(RTCDevice device, struct sh_err *err)
{
    enum RTCError code = rtcGetDeviceError(device);
    if (code == RTC_ERROR_NONE) return SH_OK;
    if (code == RTC_ERROR_CANCELLED) return sh_fail_stopped(err);
    return embree_fail(code, err);
}

static void attach(struct bvh *bvh, uint32_t n, RTCBoundsFunction bounds, RTCIntersectFunctionN meet)
{
    RTCGeometry geometry = rtcNewGeometry(bvh->device, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry, n);
    rtcSetGeometryUserData(geometry, bvh);
    rtcSetGeometryBoundsFunction(geometry, bounds, NULL);
    rtcSetGeometryIntersectFunction(geometry, meet);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(bvh->rtc, geometry);
    rtcReleaseGeometry(geometry);
}

/* Where oneTBB is refused the first memory that it asks for, it waits without end (2022.1, Debian 13). So more than
 * that is asked for before. */
static int check_memory(struct sh_err *err)
{
    void *volatile room = malloc(2 << 20);
    if (room == NULL) return embree_fail(RTC_ERROR_OUT_OF_MEMORY, err);
    free(room);
    return SH_OK;
}

/* Builds Embree's tree, unless report asks to stop. */
static int commit(struct bvh *bvh, const struct sh_report *report, struct sh_err *err)
{
    union { /* Embree only passes it on */
        const void *in;
        void *out;
    } ctx = {.in = report};
    bvh->rtc = rtcNewScene(bvh->device);
    attach(bvh, bvh->n_leaves, embree_asks_bounds, bvh_meet_leaf);
    if (bvh->scene->n_copies > 0) attach(bvh, bvh->scene->n_copies, embree_asks_copy_bounds, bvh_meet_copy);
    rtcSetSceneProgressMonitorFunction(bvh->rtc, embree_may_go_on, ctx.out);
    rtcCommitScene(bvh->rtc);
    return check_device(bvh->device, err);
}

/* bvh_find_planes notes where the leaves have each plane. It comes after Embree has freed its memory for building, so
 * that the peak is lower. */
static int build(struct bvh *bvh, unsigned threads, const struct sh_report *report, struct sh_err *err)
{
    int rc = bvh_make_leaves(bvh, report, err);
    if (rc == SH_OK) rc = bvh_make_copies(bvh, threads, report, err);
    if (rc == SH_OK) rc = check_memory(err);
    if (rc == SH_OK) rc = commit(bvh, report, err);
    if (rc == SH_OK) rc = bvh_find_planes(bvh, report, err);
    return rc;
}

/* Returns the largest number of leaves that Embree may put at one node of its tree, where it finds that cheaper. With
 * four leaves at a node the tree takes a seventh less memory, and rays are as fast where surfaces are connected. In
 * foliage a ray would try 1.5 times as many leaves. */
static unsigned most_together(const struct scene *scene)
{
    const int is_large = scene->n_triangles >= 500000, hangs_together = scene->n_vertices <= 0.6 * scene->n_triangles;
    return is_large && hangs_together ? 4 : 1;
}

int bvh_create(const struct scene *scene, unsigned threads, const struct sh_report *report, struct bvh **out,
               struct sh_err *err)
{
    return bvh_create_whole(scene, 0, threads, report, out, err);
}

int bvh_create_whole(const struct scene *scene, int in_one, unsigned threads, const struct sh_report *report,
                     struct bvh **out, struct sh_err *err)
{
    *out = NULL;
    struct bvh *bvh = calloc(1, sizeof *bvh);
    if (bvh == NULL) return sh_fail(err, SH_ENOMEM, "bvh: no memory");
    /* Embree sets 128 MB aside for subdivision surfaces. Scenes have none of these, so Embree gets the least: 1 MB. */
    char config[96];
    snprintf(config, sizeof config, "tessellation_cache_size=1,object_accel_max_leaf_size=%u,threads=%u",
             most_together(scene), threads);
    bvh->scene = scene;
    bvh->stretch_m = in_one ? INFINITY : BVH_STRETCH_M;
    bvh->device = rtcNewDevice(config);
    if (bvh->device == NULL) {
        free(bvh);
        return embree_fail(rtcGetDeviceError(NULL), err);
    }
    rtcSetDeviceMemoryMonitorFunction(bvh->device, embree_counts_bytes, bvh);
    if (scene->n_triangles > 1000000) sh_progress(report, "building the BVH", -1.0);
    const int64_t start_ns = monotonic_ns();
    int rc = build(bvh, threads, report, err);
    if (rc != SH_OK) {
        bvh_free(bvh);
        return rc;
    }
    bvh->info.packet = embree_packet(bvh->device);
    bvh->info.build_s = 1e-9 * (double)(monotonic_ns() - start_ns);
    bvh->info.bytes += (uint64_t)__atomic_load_n(&bvh->bytes, __ATOMIC_RELAXED) +
                       (uint64_t)scene->n_triangles * sizeof *bvh->at_plane +
                       (uint64_t)bvh->n_leaves * sizeof *bvh->leaf + (uint64_t)scene->n_copies * sizeof *bvh->copy;
    *out = bvh;
    return SH_OK;
}

void bvh_free(struct bvh *bvh)
{
    if (bvh == NULL) return;
    if (bvh->rtc != NULL) rtcReleaseScene(bvh->rtc);
    rtcReleaseDevice(bvh->device);
    bvh_free_copies(bvh);
    free(bvh->leaf);
    free(bvh->at_plane);
    free(bvh);
}

const struct bvh_info *bvh_get_info(const struct bvh *bvh)
{
    return &bvh->info;
}

void bvh_set_packet(struct bvh *bvh, uint32_t rays)
{
    bvh->info.packet = embree_has_packet(bvh->device, rays) ? rays : 1;
}

const double *bvh_origin(const struct bvh *bvh)
{
    return bvh->origin_m;
}

const struct scene *bvh_scene(const struct bvh *bvh)
{
    return bvh->scene;
}
