/* SPDX-License-Identifier: MIT */
#include "core/line.h"

#include <stdlib.h>
#include <string.h>

int line_block_alloc(struct line_block *block, uint32_t capacity, struct sh_err *err)
{
    memset(block, 0, sizeof *block);
    block->capacity = capacity;
    block->dt_ns = calloc(capacity, sizeof *block->dt_ns);
    block->a = calloc(capacity, sizeof *block->a);
    block->b = calloc(capacity, sizeof *block->b);
    block->c = calloc(capacity, sizeof *block->c);
    block->refl_cdb = calloc(capacity, sizeof *block->refl_cdb);
    block->echo = calloc(capacity, sizeof *block->echo);
    block->label = calloc(capacity, sizeof *block->label);
    if (block->dt_ns && block->a && block->b && block->c && block->refl_cdb && block->echo && block->label)
        return SH_OK;
    line_block_free(block);
    return sh_fail(err, SH_ENOMEM, "line: no memory for a block of %u points", capacity);
}

int line_block_alloc_attributes(struct line_block *block, struct sh_err *err)
{
    block->amplitude_cdb = calloc(block->capacity, sizeof *block->amplitude_cdb);
    block->width_cns = calloc(block->capacity, sizeof *block->width_cns);
    if (block->amplitude_cdb != NULL && block->width_cns != NULL) return SH_OK;
    return sh_fail(err, SH_ENOMEM, "line: no memory for attributes of %u points", block->capacity);
}

int line_block_alloc_colours(struct line_block *block, struct sh_err *err)
{
    block->rgb = calloc(block->capacity, sizeof *block->rgb);
    if (block->rgb != NULL) return SH_OK;
    return sh_fail(err, SH_ENOMEM, "line: no memory for colours of %u points", block->capacity);
}

int line_block_alloc_deviations(struct line_block *block, struct sh_err *err)
{
    block->deviation = calloc(block->capacity, sizeof *block->deviation);
    if (block->deviation != NULL) return SH_OK;
    return sh_fail(err, SH_ENOMEM, "line: no memory for deviations of %u points", block->capacity);
}

int line_block_alloc_waves(struct line_block *block, uint32_t waves, uint32_t samples, struct sh_err *err)
{
    struct line_waves *w = block->waves = calloc(1, sizeof *w);
    if (w != NULL) {
        w->wave = calloc(waves, sizeof *w->wave);
        w->sample = calloc(samples, sizeof *w->sample);
        w->capacity = waves;
        w->sample_capacity = samples;
        if (w->wave != NULL && w->sample != NULL) return SH_OK;
    }
    return sh_fail(err, SH_ENOMEM, "line: no memory for waveforms of %u windows, %u samples", waves, samples);
}

void line_block_free(struct line_block *block)
{
    if (block->waves != NULL) {
        free(block->waves->wave);
        free(block->waves->sample);
    }
    free(block->waves);
    free(block->deviation);
    free(block->rgb);
    free(block->amplitude_cdb);
    free(block->width_cns);
    free(block->dt_ns);
    free(block->a);
    free(block->b);
    free(block->c);
    free(block->refl_cdb);
    free(block->echo);
    free(block->label);
    memset(block, 0, sizeof *block);
}
