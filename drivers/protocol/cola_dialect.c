/* SPDX-License-Identifier: MIT */
/* CoLa-A or CoLa-B. Where the configuration chooses one (links[].dialect), the link answers in that dialect alone.
 * EIHstCola changes the dialect at once, and for all sessions of the link. Without such a choice each request is
 * answered in its own form. */
#include <stdatomic.h>

#include "drivers/protocol/cola.h"

/* The word that the link's sessions share: the form that EIHstCola set, and power_ons at that time. A word from
 * before the last power-up does not count. */
static uint32_t cola_dialect_word_of(const struct cola *self, uint32_t form)
{
    return self->spec.power_ons << 2 | (form + 1);
}

static int is_strict(const struct cola *self)
{
    return self->spec.dialect != PROTOCOL_DIALECT_ANY && self->spec.shared != NULL;
}

uint32_t cola_configured_framing(const struct cola *self)
{
    return self->spec.dialect == PROTOCOL_COLA_B ? COLA_B : COLA_A;
}

uint32_t cola_framing(const struct cola *self)
{
    if (!is_strict(self)) return self->set.framing;
    const uint32_t word = atomic_load(self->spec.shared);
    if (word == cola_dialect_word_of(self, COLA_A)) return COLA_A;
    if (word == cola_dialect_word_of(self, COLA_B)) return COLA_B;
    return self->power_framing;
}

int cola_understands(const struct cola *self, enum cola_form form)
{
    return !is_strict(self) || cola_framing(self) == form;
}

void cola_follow_dialect(struct cola *self)
{
    if (is_strict(self)) self->stream_form = (enum cola_form)cola_framing(self);
}

enum cola_error cola_read_framing(struct cola *self)
{
    cola_put_u(&self->out, 1, cola_framing(self));
    return COLA_OK;
}

/* The answer still has the form of its request. */
enum cola_error cola_write_framing(struct cola *self)
{
    const uint32_t form = self->arg[0];
    if (form > COLA_B) return COLA_INVALID_DATA;
    self->set.framing = (uint8_t)form;
    self->stream_form = (enum cola_form)form;
    if (is_strict(self)) atomic_store(self->spec.shared, cola_dialect_word_of(self, form));
    return COLA_OK;
}
