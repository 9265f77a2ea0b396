/* SPDX-License-Identifier: MIT */
/* The last descriptor, emitter and anchor that were released, latched for clients that join later.
 *
 * In: stream frames, at release. Out: copies of them, with the flags of a repetition. One thread writes, any number of
 * others read. There are no locks. Writing never waits, and is real-time safe. A reader copies again, and yields the
 * processor, while a frame is being latched. */
#ifndef FIRMWARE_SIM_LOOP_LATCHED_H
#define FIRMWARE_SIM_LOOP_LATCHED_H

#include <stdatomic.h>
#include <stdint.h>

#include "drivers/protocol/native.h"

enum {
    LATCHED_MAX_FRAME = NATIVE_HEADER_LEN + NATIVE_EMITTER_HEAD_LEN + NATIVE_MAX_BEAMS * NATIVE_BEAM_LEN,
    LATCHED_WORDS = (LATCHED_MAX_FRAME + 7) / 8,
    LATCHED_MAX_BYTES = 3 * LATCHED_WORDS * 8,
};

struct latched {
    _Atomic uint32_t version; /* odd: they are being changed */
    struct latched_frame {
        _Atomic uint32_t len; /* 0: there is none */
        _Atomic uint64_t word[LATCHED_WORDS];
    } frame[3];
};

/* Latches a frame if it is a descriptor, an emitter or an anchor. */
void latched_put(struct latched *latched, const uint8_t *frame);
/* Copies the latched frames, one after the other, descriptor first; dst holds LATCHED_MAX_BYTES. Returns their length.
 * *version changes with every frame that is latched. */
uint32_t latched_copy(struct latched *latched, uint8_t *dst, uint32_t *version);

#endif
