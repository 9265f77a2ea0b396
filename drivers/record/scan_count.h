/* What a native stream holds, for the repair of .shs and .pcapng: the scans that its frames are of. Pure. */
#ifndef DRIVERS_RECORD_SCAN_COUNT_H
#define DRIVERS_RECORD_SCAN_COUNT_H

#include "drivers/protocol/native.h"

struct scan_count { /* begins as zeros */
    uint64_t n_scans;
    int within; /* points of a scan have come, or its descriptor */
};

/* Each frame, in order. A scan begins with a descriptor that is no repetition, or with points before any. */
static inline void scan_count_frame(struct scan_count *count, uint8_t type, uint8_t flags)
{
    const int begins = type == NATIVE_DESCRIPTOR && (flags & NATIVE_REPEAT) == 0;
    if (!begins && (type != NATIVE_POINTS || count->within)) return;
    count->n_scans++;
    count->within = 1;
}

#endif
