/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/cola_clock.h"

#define SECOND_NS INT64_C(1000000000)
enum { DAY_S = 86400, FIRST_YEAR = 1970, LAST_YEAR = 2199 };

static uint32_t is_leap(uint32_t year)
{
    return (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
}

static uint32_t days_of_month(uint32_t year, uint32_t month)
{
    static const uint8_t days[12] = {31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
    return days[month - 1] + (month == 2 ? is_leap(year) : 0);
}

struct cola_date cola_date_of(int64_t ns)
{
    const uint64_t t_ns = ns < 0 ? 0 : (uint64_t)ns, t_s = t_ns / (uint64_t)SECOND_NS;
    uint64_t days = t_s / DAY_S;
    const uint32_t s = (uint32_t)(t_s % DAY_S);
    struct cola_date d = {.year = FIRST_YEAR,
                          .month = 1,
                          .hour = s / 3600,
                          .minute = s / 60 % 60,
                          .second = s % 60,
                          .us = (uint32_t)(t_ns % (uint64_t)SECOND_NS / 1000)};
    for (; days >= 365 + is_leap(d.year); d.year++)
        days -= 365 + is_leap(d.year);
    for (; days >= days_of_month(d.year, d.month); d.month++)
        days -= days_of_month(d.year, d.month);
    d.day = (uint32_t)days + 1;
    return d;
}

int cola_date_ns(const struct cola_date *d, int64_t *ns)
{
    int64_t days = 0;
    if (d->year < FIRST_YEAR || d->year > LAST_YEAR || d->month < 1 || d->month > 12 || d->day < 1 ||
        d->day > days_of_month(d->year, d->month) || d->hour > 23 || d->minute > 59 || d->second > 59 || d->us > 999999)
        return 0;
    for (uint32_t y = FIRST_YEAR; y < d->year; y++)
        days += 365 + is_leap(y);
    for (uint32_t m = 1; m < d->month; m++)
        days += days_of_month(d->year, m);
    const int64_t s = (days + d->day - 1) * DAY_S + d->hour * 3600 + d->minute * 60 + d->second;
    *ns = s * SECOND_NS + (int64_t)d->us * 1000;
    return 1;
}
