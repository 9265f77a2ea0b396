/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/latched.h"

#include <sched.h>
#include <string.h>

#include "drivers/protocol/native_encode.h"

static struct latched_frame *frame_of(struct latched *latched, uint8_t type)
{
    return type == NATIVE_DESCRIPTOR ? &latched->frame[0]
           : type == NATIVE_EMITTER  ? &latched->frame[1]
           : type == NATIVE_ANCHOR   ? &latched->frame[2]
                                     : NULL;
}

void latched_put(struct latched *latched, const uint8_t *frame)
{
    const size_t len = native_frame_len(frame);
    struct latched_frame *place = frame_of(latched, frame[1]);
    if (place == NULL || len > LATCHED_MAX_FRAME) return;
    atomic_fetch_add(&latched->version, 1);
    for (size_t at = 0; at < len; at += 8) {
        uint64_t word = 0;
        memcpy(&word, frame + at, len - at < 8 ? len - at : 8);
        atomic_store(&place->word[at / 8], word);
    }
    atomic_store(&place->len, (uint32_t)len);
    atomic_fetch_add(&latched->version, 1);
}

static uint32_t copy(struct latched *latched, uint8_t *dst)
{
    uint32_t n = 0;
    for (int i = 0; i < 3; i++) {
        struct latched_frame *place = &latched->frame[i];
        const uint32_t len = atomic_load(&place->len);
        for (uint32_t at = 0; at < len; at += 8) {
            const uint64_t word = atomic_load(&place->word[at / 8]);
            memcpy(dst + n + at, &word, 8);
        }
        n += len;
    }
    return n;
}

uint32_t latched_copy(struct latched *latched, uint8_t *dst, uint32_t *version)
{
    for (;;) {
        *version = atomic_load(&latched->version);
        const uint32_t n = *version % 2 == 0 ? copy(latched, dst) : 0;
        if (*version % 2 == 0 && atomic_load(&latched->version) == *version) {
            for (uint32_t at = 0; at < n; at += (uint32_t)native_frame_len(dst + at)) {
                dst[at + 3] |= NATIVE_REPEAT | NATIVE_LOCAL;
                native_finish_frame(dst + at, 0);
            }
            return n;
        }
        sched_yield();
    }
}
