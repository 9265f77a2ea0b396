/* SPDX-License-Identifier: MIT */
#include "tests/common/sight_beside.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { PART = 4 * BVH_CHUNK };

static int take_works(struct sight_beside *beside, struct sh_err *err)
{
    int rc = sight_work_create(&beside->work, err);
    if (rc == SH_OK) rc = bvh_work_create(&beside->bvh_work, err);
    if (rc != SH_OK) sight_beside_free(beside);
    return rc;
}

int sight_beside_create(const struct sight_spec *spec, struct sight_beside *out, struct sh_err *err)
{
    *out = (struct sight_beside){.bvh = spec->bvh};
    memcpy(out->station_m, spec->station_m, sizeof out->station_m);
    int rc = sight_create(spec, 1, NULL, &out->sight, err);
    if (rc != SH_OK) return rc;
    out->info = *sight_get_info(out->sight);
    return take_works(out, err);
}

int sight_beside_join(const struct sight_beside *other, struct sight_beside *out, struct sh_err *err)
{
    *out = (struct sight_beside){.bvh = other->bvh, .sight = other->sight, .borrowed = 1, .info = other->info};
    memcpy(out->station_m, other->station_m, sizeof out->station_m);
    return take_works(out, err);
}

void sight_beside_free(struct sight_beside *beside)
{
    if (!beside->borrowed) sight_free(beside->sight);
    if (beside->work != NULL) sight_work_free(beside->work);
    if (beside->bvh_work != NULL) bvh_work_free(beside->bvh_work);
    beside->sight = NULL;
    beside->work = NULL;
    beside->bvh_work = NULL;
}

struct results {
    double range_m[PART];
    uint32_t triangle[PART], label[PART];
    float steep[PART];
};

static int same_double(double a, double b)
{
    return memcmp(&a, &b, sizeof a) == 0 || (isnan(a) && isnan(b));
}

static int same_float(float a, float b)
{
    return memcmp(&a, &b, sizeof a) == 0 || (isnan(a) && isnan(b));
}

static int is_same(const struct results *a, const struct results *b, uint32_t i)
{
    return same_double(a->range_m[i], b->range_m[i]) && a->triangle[i] == b->triangle[i] &&
           a->label[i] == b->label[i] && same_float(a->steep[i], b->steep[i]);
}

static void keep(struct sight_beside *beside, const struct vec3_in *dir, const struct results *bvh,
                 const struct results *sight, uint32_t i)
{
    if (beside->differ >= SIGHT_BESIDE_KEPT) return;
    beside->kept[beside->differ] = (struct sight_difference){.dir = VEC3_AT(*dir, i),
                                                             .range_m = {bvh->range_m[i], sight->range_m[i]},
                                                             .triangle = {bvh->triangle[i], sight->triangle[i]},
                                                             .label = {bvh->label[i], sight->label[i]},
                                                             .steep = {bvh->steep[i], sight->steep[i]}};
}

static struct bvh_rays rays_of(const struct sight_beside *beside, uint32_t n, const struct vec3_in *dir,
                               double range_max_m, struct results *to)
{
    const double *at = beside->station_m;
    return (struct bvh_rays){.n = n,
                             .from.at_m = {at[0], at[1], at[2]},
                             .dir = *dir,
                             .range_max_m = range_max_m,
                             .range_m = to->range_m,
                             .triangle = to->triangle,
                             .label = to->label,
                             .steep = to->steep};
}

static void compare(struct sight_beside *beside, uint32_t n, const struct vec3_in *dir, const struct results *bvh,
                    const struct results *sight)
{
    for (uint32_t i = 0; i < n; i++) {
        beside->hits += bvh->triangle[i] != BVH_NO_TRIANGLE;
        if (is_same(bvh, sight, i)) continue;
        keep(beside, dir, bvh, sight, i);
        beside->differ++;
    }
    beside->rays += n;
}

static void cast_part(struct sight_beside *beside, uint32_t n, const struct vec3_in *dir, double range_max_m,
                      struct results *sight)
{
    struct results bvh;
    struct bvh_rays rays = rays_of(beside, n, dir, range_max_m, &bvh);
    bvh_hits(beside->bvh_work, beside->bvh, &rays);
    rays = rays_of(beside, n, dir, range_max_m, sight);
    memset(sight, 0x5a, sizeof *sight); /* unwritten bytes differ then */
    sight_hits(beside->work, beside->bvh_work, beside->sight, &rays);
    compare(beside, n, dir, &bvh, sight);
}

static void count(struct sight_beside *beside)
{
    const struct sight_counters *counters = sight_work_counters(beside->work);
    beside->few = counters->few;
    beside->asked = counters->asked;
}

void sight_beside_cast(struct sight_beside *beside, uint32_t n, const struct vec3_in *dir, double range_max_m,
                       double *range_m, uint32_t *triangle)
{
    struct results sight;
    for (uint32_t at = 0; at < n; at += PART) {
        const uint32_t some = n - at < PART ? n - at : PART;
        const struct vec3_in part = VEC3_IN(*dir, at);
        cast_part(beside, some, &part, range_max_m, &sight);
        if (range_m != NULL) memcpy(range_m + at, sight.range_m, some * sizeof *range_m);
        if (triangle != NULL) memcpy(triangle + at, sight.triangle, some * sizeof *triangle);
    }
    count(beside);
}

void sight_beside_check(struct sight_beside *beside, uint32_t n, const struct vec3_in *dir, double range_max_m,
                        const double *range_m, const uint32_t *triangle)
{
    struct results bvh, sight;
    for (uint32_t at = 0; at < n; at += PART) {
        const uint32_t some = n - at < PART ? n - at : PART;
        const struct vec3_in part = VEC3_IN(*dir, at);
        const struct bvh_rays rays = rays_of(beside, some, &part, range_max_m, &sight);
        sight_hits(beside->work, beside->bvh_work, beside->sight, &rays);
        bvh = sight;
        memcpy(bvh.range_m, range_m + at, some * sizeof *range_m);
        memcpy(bvh.triangle, triangle + at, some * sizeof *triangle);
        compare(beside, some, &part, &bvh, &sight);
    }
    count(beside);
}

void sight_beside_print(const struct sight_beside *beside)
{
    const double *at = beside->station_m;
    for (uint64_t i = 0; i < beside->differ && i < SIGHT_BESIDE_KEPT; i++) {
        const struct sight_difference *d = &beside->kept[i];
        printf("# from %a %a %a along %a %a %a: BVH %.17g m, triangle %u, label %u, %.9g; sight %.17g m, triangle "
               "%u, label %u, %.9g\n",
               at[0], at[1], at[2], d->dir[0], d->dir[1], d->dir[2], d->range_m[0], d->triangle[0], d->label[0],
               (double)d->steep[0], d->range_m[1], d->triangle[1], d->label[1], (double)d->steep[1]);
    }
}
