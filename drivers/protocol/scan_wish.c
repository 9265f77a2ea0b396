/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/scan_wish.h"

void scan_wish_make(struct scan_wish *wish, const struct planar_scan *scan)
{
    *wish = (struct scan_wish){1, scan->scan};
}

/* A scan of a set number of frames ends by itself. Its last turn may come when the head spins down already. It fulfils
 * the wish if the wish is older than the scan. */
void scan_wish_take_turn(struct scan_wish *wish, const struct planar_scan *scan, const struct protocol_host *host)
{
    if (!wish->lasts) return;
    const int is_asked_for = scan->head.frames != 0 && scan->scan != wish->scan;
    wish->lasts = !is_asked_for && protocol_ask_state(host) != PROTOCOL_HEAD_SCANNING;
}
