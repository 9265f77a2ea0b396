/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/pace.h"

static int64_t due_of(const struct pace *pace, uint64_t tick)
{
    if (tick < pace->together_until) tick = pace->together_until;
    return pace->epoch_ns + (int64_t)(tick + 1) * pace->tick_ns;
}

void pace_begin(struct pace *pace, int64_t now_ns)
{
    pace->expected_ns = now_ns;
    pace->credit_ns = 0;
    pace->asleep = 0;
}

/* Notes a call of pace_look. Until the next call the thread may sleep as long as it was told to. Any longer time means
 * that it stood still. */
static void note_look(struct pace *pace, int64_t now_ns)
{
    const int64_t still_ns = now_ns - pace->expected_ns;
    if (pace->asleep) lateness_note(&pace->wake, still_ns);
    if (still_ns > pace->credit_ns) pace->credit_ns = still_ns;
    pace->asleep = 0;
    pace->expected_ns = now_ns;
}

enum pace_step pace_look(struct pace *pace, uint64_t tick, int ready, int64_t now_ns, int64_t *until_ns)
{
    const int64_t late_ns = now_ns - due_of(pace, tick);
    note_look(pace, now_ns);
    if (late_ns < 0) {
        pace->asleep = 1;
        pace->expected_ns = *until_ns = due_of(pace, tick);
        return PACE_SLEEP;
    }
    if (ready) return PACE_RELEASE;
    if (late_ns > pace->late_ns + pace->credit_ns) return PACE_GIVE_UP;
    /* The thread looks again whenever a tick is due, so that note_look measures how long the machine stood still. */
    pace->expected_ns = *until_ns = now_ns + pace->tick_ns - (now_ns - pace->epoch_ns) % pace->tick_ns;
    return PACE_AWAIT;
}

void pace_released(struct pace *pace, uint64_t tick, int64_t now_ns)
{
    const int64_t late_ns = now_ns - due_of(pace, tick);
    struct device_counters *counters = pace->counters;
    lateness_note(&pace->late, late_ns);
    if (late_ns > pace->tick_ns) atomic_fetch_add(&counters->late_blocks, 1);
    if (late_ns > (int64_t)atomic_load(&counters->late_max_ns)) atomic_store(&counters->late_max_ns, (uint64_t)late_ns);
    if (late_ns <= pace->tick_ns) pace->credit_ns = 0; /* it has caught up */
}
