/* SPDX-License-Identifier: MIT */
/* The native protocol on a link: the stream as it is, and command lines with their replies (PROTOCOL.md).
 *
 * No function here does that work. The loop copies whole ticks of frames to the client without looking into them, up to
 * millions of pulses per second. It also carries out the command lines (firmware_sim/loop/session.c, pump_commands.c).
 * The reply to TIME:STEP comes after the frames of that time, and the client's next lines wait for this reply. A client
 * keeps control between its lines. */
#include <string.h>

#include "drivers/protocol/native.h"
#include "drivers/protocol/native_encode.h"
#include "drivers/protocol/protocol.h"

/* Marks the payload: an injected flip may change it alone, so that length and number in the header stay true. */
static void mark_payload(const uint8_t *frame, size_t len, uint8_t *mask)
{
    (void)frame;
    if (len > NATIVE_HEADER_LEN) memset(mask + NATIVE_HEADER_LEN, 0xff, len - NATIVE_HEADER_LEN);
}

const struct protocol_ops protocol_native = {
    .name = "native",
    .content = mark_payload,
    .reseal = native_reseal,
    .passes_native = 1,
};
