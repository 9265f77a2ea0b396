/* SPDX-License-Identifier: MIT */
/* This measures the real loop with the null link, as fast as it goes, and Embree on as many threads, in turns. */
#include <math.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/loop/loop.h"
#include "tests/bench/bench.h"

enum { ROUNDS = 3, MAX_THREADS = 64, MIN_FRAMES = 4 };

struct slice {
    const struct embree_alone *e;
    const struct bench_result *one;
    uint32_t first, n, passes;
    const _Atomic int *signal; /* 0: wait, 1: go, -1: end at once */
};

static void *slice_main(void *arg)
{
    const struct slice *s = arg;
    int signal;
    while ((signal = atomic_load(s->signal)) == 0)
        sched_yield();
    for (uint32_t i = 0; signal > 0 && i < s->passes; i++)
        embree_alone_pass(s->e, s->one->embree_width, s->one->embree_feed, s->first, s->n);
    return NULL;
}

/* Returns rays per second of Embree alone, with the rays dealt out to the threads. Returns 0 if it gets no threads. */
static double embree_rays_s(const struct bench_case *c, const struct bench_result *one, uint32_t threads,
                            uint32_t passes)
{
    pthread_t thread[MAX_THREADS];
    struct slice slice[MAX_THREADS];
    uint32_t packets = c->rays->n / 16, begun = 0;
    _Atomic int signal = 0;
    for (; begun < threads; begun++) {
        uint32_t from = 16 * (uint32_t)((uint64_t)packets * begun / threads);
        uint32_t to = 16 * (uint32_t)((uint64_t)packets * (begun + 1) / threads);
        slice[begun] = (struct slice){c->embree, one, from, to - from, passes, &signal};
        if (pthread_create(&thread[begun], NULL, slice_main, &slice[begun]) != 0) break;
    }
    int64_t start_ns = clock_now_ns();
    atomic_store(&signal, begun == threads ? 1 : -1);
    for (uint32_t i = 0; i < begun; i++)
        pthread_join(thread[i], NULL);
    double s = 1e-9 * (double)(clock_now_ns() - start_ns);
    return begun == threads ? (double)c->rays->n * passes / s : 0.0;
}

/* Fills a configuration. The head fires pulses in the directions of the bench's rays. frames: turns of the pan. */
static void fill_config(struct config *cfg, const struct bench_case *c, uint32_t threads, uint32_t frames)
{
    struct schedule_spec spec;
    bench_schedule(c->rays->lines, BENCH_LINE_PULSES, frames, &spec);
    memset(cfg, 0, sizeof *cfg);
    cfg->profile =
        (struct config_profile){.name = "bench",
                                .maker = "scanhead",
                                .model = "bench",
                                .prr_min_uhz = spec.prr_uhz,
                                .prr_max_uhz = spec.prr_uhz,
                                .lines_min_uhz = spec.lines_uhz,
                                .lines_max_uhz = spec.lines_uhz,
                                .pan_max_udeg_s = spec.pan_udeg_s,
                                .fov_min_udeg = spec.fov_min_udeg,
                                .fov_max_udeg = spec.line_stop_udeg,
                                .pan_max_udeg = spec.pan_stop_udeg,
                                .facets = 1,
                                .optical_gain = (double)spec.sweep_udeg / 360e6,
                                .range_min_m = 0.5,
                                .range_max_m = BENCH_RANGE_MAX_M,
                                .program = {{.max_echoes = 1, .range_min_m = 0.5, .range_max_m = BENCH_RANGE_MAX_M}},
                                .range_sigma_m = 0.005,
                                .mirror_counts = BENCH_ENCODER,
                                .pan_counts = BENCH_ENCODER,
                                .max_echoes = 1};
    cfg->head.settings = (struct head_settings){.prr_uhz = spec.prr_uhz,
                                                .lines_uhz = spec.lines_uhz,
                                                .pan_udeg_s = spec.pan_udeg_s,
                                                .line_start_udeg = spec.line_start_udeg,
                                                .line_stop_udeg = spec.line_stop_udeg,
                                                .pan_stop_udeg = spec.pan_stop_udeg,
                                                .frames = frames,
                                                .station = 1};
    cfg->n_stations = 1;
    cfg->output.crs = GEOREF_ECEF;
    cfg->output.layout = LINE_GEO;
    cfg->noise.range = RANGE_NOISE_ON;
    cfg->noise.seed = 1;
    cfg->link[0].type = LINK_NULL;
    cfg->n_links = 1;
    cfg->loop.tick_hz = 1000.0; /* this and the next two are the defaults (config/keys.c) */
    cfg->loop.ahead_ms = 64.0;
    cfg->loop.queue_ms = 250.0;
    cfg->loop.threads = threads;
    cfg->loop.pace = PACE_FAST;
}

static int run_loop(const struct site *site, struct loop_stats *stats, double *cpu_s, struct sh_err *err)
{
    struct device_options device_options = {.start = 1, .one_scan = 1};
    struct loop_options options = {0};
    struct device *device = NULL;
    struct loop *loop = NULL;
    double start_s = clock_cpu_s();
    int rc = device_create(site, &device_options, &device, err);
    if (rc == SH_OK) rc = loop_create(site, device, &options, &loop, err);
    if (rc == SH_OK) {
        rc = loop_start(loop, err);
        if (rc != SH_OK) loop_end(loop);
        while (rc == SH_OK && !loop_is_over(loop))
            poll(NULL, 0, 5);
        loop_join(loop, stats);
    }
    loop_free(loop);
    device_free(device);
    *cpu_s = clock_cpu_s() - start_s;
    return rc;
}

static int rounds(const struct bench_case *c, const struct bench_result *one, const struct site *site, uint32_t frames,
                  struct bench_threads *out, struct sh_err *err)
{
    double rays_s[ROUNDS], pulses_s[ROUNDS], ratio[ROUNDS], cpu_ns[ROUNDS];
    for (uint32_t i = 0; i < ROUNDS; i++) {
        struct loop_stats stats;
        double cpu_s;
        rays_s[i] = embree_rays_s(c, one, out->threads, frames);
        if (rays_s[i] <= 0.0) return sh_fail(err, SH_EIO, "bench: %u threads can't be had", out->threads);
        int rc = run_loop(site, &stats, &cpu_s, err);
        if (rc != SH_OK) return rc;
        if (stats.counters.lost_pulses != 0 || stats.counters.pulses != (uint64_t)frames * c->rays->n)
            return sh_fail(err, SH_ESTATE, "bench: the loop cast %llu pulses instead of %llu",
                           (unsigned long long)stats.counters.pulses, (unsigned long long)frames * c->rays->n);
        pulses_s[i] = (double)stats.counters.pulses / stats.wall_s;
        cpu_ns[i] = 1e9 * cpu_s / (double)stats.counters.pulses;
        ratio[i] = pulses_s[i] / rays_s[i];
    }
    out->embree_mrays_s = 1e-6 * bench_median(rays_s, ROUNDS);
    out->pulses_per_s = bench_median(pulses_s, ROUNDS);
    out->ratio = bench_median(ratio, ROUNDS);
    out->cpu_ns = bench_median(cpu_ns, ROUNDS);
    return SH_OK;
}

int bench_loop(const struct bench_case *c, const struct bench_result *one, uint32_t threads, struct bench_threads *out,
               struct sh_err *err)
{
    memset(out, 0, sizeof *out);
    out->threads = threads < MAX_THREADS ? threads : MAX_THREADS;
    double frames_s = 1e-9 * one->pipeline_ns * c->rays->n / out->threads;
    double wanted = c->seconds / (2 * ROUNDS) / frames_s;
    uint32_t frames = wanted > 1000.0 ? 1000 : wanted > MIN_FRAMES ? (uint32_t)wanted : MIN_FRAMES;
    struct config *cfg = malloc(sizeof *cfg);
    if (cfg == NULL) return sh_fail(err, SH_ENOMEM, "bench: no memory");
    fill_config(cfg, c, out->threads, frames);
    /* The site is made of parts that are there already. Only the georeference is released here. */
    struct site_station only = {.station = &cfg->station[0]}, *station = &only;
    struct site site = {.cfg = cfg,
                        .scene = c->target->scene,
                        .n_surfaces = c->target->scene->n_surfaces,
                        .bvh = c->bvh,
                        .station = station,
                        .n_stations = 1,
                        .scale_m = BENCH_SCALE_M};
    memcpy(station->at.position_m, c->target->station_m, sizeof station->at.position_m);
    station->scale[0] = station->scale[1] = station->scale[2] = BENCH_SCALE_M;
    pose_heading(0.0, station->at.rotation);
    int rc = bench_georef(c->target, &station->georef, err);
    if (rc == SH_OK) rc = embree_alone_rays(c->embree, c->rays->fx, c->rays->fy, c->rays->fz, c->rays->n, err);
    if (rc == SH_OK) rc = embree_alone_prepare(c->embree, one->embree_width, one->embree_feed, err);
    if (rc == SH_OK) rc = rounds(c, one, &site, frames, out, err);
    georef_free(station->georef);
    free(cfg);
    return rc;
}
