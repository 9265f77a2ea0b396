/* A region, divided until its squares are leaves. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/sight/build_inside.h"
#include "core/vecmath.h"

enum { NO_CANDIDATE = 0xffffffff };

/* A square of cells on the face, `size` cells wide, and its middle. */
struct square {
    uint32_t u, v, size;
    double mid_u, mid_v, half;
};

/* Candidates that may be seen in a square. */
struct seen {
    uint32_t *list, n; /* numbers of candidates, with the bit COVERS where it does */
    uint32_t *above;   /* where the stack is free */
    uint32_t cover;    /* hides all others that there are; or NO_CANDIDATE */
    uint32_t *leaf;    /* the leaf of this list, once it has been made; squares with the same list share it */
    uint32_t own_leaf;
};
enum { COVERS = 1U << 31, NO_LEAF = 0xffffffff };

/* What is known of a region while it is divided. */
struct division {
    struct build_shared *b;
    struct build_work *w;
    uint32_t face;
    uint32_t *block; /* leaves of the tile at hand, where squares are smaller than a tile */
    uint32_t block_u, block_v;
    uint64_t cells[4];
};

static const struct build_candidate *candidate_of(const struct build_work *w, uint32_t listed)
{
    return &w->candidate[listed & ~(uint32_t)COVERS];
}

static double at_middle(const double f[3], const struct square *q)
{
    return f[0] + f[1] * q->mid_u + f[2] * q->mid_v;
}

/* Whether all of a square, c lies behind what covers it. Rays here are 1 to sqrt(3) long, since a direction's
 * largest component is 1: doubts count twice. */
static int is_behind(const struct build_candidate *c, const struct build_candidate *cover, const struct square *q)
{
    const double half = q->half + SIGHT_PAD, mine = at_middle(c->plane, q), its = at_middle(cover->plane, q);
    const double r = cover->plane_slope * half, own = c->plane_slope * half;
    if (!(mine - own > 2.0 * c->graze) || !(mine + own < SIGHT_NEAR)) return c->near_m * (its - r) > 2.0;
    const double spread = (fabs(cover->plane[1] - c->plane[1]) + fabs(cover->plane[2] - c->plane[2])) * half;
    const double doubt = 2.0 * (c->slack + cover->slack) + (c->rel + cover->rel + SIGHT_SAME) * (its + r);
    return its - mine - spread > doubt;
}

/* Four quarters of a square at a time. */
typedef double quad __attribute__((vector_size(32)));
typedef int64_t quad_mask __attribute__((vector_size(32)));

struct quarters {
    struct square square[4];
    struct seen seen[4];
};

/* Of a square's candidates, those that may be seen in each quarter, and which one of those that cover it comes
 * first in its middle. */
VEC_CLONES
static void look(const struct build_candidate *candidate, const struct seen *in, struct quarters *out)
{
    const struct square *q = out->square;
    const quad u = {q[0].mid_u, q[1].mid_u, q[2].mid_u, q[3].mid_u},
               v = {q[0].mid_v, q[1].mid_v, q[2].mid_v, q[3].mid_v};
    const double half = q[0].half + SIGHT_PAD;
    uint32_t n[4] = {0, 0, 0, 0};
    quad first = {0.0, 0.0, 0.0, 0.0};
    quad_mask cover = {NO_CANDIDATE, NO_CANDIDATE, NO_CANDIDATE, NO_CANDIDATE};
    for (uint32_t i = 0; i < in->n; i++) {
        const uint32_t number = in->list[i] & ~(uint32_t)COVERS;
        const struct build_candidate *c = &candidate[number];
        quad_mask outside = {0, 0, 0, 0}, covers = {-1, -1, -1, -1};
        for (int k = 0; k < 3; k++) {
            const double *f = c->edge[k], r = 2.0 + c->edge_slope[k] * half;
            const quad e = f[0] + f[1] * u + f[2] * v;
            outside |= (quad_mask)(e < -r);
            covers &= (quad_mask)(e > r);
        }
        const double *f = c->plane, r = c->plane_slope * half;
        const quad middle = f[0] + f[1] * u + f[2] * v;
        const quad_mask better = covers & (quad_mask)(middle > first) & (quad_mask)(middle - r > 2.0 * c->graze) &
                                 (quad_mask)(middle + r < SIGHT_NEAR);
        const quad_mask mine = {number, number, number, number};
        first = (quad)(((quad_mask)middle & better) | ((quad_mask)first & ~better));
        cover = (mine & better) | (cover & ~better);
        for (int k = 0; k < 4; k++) {
            out->seen[k].list[n[k]] = number | ((uint32_t)covers[k] & COVERS);
            n[k] += outside[k] == 0;
        }
    }
    for (int k = 0; k < 4; k++) {
        out->seen[k].n = n[k];
        out->seen[k].cover = (uint32_t)cover[k];
    }
}

/* What lies behind the one that covers is dropped. */
static void drop_hidden(const struct build_work *w, struct seen *seen, const struct square *q)
{
    uint32_t kept = 0;
    const uint32_t cover = seen->cover;
    if (cover == NO_CANDIDATE || seen->n == 1) return;
    for (uint32_t i = 0; i < seen->n; i++) {
        const struct build_candidate *c = candidate_of(w, seen->list[i]);
        if (c == &w->candidate[cover] || !is_behind(c, &w->candidate[cover], q)) seen->list[kept++] = seen->list[i];
    }
    seen->n = kept;
}

/* A square's leaf: tiles as a whole, or in the block at hand. */
static void put_leaf(const struct division *d, const struct square *q, uint32_t leaf)
{
    struct sight *s = d->b->sight;
    if (q->size < SIGHT_TILE) {
        uint32_t *to = &d->block[(q->v - d->block_v) * SIGHT_TILE + q->u - d->block_u];
        for (uint32_t v = 0; v < q->size; v++)
            for (uint32_t u = 0; u < q->size; u++)
                to[v * SIGHT_TILE + u] = leaf;
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

static uint32_t make_list(const struct division *d, const struct seen *seen)
{
    if (seen->n > SIGHT_MAX_LIST) return SIGHT_ASK;
    const uint64_t at = build_take(d->b, &d->b->list, seen->n + 1, sizeof(uint32_t));
    if (at == UINT64_MAX) return SIGHT_ASK;
    uint32_t *list = &d->b->sight->list[at];
    list[0] = seen->n;
    for (uint32_t i = 0; i < seen->n; i++) {
        list[i + 1] = record_of(d, &d->w->candidate[seen->list[i] & ~(uint32_t)COVERS]);
        if (list[i + 1] == BUILD_NO_RECORD) return SIGHT_ASK;
    }
    return (uint32_t)SIGHT_FEW << SIGHT_KIND_SHIFT | (uint32_t)at;
}

enum { ONE, NOTHING, FEW, ASK };

static void end(struct division *d, const struct square *q, uint32_t leaf, int what)
{
    put_leaf(d, q, leaf);
    d->cells[what] += (uint64_t)q->size * q->size;
}

static void end_few(struct division *d, const struct square *q, const struct seen *seen)
{
    if (*seen->leaf == NO_LEAF) *seen->leaf = make_list(d, seen);
    end(d, q, *seen->leaf, *seen->leaf == SIGHT_ASK ? ASK : FEW);
}

static int all_cover(const struct seen *seen)
{
    uint32_t all = COVERS;
    for (uint32_t i = 0; i < seen->n; i++)
        all &= seen->list[i];
    return all != 0;
}

static void divide(struct division *d, const struct square *q, const struct seen *seen);

static void make_quarters(const struct square *q, const struct seen *seen, struct quarters *four)
{
    const double half = 0.5 * q->half;
    for (uint32_t k = 0; k < 4; k++) {
        four->square[k] = (struct square){.u = q->u + (k & 1) * (q->size / 2),
                                          .v = q->v + (k >> 1) * (q->size / 2),
                                          .size = q->size / 2,
                                          .mid_u = q->mid_u + (k & 1 ? half : -half),
                                          .mid_v = q->mid_v + (k & 2 ? half : -half),
                                          .half = half};
        four->seen[k].list = seen->above + k * (size_t)seen->n;
        four->seen[k].above = seen->above + 4 * (size_t)seen->n;
    }
}

static void divide_quarters(struct division *d, const struct square *q, const struct seen *seen)
{
    struct quarters four;
    make_quarters(q, seen, &four);
    look(d->w->candidate, seen, &four);
    for (uint32_t k = 0; k < 4; k++) {
        struct seen *mine = &four.seen[k];
        drop_hidden(d->w, mine, &four.square[k]);
        mine->own_leaf = NO_LEAF;
        mine->leaf = mine->n == seen->n ? seen->leaf : &mine->own_leaf;
        divide(d, &four.square[k], mine);
    }
}

/* A tile whose leaves differ: they are made beside each other, and become a block. */
static void divide_tile(struct division *d, const struct square *q, const struct seen *seen)
{
    uint32_t block[SIGHT_BLOCK], same = 1;
    d->block = block;
    d->block_u = q->u;
    d->block_v = q->v;
    divide_quarters(d, q, seen);
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
    memcpy(&d->b->sight->leaf[at], block, sizeof block);
    put_leaf(d, q, (uint32_t)SIGHT_TILED << SIGHT_KIND_SHIFT | (uint32_t)at);
}

/* Where all that is left covers the square, a few of them, their planes cross or lie in each other: rays are
 * decided. */
static void divide(struct division *d, const struct square *q, const struct seen *seen)
{
    if (seen->n == 0)
        end(d, q, SIGHT_NOTHING, NOTHING);
    else if (seen->n == 1 && seen->cover != NO_CANDIDATE)
        end(d, q, d->w->candidate[seen->cover].triangle, ONE);
    else if (q->size == 1 || (seen->n <= SIGHT_MAX_LIST && seen->cover != NO_CANDIDATE && all_cover(seen)))
        end_few(d, q, seen);
    else if (q->size == SIGHT_TILE)
        divide_tile(d, q, seen);
    else
        divide_quarters(d, q, seen);
}

void build_work_free(struct build_work *w)
{
    free(w->candidate);
    free(w->stack);
}

/* Each square's candidates stand above those of the square that it is a quarter of: four lists a level. */
static int gather(struct build_shared *b, struct build_work *w, uint32_t region, uint32_t face)
{
    const uint64_t n = b->bin[region + 1] - b->bin[region];
    uint32_t levels = 1;
    for (uint32_t size = b->region_cells; size > 1; size /= 2)
        levels++;
    if (!grow(&w->candidate, &w->room, n + 1, sizeof *w->candidate) ||
        !grow(&w->stack, &w->stack_room, (n + 1) * (4 * levels + 1), sizeof *w->stack))
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
    const uint32_t size = b->region_cells;
    const double cell = 2.0 / b->sight->cells;
    struct division d = {.b = b, .w = w, .face = face};
    if (!b->seen[region]) return SH_OK;
    int rc = gather(b, w, region, face);
    if (rc != SH_OK) return rc;
    struct square all = {
        .u = at % b->regions * size, .v = at / b->regions * size, .size = size, .half = 0.5 * size * cell};
    all.mid_u = (all.u + 0.5 * size) * cell - 1.0;
    all.mid_v = (all.v + 0.5 * size) * cell - 1.0;
    struct seen seen = {
        .list = w->stack, .n = (uint32_t)w->n, .above = w->stack + w->n, .cover = NO_CANDIDATE, .own_leaf = NO_LEAF};
    seen.leaf = &seen.own_leaf;
    divide(&d, &all, &seen);
    for (int i = 0; i < 4; i++)
        atomic_fetch_add_explicit(&b->cells[i], d.cells[i], memory_order_relaxed);
    return SH_OK;
}
