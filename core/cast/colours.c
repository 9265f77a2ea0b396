/* SPDX-License-Identifier: MIT */
/* This sets the colours of the echoes that are sent. Colours of textures are set before, at the hits (texels.c). */
#include "core/cast/colours.h"

#include <math.h>

#include "core/cast/chunk.h"
#include "core/cast/echoes.h"
#include "core/cast/optics.h"
#include "core/colour.h"

/* Returns the frame scalar at the time when a pulse of the chunk fires: a number that a trajectory has at each time
 * (cast.h). Between two knots it changes evenly. */
static double frame_at(const struct chunk *k, uint32_t pulse)
{
    const struct cast_setup *s = k->s;
    const int64_t t_ns = k->run->t0_ns + (int64_t)k->dt_ns[pulse];
    if (s->n_knots == 0) return s->colour->frame;
    const size_t at = pose_find_knot(s->knot, s->n_knots, t_ns);
    const struct pose_knot *a = &s->knot[at], *b = &s->knot[at + 1 < s->n_knots ? at + 1 : at];
    if (t_ns <= a->t_ns || b == a) return a->frame;
    const double f = (double)(t_ns - a->t_ns) / (double)(b->t_ns - a->t_ns);
    return a->frame + fmin(1.0, f) * (b->frame - a->frame);
}

/* The echoes of a chunk that get colours. Neighbours mostly have the same label, so the colours of the last labels are
 * kept, at label % KEPT. */
enum { KEPT = 16, NO_LABEL = 1 << 16 };
struct coloured {
    const struct chunk *k;
    const double *d_z;
    struct echo_list *list;
    uint32_t kept_label[KEPT], kept_colour[KEPT];
};

static uint32_t colour_of_label(struct coloured *c, uint32_t label)
{
    const uint32_t at = label % KEPT;
    uint8_t rgb[3];
    if (c->kept_label[at] == label) return c->kept_colour[at];
    colour_number(label, rgb);
    c->kept_label[at] = label;
    return c->kept_colour[at] = colour_packed(rgb);
}

/* Returns the height of echo i, along the true beam of its pulse. */
static double height_of(const struct coloured *c, uint32_t i, uint32_t pulse)
{
    double from[3];
    bvh_origin_of(&c->k->from, pulse, from);
    return from[2] + c->list->range_m[i] * c->d_z[pulse];
}

/* Returns the colour of echo i, which belongs to this pulse. */
static uint32_t colour_of(struct coloured *c, uint32_t i, uint32_t pulse)
{
    const struct chunk *k = c->k;
    const struct colour_scale *scale = &k->s->colour->scale;
    const struct echo_list *l = c->list;
    const int signal = caster_signal(k->s) != NULL;
    uint8_t rgb[3] = {scale->rgb[0], scale->rgb[1], scale->rgb[2]};
    switch (scale->mode) {
    case COLOUR_RANGE:
        colour_between(scale->low, scale->high, l->range_m[i], rgb);
        break;
    case COLOUR_HEIGHT:
        colour_between(scale->low, scale->high, height_of(c, i, pulse), rgb);
        break;
    case COLOUR_FRAME:
        colour_between(scale->low, scale->high, frame_at(k, pulse), rgb);
        break;
    case COLOUR_REFLECTANCE:
        colour_reflectance(signal && l->refl_cdb[i] != LINE_REFL_NONE ? l->refl_cdb[i] / 100.0 : (double)NAN, rgb);
        break;
    case COLOUR_LABEL:
        return colour_of_label(c, l->label[i] & 0xffff);
    default:
        break;
    }
    return colour_packed(rgb);
}

static void set_colour(struct coloured *c, uint32_t i, uint32_t pulse)
{
    if (isnan(c->list->range_m[i]))
        c->list->colour[i] = colour_packed(colour_grey);
    else if (!c->k->texels)
        c->list->colour[i] = colour_of(c, i, pulse);
}

void caster_colours(const struct chunk *k, const double *d_z, struct echo_list *l)
{
    struct coloured coloured = {.k = k, .d_z = d_z, .list = l};
    for (uint32_t i = 0; i < KEPT; i++)
        coloured.kept_label[i] = NO_LABEL;
    for (uint32_t i = 0; i < k->n; i++)
        set_colour(&coloured, i, i);
    for (uint32_t g = 0; g < l->n_secondary; g++)
        for (uint32_t j = 0; j < l->secondary[g].n; j++)
            set_colour(&coloured, l->secondary[g].at + j, l->secondary[g].pulse);
}
