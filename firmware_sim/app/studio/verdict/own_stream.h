/* SPDX-License-Identifier: MIT */
/* The head's own stream, read within this process, where faults of links don't reach: whether it scans, and each point
 * that a pulse had. */
#ifndef FIRMWARE_SIM_APP_STUDIO_VERDICT_OWN_STREAM_H
#define FIRMWARE_SIM_APP_STUDIO_VERDICT_OWN_STREAM_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>

#include "core/err.h"
#include "drivers/host/scanhead.h"
#include "drivers/link/link.h"

struct own_frame {
    uint32_t seq;
    int64_t t_ns; /* device time of its first pulse */
    size_t end;   /* index after its last point */
};

struct own_stream {
    struct link_spec link; /* for the loop, beside those of the configuration */
    struct scanhead *sh;
    pthread_t thread;
    int running, keeps;        /* keeps: the points, too */
    atomic_int is_up;          /* the head has booted */
    _Atomic int64_t points_ns; /* device time of the last frame of points; 0: none so far */
    /* The thread has these, until it is joined: */
    struct own_frame *frame;
    double (*xyz_m)[3]; /* in the stream's coordinate frame; for polar points of a moving head, in the scene's */
    size_t n_frames, room_frames, n, room;
    struct scanhead_info info; /* of the first points */
    int have_info, is_moved;   /* is_moved: the head stood in several places */
    char short_of[256];        /* why points are missing; empty: none is */
};

int own_stream_open(struct own_stream *stream, struct sh_err *err);
int own_stream_start(struct own_stream *stream, struct sh_err *err);
/* To be called after the head has ended. */
void own_stream_join(struct own_stream *stream);
void own_stream_close(struct own_stream *stream);

#endif
