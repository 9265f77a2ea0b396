/* SPDX-License-Identifier: MIT */
/* Private to drivers/record/track*.c: columns of a batch, and points that wait for attributes, colours and waveforms.
 */
#ifndef DRIVERS_RECORD_TRACK_INSIDE_H
#define DRIVERS_RECORD_TRACK_INSIDE_H

#include "drivers/record/track.h"

/* ---- the batch's columns (track_columns.c) */

/* Returns point i of the batch as a struct, without encoder angles. track_set_point does the reverse. */
static inline struct scanhead_point track_get_point(const struct track *track, int i)
{
    const struct track_points *p = &track->points;
    return (struct scanhead_point){.x = p->x[i],
                                   .y = p->y[i],
                                   .z = p->z[i],
                                   .range_m = p->range_m[i],
                                   .reflectance_db = p->reflectance_db[i],
                                   .t_ns = p->t_ns[i],
                                   .label = p->label[i],
                                   .echo = p->echo[i],
                                   .echo_count = p->echo_count[i]};
}

static inline void track_set_point(struct track *track, int i, const struct scanhead_point *from)
{
    struct track_points *p = &track->points;
    p->x[i] = from->x;
    p->y[i] = from->y;
    p->z[i] = from->z;
    p->range_m[i] = from->range_m;
    p->reflectance_db[i] = from->reflectance_db;
    p->t_ns[i] = from->t_ns;
    p->label[i] = from->label;
    p->echo[i] = from->echo;
    p->echo_count[i] = from->echo_count;
}

/* Returns the columns that the library writes points to. */
struct scanhead_columns track_columns_to(struct track *track);
/* Gives each of n points the row of its pulse. row: the number of pulses in the line before these points. Returns the
 * number of pulses in the line up to the last of these points. */
uint64_t track_number_rows(struct track *track, uint64_t row, int n);
/* Takes the points of a moving head to the scene. Returns as scanhead_to_scene does. */
int track_to_scene(struct track *track, int n);

/* ---- points that wait (track_waiting.c) */

/* Returns whether points wait: frames that follow them are wanted, and sent. */
int track_waits(const struct track *track);
/* The caller calls this before the points of a frame, when no points wait any more. first_row: the row of its first
 * pulse. SH_ENOMEM. */
int track_begin_waiting(struct track *track, const struct scanhead_frame *frame, uint64_t first_row,
                        struct sh_err *err);
/* Keeps the n points of the batch. */
void track_keep(struct track *track, int n);
/* Gives out the n points of the batch, with the colours that are computed here. */
int track_give(struct track *track, int n, struct sh_err *err);
/* Takes frames of attributes and of colours. Points are given out with the last frame that they wait for; points that
 * wait for waveforms, too, come out at the end of their line. Attributes and colours of lost points are skipped. */
int track_attributes(struct track *track, const struct scanhead_frame *frame, struct sh_err *err);
int track_colours(struct track *track, const struct scanhead_frame *frame, struct sh_err *err);

/* ---- windows of waveforms (track_waves.c) */

/* Takes a frame of waveforms. Windows are only counted where the recorder has no place for them, or where the
 * beginning of their scan was lost. SH_ENOMEM. */
int track_waves(struct track *track, const struct scanhead_frame *frame, struct sh_err *err);
/* Returns the window in which an echo of this pulse lies, NULL where there is none. NULL also where the echo's range is
 * not known: in the geo layout, for a moving head in a CRS other than local. *at: the echo's place in the window, in
 * samples. The caller asks for pulses in rising order, until it calls track_clear_waves. */
const struct scanhead_wave *track_find_wave(struct track *track, const struct scanhead_point *point, uint64_t pulse,
                                            double *at);
/* Forgets all windows, and counts those that no point was in. */
void track_clear_waves(struct track *track);
void track_free_waves(struct track *track);

#endif
