/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/nmea.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "drivers/protocol/protocol.h"

static const double KNOT_M_S = 1852.0 / 3600.0;

/* A sentence being written. Text without room is left out, but the length counts it. */
struct sentence {
    char *dst;
    size_t cap, len;
    uint8_t spoil; /* bits of the checksum that are wrong */
};

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

/* Writes ddmm.mmmmmmm and its letter. The angle is rounded before it is divided, so that the minutes never read 60. */
static void put_angle(struct sentence *s, double deg, int degree_digits, char positive, char negative)
{
    const long long degree = 600000000; /* in 1e-7 minutes */
    long long total = llround(deg * (double)degree);
    char letter = total < 0 ? negative : positive;
    total = llabs(total);
    long long minutes = total % degree;
    nmea_put(s, ",%0*lld%02lld.%07lld,%c", degree_digits, total / degree, minutes / 10000000, minutes % 10000000,
             letter);
}

static void put_place(struct sentence *s, const struct nmea_fix *fix)
{
    if (fix->quality == 0) {
        nmea_put(s, ",,,,");
        return;
    }
    put_angle(s, fix->lat_deg, 2, 'N', 'S');
    put_angle(s, fix->lon_deg, 3, 'E', 'W');
}

size_t nmea_encode_gga(char *dst, size_t cap, const struct nmea_fix *fix)
{
    struct sentence s = nmea_begin(dst, cap, fix, "GGA");
    put_time(&s, fix);
    put_place(&s, fix);
    if (fix->quality == 0)
        nmea_put(&s, ",0,00,,,M,,M,,");
    else
        nmea_put(&s, ",%d,%02d,%.1f,%.4f,M,%.4f,M,,", fix->quality, fix->satellites, fix->hdop, fix->altitude_m,
                 fix->geoid_separation_m);
    return nmea_end(&s);
}

size_t nmea_encode_rmc(char *dst, size_t cap, const struct nmea_fix *fix)
{
    static const char mode[] = "NADNRF"; /* by quality: not valid, autonomous, differential, -, RTK, RTK float */
    struct sentence s = nmea_begin(dst, cap, fix, "RMC");
    put_time(&s, fix);
    nmea_put(&s, ",%c", fix->quality == 0 ? 'V' : 'A');
    put_place(&s, fix);
    if (fix->quality == 0)
        nmea_put(&s, ",,");
    else if (isnan(fix->course_deg)) /* readers that use sscanf refuse an empty field */
        nmea_put(&s, ",%.3f,000.0", fix->speed_m_s / KNOT_M_S);
    else /* rounded down, so that it never reads 360 */
        nmea_put(&s, ",%.3f,%.2f", fix->speed_m_s / KNOT_M_S, floor(fix->course_deg * 100.0) / 100.0);
    nmea_put(&s, ",%02d%02d%02d,,,%c", fix->day, fix->month, fix->year % 100,
             mode[fix->quality >= 0 && fix->quality <= 5 ? fix->quality : 0]);
    return nmea_end(&s);
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
