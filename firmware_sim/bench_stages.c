/* The pipeline of core/cast/caster.c once more, chunk by chunk, with the counter of cycles read between its stages. That it
 * gives the same bytes is checked whenever it is used (bench_measure.c). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/cast/kernels.h"
#include "drivers/protocol/crc32c.h"
#include "drivers/protocol/native_encode.h"
#include "firmware_sim/bench.h"
#include "firmware_sim/clock.h"

enum { CHUNK = 256 }; /* as in caster.c */

struct bench_stages {
    double mirror_turn[CHUNK], pan_turn[CHUNK], dx[CHUNK], dy[CHUNK], dz[CHUNK], range_m[CHUNK];
    float fx[CHUNK], fy[CHUNK], fz[CHUNK], t[CHUNK], u[CHUNK], v[CHUNK];
    uint32_t prim[CHUNK], doubt[CHUNK];
    struct cast_counters counters;
    uint64_t *cycles, mark;
};

int bench_stages_create(struct bench_stages **out, struct sh_err *err)
{
    *out = aligned_alloc(64, (sizeof **out + 63) / 64 * 64);
    if (*out == NULL) return sh_fail(err, SH_ENOMEM, "bench: no memory");
    memset(*out, 0, sizeof **out);
    return SH_OK;
}

void bench_stages_free(struct bench_stages *stages)
{
    free(stages);
}

uint64_t bench_cycles(void)
{
#if defined(__x86_64__)
    return __builtin_ia32_rdtsc();
#else
    return (uint64_t)clock_now_ns();
#endif
}

/* What has passed since the last mark belongs to this stage. */
static void ends(struct bench_stages *s, enum bench_stage stage)
{
    uint64_t now = bench_cycles();
    s->cycles[stage] += now - s->mark;
    s->mark = now;
}

static void decide(struct bench_stages *s, const struct cast_setup *setup, const double o[3], float t_max, uint32_t n)
{
    struct decide_ray ray = {.bvh = setup->bvh, .t_max = t_max};
    memcpy(ray.station_m, setup->station_m, sizeof ray.station_m);
    memcpy(ray.o_local, o, sizeof ray.o_local);
    for (uint32_t i = 0; i < n; i++) {
        if (!s->doubt[i]) continue;
        struct decide_hit hit;
        ray.dir[0] = s->dx[i];
        ray.dir[1] = s->dy[i];
        ray.dir[2] = s->dz[i];
        decide_hit(&ray, s->prim[i], s->t[i], &s->counters, &hit);
        s->prim[i] = hit.prim;
        s->range_m[i] = hit.prim == RTC_INVALID_GEOMETRY_ID ? (double)NAN : hit.range_m;
    }
}

static void cast(struct bench_stages *s, const struct cast_setup *setup, uint32_t n)
{
    struct bvh_rays rays = {.t_max = (float)(setup->range_max_m * 1.001), .dx = s->fx, .dy = s->fy, .dz = s->fz,
                            .prim = s->prim, .t = s->t, .u = s->u, .v = s->v};
    struct kernel_hits hits = {.dx = s->dx, .dy = s->dy, .dz = s->dz, .prim = s->prim, .u = s->u, .v = s->v,
                               .range_m = s->range_m, .doubt = s->doubt};
    double o[3];
    for (int i = 0; i < 3; i++) {
        o[i] = setup->station_m[i] - setup->bvh->origin_m[i];
        rays.org[i] = (float)o[i];
    }
    kernel_to_float(s->dx, s->dy, s->dz, n, s->fx, s->fy, s->fz);
    ends(s, STAGE_DIRECTIONS);
    bvh_intersect(setup->bvh, &rays, n);
    ends(s, STAGE_EMBREE);
    uint32_t doubts = kernel_refine(setup->bvh, &hits, o, n);
    ends(s, STAGE_REFINE);
    if (doubts != 0) decide(s, setup, o, rays.t_max, n);
    ends(s, STAGE_DECIDE);
}

static void detect(struct bench_stages *s, const struct cast_setup *setup, struct line_block *block, uint32_t at, uint32_t n)
{
    kernel_detect(s->range_m, setup->range_min_m, setup->range_max_m, n, block->echo + at);
    for (uint32_t i = 0; i < n; i++) {
        uint16_t none = LINE_LABEL_NONE;
        block->label[at + i] = block->echo[at + i] != 0 ? setup->bvh->triangle[s->prim[i]].label : none;
        block->refl_cdb[at + i] = LINE_REFL_NONE;
    }
    ends(s, STAGE_DETECT);
}

static void positions(struct bench_stages *s, const struct cast_setup *setup, struct line_block *block, uint32_t at,
                      uint32_t n)
{
    kernel_read_encoders(s->mirror_turn, s->pan_turn, setup->mirror_counts, setup->pan_counts, n);
    kernel_directions(s->mirror_turn, s->pan_turn, setup->rotation, n, s->dx, s->dy, s->dz);
    kernel_scale(s->range_m, n, s->dx, s->dy, s->dz);
    georef_forward(setup->georef, n, s->dx, s->dy, s->dz, s->dx, s->dy, s->dz);
    kernel_geo(s->dx, s->dy, s->dz, setup->xyz_scale_m, n, block->a + at, block->b + at, block->c + at);
    ends(s, STAGE_GEOREF);
}

static void chunk(struct bench_stages *s, const struct cast_setup *setup, const struct schedule_run *run,
                  struct line_block *block, uint32_t at, uint32_t n)
{
    kernel_angles(run, at, n, s->mirror_turn, s->pan_turn);
    kernel_directions(s->mirror_turn, s->pan_turn, setup->rotation, n, s->dx, s->dy, s->dz);
    cast(s, setup, n);
    detect(s, setup, block, at, n);
    kernel_noise(setup, run->pulse0 + at, n, s->range_m);
    ends(s, STAGE_NOISE);
    positions(s, setup, block, at, n);
}

static void describe(const struct schedule_run *run, struct line_block *block)
{
    block->frame = run->frame;
    block->line = run->line;
    block->pulse0 = run->pulse0;
    block->n_pulses = block->n_points = run->n;
    block->t0_ns = run->t0_ns;
    block->line_t0_ns = run->line_t0_ns;
    block->layout = LINE_GEO;
    kernel_times(run, block->dt_ns);
}

size_t bench_stages_line(struct bench_stages *s, const struct cast_setup *setup, const struct schedule_segment *segment,
                         uint64_t line, uint64_t cycles[BENCH_STAGES], struct line_block *block, uint8_t *bytes, size_t cap)
{
    struct schedule_line place;
    struct schedule_run run;
    s->cycles = cycles;
    s->mark = bench_cycles();
    schedule_get_line(segment, line, &place);
    schedule_get_run(segment, &place, place.cast0, (uint32_t)(place.cast_end - place.cast0), &run);
    describe(&run, block);
    ends(s, STAGE_SCHEDULE);
    for (uint32_t at = 0; at < run.n; at += CHUNK)
        chunk(s, setup, &run, block, at, run.n - at < CHUNK ? run.n - at : CHUNK);
    size_t len = native_encode_points(bytes, cap, block, 0);
    ends(s, STAGE_ENCODE);
    /* The checksum, made within the encoder, once more by itself: its time is taken from that of the encoder. */
    uint64_t start = s->mark;
    volatile uint32_t crc = crc32c(0, bytes + NATIVE_HEADER_LEN, len - NATIVE_HEADER_LEN);
    (void)crc;
    ends(s, STAGE_CRC);
    uint64_t spent = s->mark - start;
    cycles[STAGE_ENCODE] -= spent < cycles[STAGE_ENCODE] ? spent : cycles[STAGE_ENCODE];
    return len;
}
