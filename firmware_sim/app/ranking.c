/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/ranking.h"

#include <stdlib.h>

struct ranking {
    double (*figure)(const void *ctx, uint32_t i);
    const void *ctx;
};

static int ranking_compare(const void *a, const void *b, void *ctx)
{
    const struct ranking *r = ctx;
    const uint32_t i = *(const uint32_t *)a, k = *(const uint32_t *)b;
    const double x = r->figure(r->ctx, i), y = r->figure(r->ctx, k);
    return x != y ? (x < y) - (x > y) : (i > k) - (i < k);
}

uint32_t *ranking_make(uint32_t n, double (*figure)(const void *ctx, uint32_t i), const void *ctx)
{
    uint32_t *order = malloc(((size_t)n + 1) * sizeof *order);
    for (uint32_t i = 0; i < n && order != NULL; i++)
        order[i] = i;
    if (order != NULL) qsort_r(order, n, sizeof *order, ranking_compare, &(struct ranking){figure, ctx});
    return order;
}
