/* SPDX-License-Identifier: MIT */
/* The times in recordings: creation day, GPS times, the start of each scan, and a clock that comes late. */
#include "tests/unit/e57_rig.h"

enum { POINT = 32, POINT_12 = 28 };

/* 2024-12-31 23:59:50 in GPS time: the 366th day of its year, Tuesday of week 2347 (1419465600 s). */
static const uint64_t GPS_S = 1419724790, S = 1000000000;
static const struct rig_point one = {3000, -4000, 12000, -1234, 7, 1, 1};

static void put_event(uint32_t code, uint64_t a, uint64_t at_s, uint64_t gps)
{
    static uint8_t out[1024];
    const struct native_event e = {.code = code, .a = a, .b = at_s * S, .c = gps};
    rig_put(out, native_encode_event(out, sizeof out, &e, (int64_t)(at_s * S), 0));
}

/* A scan begins at that device time, in s; a point comes 2 ms later. */
static void put_scan(uint32_t scan, uint64_t at_s)
{
    const struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, scan);
    rig_scan_t0_ns = (int64_t)(at_s * S);
    rig_descriptor(1, scan);
    rig_anchor(&a);
    rig_points(0, 0, 2, &one, 1);
}

/* Two scans, a minute apart. Each has its time at its start. */
static void put_two(void)
{
    rig_begin();
    put_event(NATIVE_EV_SCAN_START, 1, 5, GPS_S * S);
    put_scan(1, 5);
    put_event(NATIVE_EV_SCAN_START, 2, 65, (GPS_S + 60) * S);
    put_scan(2, 65);
}

/* Adjusted standard GPS time is a billion seconds less. A double of 4e8 s steps by 6e-8. */
static void test_las(void **state)
{
    (void)state;
    static const int encoding[] = {1 << 0 | 1 << 4, 1 << 0}, time_at[] = {22, 20}, len[] = {POINT, POINT_12};
    for (int old = 0; old < 2; old++) {
        put_two();
        uint8_t *las = rig_record_bytes("a.las", (struct recorder_options){.las_minor = old ? 2 : 4}, NULL),
                *p = las + rig_uint(las + 96, 4);
        assert_int_equal(rig_uint(las + 6, 2), encoding[old]);
        assert_int_equal(rig_uint(las + 90, 2), 366);
        assert_int_equal(rig_uint(las + 92, 2), 2024);
        assert_true(fabs(rig_double(p + time_at[old]) - (419724790.002)) < 1e-7);
        assert_true(fabs(rig_double(p + len[old] + time_at[old]) - (419724850.002)) < 1e-7);
        assert_null(strstr(rig_notes, "times count from the scan's start"));
        free(las);
    }
}

static void test_e57(void **state)
{
    (void)state;
    put_two();
    e57rig_record_one((struct recorder_options){0});
    const char *start = strstr(e57rig_xml, "<acquisitionStart"),
               *second = start != NULL ? strstr(start + 1, "<acquisitionStart") : NULL;
    assert_non_null(start);
    assert_non_null(second);
    assert_true(e57rig_number(start, "dateTimeValue") == (double)GPS_S);
    assert_true(e57rig_number(second, "dateTimeValue") == (double)(GPS_S + 60));
    assert_int_equal(e57rig_number(start, "isAtomicClockReferenced"), 0);
    assert_true(e57rig_number(strstr(e57rig_xml, "<creationDateTime"), "dateTimeValue") == (double)GPS_S);
    e57rig_scan(0, 0, 0);
    assert_true(fabs(e57rig_record[0].t_s - 2e-3) < 1e-12); /* of the scan */
}

static void expect_ply(const char *want, int is_there)
{
    char *ply = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1}, NULL);
    const int found = strstr(ply, want) != NULL;
    if (found != is_there) fail_msg("%s: %s", is_there ? "not there" : "there", want);
    free(ply);
}

static void test_ply(void **state)
{
    (void)state;
    put_two();
    expect_ply("comment the first scan starts at GPS week 2347 second 259190.000000\n", 1);
}

/* The time comes after the first points. The start of the running scan gets its time all the same. Only LAS goes on
 * with times since the start. */
static void put_late(uint32_t code, uint64_t gps)
{
    rig_begin();
    put_scan(1, 5);
    put_event(code, 0, 7, gps);
    rig_points(1, 10, 10, &one, 1);
}

static void test_late_clock(void **state)
{
    (void)state;
    for (int pps = 0; pps < 2; pps++) {
        const uint32_t code = pps ? NATIVE_EV_PPS : NATIVE_EV_TIME;
        const uint64_t gps = (GPS_S + 2) * (pps ? 1 : S);
        put_late(code, gps);
        e57rig_record_one((struct recorder_options){0});
        assert_non_null(strstr(e57rig_xml, "<acquisitionStart"));
        assert_true(e57rig_number(strstr(e57rig_xml, "<acquisitionStart"), "dateTimeValue") == (double)GPS_S);
        put_late(code, gps);
        expect_ply("comment the first scan starts at GPS week 2347 second 259190.000000\n", 1);
        put_late(code, gps);
        uint8_t *las = rig_record_bytes("a.las", (struct recorder_options){0}, NULL), *p = las + rig_uint(las + 96, 4);
        assert_int_equal(rig_uint(las + 6, 2), 1 << 4);
        assert_int_equal(rig_uint(las + 90, 4), 0); /* no day, no year */
        assert_true(rig_double(p + POINT + 22) == 10e-3);
        assert_non_null(strstr(rig_notes, "times count from the scan's start"));
        free(las);
    }
}

/* Only the second scan has the time. The first one's start stays unknown. */
static void put_second_alone(void)
{
    rig_begin();
    put_scan(1, 5);
    put_event(NATIVE_EV_SCAN_START, 2, 65, GPS_S * S);
    put_scan(2, 65);
}

static void test_clock_of_a_later_scan(void **state)
{
    (void)state;
    put_second_alone();
    expect_ply("the first scan starts", 0);
    put_second_alone();
    e57rig_record_one((struct recorder_options){0});
    const char *start = strstr(e57rig_xml, "<acquisitionStart"), *second = strstr(e57rig_xml, "scan 2, station 2");
    assert_true(start != NULL && second != NULL && start > second);
    assert_true(e57rig_number(start, "dateTimeValue") == (double)GPS_S);
    assert_null(strstr(e57rig_xml, "creationDateTime"));
}

static int tear_down(void **state)
{
    e57rig_free();
    return rig_tear_down(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_las),
        cmocka_unit_test(test_e57),
        cmocka_unit_test(test_ply),
        cmocka_unit_test(test_late_clock),
        cmocka_unit_test(test_clock_of_a_later_scan),
    };
    return cmocka_run_group_tests(tests, rig_set_up, tear_down);
}
