/* SPDX-License-Identifier: MIT */
/* Private to drivers/record/track*.c: points that wait for attributes and colours. */
#ifndef DRIVERS_RECORD_TRACK_INSIDE_H
#define DRIVERS_RECORD_TRACK_INSIDE_H

#include "drivers/record/track.h"

/* Whether frames that follow the points are wanted, and sent. */
int track_waits(const struct track *track);
/* To be called before the points of a frame, when no points wait any more. SH_ENOMEM. */
int track_begin_waiting(struct track *track, struct sh_err *err);
/* Keeps the n points of the batch. */
void track_keep(struct track *track, int n);
/* Gives out the n points of the batch, with the colours that are made here. */
int track_give(struct track *track, int n, struct sh_err *err);
/* Takes frames of attributes and of colours. With the last one that points wait for, these come out. Attributes and
 * colours of lost points are skipped. */
int track_attributes(struct track *track, const struct scanhead_frame *frame, struct sh_err *err);
int track_colours(struct track *track, const struct scanhead_frame *frame, struct sh_err *err);

#endif
