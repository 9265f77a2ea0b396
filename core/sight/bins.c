/* SPDX-License-Identifier: MIT */
/* Finds which triangles may be seen in which region. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/sight/build_inside.h"
#include "core/vec3.h"

/* Regions of a face. */
struct range {
    uint32_t u0, u1, v0, v1;
};

static uint32_t region_at(double x, uint32_t regions)
{
    const double at = (x + 1.0) * 0.5 * regions;
    return at <= 0.0 ? 0 : at >= regions ? regions - 1 : (uint32_t)at;
}

/* Finds the regions of a face where a box may be seen. These are all regions of the face if a part of the box lies
 * behind the plane through the station that is parallel to the face, or almost in that plane. Returns 0 where the face
 * shows nothing of the box. */
static int range_of(const struct build_group *box, uint32_t face, uint32_t regions, struct range *r)
{
    double rect[2][2];
    if (box->beside >> face & 1) return 0;
    *r = (struct range){0, regions - 1, 0, regions - 1};
    if (build_group_rect(box, face, rect))
        *r = (struct range){region_at(rect[0][0], regions), region_at(rect[0][1], regions),
                            region_at(rect[1][0], regions), region_at(rect[1][1], regions)};
    return 1;
}

static uint32_t region_number(const struct build_shared *b, uint32_t face, uint32_t u, uint32_t v)
{
    return (face * b->regions + v) * b->regions + u;
}

/* Finds the regions where rays go, by a region's middle and the distance of its corners from it. */
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
                /* A corner's angle from the middle is at most its distance on the face's plane, sqrt(2) * half. */
                const double radius_rad = 1.5 * half + 4.0 * SIGHT_PAD;
                b->seen[region_number(b, face, i, j)] =
                    b->spec->sees == NULL || b->spec->sees(b->spec->ctx, d, radius_rad) != 0;
            }
}

/* Counts a triangle or a group in each region where its box may be seen. Once all are counted, `write` puts its number
 * into the bins of these regions. */
static void put_box(struct build_shared *b, const struct build_group *box, uint32_t number, int write)
{
    struct range r;
    for (uint32_t face = 0; face < SIGHT_FACES; face++) {
        if (!range_of(box, face, b->regions, &r)) continue;
        for (uint32_t j = r.v0; j <= r.v1; j++)
            for (uint32_t i = r.u0; i <= r.u1; i++) {
                const uint32_t at = region_number(b, face, i, j);
                if (!b->seen[at]) continue;
                if (write)
                    b->binned[b->bin[at]++] = number;
                else
                    b->bin[at + 1]++;
            }
    }
}

/* Puts a group; where it is no candidate itself, its triangles. */
static void put_group(struct build_shared *b, uint32_t group, int write)
{
    struct build_group box;
    if (b->group[group].whole) {
        put_box(b, &b->group[group], group | BUILD_IS_GROUP, write);
        return;
    }
    for (uint32_t i = 0; i < build_group_size(b->sight, group); i++) {
        build_box(b->sight, group * BUILD_GROUP + i, 1, &box);
        put_box(b, &box, group * BUILD_GROUP + i, write);
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
    if (b->seen == NULL || b->bin == NULL) return sh_fail(err, SH_ENOMEM, "sight: no memory for %u regions", regions);
    find_seen(b);
    /* From here on bin[r] is the begin of region r. Filling the region moves it to the region's end, which is the begin
     * of region r + 1. So after bin-- at the end, bin[r] is the begin of region r again. */
    b->bin++;
    int rc = put_all(b, 0, err);
    for (uint32_t i = 0; i < regions; i++)
        b->bin[i + 1] += b->bin[i];
    const uint64_t bytes = b->bin[regions] * sizeof *b->binned;
    if (b->bytes + bytes > b->spec->memory_bytes) {
        memset(b->seen, 0, regions);
        memset(b->bin, 0, (regions + 1) * sizeof *b->bin);
    } else {
        b->bytes += bytes;
    }
    b->binned = malloc((b->bin[regions] + 1) * sizeof *b->binned);
    if (rc == SH_OK && b->binned == NULL)
        rc = sh_fail(err, SH_ENOMEM, "sight: no memory for %llu triangles in regions",
                     (unsigned long long)b->bin[regions]);
    if (rc == SH_OK) rc = put_all(b, 1, err);
    b->bin--;
    return rc;
}
