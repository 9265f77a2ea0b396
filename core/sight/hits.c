/* SPDX-License-Identifier: MIT */
/* Looks rays up in the map, a chunk at a time. */
#include <stdlib.h>
#include <string.h>

#include "core/sight/hits_inside.h"

struct sight_work {
    struct sight_counters counters;
    struct sight_places places;
    struct sight_run run[HITS_ROOM];
    uint32_t triangle[HITS_ROOM]; /* of a run's rays */
    /* Rays that go to the BVH. */
    uint32_t ray[HITS_ROOM]; /* their numbers in the chunk */
    double x[HITS_ROOM], y[HITS_ROOM], z[HITS_ROOM], range_m[HITS_ROOM];
    uint32_t hit[HITS_ROOM], label[HITS_ROOM];
    float steep[HITS_ROOM];
};

int sight_work_create(struct sight_work **out, struct sh_err *err)
{
    struct sight_work *w = *out = aligned_alloc(64, (sizeof *w + 63) / 64 * 64);
    if (w == NULL) return sh_fail(err, SH_ENOMEM, "sight: no memory");
    memset(w, 0, sizeof *w);
    return SH_OK;
}

void sight_work_free(struct sight_work *work)
{
    free(work);
}

const struct sight_counters *sight_work_counters(const struct sight_work *work)
{
    return &work->counters;
}

static void ask(struct sight_work *w, uint32_t from, uint32_t to, uint32_t *asked)
{
    for (uint32_t i = from; i < to; i++)
        w->ray[(*asked)++] = i;
}

/* Decides rays that have a list. Rays that the records can't decide go to the BVH. */
static void do_few(struct sight_work *w, const struct sight *s, const struct bvh_rays *rays,
                   const struct sight_run *run, uint32_t *asked)
{
    const uint32_t *list = s->list + (run->leaf & SIGHT_NUMBER), from = run->from, to = run[1].from;
    const int open = candidate_list_decide(s, rays, list, from, to, w->triangle);
    bvh_ranges_each(s->bvh, w->triangle, rays, from, to);
    for (uint32_t i = from; i < to && open; i++) {
        if (w->triangle[i - from] == FEW_OPEN) ask(w, i, i + 1, asked);
    }
}

/* The data of a run may lie anywhere: where the map is larger than the cache, each run would wait for it. So it is
 * prefetched: first the lengths of lists, then their records. */
enum { LISTS_AHEAD = 12, RECORDS_AHEAD = 6, RECORDS_EACH = 4 };

static inline void ask_list(const struct sight *s, const struct sight_run *run)
{
    if (sight_kind(run->leaf) == SIGHT_FEW)
        __builtin_prefetch(&s->list[run->leaf & SIGHT_NUMBER]);
    else if (sight_kind(run->leaf) == SIGHT_ONE)
        __builtin_prefetch(bvh_plane(s->bvh, run->leaf));
}

static inline void ask_records(const struct sight *s, const struct sight_run *run)
{
    if (sight_kind(run->leaf) != SIGHT_FEW) return;
    const uint32_t *list = &s->list[run->leaf & SIGHT_NUMBER], n = list[0] < RECORDS_EACH ? list[0] : RECORDS_EACH;
    for (uint32_t k = 0; k < n; k++) {
        const char *record = (const char *)&s->record[list[1 + k]];
        __builtin_prefetch(record);
        __builtin_prefetch(record + 64);
    }
}

/* Runs are done in order, since bvh_ranges_of may overwrite later rays. */
static uint32_t do_runs(struct sight_work *w, const struct sight *s, const struct bvh_rays *rays, uint32_t runs)
{
    const struct sight_run *last = w->run + runs - 1;
    uint32_t asked = 0;
    for (const struct sight_run *run = w->run; run <= last; run++) {
        ask_list(s, last - run > LISTS_AHEAD ? run + LISTS_AHEAD : last);
        ask_records(s, last - run > RECORDS_AHEAD ? run + RECORDS_AHEAD : last);
        if (run->leaf == SIGHT_ASK) {
            ask(w, run->from, run[1].from, &asked);
        } else if (sight_kind(run->leaf) == SIGHT_FEW) {
            w->counters.few += run[1].from - run->from;
            do_few(w, s, rays, run, &asked);
        } else {
            bvh_ranges_of(s->bvh, run->leaf, rays, run->from, run[1].from);
        }
    }
    return asked;
}

static void ask_bvh(struct sight_work *w, struct bvh_work *bvh_work, const struct sight *s, const struct bvh_rays *rays,
                    uint32_t n)
{
    struct bvh_rays asked = {.n = n,
                             .from = rays->from,
                             .dir = VEC3_IN(*w, 0),
                             .range_max_m = rays->range_max_m,
                             .range_m = w->range_m,
                             .triangle = w->hit,
                             .label = w->label,
                             .steep = rays->steep != NULL ? w->steep : NULL};
    for (uint32_t k = 0; k < n; k++) {
        w->x[k] = rays->dir.x[w->ray[k]];
        w->y[k] = rays->dir.y[w->ray[k]];
        w->z[k] = rays->dir.z[w->ray[k]];
    }
    bvh_hits(bvh_work, s->bvh, &asked);
    for (uint32_t k = 0; k < n; k++) {
        const uint32_t i = w->ray[k];
        rays->range_m[i] = w->range_m[k];
        rays->triangle[i] = w->hit[k];
        if (rays->label != NULL) rays->label[i] = w->label[k];
        if (rays->steep != NULL) rays->steep[i] = w->steep[k];
    }
}

static void look_up_chunk(struct sight_work *w, struct bvh_work *bvh_work, const struct sight *s,
                          const struct bvh_rays *rays)
{
    struct bvh_profile *profile = bvh_work_profile(bvh_work);
    const uint32_t runs = sight_find_runs(s, &rays->dir, rays->n, &w->places, w->run);
    bvh_stage_ends(profile, BVH_STAGE_PREPARE);
    const uint32_t asked = do_runs(w, s, rays, runs);
    bvh_stage_ends(profile, BVH_STAGE_REFINE);
    w->counters.asked += asked;
    if (asked != 0) ask_bvh(w, bvh_work, s, rays, asked);
    if (rays->steep != NULL) bvh_work_set_directions(bvh_work, &rays->dir, rays->n);
}

void sight_hits(struct sight_work *work, struct bvh_work *bvh_work, const struct sight *sight,
                const struct bvh_rays *rays)
{
    for (uint32_t at = 0; at < rays->n; at += BVH_CHUNK) {
        const struct bvh_rays part = bvh_rays_chunk(rays, at);
        look_up_chunk(work, bvh_work, sight, &part);
    }
}
