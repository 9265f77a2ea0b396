/* SPDX-License-Identifier: MIT */
/* Times and tables of leap seconds that are refused: each message has the line or the figure, and what is allowed. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/utc.h"
#include "tests/common/cases.h"

static struct sh_err err;

/* NTP seconds of 1972-01-01 and of 1972-07-01. */
#define FIRST  "2272060800 10 # 1972\n"
#define SECOND "2287785600 11\n"
#define EXPIRY "#@ 2300000000\n"

static void tables(void **state)
{
    (void)state;
    static const char range[] = "out of range", midnight[] = "allowed are the NTP seconds of a midnight and TAI-UTC",
                      steps[] = "allowed is the table from 1972-01-01 (10 s) on in steps of 1 s";
    static const struct {
        const char *text;
        int line; /* 0: the whole table */
        const char *says;
    } is[] = {{EXPIRY "# a comment\n\n \t" FIRST " \t\r\n" SECOND, 0, NULL},
              {EXPIRY "-1 10\n", 2, range},
              {EXPIRY FIRST "2287785600 1001\n", 3, range},
              {EXPIRY FIRST "2287785600 -1001\n", 3, range},
              {EXPIRY "2272060801 10\n", 2, midnight},
              {EXPIRY "2272060800 10 s\n", 2, midnight},
              {EXPIRY "x\n", 2, midnight},
              {EXPIRY SECOND, 2, steps},
              {EXPIRY "2272060800 9\n", 2, steps},
              {EXPIRY FIRST "2287785600 12\n", 3, steps},
              {EXPIRY FIRST "2287785600 10\n", 3, steps},
              {EXPIRY FIRST "2272060800 11\n", 3, steps},
              {EXPIRY FIRST "2271974400 11\n", 3, steps},
              {"#@ 2400000000\n" FIRST SECOND "\n2303683200 10\n", 0, NULL}, /* a second less */
              {FIRST, 0, "not a table of leap seconds that expires (#@) after its last entry and by the end of 2199"},
              {EXPIRY, 0, "not a table of leap seconds that expires (#@) after its last entry and by the end of 2199"},
              {"#@ 2287785600\n" FIRST SECOND, 0,
               "not a table of leap seconds that expires (#@) after its last entry and by the end of 2199"},
              {"#@ 2287785601\n" FIRST SECOND, 0, NULL},
              /* 2200-01-01 is 300 years of 365 days, and 73 leap days, after 1900. */
              {"#@ 9467107200\n" FIRST, 0, NULL},
              {"#@ 9467107201\n" FIRST, 0,
               "not a table of leap seconds that expires (#@) after its last entry and by the end of 2199"}};
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        struct utc_table table;
        char want[160];
        const int rc = utc_table_parse(is[i].text, &table, &err);
        if (is[i].says == NULL) {
            if (rc != SH_OK) fail_msg("case %zu: %s", i, err.text);
            continue;
        }
        snprintf(want, sizeof want, is[i].line > 0 ? "line %d: %s" : "%.0d%s", is[i].line, is[i].says);
        if (rc != SH_EFORMAT || strcmp(err.text, want) != 0) fail_msg("case %zu: %d, %s", i, rc, err.text);
    }
}

/* There is room for UTC_MAX_LEAPS entries. A second that is there already is not added again. */
static void room_for_leap_seconds(void **state)
{
    (void)state;
    char text[8192] = "#@ 9000000000\n", *p = text + strlen(text), says[64];
    struct utc_table table;
    for (int i = 0; i <= UTC_MAX_LEAPS; i++)
        p += sprintf(p, "%lld %d\n", 2272060800LL + 86400LL * i, 10 + i);
    assert_int_equal(utc_table_parse(text, &table, &err), SH_EFORMAT);
    snprintf(says, sizeof says, "line %d: more than %d leap seconds", UTC_MAX_LEAPS + 2, UTC_MAX_LEAPS);
    assert_string_equal(err.text, says);
    table = *utc_table_builtin();
    while (table.n < UTC_MAX_LEAPS) {
        const int64_t at = table.leap[table.n - 1].posix_s + 86400;
        assert_int_equal(utc_table_add(&table, at), 1);
        assert_int_equal(utc_table_add(&table, at), 0);
    }
    assert_int_equal(utc_table_add(&table, table.leap[table.n - 1].posix_s + 86400), 0);
    /* Before 1972 no leap second can be added. */
    table = *utc_table_builtin();
    const struct utc_table same = table;
    assert_int_equal(utc_table_add(&table, 0), 0);
    assert_int_equal(utc_table_add(&table, table.leap[0].posix_s - 1), 0);
    assert_memory_equal(&table, &same, sizeof table);
    /* A leap second in the middle moves the later ones on by a second. */
    table = *utc_table_builtin();
    const struct utc_table before = table;
    assert_int_equal(utc_table_add(&table, before.leap[3].posix_s + 60), 1);
    assert_int_equal(table.n, before.n + 1);
    for (uint32_t i = 0; i < before.n; i++) {
        const uint32_t at = i + (i > 3);
        assert_int_equal(table.leap[at].posix_s, before.leap[i].posix_s);
        assert_int_equal(table.leap[at].tai_minus_utc, before.leap[i].tai_minus_utc + (i > 3));
    }
    assert_int_equal(table.leap[4].posix_s, before.leap[3].posix_s + 60);
    assert_int_equal(table.leap[4].tai_minus_utc, before.leap[3].tai_minus_utc + 1);
}

static void times(void **state)
{
    (void)state;
    static const struct {
        struct utc_time at;
        const char *says; /* NULL: it is a time */
    } is[] = {{{1972, 1, 1, 0, 0, 0, 0}, NULL},
              {{2199, 12, 31, 23, 59, 59, 999999999}, NULL},
              {{1971, 12, 31, 0, 0, 0, 0}, "year 1971 is out of range; allowed 1972 to 2199"},
              {{2200, 1, 1, 0, 0, 0, 0}, "year 2200 is out of range; allowed 1972 to 2199"},
              {{2000, 2, 29, 0, 0, 0, 0}, NULL},
              {{2001, 2, 29, 0, 0, 0, 0}, "there is no 2001-02-29"},
              {{2001, 0, 1, 0, 0, 0, 0}, "there is no 2001-00-01"},
              {{2001, 13, 1, 0, 0, 0, 0}, "there is no 2001-13-01"},
              {{2001, 4, 31, 0, 0, 0, 0}, "there is no 2001-04-31"},
              {{2001, 4, 0, 0, 0, 0, 0}, "there is no 2001-04-00"},
              {{2001, 4, 1, 24, 0, 0, 0}, "there is no 24:00:00"},
              {{2001, 4, 1, -1, 0, 0, 0}, "there is no -1:00:00"},
              {{2001, 4, 1, 0, 60, 0, 0}, "there is no 00:60:00"},
              {{2001, 4, 1, 0, -1, 0, 0}, "there is no 00:-1:00"},
              {{2001, 4, 1, 0, 0, 61, 0}, "there is no 00:00:61"},
              {{2001, 4, 1, 0, 0, -1, 0}, "there is no 00:00:-1"},
              {{2001, 4, 1, 1, 2, 3, 1000000000}, "there is no 01:02:03"},
              {{2001, 4, 1, 1, 2, 3, -1}, "there is no 01:02:03"},
              {{2016, 12, 31, 23, 59, 60, 0}, NULL}, /* a leap second */
              {{2016, 12, 31, 22, 59, 60, 0}, "2016-12-31 has no 22:59:60"},
              {{2016, 12, 30, 23, 59, 60, 0}, "2016-12-30 has no 23:59:60"}};
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        int64_t tai_ns;
        const int rc = utc_to_tai(utc_table_builtin(), &is[i].at, &tai_ns, &err);
        if (rc != (is[i].says == NULL ? SH_OK : SH_EINPUT) || (rc != SH_OK && strcmp(err.text, is[i].says) != 0))
            fail_msg("case %zu: %d, %s", i, rc, err.text);
    }
}

/* Decimals are cut, and any number of them from 0 to 9 is written. */
static void texts(void **state)
{
    (void)state;
    static const struct utc_time at = {2026, 3, 4, 5, 6, 7, 987654321};
    static const char *const want[10] = {"2026-03-04T05:06:07Z",          "2026-03-04T05:06:07.9Z",
                                         "2026-03-04T05:06:07.98Z",       "2026-03-04T05:06:07.987Z",
                                         "2026-03-04T05:06:07.9876Z",     "2026-03-04T05:06:07.98765Z",
                                         "2026-03-04T05:06:07.987654Z",   "2026-03-04T05:06:07.9876543Z",
                                         "2026-03-04T05:06:07.98765432Z", "2026-03-04T05:06:07.987654321Z"};
    static const char *const bad[] = {"",
                                      "2026-03-04T05:06:07",
                                      "2026-03-04T05:06:07.Z",
                                      "2026-03-04 05:06:07Z",
                                      "2026-03-04T05:06:07.1234567891Z",
                                      "2026-03-04T05:06:07ZZ",
                                      "2026-3-04T05:06:07Z",
                                      " 2026-03-04T05:06:07Z",
                                      "2026-03-04T05:06:07+00",
                                      "2026-03-04T05:06:0:Z"};
    for (int n = 0; n < 10; n++) {
        char text[UTC_TEXT_LEN];
        struct utc_time back;
        static const int32_t unit[10] = {1000000000, 100000000, 10000000, 1000000, 100000, 10000, 1000, 100, 10, 1};
        utc_format(&at, n, text);
        assert_string_equal(text, want[n]);
        assert_int_equal(utc_parse(text, &back, &err), SH_OK);
        assert_true(back.year == 2026 && back.month == 3 && back.day == 4 && back.hour == 5 && back.minute == 6);
        assert_int_equal(back.second, 7);
        assert_int_equal(back.ns, at.ns / unit[n] * unit[n]);
    }
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct utc_time back;
        if (utc_parse(bad[i], &back, &err) != SH_EINPUT) fail_msg("%s is taken", bad[i]);
        assert_string_equal(err.text, "not a time as 2026-01-01T00:00:00Z, with up to 9 decimals");
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tables),
        cmocka_unit_test(room_for_leap_seconds),
        cmocka_unit_test(times),
        cmocka_unit_test(texts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
