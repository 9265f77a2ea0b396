/* A copy of a block's entries, to compare another cast with. */
#ifndef TESTS_ACCURACY_BLOCK_COPY_H
#define TESTS_ACCURACY_BLOCK_COPY_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/line.h"

struct copy {
    uint32_t n, *a, *b, *c, *dt_ns;
    uint16_t *label;
    int16_t *refl_cdb;
    uint8_t *echo;
};

static inline void *twin(const void *from, size_t bytes)
{
    void *to = malloc(bytes);
    assert_non_null(to);
    return memcpy(to, from, bytes);
}

static inline void copy_block(const struct line_block *b, struct copy *to)
{
    uint32_t n = to->n = b->n_points;
    to->a = twin(b->a, n * sizeof *b->a);
    to->b = twin(b->b, n * sizeof *b->b);
    to->c = twin(b->c, n * sizeof *b->c);
    to->dt_ns = twin(b->dt_ns, n * sizeof *b->dt_ns);
    to->label = twin(b->label, n * sizeof *b->label);
    to->refl_cdb = twin(b->refl_cdb, n * sizeof *b->refl_cdb);
    to->echo = twin(b->echo, n);
}

static inline void free_copy(struct copy *c)
{
    free(c->a);
    free(c->b);
    free(c->c);
    free(c->dt_ns);
    free(c->label);
    free(c->refl_cdb);
    free(c->echo);
}

#endif
