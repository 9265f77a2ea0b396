/* SPDX-License-Identifier: MIT */
/* Judges hits in odd scenes by the reference in long double. */
#ifndef TESTS_COMMON_ODD_JUDGE_H
#define TESTS_COMMON_ODD_JUDGE_H

#include <stdint.h>

#include "core/scene.h"
#include "tests/common/reference.h"

struct odd_tally {
    uint64_t rays, hits, begins_on, missed, extra, wrong;
    uint64_t undecidable; /* would be wrong, but double precision can't tell */
    double largest_m;     /* error of a range that is right */
};

/* A ray, and the hit that a caster claims for it. */
struct odd_shot {
    const double *at_m, *dir; /* [3], prcs */
    double range_m;           /* NaN: none */
    uint32_t triangle;        /* of the scene; REFERENCE_NONE: none, or not known */
    double most_m;            /* hits beyond it may be missing; 0: none may */
};

/* Returns whether the hit is right, or double precision can't decide; else prints the difference. bound_m is the bound
 * of the range's error, for a true range. */
int odd_judge(const struct scene *scene, const struct reference *reference, const struct odd_shot *shot,
              double (*bound_m)(long double range_m), struct odd_tally *tally);

/* Returns how many are missed, extra or wrong. */
uint64_t odd_print(const char *name, const struct odd_tally *tally);

#endif
