/* SPDX-License-Identifier: MIT */
/* Points of a frame wait here until the frames with their attributes, colours and waveforms have come. */
#include "drivers/record/track_inside.h"

#include <math.h>
#include <stdlib.h>

#include "drivers/protocol/native.h"

/* Points of a frame whose attributes or colours may follow, and which of these have come. */
struct track_waiting {
    uint32_t n;
    uint64_t pulse0, first_row; /* of the frame's first pulse */
    int have_attributes, have_colours;
    struct scanhead_attribute attribute[NATIVE_MAX_POINTS];
    double deviation[NATIVE_MAX_POINTS];
    struct scanhead_colour colour[NATIVE_MAX_POINTS];
    struct waiting_point {
        struct scanhead_point point;
        double frame, gps_s;
        uint32_t row, index; /* in its frame */
    } point[NATIVE_MAX_POINTS];
};

static int waits_for_colours(const struct track *t)
{
    return t->has_colours && !t->colour.given;
}

int track_waits(const struct track *t)
{
    return t->has_attributes || waits_for_colours(t) || t->has_waves;
}

int track_begin_waiting(struct track *t, const struct scanhead_frame *frame, uint64_t first_row, struct sh_err *err)
{
    if (!track_waits(t)) return 0;
    if (t->waiting == NULL) t->waiting = malloc(sizeof *t->waiting);
    if (t->waiting == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory for a frame of points", t->path);
    t->waiting->n = 0;
    t->waiting->pulse0 = frame->pulse0;
    t->waiting->first_row = first_row;
    t->waiting->have_attributes = t->waiting->have_colours = 0;
    return 0;
}

void track_keep(struct track *t, int n)
{
    struct track_waiting *w = t->waiting;
    for (int i = 0; i < n && w->n < NATIVE_MAX_POINTS; i++) { /* no frame holds more */
        struct waiting_point *p = &w->point[w->n++];
        *p = (struct waiting_point){.point = track_get_point(t, i), .row = t->row[i], .index = t->index[i]};
        if (t->info.moving) p->frame = t->frame[i];
        if (scanhead_gps_time(t->sh, p->point.t_ns, &p->gps_s) != 0) p->gps_s = (double)NAN;
    }
}

int track_give(struct track *t, int n, struct sh_err *err)
{
    for (int i = 0; i < n && t->has_colours && t->colour.given; i++)
        colour_of_point(&t->colour.scale, t, i, t->rgb[i]);
    return t->ops->points(t->rec, n, err);
}

/* Gives point n of the batch the window of waveforms that waiting point p lies in. */
static void take_wave(struct track *t, const struct waiting_point *p, int n)
{
    const struct track_waiting *w = t->waiting;
    t->wave[n] = NULL;
    if (!t->has_waves || p->point.echo_count == 0) return;
    t->wave[n] = track_find_wave(t, &p->point, w->pulse0 + (p->row - w->first_row), &t->wave_at[n]);
    t->missing.n_without_waves += t->wave[n] == NULL;
}

/* Gives point n of the batch the attributes and the colour of waiting point k, and counts lost ones. */
static void take_along(struct track *t, uint32_t k, int n)
{
    static const struct scanhead_attribute none = {(double)NAN, (double)NAN};
    const struct track_waiting *w = t->waiting;
    const struct waiting_point *p = &w->point[k];
    const int is_echo = p->point.echo_count != 0;
    if (t->has_attributes) {
        t->attribute[n] = w->have_attributes ? w->attribute[p->index] : none;
        t->deviation[n] = w->have_attributes && t->has_deviations ? w->deviation[p->index] : (double)NAN;
        t->missing.n_without_attributes += (uint64_t)(is_echo && !w->have_attributes);
    }
    if (!waits_for_colours(t)) return;
    const struct scanhead_colour *c = &w->colour[p->index];
    for (int i = 0; i < 3; i++)
        t->rgb[n][i] = !w->have_colours ? colour_grey[i] : i == 0 ? c->red : i == 1 ? c->green : c->blue;
    t->missing.n_without_colours += (uint64_t)(is_echo && !w->have_colours);
}

int track_flush(struct track *t, struct sh_err *err)
{
    struct track_waiting *w = t->waiting;
    int rc = 0, n = 0;
    for (uint32_t k = 0; w != NULL && k < w->n && rc == 0; k++) {
        const struct waiting_point *p = &w->point[k];
        track_set_point(t, n, &p->point);
        t->row[n] = p->row;
        t->frame[n] = p->frame;
        t->gps_s[n] = p->gps_s;
        take_along(t, k, n);
        take_wave(t, p, n);
        if (++n < TRACK_BATCH && k + 1 < w->n) continue;
        t->waited = 1;
        rc = track_give(t, n, err);
        n = 0;
    }
    if (w != NULL) w->n = 0;
    track_clear_waves(t);
    return rc;
}

void track_free(struct track *t)
{
    free(t->waiting);
    t->waiting = NULL;
    track_free_waves(t);
}

int track_attributes(struct track *t, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct track_waiting *w = t->waiting;
    if (w == NULL || w->n == 0 || !t->has_attributes) return 0;
    if (scanhead_attributes(t->sh, frame, 0, w->attribute, NATIVE_MAX_POINTS) < 0) return 0;
    if (t->has_deviations && scanhead_deviations(t->sh, frame, 0, w->deviation, NATIVE_MAX_POINTS) < 0) return 0;
    w->have_attributes = 1;
    return waits_for_colours(t) || t->has_waves ? 0 : track_flush(t, err);
}

int track_colours(struct track *t, const struct scanhead_frame *frame, struct sh_err *err)
{
    struct track_waiting *w = t->waiting;
    if (w == NULL || w->n == 0 || !waits_for_colours(t)) return 0;
    if (scanhead_colours(t->sh, frame, 0, w->colour, NATIVE_MAX_POINTS) < 0) return 0;
    w->have_colours = 1;
    return t->has_waves ? 0 : track_flush(t, err);
}
