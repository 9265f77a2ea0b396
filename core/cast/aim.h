/* SPDX-License-Identifier: MIT */
/* Private to core/cast: this stage turns angles into directions and origins of beams, and into what the encoders
 * read. */
#ifndef CORE_CAST_AIM_H
#define CORE_CAST_AIM_H

struct caster;
struct chunk;

void caster_aim(struct caster *c, struct chunk *k);
/* Computes the directions in the list again, as the encoders read them (struct echo_list, e), after the encoders'
 * angles have changed. Only the layout geo needs them; in any other layout the function does nothing. */
void caster_aim_read(struct caster *c, struct chunk *k);

#endif
