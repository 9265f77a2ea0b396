/* SPDX-License-Identifier: MIT */
/* NMEA sentences, compared with published examples and read by a reader that shares nothing with the encoder. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/protocol/protocol.h"
#include "tests/common/nmea_reader.h"

static struct nmea_fix fix;
static struct nmea_line line; /* the last one that was read */

static int setup(void **state)
{
    (void)state;
    fix = (struct nmea_fix){.talker = {'G', 'P'},
                            .year = 1994,
                            .month = 3,
                            .day = 23,
                            .hour = 12,
                            .minute = 35,
                            .second = 19,
                            .lat_deg = 48 + 7.038 / 60,
                            .lon_deg = 11 + 31.0 / 60,
                            .altitude_m = 545.4,
                            .geoid_separation_m = 46.9,
                            .quality = 1,
                            .satellites = 8,
                            .hdop = 0.9,
                            .speed_m_s = 22.4 * 1852.0 / 3600.0,
                            .course_deg = 84.4,
                            .sigma_m = {0.01, 0.02, 0.03}};
    return 0;
}

/* Encodes the fix, and reads its fields. */
static void encode(size_t (*how)(char *, size_t, const struct nmea_fix *), const char *type, int n_fields)
{
    char text[NMEA_MAX_SENTENCE];
    read_line(text, how(text, sizeof text, &fix), type, n_fields, &line);
}

/* The sentences are those of many manuals and tutorials (the first two are the "Munich" ones). */
static void published_checksums(void **state)
{
    (void)state;
    static const char *const lines[] = {
        "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47",
        "$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A",
        "$GPGSA,A,3,04,05,,09,12,,,24,,,,,2.5,1.3,2.1*39",
        "$GPZDA,201530.00,04,07,2002,00,00*60",
        "$GPGST,024603.00,3.2,6.6,4.7,47.3,5.8,5.6,22.0*58",
    };
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++) {
        const char *star = strchr(lines[i], '*');
        assert_int_equal(protocol_xor(lines[i] + 1, (size_t)(star - lines[i] - 1)), strtol(star + 1, NULL, 16));
    }
}

static void the_example_comes_out(void **state)
{
    (void)state;
    encode(nmea_encode_gga, "GPGGA", 15);
    static const char *const gga[] = {"123519.00", "4807.0380000", "N", "01131.0000000", "E", "1", "08",
                                      "0.9",       "545.400",      "M", "46.9",          "M", "",  ""};
    for (int i = 0; i < 14; i++)
        assert_string_equal(line.field[i + 1], gga[i]);
    encode(nmea_encode_rmc, "GPRMC", 13);
    static const char *const rmc[] = {
        "123519.00", "A", "4807.0380000", "N", "01131.0000000", "E", "22.400", "84.40", "230394", "", "", "A"};
    for (int i = 0; i < 12; i++)
        assert_string_equal(line.field[i + 1], rmc[i]);
    encode(nmea_encode_zda, "GPZDA", 7);
    assert_string_equal(line.field[2], "23");
    assert_string_equal(line.field[3], "03");
    assert_string_equal(line.field[4], "1994");
    encode(nmea_encode_gsa, "GPGSA", 18);
    assert_string_equal(line.field[2], "3");
    assert_string_equal(line.field[10], "08"); /* eight satellites, then none */
    assert_string_equal(line.field[11], "");
    assert_string_equal(line.field[16], "0.9");
    encode(nmea_encode_gst, "GPGST", 9);
    assert_string_equal(line.field[6], "0.0100");
    assert_string_equal(line.field[7], "0.0200");
    assert_string_equal(line.field[8], "0.0300");
}

/* The tolerance is half a step of the last digit, 0.5e-7 of a minute, and the rounding of 180 degrees in a double. */
#define HALF_STEP_DEG (0.5e-7 / 60 + 1e-13)

static void check_place(double lat_deg, double lon_deg)
{
    fix.lat_deg = lat_deg;
    fix.lon_deg = lon_deg;
    encode(nmea_encode_gga, "GPGGA", 15);
    double lat = read_angle(line.field[2], line.field[3], 2, "NS"),
           lon = read_angle(line.field[4], line.field[5], 3, "EW");
    if (fabs(lat - lat_deg) > HALF_STEP_DEG || fabs(lon - lon_deg) > HALF_STEP_DEG)
        fail_msg("%.12f %.12f came back as %.12f %.12f", lat_deg, lon_deg, lat, lon);
}

static void places_come_back(void **state)
{
    (void)state;
    static const double lats[] = {0,       -0.0, 90, -90, 89.99999999999, -1e-12, 1e-9, 48.0000000001, 47.99999999999,
                                  -33.8568},
                        lons[] = {0,      180,           -180, 179.99999999999, -179.99999999999,
                                  -1e-12, 8.99999999999, -0.5, 151.2153};
    for (size_t i = 0; i < sizeof lats / sizeof *lats; i++)
        for (size_t k = 0; k < sizeof lons / sizeof *lons; k++)
            check_place(lats[i], lons[k]);
    for (int i = 0; i < 20000; i++) /* the fraction of the golden ratio spreads evenly */
        check_place(180 * fmod(i * 0.6180339887498949, 1) - 90, 360 * fmod(i * 0.3819660112501051 + 0.1, 1) - 180);
}

/* 47 deg 59.99999999 min is 48 deg, not 47 deg 60 min. */
static void minutes_round_up_to_degrees(void **state)
{
    (void)state;
    fix.lat_deg = 48 - 0.4e-7 / 60;
    fix.lon_deg = -(10 - 0.4e-7 / 60);
    encode(nmea_encode_gga, "GPGGA", 15);
    assert_string_equal(line.field[2], "4800.0000000");
    assert_string_equal(line.field[4], "01000.0000000");
    assert_string_equal(line.field[5], "W");
    fix.lat_deg = 48 - 0.6e-7 / 60;
    encode(nmea_encode_gga, "GPGGA", 15);
    assert_string_equal(line.field[2], "4759.9999999");
    fix.lat_deg = -1e-12; /* no minus zero */
    encode(nmea_encode_gga, "GPGGA", 15);
    assert_string_equal(line.field[2], "0000.0000000");
    assert_string_equal(line.field[3], "N");
}

static void leap_second_and_hundredths(void **state)
{
    (void)state;
    fix.hour = 23;
    fix.minute = 59;
    fix.second = 60;
    fix.hundredth = 95;
    encode(nmea_encode_zda, "GPZDA", 7);
    assert_string_equal(line.field[1], "235960.95");
}

static void speed_and_course(void **state)
{
    (void)state;
    fix.speed_m_s = 1852.0 / 3600.0;
    fix.course_deg = 359.999;
    encode(nmea_encode_rmc, "GPRMC", 13);
    assert_string_equal(line.field[7], "1.000");
    assert_string_equal(line.field[8], "359.99"); /* never 360.00 */
    fix.speed_m_s = 0;
    fix.course_deg = NAN;
    encode(nmea_encode_rmc, "GPRMC", 13);
    assert_string_equal(line.field[7], "0.000");
    assert_string_equal(line.field[8], "000.0"); /* not empty: the head stands, and sscanf's %[^,] needs a character */
}

/* Mode letters of RMC by NMEA 0183, beside the quality of GGA. */
static void qualities(void **state)
{
    (void)state;
    static const struct {
        int quality;
        const char *mode;
    } of[] = {{0, "N"}, {1, "A"}, {2, "D"}, {4, "R"}, {5, "F"}};
    for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
        const char digit[2] = {(char)('0' + of[i].quality)};
        fix.quality = of[i].quality;
        encode(nmea_encode_gga, "GPGGA", 15);
        assert_string_equal(line.field[6], digit);
        for (int k = 2; k < 6 && fix.quality == 0; k++)
            assert_string_equal(line.field[k], "");
        encode(nmea_encode_rmc, "GPRMC", 13);
        assert_string_equal(line.field[12], of[i].mode);
        assert_string_equal(line.field[2], fix.quality == 0 ? "V" : "A");
        encode(nmea_encode_gsa, "GPGSA", 18);
        assert_string_equal(line.field[2], fix.quality == 0 ? "1" : "3");
        encode(nmea_encode_gst, "GPGST", 9);
    }
}

/* NMEA 0183: at most 82 characters with "$" and CR LF. libnmea drops longer ones, and the example of minmea those of
 * more than 81. A row with fewer decimals than the row before would have 82 to 84 characters with as many. */
static void decimals_leave_where_a_sentence_is_too_long(void **state)
{
    (void)state;
    static const struct {
        double altitude_m, separation_m, hdop;
        const char *sentence; /* without its checksum and end, which are 5 characters */
    } rows[] = {
        {500, 0, 0.7, "$GPGGA,123519.00,4807.0380000,N,01131.0000000,E,1,08,0.7,500.000,M,0.0,M,,"},
        {999.9994, 46.9, 0.7, "$GPGGA,123519.00,4807.0380000,N,01131.0000000,E,1,08,0.7,999.999,M,46.9,M,,"},
        {1000, 46.9, 0.7, "$GPGGA,123519.00,4807.0380000,N,01131.0000000,E,1,08,0.7,1000.000,M,46.9,M,,"},
        {1000, 46.95, 0.7, "$GPGGA,123519.00,4807.038000,N,01131.000000,E,1,08,0.7,1000.000,M,46.95,M,,"},
        {-1234.5, 46.9, 0.7, "$GPGGA,123519.00,4807.038000,N,01131.000000,E,1,08,0.7,-1234.500,M,46.9,M,,"},
        {-1234.5, -105.125, 0.7, "$GPGGA,123519.00,4807.03800,N,01131.00000,E,1,08,0.7,-1234.50,M,-105.12,M,,"},
        {-1234.5, -105.125, 99.9, "$GPGGA,123519.00,4807.03800,N,01131.00000,E,1,08,99.9,-1234.50,M,-105.12,M,,"},
        {-12345.678, -119.125, 99.9, "$GPGGA,123519.00,4807.0380,N,01131.0000,E,1,08,99.9,-12345.68,M,-119.12,M,,"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char text[NMEA_MAX_SENTENCE];
        fix.altitude_m = rows[i].altitude_m;
        fix.geoid_separation_m = rows[i].separation_m;
        fix.hdop = rows[i].hdop;
        const size_t len = nmea_encode_gga(text, sizeof text, &fix);
        read_line(text, len, "GPGGA", 15, &line); /* the checksum */
        assert_int_equal(len, strlen(rows[i].sentence) + 5);
        assert_memory_equal(text, rows[i].sentence, len - 5);
        assert_true(len <= 81);
    }
}

static size_t short_rmc(char *dst, size_t cap, const struct nmea_fix *at)
{
    return nmea_encode_rmc_within(dst, cap, at, 72);
}

/* 72 characters with CR LF are what clients of a VLP-16 read. The speed costs decimals of minutes. */
static void a_short_rmc_has_its_length(void **state)
{
    (void)state;
    static const double speeds_m_s[] = {0, 0.001, 3, 33, 340, 7800, 123456};
    for (size_t i = 0; i < sizeof speeds_m_s / sizeof *speeds_m_s; i++) {
        fix.speed_m_s = speeds_m_s[i];
        fix.course_deg = i == 0 ? NAN : 359.99;
        encode(short_rmc, "GPRMC", 13);
        const int decimals = i == 0 ? 5 : i < 6 ? 4 : 3;
        const double step_deg = pow(10, -decimals) / 60, knots = strtod(line.field[7], NULL);
        assert_int_equal(strlen(strchr(line.field[3], '.') + 1), decimals);
        assert_true(fabs(read_angle(line.field[3], line.field[4], 2, "NS") - fix.lat_deg) <= 0.5 * step_deg + 1e-13);
        assert_true(fabs(knots * 1852 / 3600 - fix.speed_m_s) <= (fix.speed_m_s < 500 ? 0.03 : 0.3));
        char text[NMEA_MAX_SENTENCE];
        assert_in_range(short_rmc(text, sizeof text, &fix), 60, 72);
    }
}

/* No value that a head can have makes a sentence longer than 81 characters. */
static void no_sentence_is_too_long(void **state)
{
    (void)state;
    static const double heights_m[] = {0, -0.0004, 99.9999, 8848.86, -10984, 400000},
                        separations_m[] = {0, -120, 119.9}, speeds_m_s[] = {0, 0.5, 99, 7800}, dops[] = {0.1, 99.9};
    char text[NMEA_MAX_ALL];
    fix.satellites = 99;
    fix.course_deg = 359.99;
    fix.lat_deg = -89.999999;
    fix.lon_deg = -179.999999;
    for (int i = 0; i < 3; i++)
        fix.sigma_m[i] = 1000; /* the greatest gnss.accuracy_m */
    for (size_t i = 0; i < 6 * 3 * 4 * 2; i++) {
        fix.altitude_m = heights_m[i % 6];
        fix.geoid_separation_m = separations_m[i / 6 % 3];
        fix.speed_m_s = speeds_m_s[i / 18 % 4];
        fix.hdop = dops[i / 72];
        const size_t len = nmea_encode_all(text, sizeof text, &fix);
        assert_true(len != 0);
        for (const char *at = text; at < text + len; at = strchr(at, '\n') + 1)
            assert_in_range(strchr(at, '\n') + 1 - at, 20, 81);
    }
}

/* The longest sentences fit. With less room the call returns 0, and writes nothing beyond the end. */
static void room_is_kept(void **state)
{
    (void)state;
    char text[NMEA_MAX_ALL + 1], small[NMEA_MAX_ALL + 1];
    fix.satellites = 99;
    fix.hdop = 99.9;
    fix.altitude_m = -12345.6789;
    fix.geoid_separation_m = -119.9999;
    fix.lon_deg = -180;
    fix.speed_m_s = 123456;
    for (int i = 0; i < 3; i++)
        fix.sigma_m[i] = 1000;
    size_t len = nmea_encode_all(text, sizeof text, &fix);
    assert_true(len > 0 && len <= NMEA_MAX_ALL);
    int sentences = 0;
    for (size_t i = 0; i < len; i++)
        sentences += text[i] == '\n';
    assert_int_equal(sentences, NMEA_ALL_SENTENCES);
    for (size_t cap = 0; cap <= len; cap++) {
        memset(small, 0x55, sizeof small);
        assert_int_equal(nmea_encode_all(small, cap, &fix), 0);
        for (size_t i = cap; i < sizeof small; i++)
            assert_int_equal(small[i], 0x55);
    }
    assert_int_equal(nmea_encode_all(small, len + 1, &fix), len);
    assert_memory_equal(small, text, len);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(published_checksums),
        cmocka_unit_test_setup(the_example_comes_out, setup),
        cmocka_unit_test_setup(places_come_back, setup),
        cmocka_unit_test_setup(minutes_round_up_to_degrees, setup),
        cmocka_unit_test_setup(leap_second_and_hundredths, setup),
        cmocka_unit_test_setup(speed_and_course, setup),
        cmocka_unit_test_setup(qualities, setup),
        cmocka_unit_test_setup(decimals_leave_where_a_sentence_is_too_long, setup),
        cmocka_unit_test_setup(a_short_rmc_has_its_length, setup),
        cmocka_unit_test_setup(no_sentence_is_too_long, setup),
        cmocka_unit_test_setup(room_is_kept, setup),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
