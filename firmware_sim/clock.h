/* The one clock: real, fast and stepped time behind one wait. */
#ifndef FIRMWARE_SIM_CLOCK_H
#define FIRMWARE_SIM_CLOCK_H

#include <stdint.h>

/* CLOCK_MONOTONIC in nanoseconds. Real-time safe. */
int64_t clock_now_ns(void);
/* Sleeps until the monotonic time is reached; goes on after signals. Real-time safe. */
void clock_sleep_until_ns(int64_t t_ns);
/* Processor time of the whole process, seconds. */
double clock_cpu_s(void);

#endif
