/* SPDX-License-Identifier: MIT */
#include "tests/accuracy/block_copy.h"

static void *twin(const void *from, size_t bytes)
{
    void *to = malloc(bytes);
    assert_non_null(to);
    return memcpy(to, from, bytes);
}

void copy_block(const struct line_block *b, struct copy *to)
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

void free_copy(struct copy *c)
{
    free(c->a);
    free(c->b);
    free(c->c);
    free(c->dt_ns);
    free(c->label);
    free(c->refl_cdb);
    free(c->echo);
}
