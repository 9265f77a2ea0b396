/* SPDX-License-Identifier: MIT */
#include "firmware_sim/base/clock.h"

#include <errno.h>
#include <sys/timex.h>
#include <time.h>

#include "core/monotonic.h"

static int64_t read_ns(clockid_t id)
{
    struct timespec t;
    clock_gettime(id, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

int64_t clock_now_ns(void)
{
    return monotonic_ns();
}

/* Reads the clock between two readings of the monotonic clock, a few times, since any may be interrupted; the tightest
 * reading counts. */
static int64_t system_ns(clockid_t id, int64_t now_ns)
{
    int64_t best_ns = INT64_MAX, result_ns = 0;
    for (int i = 0; i < 8; i++) {
        int64_t before_ns = clock_now_ns(), ns = read_ns(id), span_ns = clock_now_ns() - before_ns;
        if (span_ns >= best_ns) continue;
        best_ns = span_ns;
        result_ns = ns - (before_ns + span_ns / 2) + now_ns;
    }
    return result_ns;
}

int64_t clock_utc_ns(int64_t now_ns)
{
    return system_ns(CLOCK_REALTIME, now_ns);
}

int clock_tai_ns(int64_t now_ns, int64_t *tai_ns)
{
    struct timex timex = {.modes = 0};
    adjtimex(&timex);
    *tai_ns = system_ns(CLOCK_TAI, now_ns);
    return timex.tai != 0;
}

void clock_sleep_until_ns(int64_t t_ns)
{
    struct timespec t = {.tv_sec = t_ns / 1000000000, .tv_nsec = t_ns % 1000000000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR)
        continue;
}

double clock_cpu_s(void)
{
    return 1e-9 * (double)read_ns(CLOCK_PROCESS_CPUTIME_ID);
}

int64_t clock_thread_ns(void)
{
    return read_ns(CLOCK_THREAD_CPUTIME_ID);
}

int clock_read_of_thread(clockid_t clock, int64_t *ns)
{
    struct timespec t;
    if (clock_gettime(clock, &t) != 0) return 0;
    *ns = (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
    return 1;
}
