/* The rays of a normal scan. */
#include <stdlib.h>
#include <string.h>

#include "core/cast/kernels.h"
#include "tests/bench/bench.h"

enum { LINES_HZ = 480 };

void bench_schedule(uint32_t lines, uint32_t frames, struct schedule_spec *spec)
{
    *spec = (struct schedule_spec){.lines_uhz = LINES_HZ * INT64_C(1000000),
                                   .prr_uhz = LINES_HZ * INT64_C(1000000) * BENCH_LINE_PULSES,
                                   .pan_udeg_s = INT64_C(360000000) * LINES_HZ / lines,
                                   .fov_min_udeg = -40000000,
                                   .sweep_udeg = 100000000,
                                   .line_start_udeg = -40000000,
                                   .line_stop_udeg = 60000000,
                                   .pan_stop_udeg = 360000000,
                                   .frames = frames};
}

static void fill_line(struct bench_rays *rays, uint32_t l, double *mirror_turn, double *pan_turn)
{
    static const double levelled[9] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
    struct schedule_line line;
    struct schedule_run run;
    size_t at = (size_t)l * BENCH_LINE_PULSES;
    schedule_get_line(&rays->segment, l, &line);
    schedule_get_run(&rays->segment, &line, line.cast0, BENCH_LINE_PULSES, &run);
    kernel_angles(&run, 0, run.n, mirror_turn, pan_turn);
    const struct vec3_out d = {rays->dx + at, rays->dy + at, rays->dz + at};
    kernel_directions(&(struct kernel_turns){run.n, mirror_turn, pan_turn}, levelled, &d);
    bvh_to_float(&VEC3_IN(d, 0), run.n, rays->fx + at, rays->fy + at, rays->fz + at);
}

int bench_rays_create(uint32_t lines, struct bench_rays *out, struct sh_err *err)
{
    struct schedule_spec spec;
    memset(out, 0, sizeof *out);
    bench_schedule(lines, 0, &spec);
    schedule_start(&out->segment, &spec);
    out->lines = lines;
    out->n = lines * BENCH_LINE_PULSES;
    size_t n = ((size_t)out->n + 15) / 16 * 16;
    double *d = aligned_alloc(64, 3 * n * sizeof *d), angles[2 * BENCH_LINE_PULSES];
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
    for (uint32_t l = 0; l < lines; l++)
        fill_line(out, l, angles, angles + BENCH_LINE_PULSES);
    return SH_OK;
}

void bench_rays_block(const struct bench_rays *rays, uint32_t first, struct bench_block *out)
{
    memcpy(out->dx, rays->dx + first, sizeof out->dx);
    memcpy(out->dy, rays->dy + first, sizeof out->dy);
    memcpy(out->dz, rays->dz + first, sizeof out->dz);
    memcpy(out->fx, rays->fx + first, sizeof out->fx);
    memcpy(out->fy, rays->fy + first, sizeof out->fy);
    memcpy(out->fz, rays->fz + first, sizeof out->fz);
}

void bench_rays_free(struct bench_rays *rays)
{
    free(rays->dx);
    free(rays->fx);
    memset(rays, 0, sizeof *rays);
}
