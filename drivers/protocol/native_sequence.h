/* SPDX-License-Identifier: MIT */
/* The sequence numbers of stream frames: which frame comes in order, which is repeated, which comes late, and which are
 * missing. LOSSES.md has the rules.
 *
 * Headers of whole frames go in, one after the other. A kind of notice comes out for each. Numbers are modulo 2^32
 * throughout. The header of a frame in order is only stored; only a jump is examined. */
#ifndef DRIVERS_PROTOCOL_NATIVE_SEQUENCE_H
#define DRIVERS_PROTOCOL_NATIVE_SEQUENCE_H

#include <stdint.h>

/* Frame header, 28 bytes:
 *  0 u8  sync 0xd5      1 u8 type     2 u8 version    3 u8 flags
 *  4 u32 payload length 8 u32 seq    12 u32 CRC-32C of the payload
 * 16 i64 device time, ns since power-up (of the first pulse, for points)
 * 24 u32 CRC-32C of bytes 0..23 */
struct native_header {
    uint8_t type, version, flags;
    uint32_t length, seq, payload_crc;
    int64_t t_ns;
};

/* Kinds of notices. The values are those of enum scanhead_notice_kind, which explains each. */
enum native_notice_kind {
    NATIVE_NO_NOTICE = 0,
    NATIVE_GAP = 1,
    NATIVE_REPEATED = 2,
    NATIVE_LATE = 3,
    NATIVE_RESTARTED = 4,
    NATIVE_BAD_PAYLOAD = 5,
    NATIVE_BAD_BYTES = 6,
    NATIVE_CUT = 7,
};

enum {
    NATIVE_SEEN = 256,       /* frames that a repeated one is compared with */
    NATIVE_GAPS = 64,        /* ranges of missing frames: a frame in one of them is late */
    NATIVE_GAP_MOST = 65536, /* frames in such a range: a larger one is not remembered */
    NATIVE_LATE_RUN = 256,   /* late frames with consecutive numbers, which together are another sequence */
};

struct native_sequence {
    int have;  /* 1: a counted frame has come. The members below are valid only then */
    int fresh; /* 1: another connection has begun, and no counted frame has come on it yet */
    uint32_t next;
    uint32_t last_late, late_run; /* the last late frame, and how many came in a row up to it */
    uint32_t again, again_next; /* how many repeated frames came last, with consecutive numbers up to again_next - 1 */
    uint32_t n_seen, n_gaps;    /* since the start; the last NATIVE_SEEN and NATIVE_GAPS of them are kept */
    struct native_header seen[NATIVE_SEEN];
    struct {
        uint32_t first, n;
    } gap[NATIVE_GAPS];
    struct native_header local; /* the frame before, if it was LOCAL; else type 0 */
};

/* A struct native_sequence begins as zeros: nothing has come yet. */

/* Takes the next whole frame. NATIVE_NO_NOTICE: in order, or LOCAL. NATIVE_GAP: *n frames from *first on are missing
 * before this frame. NATIVE_RESTARTED: the sequence begins anew with this frame. NATIVE_REPEATED, NATIVE_LATE: the
 * frame is to be dropped. Except for a gap, *first is the frame's own number and *n is 1. */
enum native_notice_kind native_sequence_take(struct native_sequence *sequence, const struct native_header *header,
                                             uint32_t *first, uint32_t *n);

/* Frames now come on another connection. The first of them is REPEATED only if it equals the last one of the old
 * connection, and it is never LATE: the head may have started again. */
void native_sequence_resume(struct native_sequence *sequence);

#endif
