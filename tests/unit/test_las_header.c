/* SPDX-License-Identifier: MIT */
/* This compares the bytes before the points of a LAS file: the header and its records by the tables of LAS 1.2 and of
 * LAS 1.4 R15 (ASPRS), the keys of a CRS by OGC 19-008. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/bytes.h"
#include "drivers/record/crs_wkt.h"
#include "drivers/record/las_header.h"
#include "drivers/record/las_waves.h"
#include "drivers/record/track.h"
#include "tests/common/leap_zone.h"

static struct track track;
static struct las_waves waves;
static struct las_facts facts;
static uint8_t got[LAS_FRONT_MAX], want[LAS_FRONT_MAX];
static size_t n_want;

static void begin(int minor)
{
    memset(&track, 0, sizeof track);
    memset(&waves, 0, sizeof waves);
    facts = (struct las_facts){.minor = minor,
                               .track = &track,
                               .waves = &waves,
                               .profile = "tls",
                               .scale = {0.5, 0.25, 0.125},
                               .offset = {1000, -2000, 3},
                               .min = {-4, -8, -16},
                               .max = {20, 40, 80}};
    memset(want, 0, sizeof want);
    n_want = minor == 2 ? 227 : 375;
}

/* Puts what each of these headers has. */
static void want_header(int encoding, int format, int point_len, uint32_t n_records)
{
    const int minor = facts.minor;
    memcpy(want, "LASF", 4);
    want[6] = (uint8_t)encoding;
    want[24] = 1;
    want[25] = (uint8_t)minor;
    memcpy(want + 26, "tls", 3);
    memcpy(want + 58, "scanhead", 8);
    le_put16(want + 94, minor == 2 ? 227 : 375);
    le_put32(want + 96, (uint32_t)n_want);
    le_put32(want + 100, n_records);
    want[104] = (uint8_t)format;
    want[105] = (uint8_t)point_len;
    for (int i = 0; i < 3; i++) {
        le_put_double(want + 131 + 8 * i, 0.5 / (1 << i));
        le_put_double(want + 155 + 8 * i, i == 0 ? 1000 : i == 1 ? -2000 : 3);
    }
}

/* Bounds: (20, 40, 80) and (-4, -8, -16) counts of these scales are 10 and -2 from each offset. */
static void want_counts(void)
{
    static const double max[3] = {1010, -1990, 13}, min[3] = {998, -2002, 1};
    for (int i = 0; i < 3; i++) {
        le_put_double(want + 179 + 16 * i, max[i]);
        le_put_double(want + 187 + 16 * i, min[i]);
    }
}

static uint8_t *want_record(const char *user, unsigned number, size_t len, const char *description)
{
    uint8_t *at = want + n_want;
    memcpy(at + 2, user, strlen(user));
    le_put16(at + 18, (uint16_t)number);
    le_put16(at + 20, (uint16_t)len);
    memcpy(at + 22, description, strlen(description));
    n_want += 54 + len;
    return at + 54;
}

static void want_extra(uint8_t *at, int type, const char *name, int64_t no_data, double scale, const char *text)
{
    at[2] = (uint8_t)type;
    at[3] = scale != 0 ? 9 : 1; /* bit 0: no_data is relevant; bit 3: so is the scale */
    memcpy(at + 4, name, strlen(name));
    le_put64(at + 40, (uint64_t)no_data);
    if (scale != 0) le_put_double(at + 112, scale);
    memcpy(at + 160, text, strlen(text));
}

static void want_crs(void)
{
    char wkt[CRS_WKT_MAX];
    const size_t n = crs_wkt(track.epsg, track.geoid_heights, wkt) + 1;
    memcpy(want_record("LASF_Projection", 2112, n, "OGC coordinate system WKT"), wkt, n);
}

/* The text in words has no fixed bytes: other checks look at what it says. All other bytes have to be equal. */
static const char *want_text(void)
{
    const size_t at = n_want + 54, n = strlen((const char *)got + at) + 1;
    memcpy(want_record("LASF_Spec", 3, n, "text area description"), got + at, n);
    return (const char *)got + at;
}

static void check(size_t len)
{
    assert_int_equal(len, n_want);
    for (size_t i = 0; i < len; i++)
        if (got[i] != want[i]) fail_msg("byte %zu: %02x, not %02x", i, got[i], want[i]);
}

/* 2024-02-29 00:00 is day 60 of its year. GPS seconds are counted from 1980-01-06, "adjusted" ones are 10^9 less. */
static void test_all_of_1_4(void **state)
{
    (void)state;
    begin(4);
    track.has_attributes = track.has_deviations = track.geoid_heights = 1;
    track.epsg = 32632;
    track.has_colours = facts.gps_time = 1;
    facts.created_gps_s = 1709164800.0 - 315964800 - 1e9;
    facts.n_points = 5000000000;
    for (int i = 0; i < 15; i++)
        facts.n_by_return[i] = 6000000000 + (uint64_t)i;
    const size_t len = las_front(&facts, got);
    uint8_t *extra = want_record("LASF_Spec", 4, 4 * 192, "extra bytes of a point");
    want_extra(extra, 3, "label", 65535, 0, "surface hit; 65535: none");
    want_extra(extra + 192, 4, "amplitude", -32768, 0.01, "dB above detection threshold");
    want_extra(extra + 384, 3, "width", 0, 0.01, "ns FWHM; 655.35: that or more");
    want_extra(extra + 576, 3, "deviation", 65535, 0.001, "of shape; 65.534: that or more");
    const char *text = want_text();
    assert_non_null(strstr(text, "GPS time: adjusted standard GPS time. Intensity: 32768 + 100 times the reflectance"));
    assert_non_null(strstr(text, "Scan angle: in the head's frame, from straight down (0)"));
    assert_non_null(strstr(text, "Point source ID: station. Label: surface hit."));
    assert_null(strstr(text, "Waveforms"));
    want_crs();
    want_header(1 << 4 | 1, 7, 36 + 8, 3);
    want_counts();
    le_put16(want + 90, 60);
    le_put16(want + 92, 2024);
    le_put64(want + 247, 5000000000);
    for (int i = 0; i < 15; i++)
        le_put64(want + 255 + 8 * i, 6000000000 + (uint64_t)i);
    check(len);
    assert_int_equal(las_point_len(&facts), 44);
}

/* The date is the same in a time zone whose clocks count leap seconds, where gmtime is 27 s behind: the day before. */
static void test_the_zone_does_not_matter(void **state)
{
    char path[] = "/tmp/scanhead_zone_XXXXXX";
    (void)state;
    begin(4);
    facts.gps_time = 1;
    facts.created_gps_s = 1709164800.0 - 315964800 - 1e9;
    const int fd = mkstemp(path);
    assert_true(fd >= 0 && close(fd) == 0);
    assert_true(leap_zone_begin(path));
    las_front(&facts, got);
    leap_zone_end();
    unlink(path);
    assert_true(le_get16(got + 90) == 60 && le_get16(got + 92) == 2024);
    static const double none[] = {-2e9, 1e300, -1e300, NAN}; /* 1946, and no time at all */
    for (size_t i = 0; i < sizeof none / sizeof *none; i++) {
        facts.created_gps_s = none[i];
        las_front(&facts, got);
        assert_true(le_get16(got + 90) == 0 && le_get16(got + 92) == 0);
    }
}

/* Counts come when the points are known. Until the file is complete, its software says so. */
static void test_growing(void **state)
{
    (void)state;
    begin(4);
    facts.incomplete = facts.is_growing = track.moving = 1;
    facts.n_points = facts.n_by_return[0] = 7;
    const size_t len = las_front(&facts, got);
    want_extra(want_record("LASF_Spec", 4, 192, "extra bytes of a point"), 3, "label", 65535, 0,
               "surface hit; 65535: none");
    const char *text = want_text();
    assert_non_null(strstr(text, "GPS time: seconds since the scan's start, of no absolute clock."));
    assert_non_null(strstr(text, "Scan angle: not given, the head moves."));
    want_header(1 << 4, 6, 30 + 2, 2);
    memcpy(want + 58, LAS_SOFTWARE_INCOMPLETE, strlen(LAS_SOFTWARE_INCOMPLETE));
    check(len);
    las_put_counts(&facts, got);
    want_counts();
    le_put64(want + 247, 7);
    le_put64(want + 255, 7);
    check(len);
}

/* Packets of waveforms in the file (bit 1), or in a .wdp (bit 2). Room for 255 descriptors is kept. */
static void test_waves(void **state)
{
    (void)state;
    for (int inside = 0; inside < 2; inside++) {
        begin(4);
        facts.has_waves = 1;
        track.has_colours = inside;
        facts.waves_at = inside ? 123456789012 : 0;
        waves.n_kinds = 2;
        waves.kind[0] = (struct las_kind){8, 40, 500, 0.25, -1};
        waves.kind[1] = (struct las_kind){16, 70000, 2000, 0.5, 3};
        const size_t len = las_front(&facts, got);
        want_extra(want_record("LASF_Spec", 4, 192, "extra bytes of a point"), 3, "label", 65535, 0,
                   "surface hit; 65535: none");
        assert_non_null(strstr(want_text(), "Waveforms: digitizer offset + gain * sample is the signal"));
        for (uint32_t i = 0; i < 2; i++) {
            uint8_t *at = want_record("LASF_Spec", 100 + i, 26, "waveform packet descriptor");
            at[0] = i == 0 ? 8 : 16;
            le_put32(at + 2, i == 0 ? 40 : 70000);
            le_put32(at + 6, i == 0 ? 500 : 2000);
            le_put_double(at + 10, i == 0 ? 0.25 : 0.5);
            le_put_double(at + 18, i == 0 ? -1 : 3);
        }
        n_want += 253 * 80;
        want_header(1 << 4 | (inside ? 2 : 4), inside ? 10 : 9, inside ? 67 + 2 : 59 + 2, 4);
        if (inside) {
            le_put64(want + 227, 123456789012);
            le_put64(want + 235, 123456789012);
            want[243] = 1;
        }
        check(len);
    }
}

/* Keys are in the order of their numbers. A key is number, 0, 1, value; 0 is no value. */
static void test_keys_of_1_2(void **state)
{
    (void)state;
    static const struct {
        int epsg, geoid, n;
        uint16_t key[7][2];
    } cases[] = {
        {4978, 0, 4, {{1024, 3}, {1025, 1}, {2048, 4978}, {2052, 9001}}},
        {4979, 0, 6, {{1024, 2}, {1025, 1}, {2048, 4326}, {2054, 9102}, {4096, 5030}, {4099, 9001}}},
        {4979, 1, 6, {{1024, 2}, {1025, 1}, {2048, 4326}, {2054, 9102}, {4096, 5773}, {4099, 9001}}},
        {32632, 0, 6, {{1024, 1}, {1025, 1}, {3072, 32632}, {3076, 9001}, {4096, 5030}, {4099, 9001}}},
        {32661, 1, 6, {{1024, 1}, {1025, 1}, {3072, 5041}, {3076, 9001}, {4096, 5773}, {4099, 9001}}},
        {32761, 0, 6, {{1024, 1}, {1025, 1}, {3072, 5042}, {3076, 9001}, {4096, 5030}, {4099, 9001}}},
    };
    for (size_t c = 0; c < sizeof cases / sizeof cases[0]; c++) {
        begin(2);
        track.epsg = cases[c].epsg;
        track.geoid_heights = cases[c].geoid;
        track.has_colours = c % 2;
        facts.n_points = 4000000000;
        for (int i = 0; i < 15; i++)
            facts.n_by_return[i] = 3000000000 + (uint64_t)i;
        const size_t len = las_front(&facts, got);
        const char *text = want_text();
        assert_non_null(strstr(text, "Scan angle: not given. Point source ID: station."));
        assert_null(strstr(text, "Label"));
        uint8_t *at = want_record("LASF_Projection", 34735, 8 + 8 * (size_t)cases[c].n, "GeoTIFF GeoKeyDirectoryTag");
        at[0] = at[2] = 1;
        at[6] = (uint8_t)cases[c].n;
        for (int i = 0; i < cases[c].n; i++) {
            le_put16(at + 8 + 8 * i, cases[c].key[i][0]);
            at[8 + 8 * i + 4] = 1;
            le_put16(at + 8 + 8 * i + 6, cases[c].key[i][1]);
        }
        want_header(0, c % 2 ? 3 : 1, c % 2 ? 34 : 28, 2);
        want_counts();
        le_put32(want + 107, 4000000000);
        for (int i = 0; i < 5; i++)
            le_put32(want + 111 + 4 * i, 3000000000U + (uint32_t)i);
        check(len);
    }
    begin(2); /* the scene's frame has no keys */
    const size_t len = las_front(&facts, got);
    want_text();
    want_header(0, 1, 28, 1);
    check(len);
}

/* Returns are the low four bits of 1.4, and the low three of 1.2. */
static void test_counts(void **state)
{
    (void)state;
    static const int32_t place[4][3] = {{5, -5, 0}, {6, -6, 1}, {4, -4, -1}, {5, -5, 0}};
    static const int low[3] = {4, -6, -1}, high[3] = {6, -4, 1};
    static const uint8_t returns[4] = {0xf1, 0xff, 0x0b, 0x00};
    for (int minor = 2; minor <= 4; minor += 2) {
        begin(minor);
        for (int i = 0; i < 4; i++) {
            uint8_t record[30] = {0};
            for (int k = 0; k < 3; k++)
                le_put32(record + 4 * k, (uint32_t)place[i][k]);
            record[14] = returns[i];
            las_count_record(&facts, record);
        }
        assert_int_equal(facts.n_points, 4);
        for (int k = 0; k < 3; k++) {
            assert_int_equal(facts.min[k], low[k]);
            assert_int_equal(facts.max[k], high[k]);
        }
        for (int i = 0; i < 15; i++) {
            const int is_one = minor == 4 ? i == 0 || i == 14 || i == 10 : i == 0 || i == 6 || i == 2;
            assert_int_equal(facts.n_by_return[i], is_one);
        }
    }
}

/* The lengths of point formats 0 to 10: tables of ASPRS LAS 1.4 R15. */
static void test_lengths_of_formats(void **state)
{
    (void)state;
    static const size_t want_len[] = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
    for (int format = 0; format <= 10; format++)
        assert_int_equal(las_format_len(format), want_len[format]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_zone_does_not_matter),
        cmocka_unit_test(test_all_of_1_4),
        cmocka_unit_test(test_growing),
        cmocka_unit_test(test_waves),
        cmocka_unit_test(test_keys_of_1_2),
        cmocka_unit_test(test_counts),
        cmocka_unit_test(test_lengths_of_formats),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
