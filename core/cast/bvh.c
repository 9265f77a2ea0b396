#include "core/cast/bvh.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static bool count_bytes(void *user, ssize_t bytes, bool post)
{
    (void)post;
    struct bvh *bvh = user;
    __atomic_add_fetch(&bvh->bytes, (int64_t)bytes, __ATOMIC_RELAXED);
    return true;
}

static void local_vertex(const struct bvh *bvh, uint32_t vertex, double v[3])
{
    for (int i = 0; i < 3; i++)
        v[i] = bvh->scene->vertex_m[vertex][i] - bvh->origin_m[i];
}

static void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void triangle_corners(const struct bvh *bvh, uint32_t prim, double v[3][3])
{
    for (int i = 0; i < 3; i++)
        local_vertex(bvh, bvh->scene->triangle[prim][i], v[i]);
}

static void set_plane(const struct bvh *bvh, uint32_t prim, struct bvh_plane *plane)
{
    double v[3][3], e1[3], e2[3], n[3];
    triangle_corners(bvh, prim, v);
    for (int i = 0; i < 3; i++) {
        e1[i] = v[1][i] - v[0][i];
        e2[i] = v[2][i] - v[0][i];
    }
    cross(e1, e2, n);
    double length = sqrt(dot(n, n));
    for (int i = 0; i < 3; i++)
        plane->n[i] = n[i] / length;
    plane->d = dot(plane->n, v[0]);
}

static int set_planes(struct bvh *bvh, struct sh_err *err)
{
    uint32_t n = bvh->scene->n_triangles;
    bvh->plane = aligned_alloc(64, ((size_t)n * sizeof *bvh->plane + 63) / 64 * 64);
    if (bvh->plane == NULL) return sh_fail(err, SH_ENOMEM, "cast: no memory for the planes of %u triangles", n);
    for (uint32_t i = 0; i < n; i++)
        set_plane(bvh, i, &bvh->plane[i]);
    return SH_OK;
}

static int fill_geometry(struct bvh *bvh, RTCGeometry geometry, struct sh_err *err)
{
    const struct scene *scene = bvh->scene;
    float *vertex = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float),
                                            scene->n_vertices);
    uint32_t *index = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(uint32_t),
                                              scene->n_triangles);
    if (vertex == NULL || index == NULL)
        return sh_fail(err, SH_ENOMEM, "cast: Embree has no memory for %u triangles", scene->n_triangles);
    for (uint32_t i = 0; i < scene->n_vertices; i++) {
        double v[3];
        local_vertex(bvh, i, v);
        for (int j = 0; j < 3; j++) {
            vertex[3 * (size_t)i + (size_t)j] = (float)v[j];
            if (fabs(v[j]) > bvh->reach_m) bvh->reach_m = fabs(v[j]);
        }
    }
    for (uint32_t i = 0; i < scene->n_triangles; i++)
        for (int j = 0; j < 3; j++)
            index[3 * (size_t)i + (size_t)j] = scene->triangle[i][j];
    return SH_OK;
}

static int build(struct bvh *bvh, struct sh_err *err)
{
    RTCGeometry geometry = rtcNewGeometry(bvh->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    int rc = fill_geometry(bvh, geometry, err);
    if (rc == SH_OK) {
        rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_HIGH);
        rtcCommitGeometry(geometry);
        bvh->rtc = rtcNewScene(bvh->device);
        rtcSetSceneFlags(bvh->rtc, RTC_SCENE_FLAG_ROBUST);
        rtcSetSceneBuildQuality(bvh->rtc, RTC_BUILD_QUALITY_HIGH);
        rtcAttachGeometry(bvh->rtc, geometry);
        rtcCommitScene(bvh->rtc);
        int code = (int)rtcGetDeviceError(bvh->device);
        if (code != RTC_ERROR_NONE) rc = sh_fail(err, SH_ENOMEM, "cast: Embree failed to build the BVH (error %d)", code);
    }
    rtcReleaseGeometry(geometry);
    return rc;
}

static uint32_t native_packet(RTCDevice device)
{
    if (rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)) return 16;
    if (rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED)) return 8;
    return 4;
}

static double seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int bvh_create(const struct scene *scene, const double origin_m[3], unsigned threads, const struct sh_report *report,
               struct bvh **out, struct sh_err *err)
{
    *out = NULL;
    struct bvh *bvh = calloc(1, sizeof *bvh);
    if (bvh == NULL) return sh_fail(err, SH_ENOMEM, "cast: no memory");
    char config[32] = "";
    if (threads != 0) snprintf(config, sizeof config, "threads=%u", threads);
    bvh->scene = scene;
    for (int i = 0; i < 3; i++)
        bvh->origin_m[i] = origin_m[i];
    bvh->device = rtcNewDevice(config);
    if (bvh->device == NULL) {
        free(bvh);
        return sh_fail(err, SH_EIO, "cast: Embree can't start on this processor");
    }
    rtcSetDeviceMemoryMonitorFunction(bvh->device, count_bytes, bvh);
    if (scene->n_triangles > 1000000) sh_progress(report, "building the BVH", -1.0);
    double start = seconds();
    int rc = build(bvh, err);
    if (rc == SH_OK) rc = set_planes(bvh, err);
    if (rc != SH_OK) {
        bvh_free(bvh);
        return rc;
    }
    bvh->info.packet = native_packet(bvh->device);
    bvh->info.build_s = seconds() - start;
    bvh->info.bytes = (uint64_t)bvh->bytes + (uint64_t)scene->n_triangles * sizeof *bvh->plane;
    *out = bvh;
    return SH_OK;
}

void bvh_free(struct bvh *bvh)
{
    if (bvh == NULL) return;
    if (bvh->rtc != NULL) rtcReleaseScene(bvh->rtc);
    rtcReleaseDevice(bvh->device);
    free(bvh->plane);
    free(bvh);
}

void bvh_get_info(const struct bvh *bvh, struct bvh_info *info)
{
    *info = bvh->info;
}

void bvh_origin(const struct bvh *bvh, double origin_m[3])
{
    for (int i = 0; i < 3; i++)
        origin_m[i] = bvh->origin_m[i];
}

/* Closest parameter t >= 0 of the ray to the segment a-b: the common perpendicular, clamped to the segment. */
static double range_near_edge(const double o[3], const double dir[3], const double a[3], const double b[3], double *gap2)
{
    double e[3], w[3];
    for (int i = 0; i < 3; i++) {
        e[i] = b[i] - a[i];
        w[i] = a[i] - o[i];
    }
    double ee = dot(e, e), ed = dot(e, dir), we = dot(w, e), wd = dot(w, dir), dd = dot(dir, dir);
    double det = ee * dd - ed * ed;
    double s = det > 0.0 ? (ed * wd - dd * we) / det : 0.0;
    s = s < 0.0 ? 0.0 : s > 1.0 ? 1.0 : s;
    double t = (wd + s * ed) / dd;
    double g[3];
    for (int i = 0; i < 3; i++)
        g[i] = w[i] + s * e[i] - t * dir[i];
    *gap2 = dot(g, g);
    return t;
}

double bvh_clamped_range(const struct bvh *bvh, uint32_t prim, const double o_local[3], const double dir[3])
{
    double v[3][3];
    triangle_corners(bvh, prim, v);
    const struct bvh_plane *plane = &bvh->plane[prim];
    double range = (plane->d - dot(plane->n, o_local)) / dot(plane->n, dir);
    int inside = isfinite(range) && range >= 0.0;
    for (int i = 0; i < 3 && inside; i++) {
        const double *a = v[i], *b = v[(i + 1) % 3];
        double e[3], p[3], c[3];
        for (int j = 0; j < 3; j++) {
            e[j] = b[j] - a[j];
            p[j] = o_local[j] + range * dir[j] - a[j];
        }
        cross(e, p, c);
        inside = dot(c, plane->n) >= 0.0;
    }
    if (inside) return range;
    double best = INFINITY;
    for (int i = 0; i < 3; i++) {
        double gap2, t = range_near_edge(o_local, dir, v[i], v[(i + 1) % 3], &gap2);
        if (gap2 < best) {
            best = gap2;
            range = t;
        }
    }
    return range;
}
