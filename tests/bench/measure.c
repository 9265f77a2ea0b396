/* SPDX-License-Identifier: MIT */
/* One thread runs Embree, robust and not, the exact cast, the whole pipeline, and the pipeline by stages, in turns. */
#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/native_encode.h"
#include "tests/common/hits.h"
#include "tests/bench/bench.h"
#include "firmware_sim/base/clock.h"

const char *const bench_stage_name[BENCH_STAGES] = {"schedule", "directions", "embree", "refine", "detect",
                                                    "noise",    "georef",     "encode", "crc"};

enum { EMBREE, FAST, CAST, PIPELINE, IDEAL, STAGED, N_METHODS };

struct measure {
    const struct bench_case *c;
    struct bench_result *out;
    struct cast_setup setup, ideal;
    struct georef *georef;
    struct caster *caster;
    struct line_block block;
    struct bench_stages *stages;
    struct bench_block *rays;
    double range_m[BENCH_BLOCK];
    uint32_t prim[BENCH_BLOCK];
    uint8_t *sink, *staged; /* the bytes of the last line, as the null link gets them */
    size_t cap;
    double ns[N_METHODS][BENCH_MAX_ROUNDS], stage_ns[BENCH_STAGES][BENCH_MAX_ROUNDS];
};

static int set_up(struct measure *m, struct sh_err *err)
{
    const struct bench_case *c = m->c;
    int rc = bench_georef(c->target, &m->georef, err);
    if (rc == SH_OK) rc = caster_create(&m->caster, err);
    if (rc == SH_OK) rc = bench_stages_create(&m->stages, err);
    if (rc == SH_OK) rc = line_block_alloc(&m->block, BENCH_LINE_PULSES, err);
    if (rc != SH_OK) return rc;
    bench_setup(c, m->georef, &m->setup);
    m->ideal = m->setup;
    m->ideal.mirror_counts = m->ideal.pan_counts = 4294967296.0;
    m->cap = native_points_bound(BENCH_LINE_PULSES);
    m->sink = malloc(m->cap);
    m->staged = malloc(m->cap);
    m->rays = aligned_alloc(64, (sizeof *m->rays + 63) / 64 * 64);
    if (m->sink == NULL || m->staged == NULL || m->rays == NULL) return sh_fail(err, SH_ENOMEM, "bench: no memory");
    rc = embree_alone_rays(c->embree, m->rays->fx, m->rays->fy, m->rays->fz, BENCH_BLOCK, err);
    if (rc == SH_OK) rc = embree_alone_rays(c->fast, m->rays->fx, m->rays->fy, m->rays->fz, BENCH_BLOCK, err);
    return rc;
}

static void tear_down(struct measure *m)
{
    georef_free(m->georef);
    caster_free(m->caster);
    bench_stages_free(m->stages);
    line_block_free(&m->block);
    free(m->sink);
    free(m->staged);
    free(m->rays);
}

/* Makes a line as a worker of the loop makes it. */
static size_t whole_line(struct measure *m, const struct cast_setup *setup, uint32_t l)
{
    const struct schedule_segment *segment = &m->c->rays->segment;
    struct schedule_line line;
    struct schedule_run run;
    schedule_get_line(segment, l, &line);
    schedule_get_run(segment, &line, line.cast0, (uint32_t)(line.cast_end - line.cast0), &run);
    caster_cast(m->caster, setup, &run, &m->block);
    return native_encode_points(m->sink, m->cap, &m->block, 0);
}

static void staged_pass(struct measure *m, uint32_t round)
{
    const struct bench_rays *rays = m->c->rays;
    uint64_t cycles[BENCH_STAGES] = {0}, start = bench_cycles();
    double start_s = bench_thread_s();
    for (uint32_t l = 0; l < rays->lines; l++)
        bench_stages_line(m->stages, &m->setup, &rays->segment, l, cycles, &m->block, m->staged, m->cap);
    /* Cycles go on while another program has the processor, but this thread's time doesn't. */
    double ns = 1e9 * (bench_thread_s() - start_s) / (double)(bench_cycles() - start) / rays->n;
    for (int s = 0; s < BENCH_STAGES; s++)
        m->stage_ns[s][round] = (double)cycles[s] * ns;
}

/* Embree and the cast get their rays as the pipeline has them: a block at a time, in the cache. The clock stands while
 * a block is laid out. */
static double timed_blocks(struct measure *m, int method)
{
    const struct bench_case *c = m->c;
    double spent_s = 0.0;
    for (uint32_t first = 0; first < c->rays->n; first += BENCH_BLOCK) {
        const struct bench_block *b = m->rays;
        bench_rays_block(c->rays, first, m->rays);
        const struct embree_alone *e = method == FAST ? c->fast : c->embree;
        if (m->out->embree_feed == EMBREE_PREPARED) embree_alone_refill(e);
        double start_s = bench_thread_s();
        if (method != CAST)
            embree_alone_pass(e, m->out->embree_width, m->out->embree_feed, 0, BENCH_BLOCK);
        else
            hits_from(m->caster, c->bvh, m->setup.station_m, BENCH_RANGE_MAX_M, BENCH_BLOCK, b->dx, b->dy, b->dz,
                      m->range_m, m->prim);
        spent_s += bench_thread_s() - start_s;
    }
    return spent_s;
}

static double timed_lines(struct measure *m, int method, uint32_t round)
{
    double start_s = bench_thread_s();
    if (method == STAGED)
        staged_pass(m, round);
    else
        for (uint32_t l = 0; l < m->c->rays->lines; l++)
            whole_line(m, method == IDEAL ? &m->ideal : &m->setup, l);
    return bench_thread_s() - start_s;
}

static double timed_pass(struct measure *m, int method, uint32_t round)
{
    double s = method <= CAST ? timed_blocks(m, method) : timed_lines(m, method, round);
    return 1e9 * s / m->c->rays->n;
}

static double embree_ns(void *ctx)
{
    double ns[3];
    for (uint32_t k = 0; k < 3; k++)
        ns[k] = timed_pass(ctx, EMBREE, 0);
    return bench_median(ns, 3);
}

static int check_same(struct measure *m)
{
    uint64_t cycles[BENCH_STAGES] = {0};
    const struct bench_rays *rays = m->c->rays;
    for (uint32_t l = 0; l < rays->lines; l += 7) {
        size_t n = whole_line(m, &m->setup, l);
        size_t n_staged =
            bench_stages_line(m->stages, &m->setup, &rays->segment, l, cycles, &m->block, m->staged, m->cap);
        if (n == 0 || n != n_staged || memcmp(m->sink, m->staged, n) != 0) return 0;
    }
    return 1;
}

/* Returns the ratio of one method's time to another's. */
static double ratio(const struct measure *m, int base, int method)
{
    double r[BENCH_MAX_ROUNDS];
    for (uint32_t i = 0; i < m->out->rounds; i++)
        r[i] = m->ns[base][i] / m->ns[method][i];
    return bench_median(r, m->out->rounds);
}

static void summarise(struct measure *m)
{
    struct bench_result *out = m->out;
    out->cast_ratio = ratio(m, EMBREE, CAST); /* comes before the medians, because those sort */
    out->pipeline_ratio = ratio(m, EMBREE, PIPELINE);
    out->ideal_ratio = ratio(m, EMBREE, IDEAL);
    out->fast_ratio = ratio(m, FAST, CAST);
    out->embree_ns = bench_median(m->ns[EMBREE], out->rounds);
    out->fast_ns = bench_median(m->ns[FAST], out->rounds);
    out->cast_ns = bench_median(m->ns[CAST], out->rounds);
    out->pipeline_ns = bench_median(m->ns[PIPELINE], out->rounds);
    out->ideal_ns = bench_median(m->ns[IDEAL], out->rounds);
    out->staged_ns = bench_median(m->ns[STAGED], out->rounds);
    for (int s = 0; s < BENCH_STAGES; s++)
        out->stage_ns[s] = bench_median(m->stage_ns[s], out->rounds);
}

static int run(struct measure *m, struct sh_err *err)
{
    struct bench_result *out = m->out;
    struct cast_counters before, *n = &out->counters;
    int rc = bench_choose_embree(m->c->embree, &out->embree_width, &out->embree_feed, embree_ns, m, err);
    if (rc == SH_OK) rc = embree_alone_prepare(m->c->fast, out->embree_width, out->embree_feed, err);
    if (rc != SH_OK) return rc;
    caster_get_counters(m->caster, &before);
    timed_blocks(m, CAST);
    caster_get_counters(m->caster, n);
    n->decided -= before.decided;
    out->same_bytes = check_same(m);
    int64_t start_ns = clock_now_ns();
    for (uint32_t round = 0; round < BENCH_MAX_ROUNDS; round++) {
        if (round >= BENCH_MIN_ROUNDS && (double)(clock_now_ns() - start_ns) > 1e9 * m->c->seconds) break;
        for (int method = 0; method < N_METHODS; method++)
            m->ns[method][round] = timed_pass(m, method, round);
        out->rounds = round + 1;
    }
    summarise(m);
    return SH_OK;
}

int bench_measure(const struct bench_case *c, struct bench_result *out, struct sh_err *err)
{
    memset(out, 0, sizeof *out);
    out->pulses = c->rays->n;
    struct measure *m = calloc(1, sizeof *m);
    if (m == NULL) return sh_fail(err, SH_ENOMEM, "bench: no memory");
    m->c = c;
    m->out = out;
    int rc = set_up(m, err);
    if (rc == SH_OK) rc = run(m, err);
    tear_down(m);
    free(m);
    return rc;
}
