/* SPDX-License-Identifier: MIT */
/* The system's clocks, as firmware_sim reads them. core and drivers have core/monotonic.h instead.
 *
 * Out: ns, of CLOCK_MONOTONIC unless the name says otherwise. Device time (device.h) is a different time. */
#ifndef FIRMWARE_SIM_BASE_CLOCK_H
#define FIRMWARE_SIM_BASE_CLOCK_H

#include <stdint.h>
#include <time.h>

/* CLOCK_MONOTONIC in nanoseconds. Real-time safe. */
int64_t clock_now_ns(void);
/* UTC (ns since 1970, as POSIX counts) and TAI (ns since 1970-01-01 TAI) of the system's clocks at a
 * monotonic time near now. clock_tai_ns returns 0 where the system does not know the offset between TAI and UTC: then
 * *tai_ns is UTC. */
int64_t clock_utc_ns(int64_t now_ns);
int clock_tai_ns(int64_t now_ns, int64_t *tai_ns);
/* Sleeps until the monotonic time is reached; goes on after signals. Real-time safe. */
void clock_sleep_until_ns(int64_t t_ns);
/* Processor time of the whole process, seconds; of this thread, nanoseconds. */
double clock_cpu_s(void);
int64_t clock_thread_ns(void);
/* Processor time of another thread, by its clock (pthread_getcpuclockid). Returns 0 once the thread has ended. */
int clock_read_of_thread(clockid_t clock, int64_t *ns);

#endif
