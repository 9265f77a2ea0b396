/* SPDX-License-Identifier: MIT */
/* A time zone of the kind "right/": UTC whose POSIX seconds are taken for seconds that count leap seconds. In it gmtime
 * of glibc is LEAP_ZONE_S behind from 1972 on, so nothing that is written may depend on the zone. */
#ifndef TESTS_COMMON_LEAP_ZONE_H
#define TESTS_COMMON_LEAP_ZONE_H

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { LEAP_ZONE_S = 27 };

/* Writes the zone's file, RFC 8536 version 1: one type, UTC, and one record of leap seconds, 1972-07-01. Makes it the
 * zone of this process and of those that it starts. Returns 0 where that fails. */
static inline int leap_zone_begin(const char *path)
{
    static const unsigned char head[44] = {'T', 'Z', 'i', 'f', [31] = 1, [39] = 1, [43] = 4};
    static const unsigned char rest[] = {0, 0, 0, 0, 0, 0, 'U', 'T', 'C', 0, 4, 0xb2, 0x58, 0, 0, 0, 0, LEAP_ZONE_S};
    char zone[512];
    FILE *file = fopen(path, "wb");
    if (file == NULL) return 0;
    const int is_whole = fwrite(head, sizeof head, 1, file) == 1 && fwrite(rest, sizeof rest, 1, file) == 1;
    if (fclose(file) != 0 || !is_whole) return 0;
    snprintf(zone, sizeof zone, ":%s", path);
    setenv("TZ", zone, 1);
    tzset();
    const time_t later = 1709164800;
    struct tm tm;
    return gmtime_r(&later, &tm) != NULL && tm.tm_sec == 60 - LEAP_ZONE_S;
}

static inline void leap_zone_end(void)
{
    unsetenv("TZ");
    tzset();
}

#endif
