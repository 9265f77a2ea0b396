/* line -> native frames. Pure; writes only into dst; allocates nothing; real-time safe.
 *
 * Each function writes one whole frame (points: as many as needed) at dst and returns its length, or 0 when cap is
 * too small, or when the input breaks a limit of the wire (a block's dt_ns of 2^24 or more, a name beyond 255 bytes).
 * Frames leave with seq 0 and a header CRC to match; native_seal sets what is known only at release. */
#ifndef DRIVERS_PROTOCOL_NATIVE_ENCODE_H
#define DRIVERS_PROTOCOL_NATIVE_ENCODE_H

#include "core/line.h"
#include "drivers/protocol/native.h"

size_t native_encode_descriptor(uint8_t *dst, size_t cap, const struct native_descriptor *d, int64_t t_ns, int flags);
size_t native_encode_anchor(uint8_t *dst, size_t cap, const struct native_anchor *a, int64_t t_ns, int flags);
size_t native_encode_telemetry(uint8_t *dst, size_t cap, const struct native_telemetry *t, int64_t t_ns, int flags);
size_t native_encode_event(uint8_t *dst, size_t cap, const struct native_event *e, int64_t t_ns, int flags);

/* Block -> one or more points frames (NATIVE_MAX_POINTS each; cut between pulses, so that a pulse's echoes stay in one
 * frame), and behind each the frame of its attributes, where the block has some. scan_t0_ns: device time of the scan's
 * start. */
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
/* As many names as fit into one frame of at most max_payload bytes. `names` then holds those that are left. */
size_t native_encode_surfaces(uint8_t *dst, size_t cap, size_t max_payload, struct native_names *names, int64_t t_ns);

/* Sets the sequence number of the whole frame at frame and renews the header CRC. Returns the frame's length. */
size_t native_seal(uint8_t *frame, uint32_t seq);

/* Bytes that native_encode_points can need for n_points; and further ones for their attributes. */
size_t native_points_bound(uint32_t n_points);
size_t native_attributes_bound(uint32_t n_points);

#endif
