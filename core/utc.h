/* SPDX-License-Identifier: MIT */
/* UTC, TAI and GPS time.
 *
 * Inside the program there is one continuous scale: TAI in nanoseconds since 1970-01-01T00:00:00 TAI, as CLOCK_TAI
 * counts. Dates from 1972 to 2199 are allowed, well within int64. UTC is TAI less a whole number of seconds
 * that a table gives; during one of its leap seconds the time of day reads 23:59:60. GPS time is TAI less 19 s, counted
 * from 1980-01-06T00:00:00Z in weeks of 604,800 s (IS-GPS-200, 3.3.4 and 6.2.4); GPS time needs no table. POSIX time
 * has no leap seconds: 23:59:60 has the number of the second after it (POSIX.1, 4.16).
 *
 * The table is IERS Bulletin C's. The table has an end: leap seconds after expires_s are not known yet.
 * Pure; any thread. */
#ifndef CORE_UTC_H
#define CORE_UTC_H

#include <stdint.h>

#include "core/err.h"

enum { UTC_MAX_LEAPS = 64, UTC_TEXT_LEN = 32, UTC_FIRST_YEAR = 1972, UTC_LAST_YEAR = 2199 };

#define UTC_SECOND_NS ((int64_t)1000000000)

struct utc_leap {
    int64_t posix_s;       /* the second after the leap second */
    int32_t tai_minus_utc; /* TAI is ahead of UTC by so many seconds, from posix_s on */
};

struct utc_table {
    uint32_t n; /* at least 1, ascending */
    struct utc_leap leap[UTC_MAX_LEAPS];
    int64_t expires_s; /* POSIX second up to which the table is complete */
};

struct utc_time {
    int year, month, day, hour, minute; /* month and day from 1 */
    int second;                         /* 60 in a leap second */
    int32_t ns;
};

struct utc_gps {
    int64_t week; /* since 1980-01-06, not cut to 10 or 13 bits */
    int64_t ns;   /* of the week */
};

/* The leap seconds that were known when the program was written. */
const struct utc_table *utc_table_builtin(void);
/* The text of a leap-seconds.list (IERS, NIST, tzdata): NTP seconds and TAI-UTC, `#@` the expiry. On failure
 * out is unspecified. The error names the line, unless only the whole table is wrong: no entry, or no later expiry. */
int utc_table_parse(const char *text, struct utc_table *out, struct sh_err *err);
/* Adds a leap second before this POSIX second, which need not be a full minute. 0: there is one already, the table is
 * full, or the second is before the first entry (1972), where UTC has no whole leap seconds. */
int utc_table_add(struct utc_table *table, int64_t posix_s);

void utc_from_tai(const struct utc_table *table, int64_t tai_ns, struct utc_time *out);
/* SH_EINPUT for a date outside 1972..2199, a date or time of day that does not exist, or a second 60 other than that of
 * a leap second at the end of a day. A leap second within a day (utc_table_add) counts from the next midnight on. */
int utc_to_tai(const struct utc_table *table, const struct utc_time *utc, int64_t *tai_ns, struct sh_err *err);

int64_t utc_posix_from_tai(const struct utc_table *table, int64_t tai_ns); /* ns since 1970 */
int64_t utc_tai_from_posix(const struct utc_table *table, int64_t posix_ns);

/* GPS time in nanoseconds since its epoch, and as week and time of week. */
int64_t utc_gps_ns(int64_t tai_ns);
struct utc_gps utc_gps_week(int64_t tai_ns);

/* ISO 8601: "2016-12-31T23:59:60Z", with up to 9 decimals of the second. Nothing else is taken. */
int utc_parse(const char *text, struct utc_time *out, struct sh_err *err);
/* Writes a time in the form that utc_parse reads. The second has 0 to 9 decimals. Further decimals are cut
 * off, not rounded, so that no second begins early. */
void utc_format(const struct utc_time *utc, int decimals, char buf[UTC_TEXT_LEN]);

#endif
