/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/vec3.h"
#include "firmware_sim/app/studio/verdict/match_index.h"

/* A cell is twice as wide as a coordinate may differ. So all points that agree lie in the same cell or next to it. */
static void cell_of(const struct match_index *index, const double p[3], int64_t cell[3])
{
    for (int k = 0; k < 3; k++)
        cell[k] = (int64_t)floor(p[k] / (2.0 * index->within_m));
}

static int compare_cells(const int64_t a[3], const int64_t b[3])
{
    for (int k = 0; k < 3; k++)
        if (a[k] != b[k]) return a[k] < b[k] ? -1 : 1;
    return 0;
}

static int compare_entries(const void *left, const void *right)
{
    const struct match_entry *a = left, *b = right;
    const int by_cell = compare_cells(a->cell, b->cell);
    for (int k = 0; by_cell == 0 && k < 3; k++)
        if (a->p[k] < b->p[k] || a->p[k] > b->p[k]) return a->p[k] < b->p[k] ? -1 : 1;
    return by_cell;
}

void match_index_make(struct match_index *index)
{
    size_t n = 0;
    vec3_bound_nothing(index->least, index->most);
    for (size_t i = 0; i < index->n; i++) {
        cell_of(index, index->entry[i].p, index->entry[i].cell);
        vec3_bound(index->least, index->most, index->entry[i].p);
    }
    qsort(index->entry, index->n, sizeof *index->entry, compare_entries);
    for (size_t i = 0; i < index->n; i++) {
        struct match_entry *e = &index->entry[i];
        if (n > 0 && memcmp(index->entry[n - 1].p, e->p, sizeof e->p) == 0) {
            index->entry[n - 1].sent += e->sent;
            continue;
        }
        e->got = 0;
        e->parent = n;
        index->entry[n++] = *e;
    }
    index->n = n;
}

/* The first entry whose cell is not before that one. */
static size_t first_in(const struct match_index *index, const int64_t cell[3])
{
    size_t low = 0, high = index->n;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (compare_cells(index->entry[middle].cell, cell) < 0)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static int agrees(const struct match_index *index, const struct match_entry *e, const double p[3])
{
    return fabs(e->p[0] - p[0]) <= index->within_m && fabs(e->p[1] - p[1]) <= index->within_m &&
           fabs(e->p[2] - p[2]) <= index->within_m;
}

/* A place far away has no cell, since its number would be too large. */
static int is_near_any(const struct match_index *index, const double p[3])
{
    for (int k = 0; k < 3; k++)
        if (!(p[k] >= index->least[k] - index->within_m && p[k] <= index->most[k] + index->within_m)) return 0;
    return 1;
}

size_t match_index_near(const struct match_index *index, const double p[3], void (*hit)(void *ctx, size_t entry),
                        void *ctx)
{
    int64_t middle[3];
    size_t n = 0;
    if (!is_near_any(index, p)) return 0;
    cell_of(index, p, middle);
    for (int side = 0; side < 9; side++) { /* a column of three cells each */
        const int64_t first[3] = {middle[0] + side / 3 - 1, middle[1] + side % 3 - 1, middle[2] - 1};
        const int64_t last[3] = {first[0], first[1], middle[2] + 1};
        for (size_t i = first_in(index, first); i < index->n && compare_cells(index->entry[i].cell, last) <= 0; i++) {
            if (!agrees(index, &index->entry[i], p)) continue;
            n++;
            if (hit != NULL) hit(ctx, i);
        }
    }
    return n;
}

size_t match_index_root(struct match_index *index, size_t i)
{
    while (index->entry[i].parent != i) {
        index->entry[i].parent = index->entry[index->entry[i].parent].parent; /* shortens the way for the next one */
        i = index->entry[i].parent;
    }
    return i;
}

void match_index_join(struct match_index *index, size_t a, size_t b)
{
    const size_t to = match_index_root(index, a), from = match_index_root(index, b);
    if (to == from) return;
    index->entry[from].parent = to;
    index->entry[to].sent += index->entry[from].sent;
    index->entry[to].got += index->entry[from].got;
}
