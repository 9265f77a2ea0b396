/* Where rays lie on the cube, and which leaves are there. */
#include <math.h>

#include "core/sight/hits_inside.h"
#include "core/vecmath.h"

/* Each ray's tile, and its leaf within. Coordinates are those of sight_inside.h in single precision, counted in cells
 * from 0. With e = 2^-24, the error of b / |a| is 2 e of its value for the rounded components, and 2 e more for the
 * reciprocal and the product; values are 1 at most. The sum, 2 at most, is rounded by e. Together 5 e and some e^2, a
 * third of SIGHT_PAD; so it also is where rounding chooses another face. What is no direction has the tile after the
 * last, which asks the BVH. */
VEC_CLONES
static void find_places(const struct sight *s, const struct vec3_floats *dir, uint32_t n, uint32_t *restrict tile,
                        uint32_t *restrict within)
{
    const float *dx = dir->x, *dy = dir->y, *dz = dir->z, half = 0.5F * (float)s->cells, end = (float)s->cells + 1.0F;
    const int32_t last = (int32_t)s->cells - 1, tiles = (int32_t)s->cells / SIGHT_TILE;
    const uint32_t none = SIGHT_FACES * (uint32_t)tiles * (uint32_t)tiles;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        const float x = dx[i], y = dy[i], z = dz[i], ax = fabsf(x), ay = fabsf(y), az = fabsf(z);
        const int is_x = (ax >= ay) & (ax >= az), is_y = !is_x & (ay >= az);
        const float a = is_x ? x : is_y ? y : z, b = is_x ? y : is_y ? z : x, c = is_x ? z : is_y ? x : y;
        const float scale = half / fabsf(a), u = half + b * scale, v = half + c * scale;
        int32_t iu = (int32_t)(u < end ? u : 0.0F), iv = (int32_t)(v < end ? v : 0.0F);
        iu = iu < last ? iu > 0 ? iu : 0 : last;
        iv = iv < last ? iv > 0 ? iv : 0 : last;
        const int32_t face = (is_x ? 0 : is_y ? 2 : 4) + (a < 0.0F);
        const uint32_t at = (uint32_t)((face * tiles + iv / SIGHT_TILE) * tiles + iu / SIGHT_TILE);
        tile[i] = (u < end) & (v < end) ? at : none;
        within[i] = (uint32_t)(iv % SIGHT_TILE * SIGHT_TILE + iu % SIGHT_TILE);
    }
}

enum { TOGETHER = 16 };

/* The end of the rays from `at` on that lie in the same tile. */
VEC_INLINE uint32_t same_until(const uint32_t *tile, uint32_t at, uint32_t n)
{
    const uint32_t first = tile[at];
    uint32_t end = at + 1;
    for (; end + TOGETHER <= n; end += TOGETHER) {
        uint32_t other = 0;
        for (uint32_t i = 0; i < TOGETHER; i++)
            other |= tile[end + i] ^ first;
        if (other != 0) break;
    }
    while (end < n && tile[end] == first)
        end++;
    return end;
}

VEC_CLONES
static uint32_t find_runs(const struct sight *s, uint32_t n, const struct sight_places *at, struct sight_run *run)
{
    uint32_t m = 0, end, leaf = SIGHT_NO_LEAF;
    for (uint32_t i = 0; i < n; i = end) {
        end = same_until(at->tile, i, n);
        const uint32_t what = s->tile[at->tile[i]];
        if (sight_kind(what) != SIGHT_TILED) {
            if (what != leaf) run[m++] = (struct sight_run){i, leaf = what};
            continue;
        }
        const uint32_t *block = s->leaf + (what & SIGHT_NUMBER);
        for (uint32_t j = i; j < end; j++) {
            const uint32_t its = block[at->within[j]];
            run[m] = (struct sight_run){j, its};
            m += its != leaf;
            leaf = its;
        }
    }
    run[m].from = n;
    return m;
}

uint32_t sight_find_runs(const struct sight *sight, const struct vec3_floats *dir, uint32_t n,
                         struct sight_places *places, struct sight_run *run)
{
    find_places(sight, dir, n, places->tile, places->within);
    return find_runs(sight, n, places, run);
}
