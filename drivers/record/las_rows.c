/* SPDX-License-Identifier: MIT */
/* Rows of a LAS file, and the counts of its header. */
#include "drivers/record/las_columns.h"

#include "core/bytes.h"
#include "core/vecmath.h"

/* All formats begin with x, y, z, intensity and returns. Then come classification, flags and user data, which are 0,
 * scan angle (0 in LAS 1.2), station and time. The store of 8 bytes at 16 reaches into the time's place, so the time is
 * written after it. */
static void put_common(const struct las_facts *f, const struct las_columns *c, int n, uint8_t *to)
{
    const size_t len = las_point_len(f), time_at = las_time_at(f);
    const uint64_t station = (uint64_t)f->track->info.station << (f->minor == 2 ? 16 : 32);
    for (int i = 0; i < n; i++, to += len) {
        const uint32_t x = (uint32_t)c->xyz[0][i], y = (uint32_t)c->xyz[1][i], z = (uint32_t)c->xyz[2][i];
        le_put64(to, x | (uint64_t)y << 32);
        le_put64(to + 8, z | (uint64_t)c->intensity[i] << 32 | (uint64_t)c->returns[i] << 48);
        le_put64(to + 16, station | (uint32_t)c->scan_angle[i] << 16);
        le_put_double(to + time_at, c->time_s[i]);
    }
}

/* The near infrared of format 10 is 0. */
static void put_colours(const struct las_facts *f, int n, uint8_t *to)
{
    const size_t len = las_point_len(f);
    for (int i = 0; i < n; i++, to += len) {
        for (int k = 0; k < 3; k++)
            le_put16(to + 2 * k, (uint16_t)(257 * f->track->rgb[i][k])); /* 255 becomes 65535 */
        if (f->has_waves) le_put16(to + 6, 0);
    }
}

static void put_waves(const struct las_facts *f, const struct las_columns *c, int n, uint8_t *to)
{
    const size_t len = las_point_len(f);
    for (int i = 0; i < n; i++, to += len) {
        to[0] = c->packet[i].kind;
        le_put64(to + 1, c->packet[i].at);
        le_put32(to + 9, c->packet[i].len);
        le_put_float(to + 13, c->location_ps[i]);
        for (int k = 0; k < 3; k++)
            le_put_float(to + 17 + 4 * k, c->back_ps[i][k]);
    }
}

static void put_extra(const struct las_facts *f, const uint16_t *column, int n, uint8_t *to)
{
    const size_t len = las_point_len(f);
    for (int i = 0; i < n; i++, to += len)
        le_put16(to, column[i]);
}

void las_put_rows(const struct las_facts *f, const struct las_columns *c, int n, uint8_t *to)
{
    uint8_t *extra = to + las_own_len(f);
    put_common(f, c, n, to);
    if (f->track->has_colours) put_colours(f, n, to + las_time_at(f) + 8);
    if (f->minor == 2) return;
    if (f->has_waves) put_waves(f, c, n, extra - LAS_WAVE_LEN);
    put_extra(f, f->track->points.label, n, extra);
    if (!f->track->has_attributes) return;
    put_extra(f, c->amplitude, n, extra + 2);
    put_extra(f, c->width, n, extra + 4);
    if (f->track->has_deviations) put_extra(f, c->deviation, n, extra + 6);
}

/* ---- counts */

VEC_CLONES static void widen(const int32_t *restrict count, int n, int32_t *restrict min, int32_t *restrict max)
{
    int32_t low = *min, high = *max;
    for (int i = 0; i < n; i++) {
        low = count[i] < low ? count[i] : low;
        high = count[i] > high ? count[i] : high;
    }
    *min = low;
    *max = high;
}

VEC_CLONES static uint32_t count_return(const uint8_t *restrict returns, int n, uint8_t mask, uint8_t echo)
{
    uint32_t count = 0;
    for (int i = 0; i < n; i++)
        count += (returns[i] & mask) == echo;
    return count;
}

void las_count_rows(struct las_facts *f, const struct las_columns *c, int n)
{
    const uint8_t mask = f->minor == 2 ? 7 : 15;
    uint32_t n_counted = 0;
    for (int k = 0; k < 3 && n > 0; k++) {
        if (f->n_points == 0) f->min[k] = f->max[k] = c->xyz[k][0];
        widen(c->xyz[k], n, &f->min[k], &f->max[k]);
    }
    f->n_points += (uint64_t)n;
    for (uint8_t echo = 1; echo <= mask && n_counted < (uint32_t)n; echo++) {
        const uint32_t count = count_return(c->returns, n, mask, echo);
        f->n_by_return[echo - 1] += count;
        n_counted += count;
    }
}
