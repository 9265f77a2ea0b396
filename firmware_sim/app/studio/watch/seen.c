/* SPDX-License-Identifier: MIT */
/* Marks the cells of the surface that have points: a bit for each cell, by station. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/vec3.h"
#include "firmware_sim/app/studio/watch/inside.h"
#include "firmware_sim/config/config.h"

/* Limits of the number of cells, which is approximate, and of memory. Each triangle is counted below with at least one
 * piece of a cell, also a duplicate face, which has none. A piece is counted with 148 bytes, a little more than it
 * takes (PIECE_BYTES in core/studio/coverage/cells.c). */
static const double MOST_CELLS = 20000.0, MOST_MIB = 160.0;
enum { TRIES = 12 };

static double area_of(const struct scene *scene)
{
    double area_m2 = 0.0;
    for (uint32_t t = 0; t < scene->n_triangles; t++) {
        const uint32_t *c = scene->triangle[t];
        double n[3];
        vec3_normal(scene->vertex_m[c[0]], scene->vertex_m[c[1]], scene->vertex_m[c[2]], n);
        area_m2 += 0.5 * vec3_length(n);
    }
    return area_m2;
}

static int make_cells(struct watch *w, struct sh_err *err)
{
    const struct config_coverage *c = &w->cfg->coverage;
    const struct scene *scene = w->site->scene;
    struct watch_seen *seen = &w->seen;
    struct coverage_spec spec = {
        .bvh = w->site->bvh, .silent = w->site->silent, .memory_mib = fmin(c->memory_mib, MOST_MIB), .threads = 1};
    int rc = SH_EINPUT;
    const double least_mib = scene->n_triangles * 148.0 / 0x1p20;
    if (least_mib > spec.memory_mib)
        return sh_fail(err, SH_EINPUT, "the cells of %u triangles take %.0f MiB or more; allowed are %.0f MiB",
                       scene->n_triangles, least_mib, spec.memory_mib);
    spec.cell_m = fmax(c->cell_m, sqrt(area_of(scene) / MOST_CELLS));
    for (int i = 0; i < TRIES && rc == SH_EINPUT; i++, spec.cell_m *= 1.5) {
        rc = coverage_create(&spec, w->options.report, &seen->coverage, err);
        seen->cell_m = spec.cell_m;
    }
    return rc;
}

int watch_seen_open(struct watch *w, struct sh_err *err)
{
    struct watch_seen *seen = &w->seen;
    struct sh_err why;
    const int rc = make_cells(w, &why);
    if (rc == SH_EINPUT) {
        sh_warn(w->options.report, "the page shows no coverage: %s", why.text);
        return SH_OK;
    }
    if (rc != SH_OK) return sh_fail(err, rc, "%s", why.text);
    seen->n_cells = coverage_cells(seen->coverage);
    seen->words = ((size_t)seen->n_cells + 63) / 64;
    seen->cell_m2 = malloc(((size_t)seen->n_cells + 1) * sizeof *seen->cell_m2);
    seen->bits = calloc(w->site->n_stations * seen->words + 1, sizeof *seen->bits);
    seen->all = malloc((seen->words + 1) * sizeof *seen->all);
    if (seen->cell_m2 == NULL || seen->bits == NULL || seen->all == NULL)
        return sh_fail(err, SH_ENOMEM, "no memory for %u cells of coverage", seen->n_cells);
    for (uint32_t i = 0; i < seen->n_cells; i++) {
        struct coverage_cell cell;
        coverage_get(seen->coverage, i, &cell);
        seen->cell_m2[i] = cell.area_m2;
        seen->area_m2 += cell.area_m2;
    }
    return SH_OK;
}

void watch_seen_close(struct watch_seen *seen)
{
    coverage_free(seen->coverage);
    free(seen->cell_m2);
    free(seen->bits);
    free(seen->all);
    *seen = (struct watch_seen){0};
}

void watch_seen_begin(struct watch_seen *seen, uint32_t station)
{
    if (seen->coverage != NULL) memset(seen->bits + (station - 1) * seen->words, 0, seen->words * sizeof *seen->bits);
}

void watch_seen_mark(struct watch_seen *seen, uint32_t station, uint32_t triangle, const double p_m[3])
{
    if (seen->coverage == NULL || triangle == CLOUD_TRIANGLE_NONE) return;
    const uint32_t cell = coverage_cell_at(seen->coverage, triangle, p_m);
    if (cell != COVERAGE_NO_CELL) seen->bits[(station - 1) * seen->words + cell / 64] |= 1ULL << cell % 64;
}

static uint32_t seen_count(const struct watch_seen *seen, const uint64_t *bits, double *sum_m2)
{
    uint32_t n = 0;
    *sum_m2 = 0.0;
    for (uint32_t i = 0; i < seen->n_cells; i++)
        if (bits[i / 64] >> i % 64 & 1) {
            n++;
            *sum_m2 += seen->cell_m2[i];
        }
    return n;
}

double watch_seen_count(struct watch_seen *seen, uint32_t station, uint32_t n_stations)
{
    double sum_m2;
    if (seen->coverage == NULL) return (double)NAN;
    seen_count(seen, seen->bits + (station - 1) * seen->words, &sum_m2);
    memset(seen->all, 0, seen->words * sizeof *seen->all);
    for (uint32_t s = 0; s < n_stations; s++)
        for (size_t i = 0; i < seen->words; i++)
            seen->all[i] |= seen->bits[s * seen->words + i];
    seen->n_seen = seen_count(seen, seen->all, &seen->seen_m2);
    return sum_m2 / seen->area_m2;
}
