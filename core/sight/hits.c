/* Rays looked up in the map, a chunk at a time. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/sight/hits_inside.h"
#include "core/vecmath.h"

enum {
    TOGETHER = 16,         /* passed at once where none of them matters */
    ROOM = BVH_CHUNK + 48, /* arrays of a power of two would get into each other's way in a cache */
};

struct sight_work {
    struct sight_counters counters;
    uint32_t leaf[ROOM], chosen[ROOM];
    /* Rays that the BVH is asked for. */
    uint32_t ray[ROOM]; /* which ones these are, of the chunk */
    double x[ROOM], y[ROOM], z[ROOM], range_m[ROOM];
    uint32_t triangle[ROOM], label[ROOM];
    float steep[ROOM];
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

/* How many rays of a chunk are neither of one triangle nor of none. */
struct look_up_counts {
    uint32_t few, ask;
};

/* Each ray's leaf, and its triangle where the leaf has one. Coordinates are those of sight_inside.h in single
 * precision, counted in cells from 0. With e = 2^-24, the error of b / |a| is 2 e of its value for the rounded
 * components, and 2 e more for the reciprocal and the product; values are 1 at most. The sum, 2 at most, is rounded by
 * e. Together 5 e and some e^2, a third of SIGHT_PAD; so it also is where rounding chooses another face. What is no
 * direction asks the BVH. */
VEC_CLONES
static struct look_up_counts look_up(const struct sight *s, const struct vec3_floats *dir, uint32_t n,
                                     uint32_t *restrict out, uint32_t *restrict triangle)
{
    const float *dx = dir->x, *dy = dir->y, *dz = dir->z, half = 0.5F * (float)s->cells, end = (float)s->cells + 1.0F;
    const int32_t last = (int32_t)s->cells - 1, tiles = (int32_t)s->cells / SIGHT_TILE;
    const uint32_t *tile = s->tile, *leaf = s->leaf;
    uint32_t few = 0, ask = 0;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        const float x = dx[i], y = dy[i], z = dz[i], ax = fabsf(x), ay = fabsf(y), az = fabsf(z);
        const int is_x = (ax >= ay) & (ax >= az), is_y = !is_x & (ay >= az);
        const float a = is_x ? x : is_y ? y : z, b = is_x ? y : is_y ? z : x, c = is_x ? z : is_y ? x : y;
        const float scale = half / fabsf(a), u = half + b * scale, v = half + c * scale;
        int32_t iu = (int32_t)(u > 0.0F ? u < end ? u : 0.0F : 0.0F),
                iv = (int32_t)(v > 0.0F ? v < end ? v : 0.0F : 0.0F);
        iu = iu < last ? iu : last;
        iv = iv < last ? iv : last;
        const int32_t face = (is_x ? 0 : is_y ? 2 : 4) + (a < 0.0F);
        const uint32_t t = tile[(face * tiles + iv / SIGHT_TILE) * tiles + iu / SIGHT_TILE];
        const int32_t within = (iv % SIGHT_TILE) * SIGHT_TILE + iu % SIGHT_TILE;
        uint32_t l = t;
        if (t >> SIGHT_KIND_SHIFT == SIGHT_TILED) l = leaf[(int32_t)(t & SIGHT_NUMBER) + within];
        l = (u < end) & (v < end) ? l : SIGHT_ASK;
        out[i] = l;
        triangle[i] = l >> SIGHT_KIND_SHIFT == SIGHT_ONE ? l : BVH_NO_TRIANGLE;
        few += l >> SIGHT_KIND_SHIFT == SIGHT_FEW;
        ask += l == SIGHT_ASK;
    }
    return (struct look_up_counts){few, ask};
}

/* The rays whose leaf says so -> out. Room is for one more than there are. */
static uint32_t choose(const struct sight_work *w, uint32_t n, int asks, uint32_t *out)
{
    uint32_t m = 0;
    for (uint32_t i = 0; i < n; i++) {
        out[m] = i;
        m += asks ? w->leaf[i] == SIGHT_ASK : sight_kind(w->leaf[i]) == SIGHT_FEW;
    }
    return m;
}

/* Rays of lists, by their records: w->chosen are then those that could not be decided so. Returns how many. */
static uint32_t decide_lists(struct sight_work *w, const struct sight *s, const struct bvh_rays *rays)
{
    const uint32_t few = choose(w, rays->n, 0, w->chosen);
    const uint32_t open = few_decide(s, &rays->dir, w->leaf, w->chosen, few, rays->triangle);
    w->counters.few += few - open;
    return open;
}

/* What is left of them. In exact order double decides, as it would decide the BVH's proposals; else those are asked
 * for. Returns for how many. */
static uint32_t decide_open(struct sight_work *w, struct bvh_work *bvh_work, const struct sight *s,
                            const struct bvh_rays *rays, uint32_t open)
{
    for (uint32_t k = 0; k < open; k++) {
        const uint32_t i = w->chosen[k], *list = s->list + (w->leaf[i] & SIGHT_NUMBER), n = list[0];
        uint32_t triangle[SIGHT_MAX_LIST];
        if (!s->exact) {
            w->leaf[i] = SIGHT_ASK;
            continue;
        }
        for (uint32_t j = 0; j < n; j++)
            triangle[j] = s->record[list[1 + j]].triangle;
        bvh_decide_among(bvh_work, s->bvh, rays, i, triangle, n);
    }
    if (s->exact) w->counters.few += open;
    return s->exact ? 0 : open;
}

/* Which rays are cast for those that ask: in exact order themselves; else their whole packets, as bvh_hits would have
 * cut them from the chunk, so that the BVH proposes the same. */
static uint32_t gather(struct sight_work *w, const struct bvh *bvh, const struct bvh_rays *rays, int exact)
{
    struct bvh_info info;
    uint32_t m = 0;
    bvh_get_info(bvh, &info);
    const uint32_t packet = exact ? 1 : info.packet;
    for (uint32_t at = 0; at < rays->n; at += packet) {
        const uint32_t end = rays->n - at < packet ? rays->n : at + packet;
        uint32_t any = 0;
        for (uint32_t i = at; i < end; i++)
            any |= w->leaf[i] == SIGHT_ASK;
        for (uint32_t i = at; any && i < end; i++)
            w->ray[m++] = i;
    }
    for (uint32_t k = 0; k < m; k++) {
        w->x[k] = rays->dir.x[w->ray[k]];
        w->y[k] = rays->dir.y[w->ray[k]];
        w->z[k] = rays->dir.z[w->ray[k]];
    }
    return m;
}

static void ask_bvh(struct sight_work *w, struct bvh_work *bvh_work, const struct sight *s, const struct bvh_rays *rays)
{
    struct bvh_rays asked = {.n = gather(w, s->bvh, rays, s->exact),
                             .from = rays->from,
                             .dir = VEC3_IN(*w, 0),
                             .range_max_m = rays->range_max_m,
                             .range_m = w->range_m,
                             .triangle = w->triangle,
                             .label = w->label,
                             .steep = rays->steep != NULL ? w->steep : NULL};
    if (s->exact)
        bvh_hits_ordered(bvh_work, s->bvh, &asked);
    else
        bvh_hits(bvh_work, s->bvh, &asked);
    for (uint32_t k = 0; k < asked.n; k++) {
        const uint32_t i = w->ray[k];
        if (w->leaf[i] != SIGHT_ASK) continue;
        rays->range_m[i] = w->range_m[k];
        rays->triangle[i] = w->triangle[k];
        if (rays->label != NULL) rays->label[i] = w->label[k];
        if (rays->steep != NULL) rays->steep[i] = w->steep[k];
    }
    bvh_work_set_directions(bvh_work, &rays->dir, rays->n);
}

static void look_up_chunk(struct sight_work *w, struct bvh_work *bvh_work, const struct sight *s,
                          const struct bvh_rays *rays)
{
    struct bvh_profile *profile = bvh_work_profile(bvh_work);
    const struct vec3_floats dir = bvh_work_directions(bvh_work);
    uint32_t open = 0;
    bvh_work_set_directions(bvh_work, &rays->dir, rays->n);
    struct look_up_counts counts = look_up(s, &dir, rays->n, w->leaf, rays->triangle);
    bvh_stage_ends(profile, BVH_STAGE_PREPARE);
    if (counts.few != 0) open = decide_lists(w, s, rays);
    bvh_stage_ends(profile, BVH_STAGE_DECIDE);
    bvh_ranges(bvh_work, s->bvh, rays);
    bvh_stage_ends(profile, BVH_STAGE_REFINE);
    if (open != 0) counts.ask += decide_open(w, bvh_work, s, rays, open);
    bvh_stage_ends(profile, BVH_STAGE_DECIDE);
    w->counters.asked += counts.ask;
    if (counts.ask != 0) ask_bvh(w, bvh_work, s, rays);
}

void sight_hits(struct sight_work *work, struct bvh_work *bvh_work, const struct sight *sight,
                const struct bvh_rays *rays)
{
    for (uint32_t at = 0; at < rays->n; at += BVH_CHUNK) {
        struct bvh_rays part = *rays;
        part.n = rays->n - at < BVH_CHUNK ? rays->n - at : BVH_CHUNK;
        part.dir = VEC3_IN(rays->dir, at);
        part.range_m = rays->range_m + at;
        part.triangle = rays->triangle + at;
        part.label = rays->label != NULL ? rays->label + at : NULL;
        part.steep = rays->steep != NULL ? rays->steep + at : NULL;
        look_up_chunk(work, bvh_work, sight, &part);
    }
}
