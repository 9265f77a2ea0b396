/* SPDX-License-Identifier: MIT */
/* The cone that the head's tripod hides: about the plumb line, with the opening of the legs. */
#include <math.h>

#include "core/cast/caster_private.h"

void caster_hide(struct caster *c, const struct chunk *k)
{
    const struct cast_tripod *t = k->s->tripod;
    struct echo_list *l = &c->list;
    uint8_t hidden[CHUNK];
    uint32_t n = 0;
    if (t->cos_opening >= 1.0) return;
    for (uint32_t i = 0; i < k->n; i++) {
        const double cosine = c->d.x[i] * t->down[0] + c->d.y[i] * t->down[1] + c->d.z[i] * t->down[2];
        hidden[i] = cosine > t->cos_opening;
        n += hidden[i];
        if (hidden[i]) l->range_m[i] = (double)NAN;
    }
    for (uint32_t g = 0; g < l->n_further && n > 0; g++) {
        const struct further *f = &l->further[g];
        for (uint32_t i = f->at; i < f->at + f->n && hidden[f->pulse]; i++)
            l->range_m[i] = (double)NAN;
    }
    c->counters.hidden += n;
}
