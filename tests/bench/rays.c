/* SPDX-License-Identifier: MIT */
/* These are the rays of a normal scan. */
#include <stdlib.h>
#include <string.h>

#include "tests/bench/bench.h"
#include "tests/common/aimed.h"

enum { LINES_HZ = 480 };

void bench_schedule(uint32_t lines, uint32_t pulses, uint32_t frames, struct schedule_spec *spec)
{
    *spec = (struct schedule_spec){.lines_uhz = LINES_HZ * INT64_C(1000000),
                                   .prr_uhz = LINES_HZ * INT64_C(1000000) * pulses,
                                   .pan_udeg_s = INT64_C(360000000) * LINES_HZ / lines,
                                   .fov_min_udeg = BENCH_LOWEST_DEG * INT64_C(1000000),
                                   .sweep_udeg = (BENCH_HIGHEST_DEG - BENCH_LOWEST_DEG) * INT64_C(1000000),
                                   .line_start_udeg = BENCH_LOWEST_DEG * INT64_C(1000000),
                                   .line_stop_udeg = BENCH_HIGHEST_DEG * INT64_C(1000000),
                                   .pan_stop_udeg = 360000000,
                                   .frames = frames};
}

static void fill_line(struct bench_rays *rays, uint32_t line, size_t at)
{
    static const double levelled[9] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
    struct schedule_line place;
    struct schedule_run run;
    schedule_get_line(&rays->segment, line, &place);
    schedule_get_run(&rays->segment, &place, place.cast0, rays->line_pulses, &run);
    const struct vec3_out d = {rays->dx + at, rays->dy + at, rays->dz + at};
    aimed_directions(&run, levelled, &d);
    bvh_to_float(&VEC3_IN(d, 0), run.n, rays->fx + at, rays->fy + at, rays->fz + at);
}

void bench_rays_aim(struct bench_rays *rays, uint32_t first_line)
{
    for (uint32_t l = 0; l < rays->lines; l++)
        fill_line(rays, first_line + l, (size_t)l * rays->line_pulses);
}

void bench_rays_spread(struct bench_rays *rays, uint32_t bundle, uint32_t every)
{
    for (uint32_t l = 0; l < rays->lines; l++)
        fill_line(rays, l / bundle * bundle * every + l % bundle, (size_t)l * rays->line_pulses);
}

int bench_rays_room(const struct schedule_spec *spec, uint32_t lines, uint32_t line_pulses, struct bench_rays *out,
                    struct sh_err *err)
{
    memset(out, 0, sizeof *out);
    schedule_start(&out->segment, spec);
    out->lines = lines;
    out->line_pulses = line_pulses;
    out->n = lines * line_pulses;
    size_t n = ((size_t)out->n + 15) / 16 * 16;
    double *d = aligned_alloc(64, 3 * n * sizeof *d);
    float *f = aligned_alloc(64, 3 * n * sizeof *f);
    out->dx = d;
    out->fx = f;
    if (d == NULL || f == NULL) {
        bench_rays_free(out);
        return sh_fail(err, SH_ENOMEM, "bench: no memory for %u rays", out->n);
    }
    out->dy = d + n;
    out->dz = d + 2 * n;
    out->fy = f + n;
    out->fz = f + 2 * n;
    return SH_OK;
}

int bench_rays_create(uint32_t lines, struct bench_rays *out, struct sh_err *err)
{
    struct schedule_spec spec;
    bench_schedule(lines, BENCH_LINE_PULSES, 0, &spec);
    int rc = bench_rays_room(&spec, lines, BENCH_LINE_PULSES, out, err);
    if (rc == SH_OK) bench_rays_aim(out, 0);
    return rc;
}

uint32_t bench_rays_block(const struct bench_rays *rays, uint32_t first, struct bench_block *out)
{
    const uint32_t n = rays->n - first < BENCH_BLOCK ? rays->n - first : BENCH_BLOCK;
    const size_t wide = n * sizeof(double), narrow = n * sizeof(float);
    memcpy(out->dx, rays->dx + first, wide);
    memcpy(out->dy, rays->dy + first, wide);
    memcpy(out->dz, rays->dz + first, wide);
    memcpy(out->fx, rays->fx + first, narrow);
    memcpy(out->fy, rays->fy + first, narrow);
    memcpy(out->fz, rays->fz + first, narrow);
    return n;
}

void bench_rays_free(struct bench_rays *rays)
{
    free(rays->dx);
    free(rays->fx);
    memset(rays, 0, sizeof *rays);
}
