/* SPDX-License-Identifier: MIT */
/* LAS's columns and rows, which vectors make, beside the plain formulas. Figures are random with a fixed seed, beside
 * each place where a vector may decide otherwise, and at the ends of their ranges. The bytes of rows are those of the
 * ASPRS specification (LAS 1.4 R15, LAS 1.2), which the test lays out field by field. */
#include "tests/common/cases.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/bytes.h"
#include "drivers/record/las_columns.h"

static const double RAD_DEG = 180.0 / 3.14159265358979323846;

/* ---- scan angles: in single precision, as files have always had them */

static uint16_t angle_of(double x, double y, double z, uint64_t *n_none)
{
    const float up = atan2f(sqrtf((float)(x * x + y * y)), (float)-z);
    *n_none += isnan(up) != 0;
    return isnan(up) ? 0 : (uint16_t)lrintf(up * (float)(RAD_DEG / 0.006));
}

static void expect_angles(const double (*p)[TRACK_BATCH], int n)
{
    uint16_t seen[TRACK_BATCH];
    uint64_t n_none = 0;
    const uint64_t n_seen = las_set_scan_angles(p[0], p[1], p[2], n, seen);
    for (int i = 0; i < n; i++) {
        const uint16_t want = angle_of(p[0][i], p[1][i], p[2][i], &n_none);
        if (seen[i] != want) fail_msg("(%a %a %a): %u, not %u", p[0][i], p[1][i], p[2][i], seen[i], want);
    }
    assert_int_equal(n_seen, n_none);
}

static void random_directions_have_the_formulas_angle(void **state)
{
    (void)state;
    static double p[3][TRACK_BATCH];
    uint64_t seed = 1;
    for (int round = 0; round < 4000; round++) {
        for (int i = 0; i < TRACK_BATCH; i++) {
            const double range = ldexp(1 + case_unit(&seed), (int)case_between(&seed, -7, 13));
            const double up = 3.14159265358979 * case_unit(&seed), round_rad = 6.28318530717959 * case_unit(&seed);
            p[0][i] = range * sin(up) * cos(round_rad);
            p[1][i] = range * sin(up) * sin(round_rad);
            p[2][i] = -range * cos(up);
        }
        expect_angles((const double(*)[TRACK_BATCH])p, TRACK_BATCH);
    }
}

/* Angles at each half count, and at numbers of single precision beside it. */
static void directions_beside_each_tie_have_the_formulas_angle(void **state)
{
    (void)state;
    static double p[3][TRACK_BATCH];
    int n = 0;
    for (int count = 0; count < 30000; count++)
        for (int k = -2; k <= 2; k++) {
            const double up = (count + 0.5 + 1e-3 * k) * 0.006 / RAD_DEG, range = 0.5 + count % 97;
            p[0][n] = range * sin(up);
            p[1][n] = 0;
            p[2][n] = -range * cos(up);
            if (++n < TRACK_BATCH) continue;
            expect_angles((const double(*)[TRACK_BATCH])p, n);
            n = 0;
        }
    expect_angles((const double(*)[TRACK_BATCH])p, n);
}

/* The positions are all triples of `odd`. */
static void odd_positions_have_the_formulas_angle(void **state)
{
    (void)state;
    static const double odd[] = {0,    -0.0,  1,    -1,        1e-30, -1e-30, 1e-46,    1e-300,    1e19,
                                 1e20, -1e30, 1e38, 3.4028e38, 1e39,  -1e300, INFINITY, -INFINITY, NAN};
    enum { N = sizeof odd / sizeof *odd };
    static double p[3][TRACK_BATCH];
    int n = 0;
    for (int i = 0; i < N * N * N; i++) {
        p[0][n] = odd[i % N];
        p[1][n] = odd[i / N % N];
        p[2][n] = odd[i / N / N];
        if (++n < TRACK_BATCH && i + 1 < N * N * N) continue;
        expect_angles((const double(*)[TRACK_BATCH])p, n);
        n = 0;
    }
}

/* ---- counts and intensities */

static void counts_are_rounded_to_even(void **state)
{
    (void)state;
    static double at[TRACK_BATCH];
    int32_t seen[TRACK_BATCH];
    uint64_t seed = 2;
    for (int round = 0; round < 1000; round++) {
        const double scale = round % 3 == 0 ? 0.5 : round % 3 == 1 ? 1e-3 : 1e-4 * (1 + case_unit(&seed));
        const double offset = round % 2 == 0 ? 0 : 1000 * case_unit(&seed) - 500;
        for (int i = 0; i < TRACK_BATCH; i++)
            at[i] = offset + scale * 0.5 * (double)case_between(&seed, -4294967294, 4294967294); /* ties, too */
        const int n = las_set_counts(at, TRACK_BATCH, offset, scale, seen);
        for (int i = 0; i < TRACK_BATCH; i++) {
            const double want = rint((at[i] - offset) / scale);
            if (fabs(want) > INT32_MAX) {
                assert_int_equal(n, i);
                break;
            }
            if (seen[i] != (int32_t)want)
                fail_msg("%a from %a by %a: %d, not %.0f", at[i], offset, scale, seen[i], want);
        }
    }
}

/* The largest counts fit; the first point beyond them, or NaN, ends the row. */
static void a_count_beyond_32_bits_is_found(void **state)
{
    (void)state;
    static const double fit[] = {2147483647, -2147483647, 2147483647.4999, -2147483647.4999, 0};
    static const double beyond[] = {2147483647.5, -2147483648, 1e15, -1e16, 1e300, INFINITY, -INFINITY, NAN};
    enum { FIT = sizeof fit / sizeof *fit, BEYOND = sizeof beyond / sizeof *beyond };
    double at[FIT + 2];
    int32_t seen[FIT + 2];
    assert_int_equal(las_set_counts(fit, FIT, 0, 1, seen), FIT);
    assert_int_equal(seen[0], INT32_MAX);
    assert_int_equal(seen[3], -INT32_MAX);
    for (int k = 0; k < BEYOND; k++)
        for (int i = 0; i < FIT + 1; i++) {
            memcpy(at, fit, sizeof fit);
            at[FIT] = at[FIT + 1] = beyond[BEYOND - 1 - k];
            at[i] = beyond[k];
            assert_int_equal(las_set_counts(at, FIT + 2, 0, 1, seen), i);
        }
}

static void all_reflectances_of_the_wire_come_back(void **state)
{
    (void)state;
    static double db[65536];
    static uint16_t seen[65536];
    for (int cdb = INT16_MIN; cdb <= INT16_MAX; cdb++)
        db[cdb - INT16_MIN] = cdb == INT16_MIN ? (double)NAN : cdb / 100.0;
    las_set_intensities(db, 65536, seen);
    for (int i = 0; i < 65536; i++)
        assert_int_equal(seen[i], i); /* 0: not modelled; else 32768 + 100 dB */
}

/* ---- rows */

static struct track track;
static struct las_columns columns;

static void fill(uint64_t *seed)
{
    track.info.station = (uint32_t)case_between(seed, 0, 65535);
    for (int i = 0; i < TRACK_BATCH; i++) {
        for (int k = 0; k < 3; k++) {
            columns.xyz[k][i] = (int32_t)case_between(seed, i == 0 ? INT32_MIN : -9, i == 1 ? INT32_MAX : 9);
            track.rgb[i][k] = (uint8_t)case_u64(seed);
            columns.back_ps[i][k] = (float)case_unit(seed);
        }
        columns.intensity[i] = (uint16_t)case_u64(seed);
        columns.scan_angle[i] = (uint16_t)case_u64(seed);
        columns.returns[i] = (uint8_t)case_u64(seed);
        columns.time_s[i] = 1e9 * case_unit(seed);
        columns.amplitude[i] = (uint16_t)case_u64(seed);
        columns.width[i] = (uint16_t)case_u64(seed);
        columns.deviation[i] = (uint16_t)case_u64(seed);
        columns.packet[i] = (struct las_packet){(uint8_t)case_u64(seed), case_u64(seed), (uint32_t)case_u64(seed)};
        columns.location_ps[i] = (float)case_unit(seed);
        track.points.label[i] = (uint16_t)case_u64(seed);
    }
}

/* Formats 1, 3, 6, 7, 9 and 10, each with or without attributes and deviations. Returns the row's end. */
static uint8_t *lay_out(const struct las_facts *f, int i, uint8_t *to)
{
    for (int k = 0; k < 3; k++, to += 4)
        le_put32(to, (uint32_t)columns.xyz[k][i]);
    le_put16(to, columns.intensity[i]);
    to[2] = columns.returns[i];
    memset(to + 3, 0, 3); /* 1.4: flags, class, user data; 1.2: class, rank of the angle, user data */
    to += 6;
    if (f->minor != 2) le_put16(to, columns.scan_angle[i]), to += 2;
    le_put16(to, (uint16_t)track.info.station);
    le_put_double(to + 2, columns.time_s[i]);
    to += 10;
    for (int k = 0; k < 3 && f->track->has_colours; k++, to += 2)
        le_put16(to, (uint16_t)(track.rgb[i][k] * 65535 / 255));
    if (f->track->has_colours && f->has_waves) le_put16(to, 0), to += 2; /* near infrared */
    if (f->has_waves) {
        to[0] = columns.packet[i].kind;
        le_put64(to + 1, columns.packet[i].at);
        le_put32(to + 9, columns.packet[i].len);
        le_put_float(to + 13, columns.location_ps[i]);
        for (int k = 0; k < 3; k++)
            le_put_float(to + 17 + 4 * k, columns.back_ps[i][k]);
        to += 29;
    }
    const uint16_t extra[4] = {track.points.label[i], columns.amplitude[i], columns.width[i], columns.deviation[i]};
    const int n_extra = f->minor == 2 ? 0 : 1 + (track.has_attributes ? 2 : 0) + (track.has_deviations ? 1 : 0);
    for (int k = 0; k < n_extra; k++, to += 2)
        le_put16(to, extra[k]);
    return to;
}

static void expect_rows(struct las_facts *f, uint64_t *seed)
{
    static uint8_t seen[TRACK_BATCH * LAS_POINT_LEN_MAX + 1], want[TRACK_BATCH * LAS_POINT_LEN_MAX + 1];
    const int n = (int)case_between(seed, 0, TRACK_BATCH);
    uint8_t *end = want;
    fill(seed);
    if (f->minor == 2) memset(columns.scan_angle, 0, sizeof columns.scan_angle); /* as the recorder leaves it */
    for (int i = 0; i < n; i++)
        end = lay_out(f, i, end);
    assert_int_equal(end - want, (size_t)n * las_point_len(f));
    *end = 0xa5;
    memset(seen, 0xa5, sizeof seen);
    las_put_rows(f, &columns, n, seen);
    assert_memory_equal(seen, want, (size_t)(end - want) + 1); /* and no byte more */
    struct las_facts one_by_one = *f;
    for (int i = 0; i < n; i++)
        las_count_record(&one_by_one, want + (size_t)i * las_point_len(f));
    las_count_rows(f, &columns, n);
    assert_int_equal(f->n_points, one_by_one.n_points);
    assert_memory_equal(f->n_by_return, one_by_one.n_by_return, sizeof f->n_by_return);
    assert_memory_equal(f->min, one_by_one.min, sizeof f->min);
    assert_memory_equal(f->max, one_by_one.max, sizeof f->max);
}

static void rows_are_laid_out_as_specified(void **state)
{
    (void)state;
    uint64_t seed = 3;
    for (int kind = 0; kind < 2 * 2 * 2 * 3; kind++) {
        struct las_facts facts = {.track = &track, .minor = kind & 1 ? 2 : 4};
        track.has_colours = kind >> 1 & 1;
        if (facts.minor == 4) facts.has_waves = kind >> 2 & 1;
        track.has_attributes = kind >> 3 > 0;
        track.has_deviations = kind >> 3 > 1;
        for (int batch = 0; batch < 20; batch++)
            expect_rows(&facts, &seed);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_directions_have_the_formulas_angle),
        cmocka_unit_test(directions_beside_each_tie_have_the_formulas_angle),
        cmocka_unit_test(odd_positions_have_the_formulas_angle),
        cmocka_unit_test(counts_are_rounded_to_even),
        cmocka_unit_test(a_count_beyond_32_bits_is_found),
        cmocka_unit_test(all_reflectances_of_the_wire_come_back),
        cmocka_unit_test(rows_are_laid_out_as_specified),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
