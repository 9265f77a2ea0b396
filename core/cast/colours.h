/* SPDX-License-Identifier: MIT */
/* Private to core/cast: this stage gives colours to all echoes that are to be sent. */
#ifndef CORE_CAST_COLOURS_H
#define CORE_CAST_COLOURS_H

struct chunk;
struct echo_list;

/* Sets the colours of the list's echoes. d_z: z of the directions of the pulses, prcs. */
void caster_colours(const struct chunk *k, const double *d_z, struct echo_list *l);

#endif
