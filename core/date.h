/* SPDX-License-Identifier: MIT */
/* Dates of the Gregorian calendar as days since 1970-01-01. Pure; years from 1970 on. */
#ifndef CORE_DATE_H
#define CORE_DATE_H

#include <stdint.h>

static inline int64_t date_days(int year, int month, int day)
{
    /* Years that begin in March, so that the leap day is the last; (153 m + 2) / 5 days lie before month
     * m. */
    int64_t y = year - (month <= 2), m = month > 2 ? month - 3 : month + 9;
    return 365 * y + y / 4 - y / 100 + y / 400 + (153 * m + 2) / 5 + day - 1 - 719468;
}

static inline void date_of_days(int64_t days, int *year, int *month, int *day)
{
    *year = (int)(1970 + days / 366);
    *month = 12;
    while (days >= date_days(*year + 1, 1, 1))
        ++*year;
    while (days < date_days(*year, *month, 1))
        --*month;
    *day = (int)(days - date_days(*year, *month, 1)) + 1;
}

/* A second of POSIX time as a date and a time of day. Not gmtime_r: in a time zone of the kind "right/" that of glibc
 * takes leap seconds off. */
struct date_time {
    int year, month, day, hour, minute, second;
};

/* Returns 0 for a time before 1970 or after 9999. */
static inline int date_of_posix(int64_t posix_s, struct date_time *out)
{
    const int64_t days = posix_s / 86400, s = posix_s % 86400;
    if (posix_s < 0 || days >= date_days(10000, 1, 1)) return 0;
    date_of_days(days, &out->year, &out->month, &out->day);
    out->hour = (int)(s / 3600);
    out->minute = (int)(s / 60 % 60);
    out->second = (int)(s % 60);
    return 1;
}

static inline int date_exists(int year, int month, int day)
{
    const int next = month == 12;
    return month >= 1 && month <= 12 && day >= 1 &&
           date_days(year, month, day) < date_days(year + next, next ? 1 : month + 1, 1);
}

#endif
