/* SPDX-License-Identifier: MIT */
/* VLP-16 data packets against their published layout: a client computes the head's measurements. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <string.h>

#include <cmocka.h>

#include "core/bytes.h"
#include "core/rng.h"
#include "drivers/protocol/velodyne.h"
#include "tests/common/thorough.h"
#include "tests/unit/velodyne_head.h"

/* Returns a number in 0..1, of a fixed seed. */
static double uniform(uint64_t stream, uint64_t i)
{
    return (double)(rng_mix(rng_mix(stream) + i) >> 11) * 0x1p-53;
}

/* Checks every byte of a packet whose ranges and reflectances all differ. */
static void test_bytes_of_a_packet(void **state)
{
    (void)state;
    struct protocol_rig_shot shot[384];
    for (int i = 0; i < 384; i++) {
        shot[i] =
            (struct protocol_rig_shot){.n = 1, .range_m = {1.0 + 0.002 * i}, .refl_cdb = {(int16_t)(-1000 + 2 * i)}};
        if (i % 7 == 3) shot[i].n = 0;
    }
    rig.utc0_ns = INT64_C(1700000000000000000); /* 800 s into an hour */
    rig.scan_t0_ns = 5000000999;
    protocol_rig_describe(&rig, 0);
    velodyne_head_fire(0, 384, shot, 600.0, 0.25);
    assert_int_equal(rig.n_units, 1);
    const uint8_t *p = velodyne_head_packet(0);
    for (int block = 0; block < 12; block++, p += 100) {
        assert_int_equal(p[0], 0xff);
        assert_int_equal(p[1], 0xee);
        /* 10 turns a second: 360 * 10 * 110.592e-6 degrees a block */
        assert_int_equal(le_get16(p + 2), (int)lround(9000.0 + block * 36000.0 * 10.0 * 110.592e-6));
        for (int k = 0; k < 32; k++) {
            const int i = 32 * block + k;
            const double percent = 100.0 * pow(10.0, (-1000 + 2 * i) / 1000.0);
            assert_int_equal(le_get16(p + 4 + 3 * k), i % 7 == 3 ? 0 : 500 + i);
            assert_int_equal(p[4 + 3 * k + 2], i % 7 == 3 ? 0 : (int)lround(percent));
        }
    }
    assert_int_equal(le_get32(p), 805000000);
    assert_int_equal(p[4], 0x37);
    assert_int_equal(p[5], 0x22);
    assert_int_equal(rig.count[PROTOCOL_UNITS_LOST] + rig.count[PROTOCOL_POINTS_LOST], 0);
}

/* A client, from the published layout alone. The client takes all blocks of all packets in a row. An entry's azimuth
 * lies between its block's and the next one's by its time. The client reads up to the block before the last. */
struct seen {
    double range_m, elevation_deg, azimuth_deg;
    int reflectivity;
};
static uint32_t parse(struct seen *seen)
{
    static const int elevation_deg[16] = {-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15};
    uint32_t n = 0;
    for (uint32_t b = 0; b + 1 < 12 * rig.n_units; b++) {
        const uint8_t *block = velodyne_head_packet(b / 12) + 100 * (b % 12),
                      *next = velodyne_head_packet((b + 1) / 12) + 100 * ((b + 1) % 12);
        assert_int_equal(le_get16(block), 0xeeff);
        const double azimuth = le_get16(block + 2) * 0.01,
                     turned = fmod(le_get16(next + 2) * 0.01 - azimuth + 360.0, 360.0);
        assert_true(le_get16(block + 2) < 36000);
        for (int j = 0; j < 32; j++) {
            const double us = 55.296 * (j / 16) + 2.304 * (j % 16);
            seen[n++] = (struct seen){.range_m = le_get16(block + 4 + 3 * j) * 0.002,
                                      .elevation_deg = elevation_deg[j % 16],
                                      .azimuth_deg = azimuth + turned * us / 110.592,
                                      .reflectivity = block[6 + 3 * j]};
        }
    }
    return n;
}

/* The head makes more than one turn, through 0 degrees, in frames of all sizes. Errors are at most half a unit of range
 * and half a hundredth of a degree. */
static void test_client_gets_what_was_measured(void **state)
{
    (void)state;
    enum { PULSES = 384 * 80 };
    static struct protocol_rig_shot shot[PULSES];
    static struct seen seen[PULSES];
    uint64_t draw = 0;
    for (uint32_t i = 0; i < PULSES; i++) {
        double range_m = 0.4 + 100.0 * uniform(10, i);
        shot[i] = (struct protocol_rig_shot){.n = uniform(11, i) < 0.9, .range_m = {range_m}};
    }
    protocol_rig_describe(&rig, 0);
    for (uint32_t at = 0, n; at < PULSES; at += n) {
        n = 1 + (uint32_t)(1500.0 * uniform(20, draw++));
        if (n > PULSES - at) n = PULSES - at;
        velodyne_head_fire(at, n, shot + at, 600.0, 0.123456);
    }
    assert_int_equal(rig.n_units, 80);
    assert_int_equal(parse(seen), PULSES - 32);
    for (uint32_t i = 0; i < PULSES - 32; i++) {
        const double azimuth_deg = 360.0 * (0.123456 + velodyne_head_turns(i, 600.0));
        if (shot[i].n == 0)
            assert_true(seen[i].range_m == 0.0);
        else
            assert_true(fabs(seen[i].range_m - shot[i].range_m[0]) <= 0.001 + 1e-6); /* the rig's counts: 1e-6 m */
        assert_true(fabs(remainder(seen[i].azimuth_deg - azimuth_deg, 360.0)) <= 0.005 + 1e-6);
        assert_true(seen[i].elevation_deg == velodyne_head_elevation_deg(i % 16));
    }
}

/* The azimuth is rounded, and 360 degrees become 0. */
static void test_azimuth_wraps(void **state)
{
    (void)state;
    static const struct {
        double turn;
        uint32_t azimuth;
    } cases[] = {{0.0, 0},         {35999.4 / 36000.0, 35999}, {35999.6 / 36000.0, 0},
                 {0.4 / 36000, 0}, {0.6 / 36000, 1},           {1.0 + 17.0 / 36000.0, 17}};
    struct protocol_rig_shot shot[384] = {{0}};
    protocol_rig_describe(&rig, 0);
    for (uint32_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        velodyne_head_fire(384 * i, 384, shot, 600.0, cases[i].turn - velodyne_head_turns(384 * i, 600.0));
        assert_int_equal(le_get16(velodyne_head_packet(i) + 2), cases[i].azimuth);
    }
}

/* t(block, entry) = 55.296 (2 block + entry div 16) + 2.304 (entry mod 16) us after the packet's time stamp, which
 * counts from the top of the hour. The time is exact, over an hour and beyond its end. */
static void test_times_over_an_hour(void **state)
{
    (void)state;
    static const int64_t utc0_ns[] = {INT64_MIN, INT64_C(1767225600000000000), INT64_C(1767227345678901234)};
    for (int u = 0; u < 3; u++) {
        rig.utc0_ns = utc0_ns[u];
        rig.scan_t0_ns = 123456789;
        rig.descriptor.scan++;
        protocol_rig_describe(&rig, 0);
        protocol_rig_clear(&rig);
        const int64_t start_ns = rig.scan_t0_ns + (utc0_ns[u] == INT64_MIN ? 0 : utc0_ns[u]);
        uint32_t n = 0;
        /* Every 5401st packet of 65 minutes, or every 1801st: more than 500. Neither shares a factor with 125, so they
         * have all 125 residues of a microsecond. */
        for (int64_t m = 0; m < INT64_C(3900000000000) / 1327104; m += thorough(1801, 5401)) {
            velodyne_head_fire_alike((uint64_t)m * 384, 384, 10.0);
            const int64_t t_ns = start_ns + m * 1327104;
            assert_int_equal(le_get32(velodyne_head_packet(n++) + 1200), t_ns / 1000 % 3600000000);
        }
        assert_int_equal(rig.count[PROTOCOL_UNITS_LOST], 0);
    }
}

/* The time stamp is that of the first firing, even where a packet begins in the middle of a frame. */
static void test_time_of_the_first_firing(void **state)
{
    (void)state;
    protocol_rig_describe(&rig, 0);
    for (uint32_t at = 0; at < 384 * 10; at += 48)
        velodyne_head_fire_alike(at, 48, 10.0);
    protocol_rig_clear(&rig);
    velodyne_head_fire_alike(3840, 4096, 10.0);
    for (uint32_t i = 0; i < 10; i++)
        assert_int_equal(le_get32(velodyne_head_packet(i) + 1200), (uint32_t)((10 + i) * 1327104ull / 1000));
}

/* There are 753.5 packets in a second, 1507.04 in two of them, and with both returns 1507.04 in one. Full ones are
 * sent. */
static void test_packet_rate(void **state)
{
    (void)state;
    for (int dual = 0; dual < 2; dual++) {
        rig.emitter.echoes = dual ? NATIVE_ECHOES_ALL : NATIVE_ECHOES_LAST;
        rig.descriptor.scan++;
        protocol_rig_describe(&rig, 0);
        protocol_rig_clear(&rig);
        const uint32_t pulses = dual ? 289352 : 578704; /* fired before 1 s and 2 s: 16 in 55.296 us */
        for (uint32_t at = 0, n; at < pulses; at += n) {
            n = pulses - at < 290 ? pulses - at : 290;
            velodyne_head_fire_alike(at, n, 10.0);
        }
        assert_int_equal(rig.n_units, 1507);
        assert_int_equal(le_get32(velodyne_head_packet(1506) + 1200),
                         dual ? 1506 * 663552 / 1000 : 1506 * 1327104ull / 1000);
    }
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, velodyne_head_setup, velodyne_head_teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(test_bytes_of_a_packet),  TEST(test_client_gets_what_was_measured), TEST(test_azimuth_wraps),
        TEST(test_times_over_an_hour), TEST(test_time_of_the_first_firing),      TEST(test_packet_rate),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
