/* SPDX-License-Identifier: MIT */
/* Makes a sight with several threads, region by region, and frees it. */
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/grow.h"
#include "core/huge_pages.h"
#include "core/monotonic.h"
#include "core/sight/build_inside.h"
#include "core/together.h"

enum { FEW_RAYS = 4, TOO_FINE = 1, LARGE = 8 << 20 };

int sight_possible(const struct scene *scene)
{
    return scene->cutout == NULL && scene->n_copies == 0 && scene->n_triangles < SIGHT_NUMBER;
}

uint64_t build_take(struct build_shared *b, struct build_arena *arena, uint64_t n, uint64_t size)
{
    if (atomic_fetch_add_explicit(&b->bytes, n * size, memory_order_relaxed) + n * size <= b->spec->memory_bytes) {
        const uint64_t at = atomic_fetch_add_explicit(&arena->used, n, memory_order_relaxed);
        if (at + n <= arena->room) return at;
        atomic_fetch_sub_explicit(&arena->used, n, memory_order_relaxed);
    }
    atomic_fetch_sub_explicit(&b->bytes, n * size, memory_order_relaxed);
    atomic_store_explicit(&b->full, 1, memory_order_relaxed);
    return UINT64_MAX;
}

static uint64_t tiles_of(uint32_t cells)
{
    const uint64_t edge = cells / SIGHT_TILE;
    return SIGHT_FACES * edge * edge;
}

/* There are so many cells that FEW_RAYS rays come to each, and that most of the memory is left for leaves and
 * lists. */
uint32_t sight_cells(double rays, uint64_t memory_bytes)
{
    uint32_t cells = SIGHT_MIN_CELLS;
    while (cells < SIGHT_MAX_CELLS && SIGHT_FACES * 4.0 * cells * cells * FEW_RAYS <= rays &&
           tiles_of(2 * cells) * sizeof(uint32_t) * 4 <= memory_bytes)
        cells *= 2;
    return cells;
}

/* Arrays have their largest size: pages that are never touched take no memory. Arrays of LARGE bytes or more are in
 * huge pages, since they are filled at once and read at random. */
static void *take_array(struct build_shared *b, struct build_arena *arena, uint64_t most, uint64_t size)
{
    const uint64_t within = b->spec->memory_bytes / size + 1;
    arena->room = most < within ? most : within;
    if (arena->room > SIGHT_NUMBER) arena->room = SIGHT_NUMBER;
    const uint64_t bytes = (arena->room * size + 127) / 128 * 128;
    return bytes < LARGE ? aligned_alloc(128, bytes) : huge_pages_alloc(bytes);
}

static int take_arrays(struct build_shared *b, struct sh_err *err)
{
    struct sight *s = b->sight;
    s->tile = malloc((tiles_of(s->cells) + 1) * sizeof *s->tile);
    s->leaf = take_array(b, &b->leaf, tiles_of(s->cells) * SIGHT_BLOCK, sizeof *s->leaf);
    s->list = take_array(b, &b->list, UINT64_MAX, sizeof *s->list);
    s->record = take_array(b, &b->record, UINT64_MAX, sizeof *s->record);
    if (s->tile == NULL || s->leaf == NULL || s->list == NULL || s->record == NULL)
        return sh_fail(err, SH_ENOMEM, "sight: no memory for %u cells", s->cells);
    for (uint64_t i = 0; i <= tiles_of(s->cells); i++)
        s->tile[i] = SIGHT_ASK;
    b->bytes = tiles_of(s->cells) * sizeof *s->tile;
    return SH_OK;
}

/* Coarser cells everywhere are better than fine ones in some places, unless they have to be much
 * coarser. */
static int is_too_fine(const struct build_shared *b)
{
    return b->may_coarsen && atomic_load_explicit(&b->full, memory_order_relaxed);
}

static void build_some(void *shared, int reports)
{
    struct build_shared *b = shared;
    struct build_work w = {0};
    (void)reports;
    const uint32_t regions = SIGHT_FACES * b->regions * b->regions;
    for (;;) {
        const uint32_t region = atomic_fetch_add(&b->next, 1);
        if (region >= regions || atomic_load(&b->failed) != 0 || is_too_fine(b)) break;
        const int rc = sh_stopped(b->report) ? SH_ESTOPPED : build_region(b, &w, region);
        if (rc != SH_OK) atomic_store(&b->failed, rc);
    }
    atomic_fetch_add(&b->given_back, w.taken);
    build_work_free(&w);
}

static int build_all(struct build_shared *b, unsigned threads, struct sh_err *err)
{
    if (threads == 0) threads = (unsigned)sysconf(_SC_NPROCESSORS_ONLN);
    together(threads, build_some, b);
    if (b->failed == SH_ESTOPPED) return sh_fail_stopped(err);
    return b->failed != 0 ? sh_fail(err, SH_ENOMEM, "sight: no memory") : SH_OK;
}

/* Records begin at cache lines, which realloc does not promise. Room that is not given back is resident once the head
 * locks its memory (mlockall), though nobody touches it. */
static int keep_records(struct build_shared *b, struct sh_err *err)
{
    struct sight *s = b->sight;
    const uint64_t bytes = b->record.used * sizeof *s->record;
    resize(&s->record, b->record.used, sizeof *s->record);
    if ((uintptr_t)s->record % sizeof *s->record == 0) return SH_OK;
    void *const misplaced = s->record, *const aligned = aligned_alloc(sizeof *s->record, bytes + sizeof *s->record);
    if (aligned == NULL)
        return sh_fail(err, SH_ENOMEM, "sight: no memory for %llu triangles", (unsigned long long)b->record.used);
    memcpy(aligned, misplaced, bytes);
    free(misplaced);
    s->record = aligned;
    return SH_OK;
}

static void sight_finish(struct build_shared *b)
{
    struct sight *s = b->sight;
    struct sight_info *info = &s->info;
    double all = 0.0;
    /* Where an array can't shrink, it stays. */
    resize(&s->leaf, b->leaf.used, sizeof *s->leaf);
    resize(&s->list, b->list.used, sizeof *s->list);
    for (int i = 0; i < 4; i++)
        all += (double)b->cells[i];
    all = all > 0.0 ? all : 1.0;
    *info = (struct sight_info){.cells = s->cells,
                                .one = (double)b->cells[0] / all,
                                .nothing = (double)b->cells[1] / all,
                                .few = (double)b->cells[2] / all,
                                .ask = (double)b->cells[3] / all,
                                .lists = b->list.used,
                                .records = b->record.used,
                                .bytes = b->bytes - b->given_back,
                                .peak_bytes = b->bytes};
}

static int build(struct build_shared *b, unsigned threads, struct sh_err *err)
{
    int rc = take_arrays(b, err);
    if (rc == SH_OK) rc = build_groups(b, err);
    if (rc == SH_OK) rc = build_bins(b, err);
    if (rc == SH_OK) build_figures(b);
    if (rc == SH_OK) rc = build_all(b, threads, err);
    if (rc == SH_OK && !is_too_fine(b)) rc = keep_records(b, err);
    if (rc == SH_OK) sight_finish(b);
    free(b->seen);
    free(b->figures);
    free(b->kept);
    free(b->bin);
    free(b->binned);
    free(b->group);
    return rc;
}

static void free_arrays(struct sight *s)
{
    free(s->tile);
    free(s->leaf);
    free(s->list);
    free(s->record);
    s->tile = s->leaf = s->list = NULL;
    s->record = NULL;
}

/* Builds with the current number of cells. Returns TOO_FINE where may_coarsen is set and the memory does not hold so
 * many cells. */
static int try_cells(struct sight *s, const struct sight_spec *spec, unsigned threads, const struct sh_report *report,
                     int may_coarsen, struct sh_err *err)
{
    struct build_shared b = {.sight = s, .spec = spec, .report = report, .may_coarsen = may_coarsen};
    b.regions = s->cells / SIGHT_TILE < BUILD_REGIONS ? s->cells / SIGHT_TILE : BUILD_REGIONS;
    b.region_cells = s->cells / b.regions;
    int rc = build(&b, threads, err);
    return rc == SH_OK && is_too_fine(&b) ? TOO_FINE : rc;
}

static int make(struct sight *s, const struct sight_spec *spec, unsigned threads, const struct sh_report *report,
                struct sh_err *err)
{
    s->cells = sight_cells(spec->rays, spec->memory_bytes);
    int rc = try_cells(s, spec, threads, report, s->cells > SIGHT_MIN_CELLS, err);
    if (rc != TOO_FINE) return rc;
    free_arrays(s);
    s->cells /= 2;
    return try_cells(s, spec, threads, report, 0, err);
}

int sight_create(const struct sight_spec *spec, unsigned threads, const struct sh_report *report, struct sight **out,
                 struct sh_err *err)
{
    struct sight *s = *out = calloc(1, sizeof *s);
    if (s == NULL) return sh_fail(err, SH_ENOMEM, "sight: no memory");
    const int64_t start_ns = monotonic_ns();
    atomic_init(&s->owners, 1);
    s->bvh = spec->bvh;
    memcpy(s->station_m, spec->station_m, sizeof s->station_m);
    int rc = make(s, spec, threads, report, err);
    if (rc != SH_OK) {
        sight_free(s);
        *out = NULL;
        return rc;
    }
    s->info.build_s = 1e-9 * (double)(monotonic_ns() - start_ns);
    return SH_OK;
}

struct sight *sight_share(struct sight *sight)
{
    atomic_fetch_add(&sight->owners, 1);
    return sight;
}

void sight_free(struct sight *sight)
{
    if (sight == NULL || atomic_fetch_sub(&sight->owners, 1) != 1) return;
    free_arrays(sight);
    free(sight);
}

const struct sight_info *sight_get_info(const struct sight *sight)
{
    return &sight->info;
}
