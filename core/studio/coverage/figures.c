/* SPDX-License-Identifier: MIT */
/* Sums over cells. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/studio/coverage/inside.h"

/* A figure of a cell that is seen, and its area. */
struct share {
    double value, area_m2;
};

static int figures_compare(const void *a, const void *b)
{
    const double x = ((const struct share *)a)->value, y = ((const struct share *)b)->value;
    return (x > y) - (x < y);
}

/* Returns the value at which `part` of the area is reached; shares are in the order of their values. */
static double part_of(const struct share *share, uint32_t n, double area_m2, double part)
{
    double sum_m2 = 0.0;
    for (uint32_t i = 0; i < n; i++) {
        sum_m2 += share[i].area_m2;
        if (sum_m2 >= part * area_m2) return share[i].value;
    }
    return share[n - 1].value;
}

enum figure { DENSITY, INCIDENCE, RANGE };

static double figure_of(const struct coverage *c, uint32_t i, enum figure figure)
{
    struct coverage_cell cell;
    coverage_get(c, i, &cell);
    return figure == DENSITY ? cell.pulses / cell.area_m2 : figure == INCIDENCE ? cell.incidence_rad : cell.range_m;
}

static void spread_of(const struct coverage *c, enum figure figure, struct share *share, struct coverage_spread *out)
{
    double area_m2 = 0.0, sum = 0.0;
    uint32_t n = 0;
    *out = (struct coverage_spread){(double)NAN, (double)NAN, (double)NAN, (double)NAN};
    for (uint32_t i = 0; i < c->n_cells; i++) {
        if (c->cell[i].stations == 0) continue;
        share[n] = (struct share){figure_of(c, i, figure), c->cell[i].area_m2};
        area_m2 += share[n].area_m2;
        sum += share[n].value * share[n].area_m2;
        n++;
    }
    if (n == 0) return;
    qsort(share, n, sizeof *share, figures_compare);
    *out = (struct coverage_spread){sum / area_m2, part_of(share, n, area_m2, 0.05), part_of(share, n, area_m2, 0.5),
                                    part_of(share, n, area_m2, 0.95)};
}

int coverage_sum(const struct coverage *c, struct coverage_sums *sums, struct sh_err *err)
{
    struct share *share = malloc((c->n_cells + 1) * sizeof *share);
    if (share == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the figures of %u cells", c->n_cells);
    *sums = (struct coverage_sums){.stations = c->n_stations,
                                   .cells = c->n_cells,
                                   .pieces = c->n_pieces,
                                   .triangles = c->scene->n_triangles,
                                   .duplicate_m2 = c->duplicate_m2,
                                   .silent_m2 = c->silent_m2};
    for (uint32_t i = 0; i < c->n_cells; i++) {
        const struct cell *cell = &c->cell[i];
        double *by = cell->stations == 0 ? &sums->none_m2 : cell->stations == 1 ? &sums->one_m2 : &sums->several_m2;
        *by += cell->area_m2;
        sums->area_m2 += cell->area_m2;
    }
    spread_of(c, DENSITY, share, &sums->density_1_m2);
    spread_of(c, INCIDENCE, share, &sums->incidence_rad);
    spread_of(c, RANGE, share, &sums->range_m);
    free(share);
    return SH_OK;
}

void coverage_by_label(const struct coverage *c, struct coverage_of_label *label)
{
    memset(label, 0, c->scene->n_surfaces * sizeof *label);
    for (uint32_t i = 0; i < c->n_cells; i++) {
        const struct cell *cell = &c->cell[i];
        struct coverage_of_label *l = &label[cell->label];
        l->area_m2 += cell->area_m2;
        if (cell->stations > 0) l->seen_m2 += cell->area_m2;
        if (cell->stations > 1) l->several_m2 += cell->area_m2;
        l->pulses += cell->pulses;
    }
}

void coverage_alone(const struct coverage *c, double *alone_m2)
{
    for (uint32_t i = 0; i < c->n_stations; i++)
        alone_m2[i] = 0.0;
    for (uint32_t i = 0; i < c->n_cells; i++)
        if (c->cell[i].stations == 1) alone_m2[c->cell[i].first_station - 1] += c->cell[i].area_m2;
}
