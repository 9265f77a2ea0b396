/* A region, divided until its squares are leaves. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/sight/build_inside.h"

enum { NO_CANDIDATE = 0xffffffff };

/* A square of cells on the face, `size` cells wide. Its middle and half its width reach SIGHT_PAD further than the
 * cells. */
struct square {
    uint32_t u, v, size;
    double mid_u, mid_v, half;
};

/* What is known of a region while it is divided. */
struct division {
    struct build_shared *b;
    struct build_work *w;
    uint32_t face;
    uint32_t *block; /* leaves of the tile at hand, where squares are smaller than a tile */
    uint32_t block_u, block_v;
    int failed;
};

static struct square square_of(const struct sight *s, uint32_t u, uint32_t v, uint32_t size)
{
    const double cell = 2.0 / s->cells;
    return (struct square){.u = u,
                           .v = v,
                           .size = size,
                           .mid_u = (u + 0.5 * size) * cell - 1.0,
                           .mid_v = (v + 0.5 * size) * cell - 1.0,
                           .half = 0.5 * size * cell + SIGHT_PAD};
}

static double at_middle(const double f[3], const struct square *q)
{
    return f[0] + f[1] * q->mid_u + f[2] * q->mid_v;
}

enum where { OUTSIDE, PARTLY, COVERS };

/* Rays here are 1 to sqrt(3) long: a direction's largest component is 1. So doubts count twice. */
static enum where where_is(const struct build_candidate *c, const struct square *q)
{
    enum where where = COVERS;
    for (int k = 0; k < 3; k++) {
        const double e = at_middle(c->edge[k], q), r = c->edge_slope[k] * q->half;
        if (e + r < -2.0) return OUTSIDE;
        if (!(e - r > 2.0)) where = PARTLY;
    }
    return where;
}

/* Whether its plane is seen at so small an angle, or from so near, that its distance says nothing. */
static int is_grazing(const struct build_candidate *c, const struct square *q, double middle)
{
    const double r = c->plane_slope * q->half;
    return !(middle - r > 2.0 * c->graze) || !(middle + r < SIGHT_NEAR);
}

/* Whether all of square, c lies behind what covers it. */
static int is_behind(const struct build_candidate *c, const struct build_candidate *cover, const struct square *q)
{
    const double mine = at_middle(c->plane, q), its = at_middle(cover->plane, q), r = cover->plane_slope * q->half;
    if (is_grazing(c, q, mine)) return c->near_m * (its - r) > 2.0;
    const double spread = (fabs(cover->plane[1] - c->plane[1]) + fabs(cover->plane[2] - c->plane[2])) * q->half;
    const double doubt = 2.0 * (c->slack + cover->slack) + (c->rel + cover->rel + SIGHT_SAME) * (its + r);
    return its - mine - spread > doubt;
}

/* Of n candidates those that may be seen in a square -> out. Returns how many; *cover: the one that hides all
 * others there are, or NO_CANDIDATE. */
static uint32_t look(const struct build_work *w, const struct square *q, const uint32_t *in, uint32_t n, uint32_t *out,
                     uint32_t *cover)
{
    uint32_t m = 0, kept = 0, best = NO_CANDIDATE;
    double best_q = 0.0;
    for (uint32_t i = 0; i < n; i++) {
        const struct build_candidate *c = &w->candidate[in[i]];
        const enum where where = where_is(c, q);
        if (where == OUTSIDE) continue;
        out[m++] = in[i];
        if (where != COVERS) continue;
        const double middle = at_middle(c->plane, q);
        if (middle <= best_q || is_grazing(c, q, middle)) continue;
        best = in[i];
        best_q = middle;
    }
    *cover = best;
    if (best == NO_CANDIDATE) return m;
    for (uint32_t i = 0; i < m; i++)
        if (out[i] == best || !is_behind(&w->candidate[out[i]], &w->candidate[best], q)) out[kept++] = out[i];
    return kept;
}

/* A square's leaf: tiles as a whole, or in the block at hand. */
static void put_leaf(const struct division *d, const struct square *q, uint32_t leaf)
{
    struct sight *s = d->b->sight;
    if (q->size < SIGHT_TILE) {
        for (uint32_t v = 0; v < q->size; v++)
            for (uint32_t u = 0; u < q->size; u++)
                d->block[(q->v - d->block_v + v) * SIGHT_TILE + q->u - d->block_u + u] = leaf;
        return;
    }
    const uint32_t tiles = s->cells / SIGHT_TILE;
    for (uint32_t v = q->v / SIGHT_TILE; v < (q->v + q->size) / SIGHT_TILE; v++)
        for (uint32_t u = q->u / SIGHT_TILE; u < (q->u + q->size) / SIGHT_TILE; u++)
            s->tile[(d->face * tiles + v) * tiles + u] = leaf;
}

static uint32_t record_of(const struct division *d, struct build_candidate *c)
{
    if (c->record != BUILD_NO_RECORD) return c->record;
    const uint64_t at = build_take(d->b, &d->b->record, 1, sizeof(struct sight_record));
    if (at == UINT64_MAX) return BUILD_NO_RECORD;
    build_record(c, d->face, &d->b->sight->record[at]);
    return c->record = (uint32_t)at;
}

static uint32_t make_list(const struct division *d, const uint32_t *in, uint32_t n)
{
    if (n > SIGHT_MAX_LIST) return SIGHT_ASK;
    const uint64_t at = build_take(d->b, &d->b->list, n + 1, sizeof(uint32_t));
    if (at == UINT64_MAX) return SIGHT_ASK;
    uint32_t *list = &d->b->sight->list[at];
    list[0] = n;
    for (uint32_t i = 0; i < n; i++) {
        list[i + 1] = record_of(d, &d->w->candidate[in[i]]);
        if (list[i + 1] == BUILD_NO_RECORD) return SIGHT_ASK;
    }
    return (uint32_t)SIGHT_FEW << SIGHT_KIND_SHIFT | (uint32_t)at;
}

static void count(const struct division *d, const struct square *q, int what)
{
    atomic_fetch_add_explicit(&d->b->cells[what], (uint64_t)q->size * q->size, memory_order_relaxed);
}

enum { ONE, NOTHING, FEW, ASK };

static void end_few(const struct division *d, const struct square *q, const uint32_t *in, uint32_t n)
{
    const uint32_t leaf = make_list(d, in, n);
    put_leaf(d, q, leaf);
    count(d, q, leaf == SIGHT_ASK ? ASK : FEW);
}

/* Where all that is left covers the square, dividing it tells nothing new unless their planes cross. */
static int all_cover(const struct build_work *w, const struct square *q, const uint32_t *in, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++)
        if (where_is(&w->candidate[in[i]], q) != COVERS) return 0;
    return 1;
}

static void divide(struct division *d, const struct square *q, const uint32_t *in, uint32_t n);

static void divide_quarters(struct division *d, const struct square *q, const uint32_t *in, uint32_t n)
{
    const uint32_t half = q->size / 2;
    for (uint32_t k = 0; k < 4; k++) {
        const struct square quarter = square_of(d->b->sight, q->u + (k & 1) * half, q->v + (k >> 1) * half, half);
        divide(d, &quarter, in, n);
    }
}

/* A tile whose leaves differ: they are made beside each other, and become a block. */
static void divide_tile(struct division *d, const struct square *q, const uint32_t *in, uint32_t n)
{
    struct sight *s = d->b->sight;
    uint32_t block[SIGHT_BLOCK], same = 1;
    d->block = block;
    d->block_u = q->u;
    d->block_v = q->v;
    divide_quarters(d, q, in, n);
    while (same < SIGHT_BLOCK && block[same] == block[0])
        same++;
    if (same == SIGHT_BLOCK) {
        put_leaf(d, q, block[0]);
        return;
    }
    const uint64_t at = build_take(d->b, &d->b->leaf, SIGHT_BLOCK, sizeof(uint32_t));
    if (at == UINT64_MAX) {
        put_leaf(d, q, SIGHT_ASK);
        return;
    }
    memcpy(&s->leaf[at], block, sizeof block);
    put_leaf(d, q, (uint32_t)SIGHT_TILED << SIGHT_KIND_SHIFT | (uint32_t)at);
}

static void divide(struct division *d, const struct square *q, const uint32_t *in, uint32_t n)
{
    struct build_work *w = d->w;
    uint32_t *out = (uint32_t *)(uintptr_t)in + n, cover; /* on the stack, above its own */
    const uint32_t m = look(w, q, in, n, out, &cover);
    if (m == 0) {
        put_leaf(d, q, SIGHT_NOTHING);
        count(d, q, NOTHING);
    } else if (m == 1 && cover != NO_CANDIDATE) {
        put_leaf(d, q, w->candidate[cover].triangle);
        count(d, q, ONE);
    } else if (q->size == 1 || (m <= SIGHT_MAX_LIST && cover != NO_CANDIDATE && all_cover(w, q, out, m))) {
        end_few(d, q, out, m);
    } else if (q->size == SIGHT_TILE) {
        divide_tile(d, q, out, m);
    } else {
        divide_quarters(d, q, out, m);
    }
}

void build_work_free(struct build_work *w)
{
    free(w->candidate);
    free(w->stack);
}

static int gather(struct build_shared *b, struct build_work *w, uint32_t region, uint32_t face)
{
    const uint64_t n = b->bin[region + 1] - b->bin[region];
    uint32_t levels = 1;
    for (uint32_t size = b->region_cells; size > 1; size /= 2)
        levels++;
    if (!grow(&w->candidate, &w->room, n + 1, sizeof *w->candidate) ||
        !grow(&w->stack, &w->stack_room, (n + 1) * (levels + 1), sizeof *w->stack))
        return SH_ENOMEM;
    w->n = 0;
    for (uint64_t i = b->bin[region]; i < b->bin[region + 1]; i++)
        w->n += (size_t)build_candidate(b->sight, face, b->binned[i], &w->candidate[w->n]);
    for (uint32_t i = 0; i < w->n; i++)
        w->stack[i] = i;
    return SH_OK;
}

int build_region(struct build_shared *b, struct build_work *w, uint32_t region)
{
    const uint32_t face = region / (b->regions * b->regions), at = region % (b->regions * b->regions);
    struct division d = {.b = b, .w = w, .face = face};
    if (!b->seen[region]) return SH_OK;
    int rc = gather(b, w, region, face);
    if (rc != SH_OK) return rc;
    const struct square all =
        square_of(b->sight, at % b->regions * b->region_cells, at / b->regions * b->region_cells, b->region_cells);
    divide(&d, &all, w->stack, (uint32_t)w->n);
    return SH_OK;
}
