/* SPDX-License-Identifier: MIT */
/* One thread casts the cases of a group line by line in turns, and measures the whole cast of each. */
#include "tests/bench/reach.h"

#include <stdlib.h>
#include <string.h>

#include "tests/bench/bench.h"

struct group {
    uint32_t n;
    struct reach_run run[BENCH_MAX_REACH];
    double ns[BENCH_MAX_REACH][BENCH_REACH_ROUNDS];
};

/* Each line is cast for all cases before the next line. The cases take turns at being first, because the first one
 * finds the caches as the line before left them. */
static void round_of(struct group *g, uint32_t round)
{
    double spent_s[BENCH_MAX_REACH] = {0.0};
    uint64_t pulses[BENCH_MAX_REACH] = {0};
    for (uint32_t l = 0; l < REACH_LINES; l++)
        for (uint32_t k = 0; k < g->n; k++) {
            const uint32_t i = (k + l + round) % g->n;
            const double start_s = bench_thread_s();
            pulses[i] += reach_cast(&g->run[i], l);
            spent_s[i] += bench_thread_s() - start_s;
        }
    for (uint32_t i = 0; i < g->n; i++)
        g->ns[i][round] = 1e9 * spent_s[i] / (double)pulses[i];
}

static double ratio(const struct group *g, uint32_t i, uint32_t base)
{
    double q[BENCH_REACH_ROUNDS];
    for (uint32_t r = 0; r < BENCH_REACH_ROUNDS; r++)
        q[r] = g->ns[i][r] / g->ns[base][r];
    return bench_median(q, BENCH_REACH_ROUNDS);
}

static void summarise(struct group *g, struct bench_reach *out)
{
    for (uint32_t i = 0; i < g->n; i++) {
        const struct reach_run *run = &g->run[i];
        out[i] = (struct bench_reach){.of = run->of,
                                      .by_standing = ratio(g, i, 0),
                                      .by_near = ratio(g, i, (uint32_t)(run->of->near - run->of->standing)),
                                      .leaves = reach_leaves(run),
                                      .decided = reach_decided(run),
                                      .load_s = run->load_s,
                                      .mib = (double)run->bytes / 1048576.0,
                                      .triangles = run->triangles};
    }
    for (uint32_t i = 0; i < g->n; i++) /* the median sorts */
        out[i].ns = bench_median(g->ns[i], BENCH_REACH_ROUNDS);
}

static int measure_group(struct group *g, const struct reach_folder *folder, int first, struct bench_reach *out,
                         struct sh_err *err)
{
    int rc = SH_OK;
    g->n = 0;
    for (int i = first; i < REACH_CASES && REACH_CASE[i].standing == first && rc == SH_OK; i++)
        rc = reach_open(folder, &REACH_CASE[i], &g->run[g->n++], err);
    if (rc == SH_OK)
        for (uint32_t round = 0; round < BENCH_REACH_ROUNDS; round++)
            round_of(g, round);
    if (rc == SH_OK) summarise(g, out);
    for (uint32_t i = 0; i < g->n; i++)
        reach_close(&g->run[i]);
    return rc;
}

int bench_reach(const char *house, struct bench_reach out[BENCH_MAX_REACH], uint32_t *n, struct sh_err *err)
{
    struct reach_folder folder;
    struct group *g = calloc(1, sizeof *g);
    *n = 0;
    if (g == NULL) return sh_fail(err, SH_ENOMEM, "bench: no memory");
    int rc = reach_folder_make(&folder, house, err);
    while (rc == SH_OK && *n < (uint32_t)REACH_CASES) {
        fprintf(stderr, "bench: %s, and what it may cost as much as\n", REACH_CASE[*n].name);
        rc = measure_group(g, &folder, (int)*n, out + *n, err);
        *n += g->n;
    }
    reach_folder_remove(&folder);
    free(g);
    return rc;
}
