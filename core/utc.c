/* SPDX-License-Identifier: MIT */
#include "core/utc.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/date.h"

enum { DAY_S = 86400 };
static const int64_t GPS_EPOCH_TAI_S = 315964800 + 19; /* 1980-01-06 is day 3,657; TAI-UTC was 19 s */
static const int64_t NTP_TO_POSIX_S = 2208988800;      /* 1900 to 1970: 70 years, 17 leap days */
static const int64_t WEEK_NS = 604800 * UTC_SECOND_NS;

const struct utc_table *utc_table_builtin(void)
{
    static const struct utc_table table = {
        .n = 28,
        .leap = {{63072000, 10},   {78796800, 11},   {94694400, 12},  {126230400, 13},  {157766400, 14},
                 {189302400, 15},  {220924800, 16},  {252460800, 17}, {283996800, 18},  {315532800, 19},
                 {362793600, 20},  {394329600, 21},  {425865600, 22}, {489024000, 23},  {567993600, 24},
                 {631152000, 25},  {662688000, 26},  {709948800, 27}, {741484800, 28},  {773020800, 29},
                 {820454400, 30},  {867715200, 31},  {915148800, 32}, {1136073600, 33}, {1230768000, 34},
                 {1341100800, 35}, {1435708800, 36}, {1483228800, 37}},
        .expires_s = 1782604800, /* 2026-06-28 */
    };
    return &table;
}

/* ---- the file */

static int parse_line(const char *line, int number, struct utc_table *out, struct sh_err *err)
{
    char *end;
    long long ntp_s = strtoll(line, &end, 10);
    long offset = strtol(end, &end, 10);
    end += strspn(end, " \t\r");
    if (ntp_s < 0 || offset < -1000 || offset > 1000) return sh_fail(err, SH_EFORMAT, "line %d: out of range", number);
    struct utc_leap leap = {ntp_s - NTP_TO_POSIX_S, (int32_t)offset};
    if ((*end != '#' && *end != '\n' && *end != '\0') || leap.posix_s % DAY_S != 0)
        return sh_fail(err, SH_EFORMAT, "line %d: allowed are the NTP seconds of a midnight and TAI-UTC", number);
    if (out->n == UTC_MAX_LEAPS)
        return sh_fail(err, SH_EFORMAT, "line %d: more than %d leap seconds", number, UTC_MAX_LEAPS);
    /* The first entry is a step of one second, too, as if 9 s stood before it. */
    struct utc_leap before = out->n != 0 ? out->leap[out->n - 1] : (struct utc_leap){0, 9};
    if (labs(offset - before.tai_minus_utc) != 1 || leap.posix_s <= before.posix_s ||
        (out->n == 0 && (leap.posix_s != 63072000 || offset != 10)))
        return sh_fail(err, SH_EFORMAT, "line %d: allowed is the table from 1972-01-01 (10 s) on in steps of 1 s",
                       number);
    out->leap[out->n++] = leap;
    return SH_OK;
}

/* Returns 0 for a date that can't be the end of a table. The table is then refused, as 0 is before its last entry. */
static int64_t parse_expiry(const char *text)
{
    const long long ntp_s = strtoll(text, NULL, 10), last_s = date_days(UTC_LAST_YEAR + 1, 1, 1) * DAY_S;
    return ntp_s < NTP_TO_POSIX_S || ntp_s - NTP_TO_POSIX_S > last_s ? 0 : ntp_s - NTP_TO_POSIX_S;
}

int utc_table_parse(const char *text, struct utc_table *out, struct sh_err *err)
{
    memset(out, 0, sizeof *out);
    int rc = SH_OK, number = 1;
    for (const char *line = text; *line != '\0' && rc == SH_OK; number++) {
        const char *p = line + strspn(line, " \t\r");
        if (strncmp(p, "#@", 2) == 0)
            out->expires_s = parse_expiry(p + 2);
        else if (*p != '#' && *p != '\n' && *p != '\0')
            rc = parse_line(p, number, out, err);
        line += strcspn(line, "\n");
        line += *line == '\n';
    }
    if (rc != SH_OK) return rc;
    if (out->n == 0 || out->expires_s <= out->leap[out->n - 1].posix_s)
        return sh_fail(err, SH_EFORMAT,
                       "not a table of leap seconds that expires (#@) after its last entry and by the end of %d",
                       UTC_LAST_YEAR);
    return SH_OK;
}

int utc_table_add(struct utc_table *table, int64_t posix_s)
{
    uint32_t i = table->n;
    if (table->n == UTC_MAX_LEAPS || posix_s < table->leap[0].posix_s) return 0;
    while (i > 1 && table->leap[i - 1].posix_s > posix_s)
        i--;
    if (table->leap[i - 1].posix_s == posix_s) return 0;
    memmove(&table->leap[i + 1], &table->leap[i], (table->n++ - i) * sizeof table->leap[0]);
    table->leap[i] = (struct utc_leap){posix_s, table->leap[i - 1].tai_minus_utc + 1};
    while (++i < table->n)
        table->leap[i].tai_minus_utc++;
    return 1;
}

/* ---- scales */

static int64_t floor_div(int64_t a, int64_t b)
{
    return a / b - (a % b < 0);
}

/* The entry in force at a second of POSIX time, or of TAI. */
static uint32_t entry_at(const struct utc_table *table, int64_t s, int is_tai)
{
    uint32_t i = table->n - 1;
    while (i > 0 && s < table->leap[i].posix_s + (is_tai ? table->leap[i].tai_minus_utc : 0))
        i--;
    return i;
}

void utc_from_tai(const struct utc_table *table, int64_t tai_ns, struct utc_time *out)
{
    int64_t tai_s = floor_div(tai_ns, UTC_SECOND_NS);
    uint32_t i = entry_at(table, tai_s, 1);
    int64_t posix_s = tai_s - table->leap[i].tai_minus_utc;
    /* In an inserted second, the old offset already gives the midnight of the next entry. */
    int leap = i + 1 < table->n && posix_s >= table->leap[i + 1].posix_s;
    posix_s -= leap;
    int64_t days = floor_div(posix_s, DAY_S);
    int of_day = (int)(posix_s - days * DAY_S);
    date_of_days(days, &out->year, &out->month, &out->day);
    out->hour = of_day / 3600;
    out->minute = of_day / 60 % 60;
    out->second = of_day % 60 + leap;
    out->ns = (int32_t)(tai_ns - tai_s * UTC_SECOND_NS);
}

int utc_to_tai(const struct utc_table *table, const struct utc_time *utc, int64_t *tai_ns, struct sh_err *err)
{
    if (utc->year < UTC_FIRST_YEAR || utc->year > UTC_LAST_YEAR)
        return sh_fail(err, SH_EINPUT, "year %d is out of range; allowed %d to %d", utc->year, UTC_FIRST_YEAR,
                       UTC_LAST_YEAR);
    if (!date_exists(utc->year, utc->month, utc->day))
        return sh_fail(err, SH_EINPUT, "there is no %04d-%02d-%02d", utc->year, utc->month, utc->day);
    if (utc->hour < 0 || utc->hour > 23 || utc->minute < 0 || utc->minute > 59 || utc->second < 0 || utc->second > 60 ||
        utc->ns < 0 || utc->ns >= UTC_SECOND_NS)
        return sh_fail(err, SH_EINPUT, "there is no %02d:%02d:%02d", utc->hour, utc->minute, utc->second);
    int64_t midnight_s = date_days(utc->year, utc->month, utc->day) * DAY_S;
    int64_t posix_s = midnight_s + utc->hour * 3600 + utc->minute * 60 + utc->second;
    int32_t offset = table->leap[entry_at(table, midnight_s, 0)].tai_minus_utc;
    int32_t tomorrow = table->leap[entry_at(table, midnight_s + DAY_S, 0)].tai_minus_utc;
    int64_t day_s = DAY_S + tomorrow - offset;
    if (posix_s - midnight_s >= day_s || (utc->second == 60 && posix_s - midnight_s != DAY_S))
        return sh_fail(err, SH_EINPUT, "%04d-%02d-%02d has no %02d:%02d:%02d", utc->year, utc->month, utc->day,
                       utc->hour, utc->minute, utc->second);
    *tai_ns = (posix_s + offset) * UTC_SECOND_NS + utc->ns;
    return SH_OK;
}

int64_t utc_posix_from_tai(const struct utc_table *table, int64_t tai_ns)
{
    uint32_t i = entry_at(table, floor_div(tai_ns, UTC_SECOND_NS), 1);
    return tai_ns - table->leap[i].tai_minus_utc * UTC_SECOND_NS;
}

int64_t utc_tai_from_posix(const struct utc_table *table, int64_t posix_ns)
{
    uint32_t i = entry_at(table, floor_div(posix_ns, UTC_SECOND_NS), 0);
    return posix_ns + table->leap[i].tai_minus_utc * UTC_SECOND_NS;
}

int64_t utc_gps_ns(int64_t tai_ns)
{
    return tai_ns - GPS_EPOCH_TAI_S * UTC_SECOND_NS;
}

struct utc_gps utc_gps_week(int64_t tai_ns)
{
    int64_t gps_ns = utc_gps_ns(tai_ns), week = floor_div(gps_ns, WEEK_NS);
    return (struct utc_gps){week, gps_ns - week * WEEK_NS};
}

/* ---- text */

/* Whether the text begins as the form does. A 0 of the form stands for any digit. */
static int begins_like(const char *text, const char *form)
{
    for (; *form != '\0'; form++, text++)
        if (*form == '0' ? *text < '0' || *text > '9' : *text != *form) return 0;
    return 1;
}

static int take_fraction(const char **p, int32_t *ns)
{
    int32_t unit = 100000000;
    *ns = 0;
    if (**p != '.') return 1;
    for (++*p; **p >= '0' && **p <= '9' && unit > 0; ++*p, unit /= 10)
        *ns += (**p - '0') * unit;
    return (*p)[-1] != '.';
}

int utc_parse(const char *text, struct utc_time *out, struct sh_err *err)
{
    static const char form[] = "0000-00-00T00:00:00";
    if (begins_like(text, form)) {
        const char *p = text + sizeof form - 1;
        sscanf(text, "%4d-%2d-%2dT%2d:%2d:%2d", &out->year, &out->month, &out->day, &out->hour, &out->minute,
               &out->second);
        if (take_fraction(&p, &out->ns) && strcmp(p, "Z") == 0) return SH_OK;
    }
    return sh_fail(err, SH_EINPUT, "not a time as 2026-01-01T00:00:00Z, with up to 9 decimals");
}

void utc_format(const struct utc_time *utc, int decimals, char buf[UTC_TEXT_LEN])
{
    int n = snprintf(buf, UTC_TEXT_LEN, "%04d-%02d-%02dT%02d:%02d:%02d.%09d", utc->year % 10000, utc->month % 100,
                     utc->day % 100, utc->hour % 100, utc->minute % 100, utc->second % 100, (int)utc->ns);
    n -= decimals == 0 ? 10 : 9 - decimals;
    snprintf(buf + n, (size_t)(UTC_TEXT_LEN - n), "Z");
}
