/* SPDX-License-Identifier: MIT */
/* The variations of a campaign: values, combinations in their order, stations, shards, names of files. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdio.h>
#include <string.h>

#include "firmware_sim/app/studio/batch/sweep.h"

/* Returns the values of one --sweep, each in brackets; or the error, after a "!". */
static const char *values(const char *text)
{
    static char all[1100]; /* an error and its mark */
    struct batch_sweeps sweeps = {.n = 0};
    struct sh_err err = {0};
    const int rc = batch_sweeps_add(&sweeps, text, &err);
    snprintf(all, sizeof all, "!%s", err.text);
    if (rc == SH_OK) all[0] = '\0';
    for (uint32_t i = 0; rc == SH_OK && i < sweeps.sweep[0].n; i++)
        snprintf(all + strlen(all), sizeof all - strlen(all), "(%s)", sweeps.sweep[0].set[i]);
    if (rc != SH_OK) assert_int_equal(rc, SH_EINPUT);
    batch_sweeps_free(&sweeps);
    return all;
}

static void test_values(void **state)
{
    (void)state;
    assert_string_equal(values("head.prr_hz=300000,600000"), "(head.prr_hz=300000)(head.prr_hz=600000)");
    assert_string_equal(values("a=1"), "(a=1)");
    assert_string_equal(values("p=[0,0,1],[0, 1, 2.5]"), "(p=[0,0,1])(p=[0, 1, 2.5])");
    assert_string_equal(values("p={a: [1,2], b: 3},x"), "(p={a: [1,2], b: 3})(p=x)");
    assert_string_equal(values("n=\"a,b\",'c,d'"), "(n=\"a,b\")(n='c,d')");
    assert_string_equal(values("links=[{type: tcp, port: 0}, {type: \"null\"}],[]"),
                        "(links=[{type: tcp, port: 0}, {type: \"null\"}])(links=[])");
    assert_string_equal(values("a=b=c,d"), "(a=b=c)(a=d)");
    assert_string_equal(values("t=00:10"), "(t=00:10)"); /* no range: two numbers */
    assert_string_equal(values("t=2026-01-01T00:00:00Z"), "(t=2026-01-01T00:00:00Z)");
    for (const char *const *bad =
             (const char *const[]){"a", "=1", "a=", "a=1,", "a=,1", "a=1,,2", "a=[1,2", "a=1]", "a='x", "a=1,1", NULL};
         *bad != NULL; bad++)
        assert_int_equal(values(*bad)[0], '!');
}

/* Each error is whole: the text as it was given, and what is allowed. */
static void test_errors(void **state)
{
    static const char form[] = ": allowed KEY=A,B,... or KEY=FIRST:LAST:STEP, as in head.prr_hz=300000,600000";
    static const struct {
        const char *text, *says;
    } rows[] = {{"a", NULL},
                {"=1", NULL},
                {"a=", NULL},
                {"a=1,,2", "--sweep a=1,,2: an empty value; allowed as in a=A,B"},
                {"a=1,", "--sweep a=1,: an empty value; allowed as in a=A,B"},
                {"a=[1,2", "--sweep a=[1,2: a bracket or a quote is not closed"},
                {"a=1]", "--sweep a=1]: a bracket or a quote is not closed"},
                {"a='x", "--sweep a='x: a bracket or a quote is not closed"},
                {"a=1,2,1", "--sweep a: the value 1 is given twice"},
                {"a=1:2:0", "--sweep a=1:2:0: no value from FIRST to LAST; allowed FIRST:LAST:STEP as in 0:10:2"},
                {"a=2:1:1", "--sweep a=2:1:1: no value from FIRST to LAST; allowed FIRST:LAST:STEP as in 0:10:2"},
                {"a=0:10000:1", "--sweep a=0:10000:1: 10001 values; allowed at most 10000"}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char want[256];
        snprintf(want, sizeof want, rows[i].says != NULL ? "!%s" : "!--sweep %s%s",
                 rows[i].says != NULL ? rows[i].says : rows[i].text, form);
        assert_string_equal(values(rows[i].text), want);
    }
}

static void test_errors_between_sweeps(void **state)
{
    static const struct {
        const char *first, *second, *says;
    } rows[] = {
        {"a[0].b=1", "a.0.b=2", "--sweep a.0.b: the key is given twice; allowed once, with all its values"},
        {"a.b=1", "a={}", "--sweep a: it would replace the values of --sweep a.b; allowed is the other order"},
        {"a[0]=1", "a=[]", "--sweep a: it would replace the values of --sweep a[0]; allowed is the other order"},
        {"a={}", "a.b=1", NULL},
        {"ab=1", "a=1", NULL}};
    struct batch_sweeps sweeps = {.n = 0};
    struct sh_err err;
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        assert_int_equal(batch_sweeps_add(&sweeps, rows[i].first, &err), SH_OK);
        const int rc = batch_sweeps_add(&sweeps, rows[i].second, &err);
        assert_int_equal(rc, rows[i].says == NULL ? SH_OK : SH_EINPUT);
        if (rows[i].says != NULL) assert_string_equal(err.text, rows[i].says);
        batch_sweeps_free(&sweeps);
    }
    for (int i = 0; i < 16; i++) {
        char text[16];
        snprintf(text, sizeof text, "k%d=1", i);
        assert_int_equal(batch_sweeps_add(&sweeps, text, &err), SH_OK);
    }
    assert_int_equal(batch_sweeps_add(&sweeps, "more=1", &err), SH_EINPUT);
    assert_string_equal(err.text, "--sweep: at most 16 keys");
    batch_sweeps_free(&sweeps);
    assert_int_equal(sweeps.n, 0);
}

/* Either spelling of an element is the same key. */
static void test_keys(void **state)
{
    (void)state;
    assert_string_equal(batch_after_key("a[0].b=5", "a.0.b"), "=5");
    assert_string_equal(batch_after_key("a.0.b=5", "a[0]"), ".b=5");
    assert_string_equal(batch_after_key("a", "a"), "");
    assert_null(batch_after_key("a", "ab"));
    assert_null(batch_after_key("b", "a"));
}

static void test_ranges(void **state)
{
    (void)state;
    assert_string_equal(values("a=0:10:5"), "(a=0)(a=5)(a=10)");
    assert_string_equal(values("a=0:9:5"), "(a=0)(a=5)");
    assert_string_equal(values("a=3:1:-1"), "(a=3)(a=2)(a=1)");
    assert_string_equal(values("a=7:7:1"), "(a=7)");
    /* 0.1 + 2 * 0.1 isn't 0.3 in binary, nor is (0.3 - 0.1) / 0.1 two */
    assert_string_equal(values("a=0.1:0.3:0.1"), "(a=0.1)(a=0.2)(a=0.3)");
    assert_string_equal(values("a=-1e3:1e3:1e3"), "(a=-1000)(a=0)(a=1000)");
    /* -0.3 + 3 * 0.1 is 5.6e-17, and near 0 the error of 1000.3 is large */
    assert_string_equal(values("a=-0.3:0.1:0.1"), "(a=-0.3)(a=-0.2)(a=-0.1)(a=0)(a=0.1)");
    assert_string_equal(values("a=-1000.3:1000:1000.4"), "(a=-1000.3)(a=0.1)");
    /* every digit counts: northings to the micrometre, seeds, seconds since 1970 */
    assert_string_equal(values("a=1000000000001:1000000000003:1"),
                        "(a=1000000000001)(a=1000000000002)(a=1000000000003)");
    assert_string_equal(values("a=5812345.678901:5812346:1"), "(a=5812345.678901)");
    assert_string_equal(values("a=0:0:1"), "(a=0)");
    assert_string_equal(values("a=1e-9:2e-9:1e-9"), "(a=1e-09)(a=2e-09)");
    assert_string_equal(values("a=1e300:2e300:1e300"), "(a=1e+300)(a=2e+300)");
    /* more digits than a double has; the largest seed */
    assert_string_equal(values("a=1234567890123456:1234567890123476:10"),
                        "(a=1234567890123456)(a=1234567890123466)(a=1234567890123476)");
    assert_string_equal(values("a=18446744073709551613:18446744073709551615:2"),
                        "(a=18446744073709551613)(a=18446744073709551615)");
    assert_string_equal(values("a=-9007199254740993:-9007199254740995:-1"),
                        "(a=-9007199254740993)(a=-9007199254740994)(a=-9007199254740995)");
    assert_string_equal(values("a=-1:+1:1"), "(a=-1)(a=0)(a=1)");
    assert_string_equal(values("a=0:10:20"), "(a=0)");
    assert_string_equal(values("a=1000000000000.5:1000000000001:0.25"),
                        "(a=1000000000000.5)(a=1000000000000.75)(a=1000000000001)");
    static const char *const fine[] = {"a=1234567890123456:1234567890123476:10.0",
                                       "a=1234567890123.5:1234567890124:0.0625"};
    for (size_t i = 0; i < sizeof fine / sizeof fine[0]; i++) {
        char want[256];
        snprintf(want, sizeof want,
                 "!--sweep %s: a value has more than 15 digits; allowed up to 15, or whole numbers "
                 "of up to 64 bits for FIRST, LAST and STEP",
                 fine[i]);
        if (strcmp(values(fine[i]), want) != 0) fail_msg("%s: %s", fine[i], values(fine[i]));
    }
    assert_string_equal(values("a=0x1:3:1"), "(a=0x1:3:1)"); /* no range: numbers are decimal */
    assert_string_equal(values("a=1:3:5"), "(a=1)");
    assert_int_equal(values("a=3:1:5")[0], '!');
    assert_int_equal(values("a=1:2:0.0")[0], '!');
    assert_int_equal(values("a=1:2:0")[0], '!');
    assert_int_equal(values("a=2:1:1")[0], '!');
    assert_non_null(strstr(values("a=0:10000:1"), "at most 10000"));
}

static void test_order(void **state)
{
    static const char *const want[6][2] = {{"a=1", "b=x"}, {"a=1", "b=y"}, {"a=1", "b=z"},
                                           {"a=2", "b=x"}, {"a=2", "b=y"}, {"a=2", "b=z"}};
    struct batch_sweeps sweeps = {.n = 0};
    struct sh_err err;
    const char *set[BATCH_MAX_SWEEPS];
    uint32_t n;
    (void)state;
    assert_int_equal(batch_sweeps_count(&sweeps, &n, &err), SH_OK);
    assert_int_equal(n, 1); /* nothing varies: one combination */
    assert_int_equal(batch_sweeps_add(&sweeps, "a=1,2", &err), SH_OK);
    assert_int_equal(batch_sweeps_add(&sweeps, "b=x,y,z", &err), SH_OK);
    assert_int_equal(batch_sweeps_count(&sweeps, &n, &err), SH_OK);
    assert_int_equal(n, 6);
    for (uint32_t i = 0; i < n; i++) {
        batch_sweeps_at(&sweeps, i, set);
        assert_string_equal(set[0], want[i][0]);
        assert_string_equal(set[1], want[i][1]);
    }
    assert_int_equal(batch_sweeps_add(&sweeps, "a=3", &err), SH_EINPUT); /* a key twice */
    batch_sweeps_free(&sweeps);
    /* 1,000 x 1,000 are allowed; twice that are too many. */
    assert_int_equal(batch_sweeps_add(&sweeps, "a=1:1000:1", &err), SH_OK);
    assert_int_equal(batch_sweeps_add(&sweeps, "b=1:1000:1", &err), SH_OK);
    assert_int_equal(batch_sweeps_count(&sweeps, &n, &err), SH_OK);
    assert_int_equal(batch_sweeps_add(&sweeps, "c=1,2", &err), SH_OK);
    assert_int_equal(batch_sweeps_count(&sweeps, &n, &err), SH_EINPUT);
    batch_sweeps_free(&sweeps);
}

static void test_stations(void **state)
{
    static const uint32_t want[] = {1, 3, 4, 5, 4096};
    static struct batch_stations s;
    struct sh_err err;
    (void)state;
    assert_int_equal(batch_stations_parse("all", &s, &err), SH_OK);
    assert_int_equal(s.all, 1);
    assert_int_equal(batch_stations_parse("1,3-5,4096", &s, &err), SH_OK);
    assert_int_equal(s.all, 0);
    assert_int_equal(s.n, sizeof want / sizeof want[0]);
    assert_memory_equal(s.number, want, sizeof want);
    assert_int_equal(batch_stations_parse("1-2,3,4-4", &s, &err), SH_OK); /* each begins after the one before */
    assert_int_equal(s.n, 4);
    assert_int_equal(s.number[3], 4);
    assert_int_equal(batch_stations_parse("1-3,3", &s, &err), SH_EINPUT);
    assert_string_equal(err.text, "--stations 1-3,3: allowed all, or rising numbers from 1 to 4096, as in 1,3-5");
    assert_int_equal(batch_stations_parse("1-4096", &s, &err), SH_OK);
    assert_int_equal(s.n, 4096);
    for (const char *const *bad = (const char *const[]){"", "0", "1,", ",1", "2,1", "1,1", "5-3", "1-", "-2", "1-2-3",
                                                        "x", "1 2", "4097", "99999999999999999999", "1.5", "ALL", NULL};
         *bad != NULL; bad++)
        assert_int_equal(batch_stations_parse(*bad, &s, &err), SH_EINPUT);
}

static void test_shards(void **state)
{
    uint32_t i, n;
    struct sh_err err;
    (void)state;
    assert_int_equal(batch_shard_parse("2/7", &i, &n, &err), SH_OK);
    assert_int_equal(i, 2);
    assert_int_equal(n, 7);
    assert_int_equal(batch_shard_parse("1000000/1000000", &i, &n, &err), SH_OK);
    for (const char *const *bad = (const char *const[]){"", "1", "1/", "/1", "0/2", "3/2", "1/0", "1/2/3", "-1/2",
                                                        "a/b", "1/1000001", "1 / 2", NULL};
         *bad != NULL; bad++)
        assert_int_equal(batch_shard_parse(*bad, &i, &n, &err), SH_EINPUT);
}

static void test_names(void **state)
{
    char name[BATCH_NAME_LEN], other[BATCH_NAME_LEN], value[300];
    const char *set[2] = {"head.prr_hz=600000", "stations.0.position_m=[0, 0, 1]"};
    (void)state;
    batch_name(7, 4, 2, set, 1, name);
    assert_string_equal(name, "0007_station-2_head.prr_hz=600000");
    batch_name(12345, 5, 12, set, 2, name);
    assert_string_equal(name, "12345_station-12_head.prr_hz=600000_stations.0.position_m=_0,_0,_1_");
    set[0] = "f=../a\\b:c*?\"<>|\xc3\xa4\n$`'";
    batch_name(1, 4, 1, set, 1, name);
    assert_string_equal(name, "0001_station-1_f=.._a_b_c____________");
    /* Long ones differ where their ends do. */
    memset(value, 'x', sizeof value);
    value[sizeof value - 1] = '\0';
    set[0] = value;
    batch_name(1, 4, 1, set, 1, name);
    value[sizeof value - 2] = 'y';
    batch_name(1, 4, 1, set, 1, other);
    assert_true(strlen(name) < BATCH_NAME_LEN - 1);
    assert_int_equal(strlen(name), 96 + 1 + 8); /* what is kept, and the hash of all */
    assert_memory_equal(name, other, 90);
    assert_string_not_equal(name, other);
    for (int longer = 0; longer < 2; longer++) { /* "0001_station-1_" has 15 characters */
        value[96 - 15 + longer] = '\0';
        batch_name(1, 4, 1, set, 1, name);
        assert_int_equal(strlen(name), longer ? 105 : 96);
        value[96 - 15 + longer] = 'x';
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_values),   cmocka_unit_test(test_errors), cmocka_unit_test(test_errors_between_sweeps),
        cmocka_unit_test(test_keys),     cmocka_unit_test(test_ranges), cmocka_unit_test(test_order),
        cmocka_unit_test(test_stations), cmocka_unit_test(test_shards), cmocka_unit_test(test_names),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
