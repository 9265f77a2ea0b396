/* SPDX-License-Identifier: MIT */
/* A wake-up for threads: they sleep until something has changed, and the thread that changed it rings.
 *
 * No wake-up is lost where both sides keep one rule: change first, then ring; look again after each sleep. A ring that
 * finds nobody asleep is kept: the next thread that would sleep looks again instead. Several rings that nobody has
 * heard yet count as one. So ringing costs next to nothing while nobody sleeps.
 *
 * Thread: any. wakeup_signal is real-time safe. */
#ifndef FIRMWARE_SIM_LOOP_WAKEUP_H
#define FIRMWARE_SIM_LOOP_WAKEUP_H

#include <semaphore.h>
#include <stdint.h>

struct wakeup {
    sem_t rings; /* rings that nobody has heard yet */
};

void wakeup_create(struct wakeup *wakeup);
void wakeup_free(struct wakeup *wakeup);
/* Makes n threads look again: those that sleep, or the next that would. */
void wakeup_signal(struct wakeup *wakeup, uint32_t n);
/* Sleeps until it is rung. May return without a ring. */
void wakeup_sleep(struct wakeup *wakeup);
/* The same, but at most until a time of clock_now_ns(). Returns 1 when that time is over. */
int wakeup_sleep_until(struct wakeup *wakeup, int64_t t_ns);

#endif
