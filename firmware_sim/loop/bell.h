/* SPDX-License-Identifier: MIT */
/* A bell: threads sleep until something has changed, and whoever changed it rings.
 *
 * The rule that keeps all of them alive: change first, then ring; and look again after each sleep. A ring that finds
 * nobody asleep is kept, so the next one who would fall asleep looks again instead. Rings are not counted: however
 * many there were, each sleeper looks once. So ringing costs next to nothing while nobody sleeps.
 *
 * Thread: any. bell_ring is real-time safe. */
#ifndef FIRMWARE_SIM_LOOP_BELL_H
#define FIRMWARE_SIM_LOOP_BELL_H

#include <semaphore.h>
#include <stdint.h>

struct bell {
    sem_t rings; /* that nobody has heard yet */
};

void bell_create(struct bell *bell);
void bell_free(struct bell *bell);
/* n threads look again: those asleep, or the next ones who would fall asleep. */
void bell_ring(struct bell *bell, uint32_t n);
/* Sleeps until it is rung. May return without a ring. */
void bell_sleep(struct bell *bell);
/* Likewise, at most until a time of clock_now_ns(). Returns 1 when that is over. */
int bell_sleep_until(struct bell *bell, int64_t t_ns);

#endif
