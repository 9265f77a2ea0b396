/* SPDX-License-Identifier: MIT */
/* Casts a scan onto the cells, on several threads. Neither sums of whole numbers nor the larger of two numbers depend
 * on the order, so results don't depend on how threads share the work. */
#include <stdlib.h>
#include <string.h>

#include "core/studio/coverage/inside.h"
#include "core/together.h"

enum { BLOCK = 1 << 15, ROOM = BVH_CHUNK * (1 + CAST_MAX_DEPTH) };

struct look {
    struct coverage *c;
    const struct coverage_scan *scan;
    const char *what;
    const struct sh_report *report;
    uint64_t n_blocks;
    atomic_uint_fast64_t next, cast, met, hits, front;
    atomic_int failed;
};

struct worker {
    struct look *look;
    struct caster *caster;
    struct cast_setup setup;
    struct cast_hit hit[ROOM];
};

static void keep_larger(_Atomic uint32_t *of, uint32_t bits)
{
    uint32_t old = atomic_load_explicit(of, memory_order_relaxed);
    while (old < bits &&
           !atomic_compare_exchange_weak_explicit(of, &old, bits, memory_order_relaxed, memory_order_relaxed))
        ;
}

static void add_hits(struct worker *w, uint32_t n)
{
    struct coverage *c = w->look->c;
    uint32_t hits = 0, front = 0, met = 0, last = NO_CELL;
    for (uint32_t i = 0; i < n; i++) {
        const struct cast_hit *h = &w->hit[i];
        if (h->body != 0) continue;
        const uint32_t cell = coverage_cell_at(c, h->triangle, h->p_m);
        if (cell == NO_CELL) continue;
        struct cell_hits *m = &c->hits[cell];
        atomic_fetch_add_explicit(&m->pulses, 1, memory_order_relaxed);
        keep_larger(&m->cosine, coverage_bits(h->cosine));
        keep_larger(&m->nearness, coverage_bits(1.0 / h->range_m));
        hits++;
        front += h->front;
        met += h->pulse != last; /* a pulse's hits follow each other */
        last = h->pulse;
    }
    atomic_fetch_add(&w->look->hits, hits);
    atomic_fetch_add(&w->look->front, front);
    atomic_fetch_add(&w->look->met, met);
}

/* Casts pulses first .. end of one line. */
static void cast_line(struct worker *w, const struct schedule_line *line, uint64_t first, uint64_t end)
{
    const struct coverage_scan *scan = w->look->scan;
    while (first < end) {
        struct schedule_run run;
        schedule_get_run(&scan->segment, line, first, (uint32_t)(end - first < BVH_CHUNK ? end - first : BVH_CHUNK),
                         &run);
        if (scan->enter != NULL) scan->enter(scan->ctx, run.t0_ns, &w->setup);
        const uint32_t n = caster_meet(w->caster, &w->setup, &run, w->hit);
        add_hits(w, n);
        if (scan->take != NULL) scan->take(scan->take_ctx, w->hit, n);
        atomic_fetch_add(&w->look->cast, run.n);
        first += run.n;
    }
}

static uint64_t begin_of(const struct look *look, uint64_t block)
{
    const struct schedule_segment *seg = &look->scan->segment;
    if (block == 0) return seg->k0;
    return block >= look->n_blocks ? seg->end_pulse : schedule_cut(seg, seg->k0 + block * BLOCK);
}

static void cast_block(struct worker *w, uint64_t block)
{
    const struct schedule_segment *seg = &w->look->scan->segment;
    const uint64_t begin = begin_of(w->look, block), end = begin_of(w->look, block + 1);
    struct schedule_line line;
    for (uint64_t k = begin; k < end; k = line.pulse_end) {
        schedule_get_line(seg, schedule_line_of(seg, k), &line);
        cast_line(w, &line, k > line.cast0 ? k : line.cast0, end < line.cast_end ? end : line.cast_end);
        if (line.pulse_end <= k) break;
    }
}

static void work_on(void *ctx, int reports)
{
    struct look *look = ctx;
    struct sh_err err;
    struct worker *w = malloc(sizeof *w);
    uint64_t block;
    if (w == NULL || caster_create(&w->caster, &err) != SH_OK) {
        atomic_store(&look->failed, 1);
        free(w);
        return;
    }
    w->look = look;
    w->setup = look->scan->setup;
    while ((block = atomic_fetch_add(&look->next, 1)) < look->n_blocks && !sh_stopped(look->report)) {
        cast_block(w, block);
        if (reports) sh_progress(look->report, look->what, (double)(block + 1) / (double)look->n_blocks);
    }
    caster_free(w->caster);
    free(w);
}

int coverage_look(struct coverage *coverage, const struct coverage_scan *scan, const char *what,
                  const struct sh_report *report, struct coverage_pulses *pulses, struct sh_err *err)
{
    const uint64_t fired = scan->segment.end_pulse - scan->segment.k0;
    struct look look = {
        .c = coverage, .scan = scan, .what = what, .report = report, .n_blocks = (fired + BLOCK - 1) / BLOCK};
    const unsigned threads = coverage->spec.threads;
    coverage_drop(coverage);
    together(threads < look.n_blocks ? threads : (unsigned)look.n_blocks, work_on, &look);
    *pulses = (struct coverage_pulses){look.cast, look.met, look.hits, look.front};
    if (atomic_load(&look.next) < look.n_blocks && !sh_stopped(report) && look.failed)
        return sh_fail(err, SH_ENOMEM, "no memory to cast for coverage");
    return sh_check_stop(report, err);
}

void coverage_waiting(const struct coverage *coverage, double *seen_m2, double *gain_m2)
{
    *seen_m2 = *gain_m2 = 0.0;
    for (uint32_t i = 0; i < coverage->n_cells; i++) {
        if (coverage->hits[i].pulses == 0) continue;
        *seen_m2 += coverage->cell[i].area_m2;
        if (coverage->cell[i].stations == 0) *gain_m2 += coverage->cell[i].area_m2;
    }
}

void coverage_keep(struct coverage *coverage)
{
    const uint16_t station = (uint16_t)++coverage->n_stations;
    for (uint32_t i = 0; i < coverage->n_cells; i++) {
        const struct cell_hits *m = &coverage->hits[i];
        struct cell *cell = &coverage->cell[i];
        if (m->pulses == 0) continue;
        if (cell->stations++ == 0) cell->first_station = station;
        cell->pulses += m->pulses;
        if (m->cosine > cell->cosine) cell->cosine = m->cosine;
        if (m->nearness > cell->nearness) cell->nearness = m->nearness;
    }
    coverage_drop(coverage);
}

void coverage_drop(struct coverage *coverage)
{
    memset(coverage->hits, 0, coverage->n_cells * sizeof *coverage->hits);
}

void coverage_waiting_cells(const struct coverage *coverage, uint64_t *cells)
{
    memset(cells, 0, ((size_t)coverage->n_cells + 63) / 64 * sizeof *cells);
    for (uint32_t i = 0; i < coverage->n_cells; i++)
        if (coverage->hits[i].pulses != 0) cells[i / 64] |= 1ULL << i % 64;
}

void coverage_keep_cells(struct coverage *coverage, const uint64_t *cells)
{
    const uint16_t station = (uint16_t)++coverage->n_stations;
    for (uint32_t i = 0; i < coverage->n_cells; i++)
        if ((cells[i / 64] >> i % 64 & 1) != 0 && coverage->cell[i].stations++ == 0)
            coverage->cell[i].first_station = station;
}

void coverage_forget(struct coverage *coverage)
{
    for (uint32_t i = 0; i < coverage->n_cells; i++) {
        const struct cell *cell = &coverage->cell[i];
        coverage->cell[i] = (struct cell){.area_m2 = cell->area_m2, .label = cell->label};
    }
    coverage->n_stations = 0;
    coverage_drop(coverage);
}
