/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/scan_wish.h"

void scan_wish_reset(struct scan_wish *wish, const struct protocol_identity *identity)
{
    *wish = (struct scan_wish){.start_ns = INT64_MAX, .identity = identity};
}

void scan_wish_make(struct scan_wish *wish, int64_t t_ns)
{
    wish->lasts = 1;
    wish->t_ns = t_ns;
}

void scan_wish_start(struct scan_wish *wish, int64_t t_ns)
{
    wish->start_ns = t_ns;
    if (wish->lasts) wish->t_ns = t_ns;
}

/* A scan that begins within a turn has its first whole turn after two turns at most. Before that the head spins up,
 * from the tick that was released when it was started: the session may be at an earlier one, by as much as frames wait
 * for it. */
int scan_wish_is_starting(const struct scan_wish *wish, const struct planar_scan *scan, int64_t now_ns)
{
    static const uint64_t NS_UHZ = UINT64_C(1000000000000000);
    const uint64_t lines_uhz = scan->head.lines_uhz;
    const int64_t wait_ns = wish->identity->queue_ns + wish->identity->spin_up_ns +
                            (lines_uhz != 0 ? (int64_t)(2 * NS_UHZ / lines_uhz) : 0);
    if (wish->start_ns == INT64_MAX || native_since_ns(now_ns, wish->start_ns) >= wait_ns) return 0;
    return scan->whole == NULL || scan->whole->scan_came_ns < wish->start_ns;
}

/* Returns whether a turn is of a scan that began after the wish. A recording may begin in the middle of a scan, whose
 * start is then before any wish. So the first frame counts as the scan's begin where the session has started the head.
 * Where it has not, it may have joined during a scan that is being stopped, so the first frame proves nothing. */
static int began_after(const struct scan_wish *wish, const struct planar_turn *turn)
{
    if (turn->scan_t0_ns > wish->t_ns) return 1;
    return turn->scan_came_ns >= wish->t_ns && turn->scan_came_ns >= wish->start_ns;
}

void scan_wish_take_turn(struct scan_wish *wish, const struct planar_scan *scan, const struct protocol_host *host)
{
    if (!wish->lasts) return;
    wish->lasts = !began_after(wish, scan->whole) && protocol_ask_state(host) != PROTOCOL_HEAD_SCANNING;
}
