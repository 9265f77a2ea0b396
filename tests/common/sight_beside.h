/* SPDX-License-Identifier: MIT */
/* A sight beside the BVH that it was made for. The same rays go through both, and each bit is compared. */
#ifndef TESTS_COMMON_SIGHT_BESIDE_H
#define TESTS_COMMON_SIGHT_BESIDE_H

#include "core/sight.h"

enum { SIGHT_BESIDE_KEPT = 8 };

/* A ray with different results: [0] is the BVH's, [1] the sight's. */
struct sight_difference {
    double dir[3], range_m[2];
    uint32_t triangle[2], label[2];
    float steep[2];
};

struct sight_beside {
    const struct bvh *bvh;
    struct sight *sight;
    int borrowed; /* the sight is another one's */
    struct sight_info info;
    double station_m[3];
    uint64_t rays, hits, few, asked;
    uint64_t differ;                                 /* rays of which any bit differs; NaN is NaN, whatever its bits */
    struct sight_difference kept[SIGHT_BESIDE_KEPT]; /* the first of them */
    struct sight_work *work;
    struct bvh_work *bvh_work;
};

int sight_beside_create(const struct sight_spec *spec, struct sight_beside *out, struct sh_err *err);
/* Takes the same sight for another thread; `other` must outlive it. */
int sight_beside_join(const struct sight_beside *other, struct sight_beside *out, struct sh_err *err);
void sight_beside_free(struct sight_beside *beside);
/* range_m and triangle get the sight's results; NULL where they are not wanted. */
void sight_beside_cast(struct sight_beside *beside, uint32_t n, const struct vec3_in *dir, double range_max_m,
                       double *range_m, uint32_t *triangle);
/* Compares with hits that the BVH has given already, for all n in one call. Labels are not compared. */
void sight_beside_check(struct sight_beside *beside, uint32_t n, const struct vec3_in *dir, double range_max_m,
                        const double *range_m, const uint32_t *triangle);
/* Prints the first rays that differ on standard output, as TAP comments. */
void sight_beside_print(const struct sight_beside *beside);

#endif
