/* The native protocol on a link: the stream as it is, and command lines with their replies (PROTOCOL.md).
 *
 * There is no module to call. The loop copies whole ticks of frames to the client, up to millions of pulses per second,
 * and looks into none. And it carries the lines out itself: the reply to TIME:STEP comes after the frames of the time
 * that it lets pass, lines wait for it, and a client keeps control between its lines (firmware_sim/loop/session.c,
 * pump_commands.c). */
#include "drivers/protocol/native_encode.h"
#include "drivers/protocol/protocol.h"

const struct protocol_ops protocol_native = {
    .name = "native",
    .reseal = native_reseal,
    .passes_native = 1,
};
