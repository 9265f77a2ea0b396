/* SPDX-License-Identifier: MIT */
/* The last descriptor, emitter and anchor that were released, latched for clients that join later.
 *
 * In: stream frames, at release. Out: copies of them, with the flags of a repetition. One thread writes, any number of
 * others read. There are no locks, and writing never waits. Real-time safe. */
#ifndef FIRMWARE_SIM_LOOP_KEPT_H
#define FIRMWARE_SIM_LOOP_KEPT_H

#include <stdatomic.h>
#include <stdint.h>

#include "drivers/protocol/native.h"

enum {
    KEPT_MAX_FRAME = NATIVE_HEADER_LEN + NATIVE_EMITTER_HEAD_LEN + NATIVE_MAX_BEAMS * NATIVE_BEAM_LEN,
    KEPT_WORDS = (KEPT_MAX_FRAME + 7) / 8,
    KEPT_MAX_BYTES = 3 * KEPT_WORDS * 8,
};

struct kept {
    _Atomic uint32_t version; /* odd: they are being changed */
    struct kept_frame {
        _Atomic uint32_t len; /* 0: there is none */
        _Atomic uint64_t word[KEPT_WORDS];
    } frame[3];
};

/* Latches a frame if it is a descriptor, an emitter or an anchor. */
void kept_put(struct kept *kept, const uint8_t *frame);
/* Copies the latched frames, one after the other, descriptor first; dst holds KEPT_MAX_BYTES. Returns their length.
 * *version changes with every frame that is latched. */
uint32_t kept_copy(struct kept *kept, uint8_t *dst, uint32_t *version);

#endif
