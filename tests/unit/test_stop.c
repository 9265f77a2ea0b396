/* SPDX-License-Identifier: MIT */
/* Long work asks whether to stop, and ends. And the meaning of Embree's errors. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/bvh.h"
#include "core/cast.h"
#include "core/embree.h"
#include "core/footprint.h"
#include "core/pose.h"
#include "core/scene/triangulate.h"
#include "tests/common/generate.h"

enum { TRIANGLES = 4000, MANY = 200000 };

static enum RTCError device_error; /* why Embree makes no device; RTC_ERROR_NONE: it makes one */

RTCDevice rtcNewDevice(const char *config)
{
    RTCDevice (*real)(const char *config);
    void *found = dlsym(RTLD_NEXT, "rtcNewDevice");
    memcpy(&real, &found, sizeof real);
    return device_error == RTC_ERROR_NONE ? real(config) : NULL;
}

enum RTCError rtcGetDeviceError(RTCDevice device)
{
    enum RTCError (*real)(RTCDevice device);
    void *found = dlsym(RTLD_NEXT, "rtcGetDeviceError");
    memcpy(&real, &found, sizeof real);
    return device == NULL && device_error != RTC_ERROR_NONE ? device_error : real(device);
}

static struct scene *terrain, *large;
static const double STATION_M[3] = {0, 0, 5};

static struct scene *generate(uint32_t n)
{
    struct scene *scene;
    struct sh_err err;
    const double centre_m[2] = {0, 0};
    if (generate_terrain(n, 100, 1, centre_m, 1, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    return scene;
}

static int make_terrain(void **state)
{
    (void)state;
    terrain = generate(TRIANGLES);
    large = generate(MANY);
    return 0;
}

static int free_terrain(void **state)
{
    (void)state;
    scene_free(terrain);
    scene_free(large);
    return 0;
}

/* Stops at one call, from any thread. */
struct asked {
    unsigned calls, stop_at; /* 0: never */
};

static int stop(void *ctx)
{
    struct asked *asked = ctx;
    unsigned call = __atomic_add_fetch(&asked->calls, 1, __ATOMIC_RELAXED);
    return asked->stop_at != 0 && call >= asked->stop_at;
}

static int build_bvh(const struct sh_report *report, struct sh_err *err)
{
    struct bvh *bvh = NULL;
    int rc = bvh_create(terrain, 2, report, &bvh, err);
    assert_true((rc == SH_OK) == (bvh != NULL));
    bvh_free(bvh);
    return rc;
}

static int find_twins(const struct sh_report *report, struct sh_err *err)
{
    uint64_t *duplicate = NULL;
    int rc = scene_find_duplicate_faces(large, report, &duplicate, err);
    assert_true((rc == SH_OK) == (duplicate != NULL));
    free(duplicate);
    return rc;
}

static int find_outlines(const struct sh_report *report, struct sh_err *err)
{
    struct bvh *bvh = NULL;
    static struct beam beam;
    struct beam_outlines *outlines = NULL;
    beam_init(&beam, 0.007, 0.35e-3, 3e-9);
    assert_int_equal(bvh_create(terrain, 2, NULL, &bvh, err), SH_OK);
    const struct beam_outlines_spec spec = {terrain, STATION_M, &beam, 200.0, NULL, report};
    int rc = cast_outlines(&spec, bvh, &outlines, err);
    assert_true((rc == SH_OK) == (outlines != NULL));
    beam_outlines_free(outlines);
    bvh_free(bvh);
    return rc;
}

static int follow_way(const struct sh_report *report, struct sh_err *err)
{
    char path[] = "/tmp/scanhead-way-XXXXXX";
    struct trajectory *way = NULL;
    int fd = mkstemp(path);
    assert_true(fd >= 0);
    dprintf(fd, "x_m,y_m,z_m,speed_m_s\n0,0,0,1\n300,0,0,1\n300,300,0,1\n");
    close(fd);
    int rc = trajectory_read_waypoints(path, NULL, report, &way, err);
    unlink(path);
    trajectory_free(way);
    return rc;
}

/* One polygon has very many corners in a zigzag, and its ears are looked for all over it. */
static int cut_polygon(const struct sh_report *report, struct sh_err *err)
{
    enum { CORNERS = 4096 };
    struct triangulate t = {.report = report};
    assert_int_equal(triangulate_reserve(&t, CORNERS), SH_OK);
    for (uint32_t i = 0; i < CORNERS; i++) {
        const double angle = 2.0 * M_PI * i / CORNERS, r = i % 2 != 0 ? 1.0 : 0.5;
        t.at[i].p[0] = r * cos(angle);
        t.at[i].p[1] = r * sin(angle);
        t.at[i].p[2] = 0.0;
    }
    triangulate_polygon(&t, CORNERS);
    int rc = t.stopped ? sh_fail_stopped(err) : SH_OK;
    triangulate_free(&t);
    return rc;
}

/* The test first counts how often each work asks when it is not stopped. Then the work is stopped at its first call,
 * and at one halfway. */
static void work_is_ended(void **state)
{
    (void)state;
    static int (*const works[])(const struct sh_report *report,
                                struct sh_err *err) = {build_bvh, find_twins, find_outlines, follow_way, cut_polygon};
    for (size_t i = 0; i < sizeof works / sizeof works[0]; i++) {
        struct sh_err err;
        struct asked asked = {0};
        const struct sh_report report = {.ctx = &asked, .stop = stop};
        assert_int_equal(works[i](&report, &err), SH_OK);
        unsigned calls = asked.calls;
        assert_true(calls >= 4);
        const unsigned at[] = {1, calls / 2};
        for (int k = 0; k < 2; k++) {
            asked = (struct asked){.stop_at = at[k]};
            assert_int_equal(works[i](&report, &err), SH_ESTOPPED);
            assert_string_equal(err.text, "stopped while loading; no scan was run");
        }
    }
}

static void errors_of_embree(void **state)
{
    (void)state;
    struct sh_err err;
    assert_int_equal(embree_fail(RTC_ERROR_OUT_OF_MEMORY, &err), SH_ENOMEM);
    assert_non_null(strstr(err.text, "bvh: no memory"));
    assert_int_equal(embree_fail(RTC_ERROR_UNSUPPORTED_CPU, &err), SH_EIO);
    assert_non_null(strstr(err.text, "doesn't support this processor"));
    assert_int_equal(embree_fail(RTC_ERROR_INVALID_OPERATION, &err), SH_EIO);
    assert_non_null(strstr(err.text, "RTCError 3"));
}

/* Embree may make no device, as without memory. Both functions that ask for one then have its error. */
static void no_device(void **state)
{
    (void)state;
    struct sh_err err;
    struct bvh *bvh;
    char engine[96];
    device_error = RTC_ERROR_OUT_OF_MEMORY;
    assert_int_equal(bvh_create(terrain, 1, NULL, &bvh, &err), SH_ENOMEM);
    assert_int_equal(bvh_engine(engine, sizeof engine, &err), SH_ENOMEM);
    assert_non_null(strstr(err.text, "bvh: no memory"));
    assert_string_equal(engine, "");
    device_error = RTC_ERROR_NONE;
    assert_int_equal(bvh_engine(engine, sizeof engine, &err), SH_OK);
    assert_int_equal(strncmp(engine, "Embree ", 7), 0);
}

/* The memory is enough for the leaves and for some of Embree's buffers (80 bytes a triangle), but not for its BVH. */
static void no_memory_is_said(void **state)
{
    (void)state;
#ifdef SH_SANITIZE
    skip(); /* the address sanitizer takes terabytes of addresses */
#else
    int status;
    pid_t pid = fork();
    if (pid == 0) {
        unsigned long pages = 0;
        struct sh_err err = {0};
        struct bvh *bvh;
        if (build_bvh(NULL, &err) != SH_OK) _exit(3); /* TBB's threads need room, too: without it TBB aborts */
        FILE *f = fopen("/proc/self/statm", "r");
        if (f == NULL || fscanf(f, "%lu", &pages) != 1) _exit(2);
        fclose(f);
        const rlim_t bytes = pages * (rlim_t)sysconf(_SC_PAGESIZE) + MANY * 80ul + (8ul << 20);
        struct rlimit kept;
        setrlimit(RLIMIT_AS, &(struct rlimit){bytes, bytes});
        if (getrlimit(RLIMIT_AS, &kept) != 0 || kept.rlim_cur != bytes)
            _exit(4); /* QEMU's user mode has it for itself */
        int rc = bvh_create(large, 1, NULL, &bvh, &err);
        if (rc != SH_ENOMEM) fprintf(stderr, "# code %d: %s\n", rc, err.text);
        _exit(rc == SH_ENOMEM && strstr(err.text, "no memory") != NULL ? 0 : 1);
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    if (WIFEXITED(status) && WEXITSTATUS(status) == 4) skip();
    assert_int_equal(status, 0);
#endif
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(errors_of_embree),
        cmocka_unit_test(no_device),
        cmocka_unit_test(no_memory_is_said), /* forks: before Embree has threads here */
        cmocka_unit_test(work_is_ended),
    };
    return cmocka_run_group_tests(tests, make_terrain, free_terrain);
}
