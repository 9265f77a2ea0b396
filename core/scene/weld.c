/* SPDX-License-Identifier: MIT */
/* Where a file has vertices for each triangle, those at the same place, bit for bit, become one. */
#include "core/scene/weld.h"

#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/huge_pages.h"
#include "core/rng.h"
#include "core/scene/build.h"

enum { NONE = 0xffffffff };

static int weld_is_same(const struct scene_build *b, uint32_t number, const double p[3])
{
    return memcmp(b->scene->vertex_m[number], p, sizeof *b->scene->vertex_m) == 0;
}

/* The slot that holds a vertex at that place, or the free one where it belongs. */
static uint32_t *weld_find(const struct scene_build *b, const struct build_weld *w, uint64_t key, const double p[3])
{
    size_t at = (size_t)key & (w->size - 1);
    while (w->slot[at] != NONE && !weld_is_same(b, w->slot[at], p))
        at = (at + 1) & (w->size - 1);
    return &w->slot[at];
}

static uint32_t *weld_recent(struct build_weld *w, uint64_t key)
{
    return &w->recent[key >> 32 & (BUILD_RECENT - 1)];
}

/* Makes a table of `size` slots, and puts the vertices of the old one into it. */
static int make_table(struct scene_build *b, struct build_weld *w, size_t size, struct sh_err *err)
{
    uint32_t *old = w->slot, *slot = huge_pages_alloc(size * sizeof *slot);
    const size_t before = w->size;
    if (slot == NULL) return build_fail(b, SH_ENOMEM, err, "no memory to compare vertices");
    memset(slot, 0xff, size * sizeof *slot);
    w->slot = slot;
    w->size = size;
    for (size_t i = 0; i < before; i++) {
        if (old[i] == NONE) continue;
        const double *p = b->scene->vertex_m[old[i]];
        *weld_find(b, w, rng_place(0, p), p) = old[i];
    }
    free(old);
    return SH_OK;
}

/* `vertices` counts each corner of each triangle. As a rule six triangles have a corner at the same place: then at
 * most a third of the table is in use. */
int build_weld_begin(struct scene_build *b, struct build_weld *w, uint64_t vertices, struct sh_err *err)
{
    w->number = malloc((size_t)vertices * sizeof *w->number);
    if (w->number == NULL)
        return build_fail(b, SH_ENOMEM, err, "no memory for %llu vertices", (unsigned long long)vertices);
    return make_table(b, w, grow_table(vertices / 2), err);
}

/* Returns the number of the scene's last vertex. Where one was at the same place before, the last one is removed. */
static uint32_t weld_last(struct scene_build *b, struct build_weld *w, uint64_t key)
{
    const uint32_t last = b->scene->n_vertices - 1;
    const double *p = b->scene->vertex_m[last];
    uint32_t *recent = weld_recent(w, key), number = last;
    if (*recent != 0 && weld_is_same(b, *recent - 1, p)) {
        number = *recent - 1;
    } else {
        uint32_t *slot = weld_find(b, w, key, p);
        if (*slot != NONE)
            number = *slot;
        else
            w->used++;
        *slot = number;
    }
    if (number != last) {
        b->scene->n_vertices--;
        b->n_welded++;
    }
    *recent = number + 1;
    return number;
}

/* Places in the table, and the vertices that they name, are fetched into the cache before they are needed: waiting for
 * them one by one would take most of the time. */
static void fetch_slot(const struct build_weld *w, uint64_t key)
{
    __builtin_prefetch(&w->slot[key & (w->size - 1)]);
}

static void fetch_vertex(const struct scene_build *b, struct build_weld *w, uint64_t key)
{
    const uint32_t recent = *weld_recent(w, key), slot = w->slot[key & (w->size - 1)];
    if (recent != 0) __builtin_prefetch(b->scene->vertex_m[recent - 1]);
    if (slot != NONE) __builtin_prefetch(b->scene->vertex_m[slot]);
}

int build_weld_flush(struct scene_build *b, struct build_weld *w, struct sh_err *err)
{
    enum { NEAR = 8, FAR = 16 };
    const uint32_t n = w->waiting, first = b->scene->n_vertices - n;
    uint64_t key[BUILD_TOGETHER];
    const size_t size = grow_table(2 * (w->used + n)); /* at most half full, so that a free slot is near */
    int rc = size > w->size ? make_table(b, w, size, err) : SH_OK;
    if (rc != SH_OK) return rc;
    for (uint32_t i = 0; i < n; i++)
        key[i] = rng_place(0, b->scene->vertex_m[first + i]);
    b->scene->n_vertices = first;
    for (uint32_t i = 0; i < n; i++) {
        if (i + FAR < n) fetch_slot(w, key[i + FAR]);
        if (i + NEAR < n) fetch_vertex(b, w, key[i + NEAR]);
        memmove(b->scene->vertex_m[b->scene->n_vertices++], b->scene->vertex_m[first + i], sizeof *b->scene->vertex_m);
        w->number[w->n++] = weld_last(b, w, key[i]);
    }
    w->waiting = 0;
    return SH_OK;
}

int build_weld_later(struct scene_build *b, struct build_weld *w, const double v[3], struct sh_err *err)
{
    int rc = build_vertex(b, v, err);
    if (rc != SH_OK) return rc;
    return ++w->waiting == BUILD_TOGETHER ? build_weld_flush(b, w, err) : SH_OK;
}

int build_weld_vertex(struct scene_build *b, struct build_weld *w, const double v[3], struct sh_err *err)
{
    int rc = build_weld_later(b, w, v, err);
    return rc == SH_OK ? build_weld_flush(b, w, err) : rc;
}

void build_weld_free(struct build_weld *w)
{
    free(w->slot);
    free(w->number);
    *w = (struct build_weld){0};
}
