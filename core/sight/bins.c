/* SPDX-License-Identifier: MIT */
/* Finds which triangles may be seen in which region. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/sight/build_inside.h"
#include "core/vec3.h"

/* A triangle's regions on a face. */
struct range {
    uint32_t u0, u1, v0, v1;
};

/* The station and a face of the cube span a pyramid with four sides. Returns whether all corners lie beyond one of
 * these sides, or behind the station. w is along the pyramid's axis, a and b are across.
 * Corners within BUILD_BESIDE of a side count as within the pyramid, since a triangle seen edge-on may be hit a little
 * beside its end. BUILD_BESIDE is SIGHT_TILT_DOUBT over 1e-6, the sine below which core/bvh limits ranges to those
 * between the edges. */
static int is_beside(const double w[3], const double a[3], const double b[3], double far_m)
{
    const double behind = -BUILD_BESIDE * far_m;
    int out = 15;
    if (w[0] < behind && w[1] < behind && w[2] < behind) return 1;
    for (int i = 0; i < 3; i++) {
        const double k = BUILD_WIDER * w[i] + BUILD_BESIDE * far_m;
        out &= (a[i] > k) | (-a[i] > k) << 1 | (b[i] > k) << 2 | (-b[i] > k) << 3;
    }
    return out != 0;
}

static uint32_t region_at(double x, uint32_t regions)
{
    const double at = (x + 1.0) * 0.5 * regions;
    return at <= 0.0 ? 0 : at >= regions ? regions - 1 : (uint32_t)at;
}

static inline double least(double a, double b, double c)
{
    const double ab = a < b ? a : b;
    return ab < c ? ab : c;
}

static inline double most(double a, double b, double c)
{
    return -least(-a, -b, -c);
}

static void across(const double w[3], const double a[3], uint32_t regions, uint32_t *from, uint32_t *to)
{
    const double at[3] = {a[0] / w[0], a[1] / w[1], a[2] / w[2]};
    const double lo = least(at[0], at[1], at[2]), hi = most(at[0], at[1], at[2]);
    *from = region_at(lo - 4.0 * SIGHT_PAD, regions);
    *to = region_at(hi + 4.0 * SIGHT_PAD, regions);
}

/* Returns the largest coordinate, without its sign. */
static double farthest(double v[3][3])
{
    double far_m = 0.0;
    for (int i = 0; i < 3; i++) {
        const double m = most(fabs(v[i][0]), fabs(v[i][1]), fabs(v[i][2]));
        far_m = m > far_m ? m : far_m;
    }
    return far_m;
}

/* Finds the regions of a face in which a triangle may be seen. Where a corner lies behind the station, or hardly in
 * front of it, these are all regions of the face. Returns 0 where the face shows nothing of the triangle. */
static int range_of(double v[3][3], double far_m, uint32_t face, uint32_t regions, struct range *r)
{
    const uint32_t axis = face / 2, n1 = (axis + 1) % 3, n2 = (axis + 2) % 3;
    const double sign = face & 1 ? -1.0 : 1.0;
    const double w[3] = {sign * v[0][axis], sign * v[1][axis], sign * v[2][axis]};
    const double a[3] = {v[0][n1], v[1][n1], v[2][n1]}, b[3] = {v[0][n2], v[1][n2], v[2][n2]};
    if (is_beside(w, a, b, far_m)) return 0;
    *r = (struct range){0, regions - 1, 0, regions - 1};
    const double near_w = least(w[0], w[1], w[2]), far_w = most(w[0], w[1], w[2]);
    if (!(near_w > 1e-5 * far_w)) return 1;
    across(w, a, regions, &r->u0, &r->u1);
    across(w, b, regions, &r->v0, &r->v1);
    return 1;
}

static uint32_t region_number(const struct build_shared *b, uint32_t face, uint32_t u, uint32_t v)
{
    return (face * b->regions + v) * b->regions + u;
}

/* Finds the regions that rays go to. `sees` gets a cone that holds the region: the direction of the region's middle,
 * and an angle around that direction. */
static void find_seen(struct build_shared *b)
{
    const double half = 1.0 / b->regions;
    for (uint32_t face = 0; face < SIGHT_FACES; face++)
        for (uint32_t j = 0; j < b->regions; j++)
            for (uint32_t i = 0; i < b->regions; i++) {
                const uint32_t axis = face / 2;
                const double u = (2.0 * i + 1.0) * half - 1.0, v = (2.0 * j + 1.0) * half - 1.0;
                const double length = sqrt(1.0 + u * u + v * v);
                double d[3];
                d[axis] = (face & 1 ? -1.0 : 1.0) / length;
                d[(axis + 1) % 3] = u / length;
                d[(axis + 2) % 3] = v / length;
                /* The face is 1 from the station. So the angle from middle to corner is at most their distance. */
                const double radius_rad = 1.5 * half + 4.0 * SIGHT_PAD;
                b->seen[region_number(b, face, i, j)] =
                    b->spec->sees == NULL || b->spec->sees(b->spec->ctx, d, radius_rad) != 0;
            }
}

/* Counts a triangle or a group in each region of the range, and a triangle's regions. Once all are counted, `write`
 * puts its number into the bins of these regions. */
static void put_range(struct build_shared *b, uint32_t face, const struct range *r, uint32_t number, int write)
{
    for (uint32_t j = r->v0; j <= r->v1; j++)
        for (uint32_t i = r->u0; i <= r->u1; i++) {
            const uint32_t at = region_number(b, face, i, j);
            if (!b->seen[at]) continue;
            if (write) {
                b->binned[b->bin[at]++] = number;
                continue;
            }
            b->bin[at + 1]++;
            if ((number & BUILD_IS_GROUP) == 0) b->kept[number]++;
        }
}

/* Puts the triangles first .. end of a group that is not a candidate itself. `all` holds their range, or NULL. */
static void put_triangles(struct build_shared *b, uint32_t face, uint32_t first, uint32_t end, const struct range *all,
                          int write)
{
    const int in_one = all != NULL && all->u0 == all->u1 && all->v0 == all->v1;
    struct range r;
    for (uint32_t t = first; t < end; t++) {
        double v[3][3];
        if (in_one) {
            put_range(b, face, all, t, write);
            continue;
        }
        sight_corners(b->sight, t, v);
        if (range_of(v, farthest(v), face, b->regions, &r)) put_range(b, face, &r, t, write);
    }
}

static void put_group(struct build_shared *b, uint32_t group, int write)
{
    const struct build_group *g = &b->group[group];
    const uint32_t n = bvh_scene(b->sight->bvh)->n_triangles, first = group * BUILD_GROUP,
                   end = n - first < BUILD_GROUP ? n : first + BUILD_GROUP;
    for (uint32_t face = 0; face < SIGHT_FACES; face++) {
        double rect[2][2];
        struct range r = {0};
        if (g->beside >> face & 1) continue;
        const int known = build_group_rect(g, face, rect);
        if (known)
            r = (struct range){region_at(rect[0][0], b->regions), region_at(rect[0][1], b->regions),
                               region_at(rect[1][0], b->regions), region_at(rect[1][1], b->regions)};
        if (g->whole)
            put_range(b, face, &r, group | BUILD_IS_GROUP, write);
        else
            put_triangles(b, face, first, end, known ? &r : NULL, write);
    }
}

static int put_all(struct build_shared *b, int write, struct sh_err *err)
{
    int rc = SH_OK;
    for (uint32_t g = 0; g < b->n_groups && rc == SH_OK; g++) {
        if ((g & 0xfff) == 0) rc = sh_check_stop(b->report, err);
        put_group(b, g, write);
    }
    return rc;
}

int build_bins(struct build_shared *b, struct sh_err *err)
{
    const uint32_t regions = SIGHT_FACES * b->regions * b->regions;
    b->seen = malloc(regions);
    b->bin = calloc((size_t)regions + 2, sizeof *b->bin);
    b->kept = calloc((size_t)bvh_scene(b->sight->bvh)->n_triangles + 1, sizeof *b->kept);
    if (b->seen == NULL || b->bin == NULL || b->kept == NULL)
        return sh_fail(err, SH_ENOMEM, "sight: no memory for %u regions", regions);
    find_seen(b);
    /* Filling moves bin[region] from the region's begin to its end, which is the begin of the next region. So bin
     * points one place further while regions are counted and filled. */
    b->bin++;
    int rc = put_all(b, 0, err);
    for (uint32_t i = 0; i < regions; i++)
        b->bin[i + 1] += b->bin[i];
    const uint64_t bytes =
        b->bin[regions] * sizeof *b->binned + bvh_scene(b->sight->bvh)->n_triangles * sizeof *b->kept;
    if (b->bytes + bytes > b->spec->memory_bytes) {
        memset(b->seen, 0, regions);
        memset(b->bin, 0, (regions + 1) * sizeof *b->bin);
    } else {
        b->bytes += bytes;
        b->given_back += bytes;
    }
    b->binned = malloc((b->bin[regions] + 1) * sizeof *b->binned);
    if (rc == SH_OK && b->binned == NULL)
        rc = sh_fail(err, SH_ENOMEM, "sight: no memory for %llu triangles in regions",
                     (unsigned long long)b->bin[regions]);
    if (rc == SH_OK) rc = put_all(b, 1, err);
    b->bin--;
    return rc;
}
