/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/wakeup.h"

#include <errno.h>
#include <stdatomic.h>
#include <time.h>

void wakeup_create(struct wakeup *wakeup)
{
    sem_init(&wakeup->signals, 0, 0);
}

void wakeup_free(struct wakeup *wakeup)
{
    sem_destroy(&wakeup->signals);
}

/* The caller has changed something before. Either this thread sees that an earlier signal has been taken, and signals
 * again; or the thread that takes the earlier signal sees what the caller has changed. Both cases need a store to be
 * ordered before a later load, which a semaphore by itself does not promise. */
void wakeup_signal(struct wakeup *wakeup, uint32_t n)
{
    int kept = 0;
    atomic_thread_fence(memory_order_seq_cst);
    sem_getvalue(&wakeup->signals, &kept);
    for (uint32_t i = (uint32_t)kept; i < n; i++)
        sem_post(&wakeup->signals);
}

void wakeup_sleep(struct wakeup *wakeup)
{
    sem_wait(&wakeup->signals); /* it may also return, without a wake-up, after a POSIX signal (EINTR) */
    atomic_thread_fence(memory_order_seq_cst);
}

int wakeup_sleep_until(struct wakeup *wakeup, int64_t t_ns)
{
    const struct timespec until = {.tv_sec = t_ns / 1000000000, .tv_nsec = t_ns % 1000000000};
    const int over = sem_clockwait(&wakeup->signals, CLOCK_MONOTONIC, &until) != 0 && errno == ETIMEDOUT;
    atomic_thread_fence(memory_order_seq_cst);
    return over;
}
