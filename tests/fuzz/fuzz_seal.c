/* SPDX-License-Identifier: MIT */
/* This fuzzes faults that no checksum shows: content() and reseal() of each protocol, on any bytes. The input is a byte
 * (which), then the unit. Changes must lie in the unit, a unit sealed twice must equal one sealed once, and content()
 * must change nothing. */
#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/protocol.h"
#include "tests/fuzz/rig.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct fuzz_bytes in = {data, size};
    const struct protocol_ops *ops = protocol_ops_get((enum protocol_id)(fuzz_u8(&in) % PROTOCOL_N));
    if (ops == NULL || in.n == 0 || in.n > 4096) return 0;
    uint8_t *unit = malloc(in.n), *mask = calloc(1, in.n), *again = malloc(in.n);
    memcpy(unit, in.p, in.n);
    if (ops->reseal != NULL) ops->reseal(unit, in.n);
    memcpy(again, unit, in.n);
    if (ops->reseal != NULL) ops->reseal(again, in.n);
    fuzz_must(memcmp(unit, again, in.n) == 0, "sealed twice is as sealed once");
    if (ops->content != NULL) ops->content(unit, in.n, mask);
    fuzz_must(memcmp(unit, again, in.n) == 0, "asking for the content changes nothing");
    for (size_t i = 0; i < in.n; i++)
        unit[i] ^= mask[i];
    if (ops->reseal != NULL) ops->reseal(unit, in.n);
    free(unit);
    free(mask);
    free(again);
    return 0;
}
