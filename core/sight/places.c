/* SPDX-License-Identifier: MIT */
/* Finds the places of rays on the cube, and their leaves. */
#include <math.h>
#include <string.h>

#include "core/sight/hits_inside.h"
#include "core/vecmath.h"

/* Finds the place of each ray's leaf: the number of its tile, and the cell within. Coordinates are those of
 * sight_inside.h in single precision, counted in cells from 0. With e = 2^-24, the error of b / |a| is 2 e of its value
 * for the rounded components, and 3 e more for the reciprocal and the products; values are 1 at most. A coordinate is
 * half the number of cells times 1 + b / |a|. This sum is 2 at most, and is rounded by e. Together the error is 6 e and
 * some e^2, less than half of SIGHT_PAD. The error also stays below that where rounding chooses another face. Vectors
 * that are no direction belong to `nowhere`. */
VEC_CLONES
static void find_places(uint32_t cells, const struct vec3_in *dir, uint32_t n, int32_t nowhere, int32_t *restrict tile,
                        int32_t *restrict within)
{
    const double *dx = dir->x, *dy = dir->y, *dz = dir->z;
    const float half = 0.5F * (float)cells, end = (float)cells + 1.0F;
    const int32_t last = (int32_t)cells - 1, tiles = (int32_t)cells / SIGHT_TILE;
    VEC_LOOP
    for (uint32_t i = 0; i < n; i++) {
        const float x = (float)dx[i], y = (float)dy[i], z = (float)dz[i], ax = fabsf(x), ay = fabsf(y), az = fabsf(z);
        const float xy = ax >= ay ? x : y, axy = ax >= ay ? ax : ay, a = axy >= az ? xy : z, aa = axy >= az ? axy : az;
        const int32_t axis = axy >= az ? (ax >= ay ? 0 : 2) : 4;
        const float b = axis == 0 ? y : axis == 2 ? z : x, c = axis == 0 ? z : axis == 2 ? x : y;
        const float scale = half / aa, u = half + b * scale, v = half + c * scale;
        const int32_t ok = (int32_t)(u < end) & (int32_t)(v < end);
        const float from_u = u > 0.0F ? u : 0.0F, from_v = v > 0.0F ? v : 0.0F;
        int32_t iu = (int32_t)(from_u < end ? from_u : 0.0F), iv = (int32_t)(from_v < end ? from_v : 0.0F);
        iu = iu < last ? iu : last;
        iv = iv < last ? iv : last;
        const int32_t face = axis + (a < 0.0F ? 1 : 0);
        const int32_t at = (face * tiles + (iv >> 3)) * tiles + (iu >> 3);
        tile[i] = ok ? at : nowhere;
        within[i] = (iv & 7) << 3 | (iu & 7);
    }
}
_Static_assert(SIGHT_TILE == 8, "shifts by 3");

/* Sets changes[i] to 1 where ray i has another tile than the ray before it, else to 0. The eight bytes after the last
 * ray become 1, so that next_change() finds an end. */
VEC_CLONES
static void find_changes(const int32_t *restrict tile, uint32_t n, uint8_t *restrict changes)
{
    changes[0] = 1;
    VEC_LOOP
    for (uint32_t i = 1; i < n; i++)
        changes[i] = tile[i] != tile[i - 1] ? 1 : 0;
    for (uint32_t i = n; i < n + 8; i++)
        changes[i] = 1;
}

/* Returns the next change from `at` on. */
static inline uint32_t next_change(const uint8_t *changes, uint32_t at)
{
    uint64_t eight;
    for (;; at += 8) {
        memcpy(&eight, changes + at, sizeof eight);
        if (eight != 0) return at + (uint32_t)__builtin_ctzll(eight) / 8;
    }
}

static uint32_t find_runs(const struct sight *s, uint32_t n, const struct sight_places *at, struct sight_run *run)
{
    uint32_t m = 0, end, leaf = SIGHT_NO_LEAF;
    for (uint32_t i = 0; i < n; i = end) {
        end = next_change(at->changes, i + 1);
        const uint32_t what = s->tile[at->tile[i]];
        if (sight_kind(what) != SIGHT_TILED) {
            run[m] = (struct sight_run){i, what};
            m += what != leaf;
            leaf = what;
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

uint32_t sight_find_runs(const struct sight *sight, const struct vec3_in *dir, uint32_t n, struct sight_places *places,
                         struct sight_run *run)
{
    const uint32_t edge = sight->cells / SIGHT_TILE;
    find_places(sight->cells, dir, n, (int32_t)(SIGHT_FACES * edge * edge), places->tile, places->within);
    find_changes(places->tile, n, places->changes);
    return find_runs(sight, n, places, run);
}
