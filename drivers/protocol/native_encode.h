/* SPDX-License-Identifier: MIT */
/* Writes native frames from the head's data: descriptor, anchor, lines, poses, names. native.h reads them.
 *
 * Each function writes one whole frame at dst (points: as many frames as needed) and returns the length. It
 * returns 0 when cap is too small, or when the input breaks a limit of the wire: a block's dt_ns of 2^24 or
 * more, a name of more than 255 bytes. t_ns is the device time in the header, flags are enum native_flags.
 * Frames have sequence number 0 until native_finish_frame. Pure; writes only into dst; allocates nothing; real-time
 * safe; any thread. */
#ifndef DRIVERS_PROTOCOL_NATIVE_ENCODE_H
#define DRIVERS_PROTOCOL_NATIVE_ENCODE_H

#include "core/line.h"
#include "drivers/protocol/native.h"

size_t native_encode_descriptor(uint8_t *dst, size_t cap, const struct native_descriptor *d, int64_t t_ns, int flags);
size_t native_encode_anchor(uint8_t *dst, size_t cap, const struct native_anchor *a, int64_t t_ns, int flags);
/* beam: e->n_beams of them, at most NATIVE_MAX_BEAMS. */
size_t native_encode_emitter(uint8_t *dst, size_t cap, const struct native_emitter *e, const struct native_beam *beam,
                             int64_t t_ns, int flags);
size_t native_encode_telemetry(uint8_t *dst, size_t cap, const struct native_telemetry *t, int64_t t_ns, int flags);
size_t native_encode_event(uint8_t *dst, size_t cap, const struct native_event *e, int64_t t_ns, int flags);

/* A block as one or more points frames of at most NATIVE_MAX_POINTS. After each points frame come the frames of its
 * attributes, its colours and its waveforms, where the block has some. Cuts lie between pulses, so that a pulse's
 * echoes stay in one frame. scan_t0_ns: device time of the scan's start. */
size_t native_encode_points(uint8_t *dst, size_t cap, const struct line_block *block, int64_t scan_t0_ns);
size_t native_encode_line_end(uint8_t *dst, size_t cap, const struct line_end *end, int64_t scan_t0_ns);

/* n <= NATIVE_MAX_POSES poses in one frame. */
size_t native_encode_poses(uint8_t *dst, size_t cap, const struct native_pose *pose, uint32_t n, int64_t t_ns,
                           int flags);

/* Names of n labels from `first` on. name() gives object and material of one. */
struct native_names {
    uint32_t first, n;
    void (*name)(void *ctx, uint32_t label, const char **object, const char **material);
    void *ctx;
};
/* Encodes as many names as fit into one frame with at most max_payload bytes of payload. `names` then holds the
 * rest. */
size_t native_encode_surfaces(uint8_t *dst, size_t cap, size_t max_payload, struct native_names *names, int64_t t_ns);

/* Sets the sequence number of a whole frame, and renews the CRC of its header. Returns the frame's length. */
size_t native_finish_frame(uint8_t *frame, uint32_t seq);

/* Makes both checksums of a frame of len bytes right, whatever is in it. */
void native_reseal(uint8_t *frame, size_t len);

/* The most bytes that native_encode_points can need for n_points, and the most that their attributes (with deviations),
 * their colours and their waveforms add. */
size_t native_points_bound(uint32_t n_points);
size_t native_attributes_bound(uint32_t n_points);
size_t native_colours_bound(uint32_t n_points);
size_t native_waves_bound(uint32_t n_points, uint32_t n_windows, uint32_t n_samples);

#endif
