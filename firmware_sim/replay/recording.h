/* SPDX-License-Identifier: MIT */
/* A recording, frame by frame, with the time at which the head released each.
 *
 * In: a file of the native protocol's frames (.shs, .pcapng), read by the client library. Out: its frames as they are,
 * in their order. Frames that came twice or too late, frames with wrong contents, and bytes that are in no frame, are
 * left out and counted. Only the frames that wait for their time (timing.h) are in memory. One thread. */
#ifndef FIRMWARE_SIM_REPLAY_RECORDING_H
#define FIRMWARE_SIM_REPLAY_RECORDING_H

#include "drivers/host/scanhead.h"
#include "firmware_sim/replay/timing.h"

enum { RECORDING_QUEUE = 256 };

struct recording_frame {
    const uint8_t *bytes; /* the recording's, until the next call */
    uint32_t len;
    int64_t t_ns;  /* the recording's device time: a moment in the tick at whose end it was released */
    int restarted; /* another head, or another recording, begins with it: device time may be any */
};

struct recording_item {
    uint8_t *bytes;
    size_t room;
    uint32_t len;
    int64_t t_ns;
    int is_known, restarted;
    enum timing_kind kind;
};

struct recording {
    char path[4096];
    struct scanhead *stream;
    struct timing timing;
    /* frames that wait, item i at i % RECORDING_QUEUE */
    struct recording_item item[RECORDING_QUEUE];
    uint32_t first, n;
    int64_t last_t_ns;  /* of the last frame that was given */
    int64_t first_t_ns; /* of the first frame with a time of its own, once it was given */
    int has_first;
    int at_end, restarted;
};

/* Opens the file as a stream of the client library. Even a path such as tcp:1.shs names a file here. */
int recording_open_file(const char *path, struct scanhead **stream, struct sh_err *err);
/* recording: zeros. SH_EINPUT, SH_EIO with the path. recording_close is needed after a failure, too. */
int recording_open(struct recording *recording, const char *path, struct sh_err *err);
/* Finds the device time of the last frame in a file of frames (.shs) that is not marked LOCAL, and reads only the
 * file's end. Returns 1; 0: that end has no such frame, or the file is of another form, or can't be read. */
int recording_last_ns(const char *path, int64_t *t_ns);
/* Starts again at the beginning. */
int recording_rewind(struct recording *recording, struct sh_err *err);
/* 1: *frame is the next one; 0: there is no more; or an error. */
int recording_next(struct recording *recording, struct recording_frame *frame, struct sh_err *err);
/* Counts of what was left out so far. */
void recording_stats(const struct recording *recording, struct scanhead_stats *stats);
void recording_close(struct recording *recording);

#endif
