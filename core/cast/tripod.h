/* SPDX-License-Identifier: MIT */
/* Private to core/cast: pulses into the tripod's cone lose their echoes. */
#ifndef CORE_CAST_TRIPOD_H
#define CORE_CAST_TRIPOD_H

#include "core/cast.h"

struct echo_list;

/* Returns whether the beam with direction i of d goes into the cone. */
static inline int caster_is_hidden(const struct cast_tripod *t, const struct vec3_in *d, uint32_t i)
{
    const double cosine = d->x[i] * t->down[0] + d->y[i] * t->down[1] + d->z[i] * t->down[2];
    return cosine > t->cos_opening;
}

/* d: directions of n_pulses <= CHUNK, prcs. Returns how many of them are hidden. The caster hides single
 * rays before optics, which then follows no hidden ray. The caster hides footprints once caster_sub_rays has put their
 * hits into l. */
uint32_t caster_hide(const struct cast_tripod *t, const struct vec3_in *d, uint32_t n_pulses, struct echo_list *l);

#endif
