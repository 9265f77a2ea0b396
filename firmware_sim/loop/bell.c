/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/bell.h"

#include <errno.h>
#include <stdatomic.h>
#include <time.h>

void bell_create(struct bell *bell)
{
    sem_init(&bell->rings, 0, 0);
}

void bell_free(struct bell *bell)
{
    sem_destroy(&bell->rings);
}

/* Either this thread sees that an earlier ring was heard, and rings again; or the thread that heard it sees the change.
 * Both need a store to be ordered before a later load, which a semaphore by itself does not promise. */
void bell_ring(struct bell *bell, uint32_t n)
{
    int kept = 0;
    atomic_thread_fence(memory_order_seq_cst);
    sem_getvalue(&bell->rings, &kept);
    for (uint32_t i = (uint32_t)kept; i < n; i++)
        sem_post(&bell->rings);
}

void bell_sleep(struct bell *bell)
{
    sem_wait(&bell->rings); /* a signal may end it: then it returns without a ring */
    atomic_thread_fence(memory_order_seq_cst);
}

int bell_sleep_until(struct bell *bell, int64_t t_ns)
{
    const struct timespec until = {.tv_sec = t_ns / 1000000000, .tv_nsec = t_ns % 1000000000};
    const int over = sem_clockwait(&bell->rings, CLOCK_MONOTONIC, &until) != 0 && errno == ETIMEDOUT;
    atomic_thread_fence(memory_order_seq_cst);
    return over;
}
