/* SPDX-License-Identifier: MIT */
/* Private to core/cast: this stage turns echoes into entries of the block. */
#ifndef CORE_CAST_POINTS_H
#define CORE_CAST_POINTS_H

#include <stdint.h>

struct caster;
struct chunk;

/* Writes entries from k->at on. Returns the number of echoes. */
uint32_t caster_points(struct caster *c, struct chunk *k);

#endif
