/* SPDX-License-Identifier: MIT */
#include "tests/fuzz/seal.h"

#include <string.h>

#include "drivers/protocol/native.h"
#include "drivers/protocol/native_encode.h"

void fuzz_seal(uint8_t *stream, size_t len)
{
    size_t at = 0;
    while (at + NATIVE_HEADER_LEN <= len) {
        uint8_t *frame = memchr(stream + at, NATIVE_SYNC, len - at);
        if (frame == NULL || frame + NATIVE_HEADER_LEN > stream + len) return;
        at = (size_t)(frame - stream);
        const size_t rest = len - at - NATIVE_HEADER_LEN;
        if (le_get32(frame + 4) > rest) le_put32(frame + 4, (uint32_t)rest);
        const size_t n = native_frame_len(frame);
        if ((frame[3] & 0x80) != 0)
            frame[3] &= 0x7f;
        else
            native_reseal(frame, n);
        at += n;
    }
}
