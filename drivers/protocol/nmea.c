/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/nmea.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/protocol.h"

static const double KNOT_M_S = 1852.0 / 3600.0;

/* A sentence being written. Text without room is left out, but the length counts it. */
struct sentence {
    char *dst;
    size_t cap, len;
    uint8_t spoil; /* bits of the checksum that are wrong */
};

/* Decimals of minutes of arc, and of heights in metres and speeds in knots. */
struct decimals {
    int minutes, others;
};

/* From the finest on; a sentence that is too long is written with the next ones. A minute's seventh decimal is 0.19 mm.
 * The last ones hold any speed below 1e7 knots in 72 characters. */
static const struct decimals finest_first[] = {{7, 3}, {6, 3}, {6, 2}, {5, 2}, {4, 2}, {4, 1}, {4, 0}, {3, 0}};
enum { N_DECIMALS = sizeof finest_first / sizeof finest_first[0] };

typedef size_t placed(char *dst, size_t cap, const struct nmea_fix *fix, const struct decimals *decimals);

static size_t encode_within(placed *encode, char *dst, size_t cap, const struct nmea_fix *fix, size_t most)
{
    char text[NMEA_MAX_SENTENCE];
    size_t i = 0, len = encode(text, sizeof text, fix, &finest_first[i]);
    while (len > most && ++i < N_DECIMALS)
        len = encode(text, sizeof text, fix, &finest_first[i]);
    if (len == 0 || len >= cap) return 0;
    memcpy(dst, text, len + 1);
    return len;
}

static void nmea_put(struct sentence *s, const char *fmt, ...) __attribute__((format(printf, 2, 3)));
static void nmea_put(struct sentence *s, const char *fmt, ...)
{
    va_list args;
    va_start(args, fmt);
    int n = vsnprintf(s->len < s->cap ? s->dst + s->len : NULL, s->len < s->cap ? s->cap - s->len : 0, fmt, args);
    va_end(args);
    s->len += (size_t)n;
}

static struct sentence nmea_begin(char *dst, size_t cap, const struct nmea_fix *fix, const char *type)
{
    struct sentence s = {dst, cap, 0, fix->is_spoilt ? 0xff : 0};
    nmea_put(&s, "$%.2s%s", fix->talker, type);
    return s;
}

static size_t nmea_end(struct sentence *s)
{
    unsigned sum = s->len < s->cap ? protocol_xor(s->dst + 1, s->len - 1) ^ s->spoil : 0;
    nmea_put(s, "*%02X\r\n", sum);
    return s->len < s->cap ? s->len : 0;
}

static void put_time(struct sentence *s, const struct nmea_fix *fix)
{
    nmea_put(s, ",%02d%02d%02d.%02d", fix->hour, fix->minute, fix->second, fix->hundredth);
}

/* Writes ddmm.mmmm and its letter. The angle is rounded before it is divided, so that the minutes never read 60. */
static void put_angle(struct sentence *s, double deg, int degree_digits, int decimals, const char letters[2])
{
    long long minute = 1;
    for (int i = 0; i < decimals; i++)
        minute *= 10;
    long long total = llround(deg * (double)(60 * minute));
    const char letter = letters[total < 0];
    total = llabs(total);
    nmea_put(s, ",%0*lld%02lld.%0*lld,%c", degree_digits, total / (60 * minute), total / minute % 60, decimals,
             total % minute, letter);
}

static void put_place(struct sentence *s, const struct nmea_fix *fix, int decimals)
{
    if (fix->quality == 0) {
        nmea_put(s, ",,,,");
        return;
    }
    put_angle(s, fix->lat_deg, 2, decimals, "NS");
    put_angle(s, fix->lon_deg, 3, decimals, "EW");
}

/* The least number of decimals, from 1 to `most`, that are as exact as `most` of them. */
static int needed_decimals(double value, int most)
{
    int n = 1;
    for (double scaled = 10.0 * value; n < most && fabs(scaled - round(scaled)) > 1e-6; scaled *= 10.0)
        n++;
    return n < most ? n : most;
}

static size_t encode_gga(char *dst, size_t cap, const struct nmea_fix *fix, const struct decimals *decimals)
{
    struct sentence s = nmea_begin(dst, cap, fix, "GGA");
    put_time(&s, fix);
    put_place(&s, fix, decimals->minutes);
    if (fix->quality == 0)
        nmea_put(&s, ",0,00,,,M,,M,,");
    else
        nmea_put(&s, ",%d,%02d,%.1f,%.*f,M,%.*f,M,,", fix->quality, fix->satellites, fix->hdop, decimals->others,
                 fix->altitude_m, needed_decimals(fix->geoid_separation_m, decimals->others), fix->geoid_separation_m);
    return nmea_end(&s);
}

size_t nmea_encode_gga(char *dst, size_t cap, const struct nmea_fix *fix)
{
    return encode_within(encode_gga, dst, cap, fix, NMEA_MOST_LEN);
}

static size_t encode_rmc(char *dst, size_t cap, const struct nmea_fix *fix, const struct decimals *decimals)
{
    static const char mode[] = "NADNRF"; /* by quality: not valid, autonomous, differential, -, RTK, RTK float */
    struct sentence s = nmea_begin(dst, cap, fix, "RMC");
    put_time(&s, fix);
    nmea_put(&s, ",%c", fix->quality == 0 ? 'V' : 'A');
    put_place(&s, fix, decimals->minutes);
    if (fix->quality == 0)
        nmea_put(&s, ",,");
    else if (isnan(fix->course_deg)) /* readers that use sscanf refuse an empty field */
        nmea_put(&s, ",%.*f,000.0", decimals->others, fix->speed_m_s / KNOT_M_S);
    else /* rounded down, so that it never reads 360 */
        nmea_put(&s, ",%.*f,%.2f", decimals->others, fix->speed_m_s / KNOT_M_S, floor(fix->course_deg * 100.0) / 100.0);
    nmea_put(&s, ",%02d%02d%02d,,,%c", fix->day, fix->month, fix->year % 100,
             mode[fix->quality >= 0 && fix->quality <= 5 ? fix->quality : 0]);
    return nmea_end(&s);
}

size_t nmea_encode_rmc(char *dst, size_t cap, const struct nmea_fix *fix)
{
    return nmea_encode_rmc_within(dst, cap, fix, NMEA_MOST_LEN);
}

size_t nmea_encode_rmc_within(char *dst, size_t cap, const struct nmea_fix *fix, size_t most)
{
    return encode_within(encode_rmc, dst, cap, fix, most);
}

/* Single satellites are not modelled, so GSA lists the numbers from 1 on, 12 at most. */
size_t nmea_encode_gsa(char *dst, size_t cap, const struct nmea_fix *fix)
{
    struct sentence s = nmea_begin(dst, cap, fix, "GSA");
    nmea_put(&s, ",A,%d", fix->quality == 0 ? 1 : 3);
    for (int i = 1; i <= 12; i++)
        if (fix->quality != 0 && i <= fix->satellites)
            nmea_put(&s, ",%02d", i);
        else
            nmea_put(&s, ",");
    if (fix->quality == 0)
        nmea_put(&s, ",,,");
    else
        nmea_put(&s, ",,%.1f,", fix->hdop);
    return nmea_end(&s);
}

size_t nmea_encode_gst(char *dst, size_t cap, const struct nmea_fix *fix)
{
    struct sentence s = nmea_begin(dst, cap, fix, "GST");
    put_time(&s, fix);
    if (fix->quality == 0)
        nmea_put(&s, ",,,,,,,");
    else
        nmea_put(&s, ",,,,,%.4f,%.4f,%.4f", fix->sigma_m[0], fix->sigma_m[1], fix->sigma_m[2]);
    return nmea_end(&s);
}

size_t nmea_encode_zda(char *dst, size_t cap, const struct nmea_fix *fix)
{
    struct sentence s = nmea_begin(dst, cap, fix, "ZDA");
    put_time(&s, fix);
    nmea_put(&s, ",%02d,%02d,%04d,00,00", fix->day, fix->month, fix->year);
    return nmea_end(&s);
}

size_t nmea_encode_all(char *dst, size_t cap, const struct nmea_fix *fix)
{
    static size_t (*const encode[NMEA_ALL_SENTENCES])(char *, size_t, const struct nmea_fix *) = {
        nmea_encode_rmc, nmea_encode_gga, nmea_encode_gsa, nmea_encode_gst, nmea_encode_zda};
    size_t len = 0;
    for (int i = 0; i < NMEA_ALL_SENTENCES; i++) {
        size_t n = encode[i](dst + len, cap - len, fix);
        if (n == 0) return 0;
        len += n;
    }
    return len;
}
