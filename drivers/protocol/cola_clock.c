/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/cola_clock.h"

#include "core/date.h"

#define SECOND_NS INT64_C(1000000000)
enum { DAY_S = 86400, FIRST_YEAR = 1970, LAST_YEAR = 2199 };

struct cola_date cola_date_of(int64_t ns)
{
    const int64_t t_ns = ns < 0 ? 0 : ns, t_s = t_ns / SECOND_NS;
    const uint32_t s = (uint32_t)(t_s % DAY_S);
    int year, month, day;
    date_of_days(t_s / DAY_S, &year, &month, &day);
    return (struct cola_date){.year = (uint32_t)year,
                              .month = (uint32_t)month,
                              .day = (uint32_t)day,
                              .hour = s / 3600,
                              .minute = s / 60 % 60,
                              .second = s % 60,
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
