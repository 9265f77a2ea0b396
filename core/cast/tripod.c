/* SPDX-License-Identifier: MIT */
/* The cone that the head's tripod hides: about the plumb line, with the opening of the legs. */
#include "core/cast/tripod.h"

#include <math.h>

#include "core/cast/echoes.h"

uint32_t caster_hide(const struct cast_tripod *t, const struct vec3_in *d, uint32_t n_pulses, struct echo_list *l)
{
    uint8_t hidden[CHUNK];
    uint32_t n = 0;
    if (t->cos_opening >= 1.0) return 0;
    for (uint32_t i = 0; i < n_pulses; i++) {
        hidden[i] = (uint8_t)caster_is_hidden(t, d, i);
        n += hidden[i];
        if (hidden[i]) l->range_m[i] = (double)NAN;
    }
    for (uint32_t g = 0; g < l->n_secondary && n > 0; g++) {
        const struct secondary *f = &l->secondary[g];
        for (uint32_t i = f->at; i < f->at + f->n && hidden[f->pulse]; i++)
            l->range_m[i] = (double)NAN;
    }
    return n;
}
