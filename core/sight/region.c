/* SPDX-License-Identifier: MIT */
/* Divides a region until its squares are leaves. */
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/sight/build_inside.h"
#include "core/sight/quad.h"

enum { NO_CANDIDATE = 0xffffffff };

/* A square of cells on the face, `size` cells wide. */
struct square {
    uint32_t u, v, size;
};

/* Candidates that may be seen in a square. */
struct seen {
    uint32_t *list, n; /* numbers of candidates; with the bit COVERS: this one covers the square */
    uint32_t *above;   /* where the stack is free */
    uint32_t cover;    /* of those that cover the square, the nearest in its middle; or NO_CANDIDATE */
    uint32_t groups;   /* how many candidates are groups */
    int filled;        /* a group may be seen in all of the square */
    uint32_t *leaf;    /* the leaf of this list, once it has been made; squares with the same list share it */
    uint32_t own_leaf;
};
enum { COVERS_BIT = 31, COVERS = 1U << COVERS_BIT, NO_LEAF = 0xffffffff };

/* The state of a region while it is divided. */
struct division {
    struct build_shared *b;
    struct build_work *w;
    uint32_t face;
    uint32_t *block; /* leaves of the tile at hand, where squares are smaller than a tile */
    uint32_t block_u, block_v;
    uint64_t cells[4];
};

/* Four quarters of a square at a time. */
struct quarters {
    struct square square[4];
    struct seen seen[4];
    quad u, v;   /* their middles */
    double half; /* half of a quarter's width, plus SIGHT_PAD */
    /* The plane of the candidate that covers each quarter; cover is NO_CANDIDATE, and first 0, where none
     * does. */
    quad_mask cover;
    quad first, plane[3], slope, slack;
};

/* Flags of a candidate: outside and covers, each with four bits, one for each quarter; then one bit that says whether
 * the candidate is a group. A group covers the parts that its rectangle covers. */
enum { OUTSIDE_BITS = 15, COVERS_SHIFT = 4, GROUP_SHIFT = 8 };
/* A square up to this many cells wide is not divided where groups alone may be seen. */
enum { GROUPS_SIZE = SIGHT_TILE / 2 };

VEC_INLINE void at_middles(const double f[3], const struct quarters *four, quad *out)
{
    *out = f[0] + f[1] * four->u + f[2] * four->v;
}

/* A bit for each lane that is set. */
VEC_INLINE uint32_t bits_of(const quad_mask *which)
{
    const quad_mask bit = *which & (quad_mask){1, 2, 4, 8};
    return (uint32_t)(bit[0] | bit[1] | bit[2] | bit[3]);
}

/* Whether a plane's distance can be used: 0 where it is seen at too small an angle, or from too near. */
VEC_INLINE void find_clear(const struct build_candidate *c, const quad *middle, double half, quad_mask *clear)
{
    const double r = c->plane_slope * half;
    *clear = (quad_mask)(*middle - r > 2.0 * c->graze) & (quad_mask)(*middle + r < SIGHT_NEAR);
}

/* Returns the flags of a group. */
VEC_INLINE uint16_t place_group(const struct build_candidate *c, const struct quarters *four)
{
    const double half = four->half, *u = c->rect[0], *v = c->rect[1];
    const quad from_u = four->u - u[0], from_v = four->v - v[0];
    const quad_mask outside = (quad_mask)(from_u > u[1] + half) | (quad_mask)(-from_u > u[1] + half) |
                              (quad_mask)(from_v > v[1] + half) | (quad_mask)(-from_v > v[1] + half);
    const quad_mask filled = (quad_mask)(from_u <= u[1] - half) & (quad_mask)(-from_u <= u[1] - half) &
                             (quad_mask)(from_v <= v[1] - half) & (quad_mask)(-from_v <= v[1] - half);
    return (uint16_t)(bits_of(&outside) | bits_of(&filled) << COVERS_SHIFT | 1U << GROUP_SHIFT);
}

/* Finds which candidates lie outside of each quarter, which cover it, and which of those comes first in its
 * middle. Doubts are for directions of length 1 (sight_inside.h). Here a direction's largest component is 1, so its
 * length is 1 to sqrt(3). So each doubt is doubled. */
VEC_INLINE void find_covers(const struct build_work *w, const struct seen *in, struct quarters *four)
{
    quad first = {0.0, 0.0, 0.0, 0.0};
    quad_mask cover = {NO_CANDIDATE, NO_CANDIDATE, NO_CANDIDATE, NO_CANDIDATE};
    for (uint32_t i = 0; i < in->n; i++) {
        const uint32_t number = in->list[i] & ~(uint32_t)COVERS;
        const struct build_candidate *c = &w->candidate[number];
        quad_mask outside = {0, 0, 0, 0}, covers = {-1, -1, -1, -1}, better;
        quad e;
        if (c->triangle == BVH_NO_TRIANGLE) {
            w->where[i] = place_group(c, four);
            continue;
        }
        for (int k = 0; k < 3; k++) {
            const double r = 2.0 + c->edge_slope[k] * four->half;
            at_middles(c->edge[k], four, &e);
            outside |= (quad_mask)(e < -r);
            covers &= (quad_mask)(e > r);
        }
        at_middles(c->plane, four, &e);
        find_clear(c, &e, four->half, &better);
        better &= covers & (quad_mask)(e > first);
        quad_choose(&better, &e, &first);
        cover = (((quad_mask){number, number, number, number}) & better) | (cover & ~better);
        outside = (outside & (quad_mask){1, 2, 4, 8}) | (covers & (quad_mask){16, 32, 64, 128});
        w->where[i] = (uint16_t)(outside[0] | outside[1] | outside[2] | outside[3]);
    }
    four->first = first;
    four->cover = cover;
}

/* Takes the planes of the covering candidates, side by side. Returns 0 where none covers a quarter. */
VEC_INLINE int take_covers(const struct build_work *w, struct quarters *four)
{
    const quad none = {0.0, 0.0, 0.0, 0.0};
    int any = 0;
    four->plane[0] = four->plane[1] = four->plane[2] = four->slope = four->slack = none;
    for (int k = 0; k < 4; k++) {
        if ((uint32_t)four->cover[k] == NO_CANDIDATE) continue;
        const struct build_candidate *c = &w->candidate[four->cover[k]];
        for (int j = 0; j < 3; j++)
            four->plane[j][k] = c->plane[j];
        four->slope[k] = c->plane_slope;
        four->slack[k] = c->slack;
        any = 1;
    }
    return any;
}

/* Finds the quarters in which all of a candidate lies behind the covering one. A candidate seen at too small
 * an angle is compared as a whole. */
VEC_INLINE void find_behind(const struct build_candidate *c, const struct quarters *four, quad_mask *behind)
{
    const double half = four->half;
    const quad across = four->plane[1] - c->plane[1], up = four->plane[2] - c->plane[2], reach = four->slope * half;
    const quad doubt = 2.0 * (c->slack + four->slack) + SIGHT_SAME * (four->first + reach);
    const quad_mask positive = {INT64_MAX, INT64_MAX, INT64_MAX, INT64_MAX};
    const quad spread = ((quad)((quad_mask)across & positive) + (quad)((quad_mask)up & positive)) * half;
    quad mine;
    quad_mask clear;
    at_middles(c->plane, four, &mine);
    find_clear(c, &mine, half, &clear);
    *behind = (clear & (quad_mask)(four->first - mine - spread > doubt)) |
              (~clear & (quad_mask)(c->near_m * (four->first - reach) > 2.0));
}

/* Finds the candidates of a square that may be seen in each quarter. */
VEC_CLONES
static void region_look(const struct build_work *w, const struct seen *in, struct quarters *four)
{
    uint32_t n[4] = {0, 0, 0, 0}, groups[4] = {0, 0, 0, 0}, filled = 0;
    find_covers(w, in, four);
    const int hides = in->n > 1 && take_covers(w, four);
    for (uint32_t i = 0; i < in->n; i++) {
        const uint32_t number = in->list[i] & ~(uint32_t)COVERS, where = w->where[i];
        uint32_t gone = where & OUTSIDE_BITS;
        if (hides && gone != OUTSIDE_BITS) {
            quad_mask behind;
            find_behind(&w->candidate[number], four, &behind);
            behind &= (quad_mask)(((quad_mask){number, number, number, number}) != four->cover);
            gone |= bits_of(&behind);
        }
        const uint32_t group = where >> GROUP_SHIFT;
        filled |= group != 0 ? ~gone & where >> COVERS_SHIFT : 0;
        for (int k = 0; k < 4; k++) {
            four->seen[k].list[n[k]] = number | (where >> (COVERS_SHIFT + k) & 1) << COVERS_BIT;
            n[k] += ~(gone >> k) & 1;
            groups[k] += ~(gone >> k) & group;
        }
    }
    for (int k = 0; k < 4; k++) {
        four->seen[k].n = n[k];
        four->seen[k].groups = groups[k];
        four->seen[k].filled = (int)(filled >> k & 1);
        four->seen[k].cover = (uint32_t)four->cover[k];
    }
}

/* Sets the leaf of a square. A square smaller than a tile has its cells in the current block; any other square consists
 * of whole tiles. */
static void put_leaf(const struct division *d, const struct square *q, uint32_t leaf)
{
    const struct sight *s = d->b->sight;
    const int in_block = q->size < SIGHT_TILE;
    const uint32_t tiles = s->cells / SIGHT_TILE, row = in_block ? (uint32_t)SIGHT_TILE : tiles,
                   n = in_block ? q->size : q->size / SIGHT_TILE;
    uint32_t *to = in_block ? &d->block[(q->v - d->block_v) * SIGHT_TILE + q->u - d->block_u]
                            : &s->tile[(d->face * tiles + q->v / SIGHT_TILE) * tiles + q->u / SIGHT_TILE];
    for (uint32_t v = 0; v < n; v++)
        for (uint32_t u = 0; u < n; u++)
            to[v * row + u] = leaf;
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
    if (seen->n > SIGHT_MAX_LIST || seen->groups > 0) return SIGHT_ASK;
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

static void region_end(struct division *d, const struct square *q, uint32_t leaf, int what)
{
    put_leaf(d, q, leaf);
    d->cells[what] += (uint64_t)q->size * q->size;
}

static void end_few(struct division *d, const struct square *q, const struct seen *seen)
{
    if (*seen->leaf == NO_LEAF) *seen->leaf = make_list(d, seen);
    region_end(d, q, *seen->leaf, *seen->leaf == SIGHT_ASK ? ASK : FEW);
}

static int all_cover(const struct seen *seen)
{
    uint32_t all = seen->groups == 0 ? COVERS : 0;
    for (uint32_t i = 0; i < seen->n; i++)
        all &= seen->list[i];
    return all != 0;
}

static void divide(struct division *d, const struct square *q, const struct seen *seen);

/* Middles and halves are exact: cells are a power of two. */
static void make_quarters(uint32_t cells, const struct square *q, const struct seen *seen, struct quarters *four)
{
    const uint32_t size = q->size / 2;
    const double cell = 2.0 / cells, half = 0.5 * size * cell;
    four->half = half + SIGHT_PAD;
    for (uint32_t k = 0; k < 4; k++) {
        four->square[k] = (struct square){q->u + (k & 1) * size, q->v + (k >> 1) * size, size};
        four->u[k] = four->square[k].u * cell + half - 1.0;
        four->v[k] = four->square[k].v * cell + half - 1.0;
        four->seen[k].list = seen->above + k * (size_t)seen->n;
        four->seen[k].above = seen->above + 4 * (size_t)seen->n;
    }
}

static void divide_quarters(struct division *d, const struct square *q, const struct seen *seen)
{
    struct quarters four;
    make_quarters(d->b->sight->cells, q, seen, &four);
    region_look(d->w, seen, &four);
    for (uint32_t k = 0; k < 4; k++) {
        struct seen *mine = &four.seen[k];
        mine->own_leaf = NO_LEAF;
        mine->leaf = mine->n == seen->n ? seen->leaf : &mine->own_leaf;
        divide(d, &four.square[k], mine);
    }
}

/* Divides a tile. If the leaves of its cells differ, the map gets a block with all of them. If they are equal, the tile
 * becomes one leaf. */
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

/* Where a few candidates are left and all cover the square, their planes cross or coincide: more division is
 * useless, and rays are decided one by one. */
static void divide(struct division *d, const struct square *q, const struct seen *seen)
{
    if (seen->n == 0)
        region_end(d, q, SIGHT_NOTHING, NOTHING);
    else if (seen->n == 1 && seen->cover != NO_CANDIDATE)
        region_end(d, q, d->w->candidate[seen->cover].triangle, ONE);
    else if (seen->groups == seen->n && (seen->filled || q->size <= GROUPS_SIZE))
        region_end(d, q, SIGHT_ASK, ASK);
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
    free(w->where);
}

/* Returns how many numbers the stack may hold for a region of n candidates. Each division of a square puts four lists
 * of at most n candidates on top of the stack, one list for each quarter. */
static size_t stacked(const struct build_shared *b, size_t n)
{
    size_t lists = 5;
    for (uint32_t size = b->region_cells; size > 1; size /= 2)
        lists += 4;
    return lists * n;
}

/* Whether there is memory to divide a region of n triangles. Arrays grow by half of their size. */
static int may_take(struct build_shared *b, struct build_work *w, size_t n)
{
    const uint64_t each = sizeof *w->candidate + sizeof *w->where;
    const uint64_t need = 3 * (n * each + stacked(b, n) * sizeof *w->stack) / 2;
    if (need <= w->taken) return 1;
    const uint64_t more = need - w->taken;
    if (atomic_fetch_add(&b->bytes, more) + more > b->spec->memory_bytes) {
        atomic_fetch_sub(&b->bytes, more);
        return 0;
    }
    w->taken = need;
    return 1;
}

/* Fills the work with the candidates of a region. *fits is 0 where memory_bytes does not allow them. */
static int gather(struct build_shared *b, struct build_work *w, uint32_t region, uint32_t face, int *fits)
{
    const size_t n = b->bin[region + 1] - b->bin[region];
    w->n = w->groups = 0;
    *fits = may_take(b, w, n);
    if (!*fits) return SH_OK;
    if (!grow(&w->candidate, &w->room, n, sizeof *w->candidate) ||
        !grow(&w->where, &w->where_room, n, sizeof *w->where) ||
        !grow(&w->stack, &w->stack_room, stacked(b, n), sizeof *w->stack))
        return SH_ENOMEM;
    for (uint64_t i = b->bin[region]; i < b->bin[region + 1]; i++) {
        const uint32_t number = b->binned[i];
        struct build_candidate *c = &w->candidate[w->n];
        if ((number & BUILD_IS_GROUP) == 0) {
            w->n += (size_t)build_candidate(b, face, number, c);
            continue;
        }
        build_group_candidate(&b->group[number & ~BUILD_IS_GROUP], face, c);
        w->n++;
        w->groups++;
    }
    for (uint32_t i = 0; i < w->n; i++)
        w->stack[i] = i;
    return SH_OK;
}

int build_region(struct build_shared *b, struct build_work *w, uint32_t region)
{
    const uint32_t each = b->regions * b->regions, at = region % each, size = b->region_cells;
    struct division d = {.b = b, .w = w, .face = region / each};
    const struct square all = {at % b->regions * size, at / b->regions * size, size};
    int fits;
    if (!b->seen[region]) return SH_OK;
    int rc = gather(b, w, region, d.face, &fits);
    if (rc != SH_OK) return rc;
    struct seen seen = {.list = w->stack,
                        .n = (uint32_t)w->n,
                        .above = w->n > 0 ? w->stack + w->n : w->stack,
                        .cover = NO_CANDIDATE,
                        .groups = (uint32_t)w->groups,
                        .own_leaf = NO_LEAF};
    seen.leaf = &seen.own_leaf;
    if (fits)
        divide(&d, &all, &seen);
    else
        region_end(&d, &all, SIGHT_ASK, ASK);
    for (int i = 0; i < 4; i++)
        atomic_fetch_add_explicit(&b->cells[i], d.cells[i], memory_order_relaxed);
    return SH_OK;
}
