/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/cola_clock.h"

#include "core/date.h"

#define SECOND_NS INT64_C(1000000000)
enum { DAY_S = 86400, FIRST_YEAR = 1970, LAST_YEAR = 2199 };

struct cola_date cola_date_of(int64_t ns)
{
    const int64_t t_ns = ns < 0 ? 0 : ns;
    struct date_time at = {0};
    date_of_posix(t_ns / SECOND_NS, &at); /* 64 bits of nanoseconds end in 2262 */
    return (struct cola_date){.year = (uint32_t)at.year,
                              .month = (uint32_t)at.month,
                              .day = (uint32_t)at.day,
                              .hour = (uint32_t)at.hour,
                              .minute = (uint32_t)at.minute,
                              .second = (uint32_t)at.second,
                              .us = (uint32_t)(t_ns % SECOND_NS / 1000)};
}

int cola_date_ns(const struct cola_date *d, int64_t *ns)
{
    const int year = (int)d->year, month = (int)d->month, day = (int)d->day;
    if (d->year < FIRST_YEAR || d->year > LAST_YEAR || !date_exists(year, month, day) || d->hour > 23 ||
        d->minute > 59 || d->second > 59 || d->us > 999999)
        return 0;
    const int64_t s = date_days(year, month, day) * DAY_S + d->hour * 3600 + d->minute * 60 + d->second;
    *ns = s * SECOND_NS + (int64_t)d->us * 1000;
    return 1;
}
