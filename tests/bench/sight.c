/* SPDX-License-Identifier: MIT */
/* One thread measures whole scans: Embree, the cast and the pipeline, each of the latter two without and with a sight,
 * in turns. */
#include "tests/bench/sight.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/native_encode.h"
#include "tests/common/hits.h"

enum { EMBREE, WITHOUT, SIGHT, PIPELINE_WITHOUT, PIPELINE, N_METHODS };
enum { KINDS = 3 /* one or nothing, few, ask */, TRIES = 3 };

struct sums { /* sums of the least squares that explain a block's cost by its kinds of pulses */
    double a[KINDS][KINDS], b[KINDS];
};

struct rows {
    const struct bench_case *c;
    struct bench_sight *out;
    struct bench_rays bundle;
    struct bench_block *block;
    struct cast_setup setup;
    struct georef *georef;
    struct caster *caster;
    struct bvh_work *bvh_work;
    struct sight_work *work;
    struct sight *sight;
    struct line_block line;
    uint8_t *sink;
    size_t cap;
    double range_m[2][BENCH_BLOCK];
    uint32_t prim[2][BENCH_BLOCK];
    double ns[N_METHODS][BENCH_SIGHT_ROUNDS], build_s[BENCH_SIGHT_ROUNDS], kind_ns[KINDS][BENCH_SIGHT_ROUNDS];
};

static int set_up(struct rows *r, struct sh_err *err)
{
    const struct bench_case *c = r->c;
    const struct bench_scan *scan = &r->out->scan;
    struct schedule_spec spec;
    bench_schedule(scan->lines, scan->line_pulses, 0, &spec);
    int rc = bench_rays_room(&spec, scan->bundle, scan->line_pulses, &r->bundle, err);
    if (rc == SH_OK) rc = bench_georef(c->target, &r->georef, err);
    if (rc == SH_OK) rc = caster_create(&r->caster, err);
    if (rc == SH_OK) rc = bvh_work_create(&r->bvh_work, err);
    if (rc == SH_OK) rc = sight_work_create(&r->work, err);
    if (rc == SH_OK) rc = line_block_alloc(&r->line, scan->line_pulses, err);
    if (rc != SH_OK) return rc;
    bench_setup(c, r->georef, &r->setup);
    r->setup.noise_on = 0;
    r->cap = native_points_bound(scan->line_pulses);
    r->sink = malloc(r->cap);
    r->block = aligned_alloc(64, (sizeof *r->block + 63) / 64 * 64);
    if (r->sink == NULL || r->block == NULL) return sh_fail(err, SH_ENOMEM, "bench: no memory");
    return embree_alone_rays(c->embree, r->block->fx, r->block->fy, r->block->fz, BENCH_BLOCK, err);
}

static void tear_down(struct rows *r)
{
    bench_rays_free(&r->bundle);
    georef_free(r->georef);
    caster_free(r->caster);
    bvh_work_free(r->bvh_work);
    sight_work_free(r->work);
    sight_free(r->sight);
    line_block_free(&r->line);
    free(r->sink);
    free(r->block);
}

/* Builds the sight of this round and takes its cost. */
static int build(struct rows *r, uint32_t round, struct sh_err *err)
{
    struct sight_spec spec;
    bench_scan_spec(&r->out->scan, r->c->bvh, r->c->target->station_m, &spec);
    sight_free(r->sight);
    r->sight = NULL;
    double start_s = bench_process_s();
    int rc = sight_create(&spec, 1, NULL, &r->sight, err);
    r->build_s[round] = bench_process_s() - start_s;
    r->setup.sight = r->sight;
    return rc;
}

static void hits(struct rows *r, int method, uint32_t n)
{
    const struct bench_block *b = r->block;
    const int k = method == WITHOUT;
    struct bvh_rays rays = {.n = n,
                            .dir = {b->dx, b->dy, b->dz},
                            .range_max_m = BENCH_RANGE_MAX_M,
                            .range_m = r->range_m[k],
                            .triangle = r->prim[k]};
    memcpy(rays.from.at_m, r->c->target->station_m, sizeof rays.from.at_m);
    if (method == EMBREE)
        embree_alone_pass(r->c->embree, r->out->embree_width, r->out->embree_feed, 0, n);
    else if (method == WITHOUT)
        bvh_hits(r->bvh_work, r->c->bvh, &rays);
    else
        sight_hits(r->work, r->bvh_work, r->sight, &rays);
}

static void add_block(struct sums *s, uint32_t n, const struct sight_counters *before,
                      const struct sight_counters *after, double ns)
{
    const double few = (double)(after->few - before->few), asked = (double)(after->asked - before->asked);
    const double of[KINDS] = {n - few - asked, few, asked};
    for (int i = 0; i < KINDS; i++) {
        for (int k = 0; k < KINDS; k++)
            s->a[i][k] += of[i] * of[k];
        s->b[i] += of[i] * ns;
    }
}

/* Solves the normal equations. The cost of a kind that hardly occurs can't be found, and is NaN. */
static void solve(struct sums *s, double of_kind[KINDS])
{
    int known[KINDS];
    for (int i = 0; i < KINDS; i++) {
        const double whole = s->a[i][i];
        for (int j = 0; j < i; j++) {
            if (!known[j]) continue;
            const double f = s->a[i][j] / s->a[j][j];
            for (int k = 0; k < KINDS; k++)
                s->a[i][k] -= f * s->a[j][k];
            s->b[i] -= f * s->b[j];
        }
        known[i] = s->a[i][i] > 1e-6 * whole && whole > 0.0;
    }
    for (int i = KINDS - 1; i >= 0; i--) {
        double b = s->b[i];
        for (int k = i + 1; k < KINDS; k++)
            if (known[k]) b -= s->a[i][k] * of_kind[k];
        of_kind[i] = known[i] ? b / s->a[i][i] : (double)NAN;
    }
}

/* Rays are laid out, a block at a time, in the cache, while the clock stands. */
static double timed_blocks(struct rows *r, int method, uint32_t first_line, struct sums *sums)
{
    double spent_s = 0.0;
    uint32_t n;
    bench_rays_aim(&r->bundle, first_line);
    for (uint32_t first = 0; first < r->bundle.n; first += n) {
        const struct sight_counters before = *sight_work_counters(r->work);
        n = bench_rays_block(&r->bundle, first, r->block);
        if (method == EMBREE && r->out->embree_feed == EMBREE_PREPARED) embree_alone_refill(r->c->embree);
        double start_s = bench_thread_s();
        hits(r, method, n);
        double block_s = bench_thread_s() - start_s;
        spent_s += block_s;
        if (sums != NULL) add_block(sums, n, &before, sight_work_counters(r->work), 1e9 * block_s);
    }
    return spent_s;
}

static size_t whole_line(struct rows *r, const struct cast_setup *setup, uint32_t l)
{
    struct schedule_line line;
    struct schedule_run run;
    schedule_get_line(&r->bundle.segment, l, &line);
    schedule_get_run(&r->bundle.segment, &line, line.cast0, (uint32_t)(line.cast_end - line.cast0), &run);
    caster_cast(r->caster, setup, &run, &r->line);
    return native_encode_points(r->sink, r->cap, &r->line, 0);
}

static double timed_lines(struct rows *r, int method, uint32_t first_line)
{
    struct cast_setup setup = r->setup;
    if (method == PIPELINE_WITHOUT) setup.sight = NULL;
    double start_s = bench_thread_s();
    for (uint32_t l = 0; l < r->out->scan.bundle; l++)
        whole_line(r, &setup, first_line + l);
    return bench_thread_s() - start_s;
}

/* Returns the time of the pulses that are cast, in ns each. */
static double timed_pass(struct rows *r, int method, uint32_t step, struct sums *sums)
{
    const struct bench_scan *scan = &r->out->scan;
    double spent_s = 0.0, pulses = 0.0;
    for (uint32_t l = 0; l < scan->lines; l += step * scan->bundle) {
        spent_s += method >= PIPELINE_WITHOUT ? timed_lines(r, method, l) : timed_blocks(r, method, l, sums);
        pulses += r->bundle.n;
    }
    return 1e9 * spent_s / pulses;
}

static double embree_ns(void *ctx)
{
    struct rows *r = ctx;
    double ns[TRIES];
    for (int k = 0; k < TRIES; k++)
        ns[k] = timed_pass(r, EMBREE, 8 * r->out->scan.every, NULL);
    return bench_median(ns, TRIES);
}

/* Counts pulses whose triangle or bits differ between the cast without and with the sight. Also counts the pulses that
 * the map left open. */
static void compare(struct rows *r)
{
    const struct bench_scan *scan = &r->out->scan;
    const struct sight_counters before = *sight_work_counters(r->work);
    uint32_t n;
    for (uint32_t l = 0; l < scan->lines; l += scan->every * scan->bundle) {
        bench_rays_aim(&r->bundle, l);
        for (uint32_t first = 0; first < r->bundle.n; first += n) {
            n = bench_rays_block(&r->bundle, first, r->block);
            hits(r, WITHOUT, n);
            hits(r, SIGHT, n);
            for (uint32_t i = 0; i < n; i++)
                r->out->different += r->prim[0][i] != r->prim[1][i] ||
                                     (r->prim[0][i] != BVH_NO_TRIANGLE && r->range_m[0][i] != r->range_m[1][i]);
        }
        r->out->cast += r->bundle.n;
    }
    const struct sight_counters *after = sight_work_counters(r->work);
    r->out->few = (double)(after->few - before.few) / (double)r->out->cast;
    r->out->asked = (double)(after->asked - before.asked) / (double)r->out->cast;
}

static int round_of(struct rows *r, uint32_t round, struct sh_err *err)
{
    static const int turn[] = {EMBREE, WITHOUT, SIGHT, PIPELINE_WITHOUT, PIPELINE};
    const uint32_t every = r->out->scan.every;
    double of_kind[KINDS];
    struct sums sums = {0};
    int rc = build(r, round, err);
    if (rc != SH_OK) return rc;
    for (size_t i = 0; i < sizeof turn / sizeof turn[0]; i++)
        r->ns[turn[i]][round] = timed_pass(r, turn[i], every, turn[i] == SIGHT ? &sums : NULL);
    solve(&sums, of_kind);
    for (int k = 0; k < KINDS; k++)
        r->kind_ns[k][round] = of_kind[k];
    return SH_OK;
}

/* Returns the ratio of one method's time to another's. A sight's building belongs to the methods that need it. */
static double ratio(const struct rows *r, int base, int method)
{
    const int built = method == SIGHT || method == PIPELINE;
    const double pulses = (double)r->out->scan.pulses;
    double q[BENCH_SIGHT_ROUNDS];
    for (uint32_t i = 0; i < r->out->rounds; i++)
        q[i] = r->ns[base][i] / (r->ns[method][i] + (built ? 1e9 * r->build_s[i] / pulses : 0.0));
    return bench_median(q, r->out->rounds);
}

static void summarise(struct rows *r)
{
    struct bench_sight *out = r->out;
    const uint32_t n = out->rounds;
    out->cast_ratio = ratio(r, EMBREE, SIGHT); /* comes before the medians, because those sort */
    out->cast_ratio_without = ratio(r, EMBREE, WITHOUT);
    out->pipeline_ratio = ratio(r, EMBREE, PIPELINE);
    out->pipeline_ratio_without = ratio(r, EMBREE, PIPELINE_WITHOUT);
    out->gain = ratio(r, WITHOUT, SIGHT);
    out->plan_ratio = fmin(1.0, out->planned ? out->gain : 1.0 / out->gain);
    out->build_s = bench_median(r->build_s, n);
    out->build_ns = 1e9 * out->build_s / (double)out->scan.pulses;
    out->embree_ns = bench_median(r->ns[EMBREE], n);
    out->without_ns = bench_median(r->ns[WITHOUT], n);
    out->sight_ns = bench_median(r->ns[SIGHT], n);
    out->pipeline_without_ns = bench_median(r->ns[PIPELINE_WITHOUT], n);
    out->pipeline_ns = bench_median(r->ns[PIPELINE], n);
    out->one_ns = bench_median(r->kind_ns[0], n);
    out->few_ns = bench_median(r->kind_ns[1], n);
    out->ask_ns = bench_median(r->kind_ns[2], n);
}

static int run(struct rows *r, struct sh_err *err)
{
    int rc = bench_choose_embree(r->c->embree, &r->out->embree_width, &r->out->embree_feed, embree_ns, r, err);
    const double start_s = bench_process_s();
    if (rc == SH_OK) rc = bench_scan_plan(&r->out->scan, r->c->bvh, r->c->target->station_m, &r->out->planned, err);
    r->out->plan_s = bench_process_s() - start_s;
    if (rc == SH_OK) rc = build(r, 0, err);
    if (rc != SH_OK) return rc;
    r->out->info = *sight_get_info(r->sight);
    compare(r);
    for (uint32_t round = 0; round < BENCH_SIGHT_ROUNDS; round++) {
        rc = round_of(r, round, err);
        if (rc != SH_OK) return rc;
        r->out->rounds = round + 1;
    }
    summarise(r);
    return SH_OK;
}

int bench_sight(const struct bench_case *c, const struct bench_scan *scan, struct bench_sight *out, struct sh_err *err)
{
    memset(out, 0, sizeof *out);
    out->scan = *scan;
    struct rows *r = calloc(1, sizeof *r);
    if (r == NULL) return sh_fail(err, SH_ENOMEM, "bench: no memory");
    r->c = c;
    r->out = out;
    int rc = set_up(r, err);
    if (rc == SH_OK) rc = run(r, err);
    tear_down(r);
    free(r);
    return rc;
}
