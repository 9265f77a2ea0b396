/* SPDX-License-Identifier: MIT */
/* Private to core/cast: pulses into the tripod's cone lose their echoes. */
#ifndef CORE_CAST_TRIPOD_H
#define CORE_CAST_TRIPOD_H

#include "core/cast.h"

struct echo_list;

/* d: directions of n_pulses <= CHUNK, prcs. Returns how many of them are hidden. Called before optics for single rays,
 * so that nothing is followed; for footprints once these have become echoes. */
uint32_t caster_hide(const struct cast_tripod *t, const struct vec3_in *d, uint32_t n_pulses, struct echo_list *l);

#endif
