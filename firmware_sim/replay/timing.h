/* SPDX-License-Identifier: MIT */
/* Finds the times at which a head released the frames of a recording.
 *
 * In: frames of the native protocol, in the order of the stream. Out: for each a device time in the tick at whose end
 * the head released it. Most frames have that time in their header. For points the time follows from their pulses: a
 * head releases packets of SCHEDULE_PACKET pulses, counted from the line's first, once the last pulse of a packet has
 * fired. Frames may end within a packet: those of moving meshes do at each tick. Such a frame goes out with its packet
 * at the latest, and earlier where the line or the scan ends within that packet. Then a later frame whose time is known
 * gives the time. In the pace `step` a head on a live platform does not wait for whole packets. The points of such a
 * head may be assigned a tick too late.
 *
 * The time is exact from the scan's start until the rates change, since the stream then says exactly when pulses fire.
 * After that, and where frames are missing, the time is good to a nanosecond, and about one frame in a million may be
 * assigned to the tick before or after its own. Pure; no allocation. */
#ifndef FIRMWARE_SIM_REPLAY_TIMING_H
#define FIRMWARE_SIM_REPLAY_TIMING_H

#include "drivers/protocol/native.h"

enum timing_kind {
    TIMING_KNOWN,   /* t_ns; frames before it went out by then */
    TIMING_FOLLOWS, /* as the frame before */
    TIMING_AT_MOST, /* t_ns, or the time of the next frame that is TIMING_KNOWN, where that is earlier */
    TIMING_STOPS,   /* the last line of a scan that was stopped: the time of the next event or telemetry; else t_ns */
};

struct timing {
    int has_rate;
    uint64_t num, den; /* a firing sequence, or a pulse, lasts num / den ns */
    uint32_t n_beams;  /* 0: a sequence is a pulse */
    uint32_t offset_ns[NATIVE_MAX_BEAMS];
    int knows_line; /* the next line's number, and its first pulse */
    uint32_t next_line;
    uint64_t next_first;
    uint64_t changed_at; /* first pulse at the present rates */
};

struct timing_moment {
    enum timing_kind kind;
    int64_t t_ns; /* device time */
};

/* timing begins as zeros. */
struct timing_moment timing_take(struct timing *timing, const struct native_header *header, const uint8_t *payload);

#endif
