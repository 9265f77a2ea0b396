/* Echoes of pulses with a footprint -> the list that detection works on. */
#include <math.h>
#include <string.h>

#include "core/cast/beam_work.h"
#include "core/surface.h"

/* Pulses p .. end - 1 whose central ray does for all of the footprint. */
static void list_central(struct caster *c, const struct cast_setup *s, uint32_t p, uint32_t end)
{
    struct echo_list *l = &c->list;
    const uint32_t at = l->n, n = end - p;
    memcpy(l->range_m + at, c->range_m + p, n * sizeof *l->range_m);
    memcpy(l->label + at, c->label + p, n * sizeof *l->label);
    memset(l->number + at, 0, n);
    for (uint32_t i = 0; i < n; i++) {
        l->pulse[at + i] = p + i;
        l->cosine[at + i] = 1.0 / sqrt((double)c->beam->steep[p + i]);
        l->energy[at + i] = 1.0;
    }
    if (c->attributes) caster_plane_widths(&s->beam->beam, c->beam->steep + p, c->range_m + p, n, l->width_m + at);
    l->n += n;
}

/* A pulse with sub-rays. */
static void list_echoes(struct caster *c, uint32_t p)
{
    struct echo_list *l = &c->list;
    const struct beam_echoes *e = &c->beam->some;
    const struct several *of = &c->beam->several[p];
    uint32_t at = l->n;
    for (uint32_t i = of->first; i < of->first + of->n; i++, at++) {
        l->pulse[at] = p;
        l->number[at] = e->number[i];
        l->range_m[at] = e->range_m[i];
        l->cosine[at] = (double)e->cosine[i];
        l->energy[at] = (double)e->energy[i];
        l->label[at] = e->label[i];
    }
    for (uint32_t i = 0; i < of->n && c->attributes; i++)
        l->width_m[l->n + i] = e->width_m[of->first + i];
    if (of->n == 0) {
        l->pulse[at] = p;
        l->number[at] = 0;
        l->range_m[at] = l->cosine[at] = (double)NAN;
        l->energy[at] = 0.0;
        l->label[at++] = LINE_LABEL_NONE;
    }
    l->n = at;
}

/* What comes back is known of echoes of several returns. */
static void set_backs(struct caster *c)
{
    struct echo_list *l = &c->list;
    const struct beam_work *w = c->beam;
    for (uint32_t k = 0, i = 0; k < w->n_near; k++) {
        const struct several *of = &w->several[w->near[k]];
        while (l->pulse[i] != w->near[k])
            i++;
        for (uint32_t j = 0; j < of->n; j++)
            l->rho[i + j] = (double)w->some.back[of->first + j];
    }
}

void beam_list(struct caster *c, const struct cast_setup *s, uint32_t n)
{
    struct echo_list *l = &c->list;
    const struct beam_work *w = c->beam;
    uint32_t p = 0;
    l->n = 0;
    for (uint32_t k = 0; k < w->n_near; k++) {
        list_central(c, s, p, w->near[k]);
        list_echoes(c, w->near[k]);
        p = w->near[k] + 1;
    }
    list_central(c, s, p, n);
    memset(l->ghost, 0, l->n);
    if (s->detect->surfaces != NULL)
        surface_return(s->detect->surfaces, l->n, l->label, l->cosine, l->rho);
    else
        memcpy(l->rho, l->energy, l->n * sizeof *l->rho);
    set_backs(c);
}
