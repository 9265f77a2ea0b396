/* SPDX-License-Identifier: MIT */
/* UTC, TAI and GPS time against published dates and the system's own table and calendar. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <cmocka.h>

#include "core/utc.h"

static int64_t tai_of(const char *text)
{
    struct utc_time utc;
    struct sh_err err;
    int64_t tai_ns = 0;
    if (utc_parse(text, &utc, &err) != SH_OK || utc_to_tai(utc_table_builtin(), &utc, &tai_ns, &err) != SH_OK)
        fail_msg("%s: %s", text, err.text);
    return tai_ns;
}

static const char *text_of(const struct utc_table *table, int64_t tai_ns, int decimals)
{
    static char buf[UTC_TEXT_LEN];
    struct utc_time utc;
    utc_from_tai(table, tai_ns, &utc);
    utc_format(&utc, decimals, buf);
    return buf;
}

/* The dates are those of IS-GPS-200 (epoch), IERS Bulletin C 52 (the leap second of 2016) and LIGO's tconvert. The GPS
 * week rollovers of 1999 and 2019 are those that the US Coast Guard announced. */
static void published_dates(void **state)
{
    (void)state;
    static const struct {
        const char *utc;
        int64_t gps_s, week, of_week_s;
        int tai_minus_utc;
    } date[] = {
        {"1980-01-06T00:00:00Z", 0, 0, 0, 19},
        {"1999-08-21T23:59:46Z", 619315199, 1023, 604799, 32},
        {"1999-08-21T23:59:47Z", 619315200, 1024, 0, 32},
        {"2000-01-01T00:00:00Z", 630720013, 1042, 518413, 32},
        {"2011-09-14T01:46:25Z", 1000000000, 1653, 265600, 34},
        {"2016-12-31T23:59:59Z", 1167264016, 1930, 16, 36},
        {"2016-12-31T23:59:60Z", 1167264017, 1930, 17, 36},
        {"2017-01-01T00:00:00Z", 1167264018, 1930, 18, 37},
        {"2019-04-06T23:59:42Z", 1238630400, 2048, 0, 37},
    };
    for (size_t i = 0; i < sizeof date / sizeof *date; i++) {
        int64_t tai_ns = tai_of(date[i].utc);
        assert_true(utc_gps_ns(tai_ns) == date[i].gps_s * UTC_SECOND_NS);
        struct utc_gps gps = utc_gps_week(tai_ns + 999999999);
        assert_true(gps.week == date[i].week && gps.ns == date[i].of_week_s * UTC_SECOND_NS + 999999999);
        assert_string_equal(text_of(utc_table_builtin(), tai_ns, 0), date[i].utc);
        assert_string_equal(text_of(utc_table_builtin(), tai_ns + 999999999, 0), date[i].utc); /* cut, not rounded */
    }
}

/* gmtime_r of the C library has no leap seconds in the default zone. Our calendar is compared with it over all days of
 * 228 years. */
static void calendar_as_the_library_has_it(void **state)
{
    (void)state;
    const struct utc_table *table = utc_table_builtin();
    for (int64_t s = 63072000 + 43210; s < 7258118400; s += 86400) {
        int64_t tai_ns = utc_tai_from_posix(table, s * UTC_SECOND_NS), back_ns;
        time_t posix = (time_t)s;
        struct tm tm;
        struct utc_time utc;
        gmtime_r(&posix, &tm);
        utc_from_tai(table, tai_ns, &utc);
        assert_true(utc.year == tm.tm_year + 1900 && utc.month == tm.tm_mon + 1 && utc.day == tm.tm_mday);
        assert_true(utc.hour == tm.tm_hour && utc.minute == tm.tm_min && utc.second == tm.tm_sec && utc.ns == 0);
        assert_true(utc_posix_from_tai(table, tai_ns) == s * UTC_SECOND_NS);
        assert_int_equal(utc_to_tai(table, &utc, &back_ns, NULL), SH_OK);
        assert_true(back_ns == tai_ns);
    }
}

/* Each second around each leap second comes one after the other, and converts back and forth. */
static void leap_seconds_count(void **state)
{
    (void)state;
    const struct utc_table *table = utc_table_builtin();
    for (uint32_t i = 1; i < table->n; i++) {
        int64_t first_ns = (table->leap[i].posix_s + table->leap[i].tai_minus_utc - 3) * UTC_SECOND_NS;
        static const char *const end[] = {"23:59:58.5Z", "23:59:59.5Z", "23:59:60.5Z", "00:00:00.5Z", "00:00:01.5Z"};
        static const int posix[] = {-2, -1, 0, 0, 1}; /* 23:59:60 has the number of the second after it */
        for (int k = 0; k < 5; k++) {
            int64_t tai_ns = first_ns + k * UTC_SECOND_NS + 500000000, back_ns;
            struct utc_time utc;
            const char *text = text_of(table, tai_ns, 1);
            assert_string_equal(text + 11, end[k]);
            assert_int_equal(utc_parse(text, &utc, NULL), SH_OK);
            assert_int_equal(utc_to_tai(table, &utc, &back_ns, NULL), SH_OK);
            assert_true(back_ns == tai_ns);
            assert_true(utc_posix_from_tai(table, tai_ns) ==
                        (table->leap[i].posix_s + posix[k]) * UTC_SECOND_NS + 500000000);
        }
    }
}

/* A negative leap second never happened, but is allowed: the second 23:59:59 is left out. */
static void a_negative_leap_second(void **state)
{
    (void)state;
    struct utc_table table = *utc_table_builtin();
    table.leap[table.n] = (struct utc_leap){1893456000, 36}; /* 2030-01-01 */
    table.n++;
    struct utc_time utc = {2029, 12, 31, 23, 59, 58, 0};
    int64_t tai_ns;
    assert_int_equal(utc_to_tai(&table, &utc, &tai_ns, NULL), SH_OK);
    assert_string_equal(text_of(&table, tai_ns, 0), "2029-12-31T23:59:58Z");
    assert_string_equal(text_of(&table, tai_ns + UTC_SECOND_NS, 0), "2030-01-01T00:00:00Z");
    utc.second = 59;
    assert_int_equal(utc_to_tai(&table, &utc, &tai_ns, NULL), SH_EINPUT);
    utc.second = 60;
    assert_int_equal(utc_to_tai(&table, &utc, &tai_ns, NULL), SH_EINPUT);
}

static void what_is_no_time(void **state)
{
    (void)state;
    static const char *const text[] = {"",
                                       "2026-01-01",
                                       "2026-01-01T00:00:00",
                                       "2026-01-01T00:00:00z",
                                       "2026-01-01 00:00:00Z",
                                       "2026-01-01T00:00:00.Z",
                                       "2026-01-01T00:00:00.0123456789Z",
                                       "2026-01-01T00:00:00Z ",
                                       "2026-1-01T00:00:00Z",
                                       "+026-01-01T00:00:00Z"};
    static const char *const date[] = {"1971-12-31T23:59:59Z", "2200-01-01T00:00:00Z", "2026-00-01T00:00:00Z",
                                       "2026-13-01T00:00:00Z", "2026-02-29T00:00:00Z", "2100-02-29T00:00:00Z",
                                       "2026-04-31T00:00:00Z", "2026-01-00T00:00:00Z", "2026-01-01T24:00:00Z",
                                       "2026-01-01T00:60:00Z", "2026-01-01T00:00:61Z", "2016-12-31T22:59:60Z",
                                       "2026-12-31T23:59:60Z", "2015-12-31T23:59:60Z"};
    struct utc_time utc;
    int64_t tai_ns;
    struct sh_err err;
    for (size_t i = 0; i < sizeof text / sizeof *text; i++)
        assert_int_equal(utc_parse(text[i], &utc, &err), SH_EINPUT);
    for (size_t i = 0; i < sizeof date / sizeof *date; i++) {
        assert_int_equal(utc_parse(date[i], &utc, &err), SH_OK);
        if (utc_to_tai(utc_table_builtin(), &utc, &tai_ns, &err) != SH_EINPUT) fail_msg("%s was taken", date[i]);
    }
    assert_true(tai_of("2024-02-29T12:00:00.123456789Z") - tai_of("2024-02-29T12:00:00Z") == 123456789);
    assert_true(tai_of("2024-02-29T12:00:00.5Z") - tai_of("2024-02-29T12:00:00Z") == 500000000);
}

static void tables_are_checked(void **state)
{
    (void)state;
    static const char good[] = "# text\n#@\t3991593600\n2272060800\t10\t# 1 Jan 1972\n2287785600 11 # 1 Jul 1972\n";
    static const char *const bad[] = {"",
                                      "2272060800 10\n",                                     /* no expiry */
                                      "#@ 3991593600\n",                                     /* no entry */
                                      "#@ 3991593600\n2287785600 11\n",                      /* not from 1972 on */
                                      "#@ 3991593600\n2272060800 10\n2287785600 13\n",       /* a step of 3 s */
                                      "#@ 3991593600\n2272060800 10\n2272060800 11\n",       /* twice */
                                      "#@ 3991593600\n2272060800 10\n2287785601 11\n",       /* not at midnight */
                                      "#@ 3991593600\n2272060800 10\nabout 11\n",            /* no number */
                                      "#@ 3991593600\n2272060800 10\n2287785600 11 extra\n", /* more than two */
                                      "#@ 2272060800\n2272060800 10\n",                      /* ends before it begins */
                                      "#@ 9223372036854775808\n2272060800 10\n",             /* ends after all time */
                                      "#@ -9223372036854775808\n2272060800 10\n",
                                      "#@ 3991593600\n2272060800 -9223372036854775808\n"}; /* no offset */
    struct utc_table table;
    struct sh_err err;
    assert_int_equal(utc_table_parse(good, &table, &err), SH_OK);
    assert_true(table.n == 2 && table.leap[1].posix_s == 78796800 && table.leap[1].tai_minus_utc == 11);
    assert_true(table.expires_s == 1782604800);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        if (utc_table_parse(bad[i], &table, &err) != SH_EFORMAT) fail_msg("table %zu was taken", i);
}

/* tzdata's table, which IERS publishes, begins as the built-in one. */
static void the_systems_table_is_the_same(void **state)
{
    (void)state;
    static char text[65536];
    FILE *f = fopen("/usr/share/zoneinfo/leap-seconds.list", "r");
    if (f == NULL) {
        print_message("# no /usr/share/zoneinfo/leap-seconds.list (package tzdata)\n");
        skip();
    }
    size_t n = fread(text, 1, sizeof text - 1, f);
    fclose(f);
    text[n] = '\0';
    struct utc_table table;
    struct sh_err err;
    if (utc_table_parse(text, &table, &err) != SH_OK) fail_msg("%s", err.text);
    const struct utc_table *ours = utc_table_builtin();
    uint32_t common = table.n < ours->n ? table.n : ours->n;
    for (uint32_t i = 0; i < common; i++)
        assert_true(table.leap[i].posix_s == ours->leap[i].posix_s &&
                    table.leap[i].tai_minus_utc == ours->leap[i].tai_minus_utc);
    for (uint32_t i = common; i < table.n; i++) /* seconds that are new to us came after ours ended */
        assert_true(table.leap[i].posix_s > ours->expires_s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(published_dates),
        cmocka_unit_test(calendar_as_the_library_has_it),
        cmocka_unit_test(leap_seconds_count),
        cmocka_unit_test(a_negative_leap_second),
        cmocka_unit_test(what_is_no_time),
        cmocka_unit_test(tables_are_checked),
        cmocka_unit_test(the_systems_table_is_the_same),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
