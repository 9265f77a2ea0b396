/* SPDX-License-Identifier: MIT */
/* A wake-up for threads: they sleep until something has changed, and the thread that changed it signals.
 *
 * No wake-up is lost where both sides keep one rule: change first, then signal; look again after each sleep. A signal
 * that finds nobody asleep is stored: the next thread that would sleep looks again instead. Several signals that nobody
 * has taken yet count as one. So a signal costs next to nothing while nobody sleeps.
 *
 * Thread: any. wakeup_signal is real-time safe. */
#ifndef FIRMWARE_SIM_LOOP_WAKEUP_H
#define FIRMWARE_SIM_LOOP_WAKEUP_H

#include <semaphore.h>
#include <stdint.h>

struct wakeup {
    sem_t signals; /* that nobody has taken yet */
};

void wakeup_create(struct wakeup *wakeup);
void wakeup_free(struct wakeup *wakeup);
/* Makes n threads look again: those that sleep, or the next that would. */
void wakeup_signal(struct wakeup *wakeup, uint32_t n);
/* Sleeps until there is a signal. May return without one. */
void wakeup_sleep(struct wakeup *wakeup);
/* The same, but at most until a time of clock_now_ns(). Returns 1 when that time is over. */
int wakeup_sleep_until(struct wakeup *wakeup, int64_t t_ns);

#endif
