/* SPDX-License-Identifier: MIT */
/* A copy of a block's entries, for comparison with another cast. */
#ifndef TESTS_ACCURACY_BLOCK_COPY_H
#define TESTS_ACCURACY_BLOCK_COPY_H

#include <stdlib.h>
#include <string.h>

#include "core/line.h"
#include "tests/common/cases.h"

struct copy {
    uint32_t n, *a, *b, *c, *dt_ns;
    uint16_t *label;
    int16_t *refl_cdb;
    uint8_t *echo;
};

void copy_block(const struct line_block *b, struct copy *to);

void free_copy(struct copy *c);

#endif
