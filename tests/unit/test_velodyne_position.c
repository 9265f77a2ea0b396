/* SPDX-License-Identifier: MIT */
/* VLP-16 position packets: their fields, their rate, the receiver's sentence. */
#include <setjmp.h>
#include <stdarg.h>
#include <string.h>

#include <cmocka.h>

#include "core/bytes.h"
#include "tests/common/protocol_rig.h"

static struct protocol_rig rig;
static int64_t asked_ns;
static int n_asked;

static int setup(void **state)
{
    (void)state;
    protocol_rig_open(&rig, PROTOCOL_VELODYNE_POSITION, "Velodyne", "VLP-16");
    rig.fix = protocol_rig_fix;
    n_asked = 0;
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    protocol_rig_close(&rig);
    return 0;
}

static const uint8_t *packet(uint32_t i)
{
    assert_true(i < rig.n_units);
    assert_int_equal(rig.end[i], 512 * (i + 1));
    return rig.bytes + (size_t)512 * i;
}

/* Notes the time that is asked for, and gives the rig's fix. */
static int note_time(void *ctx, int64_t t_ns, struct nmea_fix *fix)
{
    const struct protocol_rig *r = ctx;
    asked_ns = t_ns;
    n_asked++;
    *fix = r->fix;
    return 1;
}

static void open_again(int64_t t_ns)
{
    struct sh_err err;
    protocol_destroy(rig.ops, rig.protocol);
    rig.spec.host.fix = note_time;
    assert_int_equal(protocol_create(rig.ops, &rig.spec, &rig.protocol, &err), 0);
    rig.ops->open(rig.protocol, t_ns);
}

/* Checks the fields that VELODYNE.md names, by their offsets; all else is 0. */
static void test_fields(void **state)
{
    (void)state;
    static const char rmc[] = "$GPRMC,030405.00,A,3351.40706,S,15112.91780,E,1.94,90.00,020126,,,R*";
    uint8_t want[512] = {0};
    rig.utc0_ns = INT64_C(1767323040000000000); /* 2026-01-02 03:04:00 */
    rig.ops->time(rig.protocol, 1);             /* the packet of device time 0 */
    rig.ops->time(rig.protocol, 10000000000);
    const uint32_t last = rig.n_units - 1;
    const int64_t t_ns = last == 0 ? 0 : INT64_C(18579456) * (10000000000 / 18579456);
    assert_true(rig.n_units > 60);
    const uint8_t *p = packet(last);
    want[0xbb] = 42;
    want[0xbc] = 39;
    want[0xbd] = 40;
    want[0xbe] = 2;
    want[0xc0] = 9;
    want[0xc4] = 1;
    const uint32_t us = (uint32_t)((4 * 60000000000 + t_ns) / 1000);
    le_put32(want + 0xc6, us);
    want[0xca] = 2;
    want[0xcd] = 25;
    memcpy(want + 0xce, p + 0xce, 128); /* below */
    assert_memory_equal(p, want, 512);
    const char *text = (const char *)p + 206;
    assert_memory_equal(text, rmc, sizeof rmc - 1);
    uint8_t sum = 0;
    for (const char *c = text + 1; *c != '*'; c++)
        sum ^= (uint8_t)*c;
    static const char hex[] = "0123456789ABCDEF";
    const char end[] = {hex[sum >> 4], hex[sum & 15], '\r', '\n', 0};
    assert_string_equal(text + sizeof rmc - 1, end);
    assert_int_equal(strlen(text), 72); /* the field's length in the structures of published readers */
}

/* Checks the states of the pulses, and the time: UTC once it was set, before it the time since power-up. */
static void test_pulses_per_second(void **state)
{
    (void)state;
    rig.utc0_ns = INT64_C(1767323040000000000);
    for (int k = 0; k < 4; k++) {
        rig.pps = (enum protocol_pps)k;
        rig.pps_unset = k == 0;
        open_again(0);
        rig.ops->time(rig.protocol, 1);
        const uint8_t *p = packet(rig.n_units - 1);
        assert_int_equal(p[0xca], k);
        assert_int_equal(le_get32(p + 0xc6), k == 0 ? 0 : 4 * 60000000);
    }
}

/* There is one position packet for 14 data packets of a single return: 18.579456 ms, from device time 0 on, whenever
 * the session was opened. */
static void test_rate(void **state)
{
    (void)state;
    for (int64_t tick = 1; tick <= 2000; tick++)
        rig.ops->time(rig.protocol, tick * 1000000);
    assert_int_equal(rig.ops->next_ns(rig.protocol), 108 * 18579456ll + 1);
    assert_int_equal(rig.n_units, 108); /* 2 s / 18.579456 ms = 107.6, and the one of 0 */
    for (uint32_t i = 0; i < rig.n_units; i++)
        assert_int_equal(le_get32(packet(i) + 198), i * 18579456ull / 1000);
    protocol_rig_clear(&rig);
    open_again(1000000000);
    rig.ops->time(rig.protocol, 1003303624); /* 54 x 18.579456 ms = 1.003290624 s is the next */
    assert_int_equal(rig.n_units, 1);
    assert_int_equal(le_get32(packet(0) + 198), 1003290);
}

/* Without UTC the time counts from power-up, PPS is absent, and there is no sentence. The time wraps with the hour. */
static void test_without_utc(void **state)
{
    (void)state;
    rig.fix.quality = 0; /* the rig has none then */
    const int64_t hour_ns = INT64_C(3600000000000), first_ns = (hour_ns / 18579456 + 1) * 18579456;
    protocol_destroy(rig.ops, rig.protocol);
    assert_int_equal(protocol_create(rig.ops, &rig.spec, &rig.protocol, NULL), 0);
    rig.ops->open(rig.protocol, hour_ns);
    rig.ops->time(rig.protocol, first_ns + 1);
    assert_int_equal(rig.n_units, 1);
    assert_int_equal(le_get32(packet(0) + 198), (first_ns - hour_ns) / 1000);
    assert_int_equal(packet(0)[202], 0);
    for (int i = 206; i < 512; i++)
        assert_int_equal(packet(0)[i], 0);
}

/* After a power cycle the reason for the calibration is power-on. Its seconds count from the end of the cycle. */
static void test_after_power_cycle(void **state)
{
    (void)state;
    rig.spec.power_ns = INT64_C(5000000000);
    open_again(rig.spec.power_ns);
    rig.ops->time(rig.protocol, INT64_C(7500000000)); /* the last packet before it is at 7.487521 s */
    assert_int_equal(packet(rig.n_units - 1)[0xc4], 1);
    assert_int_equal(le_get32(packet(rig.n_units - 1) + 0xc0), 2);
}

/* UTC is known, but the receiver gives no position: locked, without a sentence. */
static void test_without_fix(void **state)
{
    (void)state;
    rig.utc0_ns = 0;
    rig.fix.quality = 0;
    rig.ops->time(rig.protocol, 1);
    assert_int_equal(packet(0)[202], 2);
    assert_int_equal(packet(0)[206], 0);
}

/* The receiver is asked once for its fix, at the packet's own time. */
static void test_fix_of_the_packet(void **state)
{
    (void)state;
    rig.utc0_ns = INT64_C(1700000000300000000);
    open_again(3790209024);
    rig.ops->time(rig.protocol, 3800000000);
    assert_int_equal(rig.n_units, 1);
    assert_int_equal(asked_ns, 3790209024); /* 204 x 18.579456 ms */
    assert_int_equal(n_asked, 1);
}

/* The longest sentence stays within the 128 bytes that clients read. */
static void test_longest_sentence(void **state)
{
    (void)state;
    rig.utc0_ns = 0;
    rig.fix.lat_deg = -89.99999999;
    rig.fix.lon_deg = -179.99999999;
    rig.fix.speed_m_s = 9999.0;
    rig.fix.course_deg = 359.999;
    rig.ops->time(rig.protocol, 1);
    const char *text = (const char *)packet(0) + 206;
    assert_true(strlen(text) < 128);
    assert_string_equal(text + strlen(text) - 2, "\r\n");
}

/* Time passes without a call. At most 64 packets, the newest, are sent at once, and the others are counted. */
static void test_after_a_long_silence(void **state)
{
    (void)state;
    const int64_t t_ns = INT64_C(1000) * 18579456;
    rig.ops->time(rig.protocol, t_ns); /* due: 0 .. 999 */
    assert_int_equal(rig.n_units, 64);
    assert_int_equal(rig.count[PROTOCOL_UNITS_LOST], 1000 - 64);
    assert_int_equal(le_get32(packet(63) + 198), 999 * 18579456ull / 1000);
    rig.ops->time(rig.protocol, t_ns + 1);
    assert_int_equal(rig.n_units, 65);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(test_fields),
        TEST(test_pulses_per_second),
        TEST(test_rate),
        TEST(test_without_utc),
        TEST(test_after_power_cycle),
        TEST(test_without_fix),
        TEST(test_fix_of_the_packet),
        TEST(test_longest_sentence),
        TEST(test_after_a_long_silence),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
