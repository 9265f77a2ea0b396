/* SPDX-License-Identifier: MIT */
/* Calendar dates of the clock that a scanner shows: ns since 1970-01-01, no leap seconds. Pure. */
#ifndef DRIVERS_PROTOCOL_COLA_CLOCK_H
#define DRIVERS_PROTOCOL_COLA_CLOCK_H

#include <stdint.h>

struct cola_date {
    uint32_t year, month, day, hour, minute, second, us; /* month and day from 1 */
};

/* ns since 1970-01-01; negative ns count as 0. */
struct cola_date cola_date_of(int64_t ns);
/* 1, or 0: there is no such date between 1970 and 2199. */
int cola_date_ns(const struct cola_date *date, int64_t *ns);

#endif
