/* SPDX-License-Identifier: MIT */
/* VLP-16 data packets: return modes, losses, and streams that a device of this kind would never send. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <string.h>

#include <cmocka.h>

#include "core/bytes.h"
#include "core/rng.h"
#include "drivers/protocol/native_encode.h"
#include "drivers/protocol/velodyne.h"
#include "tests/unit/velodyne_head.h"

/* Returns the range of packet i, block 0..11, entry 0..31, at the published places. */
static uint32_t range_units(uint32_t i, int block, int entry)
{
    return le_get16(velodyne_head_packet(i) + 100 * block + 4 + 3 * entry);
}

static int reflectivity(uint32_t i, int block, int entry)
{
    return velodyne_head_packet(i)[100 * block + 4 + 3 * entry + 2];
}

static uint32_t azimuth(uint32_t i, int block)
{
    return le_get16(velodyne_head_packet(i) + 100 * block + 2);
}

static void select_echoes(uint32_t echoes)
{
    rig.emitter.echoes = echoes;
    protocol_rig_describe(&rig, 0);
}

static uint64_t lost(void)
{
    return rig.count[PROTOCOL_UNITS_LOST];
}

static uint64_t unsent(void)
{
    return rig.count[PROTOCOL_PULSES_UNSENT];
}

/* The even block of a pair has the last return, and the odd one the strongest, or the second strongest where that is
 * the last. A single return is in both (user manual, 9.3.2). */
static void test_dual_returns(void **state)
{
    (void)state;
    static const struct {
        struct protocol_rig_shot shot;
        uint32_t even, odd;
        int even_refl, odd_refl;
    } cases[] = {
        {{0, {0}, {0}, {0}}, 0, 0, 0, 0},
        {{1, {10.0}, {-300}, {0}}, 5000, 5000, 50, 50},
        /* The first is the stronger one, by reflectance and by range. */
        {{2, {10.0, 20.0}, {-300, -1000}, {0}}, 10000, 5000, 10, 50},
        /* The last is the stronger one: 7 dB more reflectance against 6 dB of range. */
        {{2, {10.0, 20.0}, {-1000, -300}, {0}}, 10000, 5000, 50, 10},
        /* 3 dB of reflectance don't make up for 6 dB of range, but do where the range is the same within a
         * metre. */
        {{3, {10.0, 20.0, 21.0}, {-1000, -700, -1000}, {0}}, 10500, 5000, 10, 10},
        {{3, {10.0, 20.0, 21.0}, {-1000, -550, -2000}, {0}}, 10500, 5000, 1, 10}, /* nor do 4.5 dB */
        {{3, {10.0, 20.0, 21.0}, {-2000, -700, -1000}, {0}}, 10500, 10000, 10, 20},
        {{3, {10.0, 11.0, 21.0}, {-1000, -700, 0}, {0}}, 10500, 5500, 100, 20},
        /* The last is the strongest of three, and the first is the second strongest. */
        {{3, {10.0, 11.0, 12.0}, {-700, -1000, 0}, {0}}, 6000, 5000, 100, 20},
        /* Reflectances are not modelled, so the nearest is the strongest. */
        {{2, {10.0, 20.0}, {INT16_MIN, INT16_MIN}, {0}}, 10000, 5000, 0, 0},
    };
    enum { N = sizeof cases / sizeof cases[0] };
    struct protocol_rig_shot shot[192];
    for (int i = 0; i < 192; i++)
        shot[i] = cases[i % N].shot;
    select_echoes(NATIVE_ECHOES_ALL);
    velodyne_head_fire(0, 192, shot, 600.0, 0.0);
    assert_int_equal(rig.n_units, 1);
    assert_int_equal(velodyne_head_packet(0)[1204], 0x39);
    for (int i = 0; i < 192; i++) {
        const int even = 2 * (i / 32);
        assert_int_equal(range_units(0, even, i % 32), cases[i % N].even);
        assert_int_equal(range_units(0, even + 1, i % 32), cases[i % N].odd);
        assert_int_equal(reflectivity(0, even, i % 32), cases[i % N].even_refl);
        assert_int_equal(reflectivity(0, even + 1, i % 32), cases[i % N].odd_refl);
        assert_int_equal(azimuth(0, even), azimuth(0, even + 1));
        assert_int_equal(azimuth(0, even), lround(even / 2 * 36000.0 * 10.0 * 110.592e-6));
    }
}

/* Ranges are 2 mm a unit, rounded. If no number fits, the entry has no return, and it is counted. */
static void test_range_units(void **state)
{
    (void)state;
    static const struct {
        double range_m;
        uint32_t units, n_lost;
    } cases[] = {{0.002, 1, 0},        {0.0029, 1, 0},   {0.0031, 2, 0}, {100.0, 50000, 0}, {131.07, 65535, 0},
                 {131.0709, 65535, 0}, {131.0711, 0, 1}, {500.0, 0, 1},  {0.0009, 0, 1}};
    enum { N = sizeof cases / sizeof cases[0] };
    struct protocol_rig_shot shot[384] = {{0}};
    uint32_t n_lost = 0;
    for (int i = 0; i < N; i++) {
        shot[i] = (struct protocol_rig_shot){.n = 1, .range_m = {cases[i].range_m}, .refl_cdb = {-100}};
        n_lost += cases[i].n_lost;
    }
    protocol_rig_describe(&rig, 0);
    velodyne_head_fire(0, 384, shot, 600.0, 0.0);
    for (int i = 0; i < N; i++) {
        assert_int_equal(range_units(0, 0, i), cases[i].units);
        assert_int_equal(reflectivity(0, 0, i), cases[i].units == 0 ? 0 : 79);
    }
    assert_int_equal(rig.count[PROTOCOL_POINTS_LOST], n_lost);
    assert_int_equal(lost(), 0);
    /* A pair of blocks has a single return twice, and it is one echo. Of two returns either one may be too far. */
    for (int i = 0; i < 192; i++)
        shot[i] = (struct protocol_rig_shot){.n = 1 + (uint32_t)i % 2, .range_m = {150.0, 160.0}};
    select_echoes(NATIVE_ECHOES_ALL);
    velodyne_head_fire(384, 192, shot, 600.0, 0.0);
    assert_int_equal(rig.count[PROTOCOL_POINTS_LOST], n_lost + 96 + 2 * 96);
}

/* 0..100 is a matt surface's reflectance in percent (user manual, 6.1); a retro-reflector has more. */
static void test_reflectivities(void **state)
{
    (void)state;
    for (int cdb = -3200; cdb <= 0; cdb++)
        assert_int_equal(velodyne_reflectivity(cdb), (int)floor(100.0 * pow(10.0, cdb / 1000.0) + 0.5));
    for (int cdb = 1; cdb <= 32767; cdb++) {
        if (cdb < 3080) assert_int_equal(velodyne_reflectivity(cdb), 101 + cdb / 20); /* 154 steps of 0.2 dB */
        assert_int_equal(velodyne_reflectivity(cdb) == 255, cdb >= 3080);
    }
    assert_int_equal(velodyne_reflectivity(INT16_MIN), 0);
    /* A packet has the same ones. */
    struct protocol_rig_shot shot[384];
    for (int i = 0; i < 384; i++)
        shot[i] = (struct protocol_rig_shot){.n = 1, .range_m = {5.0}, .refl_cdb = {(int16_t)(-3000 + 16 * i)}};
    protocol_rig_describe(&rig, 0);
    velodyne_head_fire(0, 384, shot, 600.0, 0.0);
    for (int i = 0; i < 384; i++) /* shot 380 has 3080, the first with 255 */
        assert_int_equal(reflectivity(0, i / 32, i % 32), velodyne_reflectivity(-3000 + 16 * i));
}

/* After pulses that the head did not send the next packet begins with the next firing sequence. The begun packet is not
 * sent. Its pulses count as unsent, and not as a loss: no reader was too slow. */
static void test_lost_pulses(void **state)
{
    (void)state;
    protocol_rig_describe(&rig, 0);
    velodyne_head_fire_alike(0, 384 + 100, 10.0);
    velodyne_head_fire_alike(1005, 3000, 20.0); /* pulses 484..1004 are missing */
    assert_int_equal(rig.n_units, 1 + (1005 + 3000 - 1008) / 384);
    assert_int_equal(lost(), 0);
    assert_int_equal(unsent(), 100 + 3); /* 1005 to 1007 are within a sequence */
    for (uint32_t i = 1; i < rig.n_units; i++) {
        const uint32_t us = le_get32(velodyne_head_packet(i) + 1200);
        assert_int_equal(us, (63 * 55296ull + (i - 1) * 1327104ull) / 1000); /* 1008 = 63 sequences */
        for (int k = 0; k < 384; k++)
            assert_int_equal(range_units(i, k / 32, k % 32), 10000);
    }
}

/* gap() alone: the pulses may go on where they were, but frames were lost between them. */
static void test_gap(void **state)
{
    (void)state;
    protocol_rig_describe(&rig, 0);
    velodyne_head_fire_alike(0, 40, 10.0);
    rig.ops->gap(rig.protocol, 3);
    velodyne_head_fire_alike(40, 8 + 384, 20.0);
    assert_int_equal(lost(), 1);
    assert_int_equal(rig.n_units, 1);
    assert_int_equal(range_units(0, 0, 0), 10000);
    /* A gap between two packets costs nothing. */
    rig.ops->gap(rig.protocol, 1);
    velodyne_head_fire_alike(432, 384, 20.0);
    assert_int_equal(lost(), 1);
    assert_int_equal(unsent(), 0);
    assert_int_equal(rig.n_units, 2);
}

/* At the end of a scan the rest of a packet is not padded, and is no loss of a reader. The next scan begins with its
 * pulse 0. */
static void test_end_of_scan(void **state)
{
    (void)state;
    protocol_rig_describe(&rig, 0);
    velodyne_head_fire_alike(0, 1000, 10.0);
    velodyne_head_event(NATIVE_EV_SCAN_END);
    assert_int_equal(unsent(), 1000 - 2 * 384);
    assert_int_equal(rig.n_units, 2);
    rig.descriptor.scan++;
    protocol_rig_describe(&rig, 0);
    velodyne_head_fire_alike(0, 384, 20.0);
    assert_int_equal(unsent(), 1000 - 2 * 384);
    assert_int_equal(lost(), 0);
    assert_int_equal(rig.n_units, 3);
    assert_int_equal(range_units(2, 0, 0), 10000);
}

/* A client joins in the middle of a scan and of a sequence. */
static void test_joined_late(void **state)
{
    (void)state;
    protocol_rig_describe(&rig, 0);
    velodyne_head_fire_alike(16 * 1000 + 5, 11 + 384, 10.0);
    assert_int_equal(rig.n_units, 1);
    assert_int_equal(lost(), 0);
    assert_int_equal(unsent(), 0); /* the 11 pulses are from before it came */
}

/* The return mode changes between two blocks. No packet has both, and the byte says which. */
static void test_mode_changes(void **state)
{
    (void)state;
    static const uint32_t echoes[] = {NATIVE_ECHOES_STRONGEST, NATIVE_ECHOES_ALL, NATIVE_ECHOES_LAST,
                                      NATIVE_ECHOES_ALL};
    static const int byte[] = {0x37, 0x39, 0x38, 0x39};
    uint64_t pulse = 0, units = 0, left = 0;
    for (int i = 0; i < 4; i++) {
        select_echoes(echoes[i]);
        protocol_rig_clear(&rig);
        velodyne_head_fire_alike(pulse, 1000, 1.0 + i);
        const uint64_t from = (pulse + 15) / 16 * 16, per_packet = byte[i] == 0x39 ? 192 : 384;
        units = (pulse + 1000 - from) / per_packet;
        assert_int_equal(rig.n_units, units);
        for (uint32_t p = 0; p < rig.n_units; p++) {
            assert_int_equal(velodyne_head_packet(p)[1204], byte[i]);
            for (int k = 0; k < 384; k++)
                assert_int_equal(range_units(p, k / 32, k % 32), 500 * (1 + i));
        }
        left += from - pulse;             /* the rest of a sequence */
        assert_int_equal(unsent(), left); /* and the packet of the mode before */
        pulse += 1000;
        left += (pulse - from) % per_packet;
    }
    assert_int_equal(lost(), 0);
    /* The repeated frames of each second change nothing. */
    protocol_rig_clear(&rig);
    velodyne_head_fire_alike(pulse, 92, 5.0);
    protocol_rig_describe(&rig, 0);
    const uint64_t before = unsent();
    velodyne_head_fire_alike(pulse + 92, 8, 5.0);
    assert_int_equal(unsent(), before);
}

/* The rate of turns changes. The current packet goes on, and so does the azimuth. */
static void test_rpm_changes(void **state)
{
    (void)state;
    struct protocol_rig_shot shot[384] = {{0}};
    const double turn = velodyne_head_turns(208, 600.0) - velodyne_head_turns(208, 1200.0);
    protocol_rig_describe(&rig, 0);
    velodyne_head_fire(0, 208, shot, 600.0, 0.0);
    rig.descriptor.lines_uhz = 20000000;
    protocol_rig_describe(&rig, 0);
    velodyne_head_fire(208, 176, shot, 1200.0, turn);
    assert_int_equal(lost(), 0);
    assert_int_equal(rig.n_units, 1);
    for (int b = 0; b < 12; b++) {
        const double sequences = b <= 6 ? 2 * b : 13 + 2 * (2 * b - 13);
        assert_int_equal(azimuth(0, b), lround(sequences * 55.296e-6 * 10.0 * 36000.0));
    }
}

/* A VLP-16 can't be such a head: other beams, a planar head, first echoes. Nothing is sent, and pulses are counted. */
static void test_other_heads(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        protocol_rig_beams(&rig, 10);
        rig.emitter.echoes = NATIVE_ECHOES_LAST;
        if (i == 0) rig.emitter.n_beams = 15;
        if (i == 1) rig.emitter.kind = NATIVE_EMIT_PLANAR;
        if (i == 2) rig.emitter.echoes = NATIVE_ECHOES_FIRST;
        protocol_rig_describe(&rig, 0);
        velodyne_head_fire_alike(0, 3840, 10.0);
        assert_int_equal(rig.n_units, 0);
        assert_int_equal(unsent(), 3840 * (i + 1));
        assert_int_equal(lost(), 0);
    }
}

/* No emitter frame has come. */
static void test_line_head(void **state)
{
    (void)state;
    velodyne_head_fire_alike(0, 400, 10.0);
    assert_int_equal(rig.n_units, 0);
    assert_int_equal(unsent(), 400);
}

/* The elevations decide the model byte: those of the Puck Hi-Res in the order of its table. Any others give VLP-16. */
static void test_models(void **state)
{
    (void)state;
    static const double hi_res_deg[16] = {-10.0, 0.67, -8.67, 2.0,  -7.33, 3.33, -6.0,  4.67,
                                          -4.67, 6.0,  -3.33, 7.33, -2.0,  8.67, -0.67, 10.0};
    for (int i = 0; i < 3; i++) {
        protocol_rig_beams(&rig, 10);
        rig.emitter.echoes = NATIVE_ECHOES_LAST;
        for (int k = 0; k < 16 && i > 0; k++)
            rig.beam[k].elevation_udeg = (int32_t)lround(hi_res_deg[i == 1 ? k : 15 - k] * 1e6);
        protocol_rig_describe(&rig, 0);
        velodyne_head_fire_alike(384 * (uint64_t)i, 384, 10.0);
        assert_int_equal(rig.bytes[1206 * i + 1205], i == 1 ? 0x24 : 0x22);
    }
    assert_int_equal(lost(), 0);
}

/* Without room a packet is lost, whole, and the next one is unchanged. */
static void test_no_room(void **state)
{
    (void)state;
    protocol_rig_describe(&rig, 0);
    rig.room = 1206;
    velodyne_head_fire_alike(0, 384 * 2, 10.0);
    rig.room = SIZE_MAX;
    velodyne_head_fire_alike(384 * 2, 384, 20.0);
    assert_int_equal(rig.n_units, 2);
    assert_int_equal(range_units(0, 11, 31), 5000);
    assert_int_equal(range_units(1, 0, 0), 10000);
    assert_int_equal(lost(), 0); /* the session's owner counts that one */
}

/* Frames have any content. No packet has another length, and the module goes on. */
static void test_any_frames(void **state)
{
    (void)state;
    static uint8_t frame[28 + 4096];
    uint64_t draw = 0;
    protocol_rig_describe(&rig, 0);
    for (int i = 0; i < 20000; i++) {
        const uint32_t len = (uint32_t)(rng_mix(++draw) % 1200);
        for (uint32_t k = 0; k < 28 + len; k += 8) {
            const uint64_t word = rng_mix(++draw);
            memcpy(frame + k, &word, 8);
        }
        frame[1] = (uint8_t)(1 + rng_mix(++draw) % 10);
        const uint32_t n_points = (len - 40) / 20;
        memcpy(frame + 4, &len, 4);
        if (len >= 40) memcpy(frame + 28 + 36, &n_points, 4);
        rig.ops->frame(rig.protocol, frame, 28 + len);
        if (rig.n_units > 1000) protocol_rig_clear(&rig);
    }
    protocol_rig_clear(&rig);
    rig.descriptor.scan++;
    select_echoes(NATIVE_ECHOES_LAST);
    velodyne_head_fire_alike(0, 384, 10.0);
    assert_int_equal(rig.n_units, 1);
    assert_int_equal(range_units(0, 11, 31), 5000);
}

/* A frame of points that says more of them than it has is left out (LOSSES.md). */
static void test_too_few_points(void **state)
{
    (void)state;
    enum { N = 384 };
    static uint8_t frame[28 + 40 + 20 * N];
    for (uint32_t more = 2; more-- > 0;) {
        static uint32_t zero[N], dt[N];
        static int16_t refl[N];
        static uint16_t label[N];
        static uint8_t echo[N];
        const struct line_block block = {.n_pulses = N + more,
                                         .n_points = N,
                                         .dt_ns = dt,
                                         .a = zero,
                                         .b = zero,
                                         .c = zero,
                                         .refl_cdb = refl,
                                         .echo = echo,
                                         .label = label};
        rig.descriptor.scan++;
        protocol_rig_describe(&rig, 0);
        protocol_rig_clear(&rig);
        assert_int_equal(native_encode_points(frame, sizeof frame, &block, 0), sizeof frame);
        le_put32(frame + 28 + 36, N + more);
        rig.ops->frame(rig.protocol, frame, sizeof frame);
        assert_int_equal(rig.n_units, more ? 0 : 1);
    }
    assert_int_equal(lost(), 0);
}

/* A UDP link has no input; elsewhere it is counted. */
static void test_input_is_counted(void **state)
{
    (void)state;
    protocol_rig_input(&rig, "hello");
    assert_int_equal(rig.count[PROTOCOL_INPUT_LOST], 5);
    assert_int_equal(rig.n_units, 0);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, velodyne_head_setup, velodyne_head_teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(test_dual_returns), TEST(test_range_units), TEST(test_reflectivities), TEST(test_lost_pulses),
        TEST(test_gap),          TEST(test_end_of_scan), TEST(test_joined_late),    TEST(test_mode_changes),
        TEST(test_rpm_changes),  TEST(test_other_heads), TEST(test_line_head),      TEST(test_models),
        TEST(test_no_room),      TEST(test_any_frames),  TEST(test_too_few_points), TEST(test_input_is_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
