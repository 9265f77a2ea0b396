/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "core/studio/cloud.h"

/* The bits of doubles from 0 up are in the order of their values. */
static uint64_t bits_of(double v)
{
    uint64_t bits;
    memcpy(&bits, &v, sizeof bits);
    return bits;
}

/* Finds the bits of the value, 8 at a time from the top: each pass counts the values with the bits found so far by
 * their next 8 bits. It takes eight passes, whatever the values are. */
double cloud_percentile(const double *v, size_t n, size_t n_finite, unsigned permille)
{
    size_t rank = n_finite / 1000 * permille + (n_finite % 1000 * permille + 999) / 1000; /* rounded up */
    uint64_t prefix = 0;
    if (n_finite == 0) return (double)NAN;
    for (int shift = 56; shift >= 0; shift -= 8) {
        size_t count[256] = {0};
        for (size_t i = 0; i < n; i++) {
            uint64_t bits = bits_of(v[i]);
            if (isfinite(v[i]) && (shift == 56 || bits >> (shift + 8) == prefix)) count[bits >> shift & 0xff]++;
        }
        uint64_t digit = 0;
        while (rank > count[digit])
            rank -= count[digit++];
        prefix = prefix << 8 | digit;
    }
    double value;
    memcpy(&value, &prefix, sizeof value);
    return value;
}

static void count_far(struct cloud_stats *s, size_t i)
{
    if (s->far++ == 0) s->worst = i;
    s->beyond++;
}

void cloud_stats(const double *distance_m, size_t n, double tolerance_m, struct cloud_stats *out)
{
    struct cloud_stats s = {.worst = n, .max_m = -INFINITY};
    /* A long double has 64 bits of mantissa, so 2^32 equal summands lose less than a double's rounding. */
    long double sum = 0, sum2 = 0;
    for (size_t i = 0; i < n; i++) {
        double d = distance_m[i];
        if (isnan(d)) {
            s.empty++;
            continue;
        }
        s.points++;
        if (isinf(d)) {
            count_far(&s, i);
            continue;
        }
        if (d > tolerance_m) s.beyond++;
        if (d > s.max_m) {
            s.max_m = d;
            if (s.far == 0) s.worst = i;
        }
        sum += d;
        sum2 += (long double)d * d;
    }
    size_t near = s.points - s.far;
    if (near > 0) {
        s.mean_m = (double)(sum / (long double)near);
        s.rms_m = (double)sqrtl(sum2 / (long double)near);
        s.p50_m = cloud_percentile(distance_m, n, near, 500);
        s.p95_m = cloud_percentile(distance_m, n, near, 950);
        s.p999_m = cloud_percentile(distance_m, n, near, 999);
    } else {
        s.mean_m = s.rms_m = s.p50_m = s.p95_m = s.p999_m = s.max_m = NAN;
    }
    *out = s;
}
