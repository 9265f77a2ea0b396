/* SPDX-License-Identifier: MIT */
/* The contents of CoLa's LMDscandata against the ranges, times and angles that went in. The contents are read back by
 * the public layout alone (cola_rig). */
#include <math.h>

#include "drivers/protocol/native_encode.h"
#include "drivers/protocol/cola_way.h"
#include "tests/unit/cola_rig.h"

static struct cola_lmd lmd;
static struct protocol_rig_shot shots[3001];

/* ---- the telegram as a whole, by hand: 4 beams of a head with 8 steps a turn, 10 Hz */

static void open_small(void)
{
    cola_open("TiM571");
    protocol_rig_planar(&cola, 8, 2, 5, 4, -1, 10);
    cola.scan_t0_ns = INT64_C(1000000000);
    protocol_rig_describe(&cola, 0);
    memset(shots, 0, sizeof shots);
    shots[0] = (struct protocol_rig_shot){1, {1.0}, {0}, {0}};
    shots[1] = (struct protocol_rig_shot){1, {2.5}, {-3200}, {0}};
    shots[3] = (struct protocol_rig_shot){2, {4.6556, 9.0}, {-6399, 0}, {0}}; /* 4656 mm; the first echo counts */
}

static void a_telegram_in_a_is_this_text(void **state)
{
    (void)state;
    open_small();
    cola_stream(0);
    protocol_rig_clear(&cola);
    protocol_rig_turn(&cola, 0, shots, 1);
    /* Serial number 17210001 = 0x1069A91. Scan start 1 s = F4240 us, sent at the turn's end, 1.1 s = 10C8E0. 10 Hz =
     * 3E8, 80 pulses a second: 1 (100 Hz). Step 45 deg = 6DDD0, and that is more than 16 bits: DDD0. First beam 90 - 2
     * x 45 deg = 0. White is FF, -32 dB 80, -63.99 dB 1. */
    static const char expected[] = "\2sSN LMDscandata 1 1 1069A91 0 0 0 0 F4240 10C8E0 0 0 0 0 0 3E8 1 0 1 "
                                   "DIST1 3F800000 00000000 0 DDD0 4 3E8 9C4 0 1230 "
                                   "1 RSSI1 3F800000 00000000 0 DDD0 4 FF 80 0 1 0 0 0 0 0\3";
    assert_int_equal(cola.n_units, 1);
    cola.bytes[cola.len] = 0;
    assert_string_equal((char *)cola.bytes, expected);
}

static void a_telegram_in_b_is_these_bytes(void **state)
{
    (void)state;
    open_small();
    cola_stream(1);
    protocol_rig_clear(&cola);
    protocol_rig_turn(&cola, 0, shots, 1);
    static const char payload[] = "sSN LMDscandata \0\1\0\1\x01\x06\x9a\x91\0\0\0\0\0\0\0\x0f\x42\x40\0\x10\xc8\xe0"
                                  "\0\0\0\0\0\0\0\0\3\xe8\0\0\0\1\0\0"
                                  "\0\1DIST1\x3f\x80\0\0\0\0\0\0\0\0\0\0\xdd\xd0\0\4\x03\xe8\x09\xc4\0\0\x12\x30"
                                  "\0\1RSSI1\x3f\x80\0\0\0\0\0\0\0\0\0\0\xdd\xd0\0\4\xff\x80\0\1\0\0\0\0\0\0\0\0\0\0";
    uint8_t frame[512];
    assert_int_equal(cola.len, cola_frame_b(frame, payload, sizeof payload - 1));
    assert_memory_equal(cola.bytes, frame, cola.len);
}

/* 2552 bytes for 811 points and RSSI of 8 bit: what a TiM571 sends. */
static void a_tim571_telegram_has_its_length(void **state)
{
    (void)state;
    cola_open_tim("TiM571");
    cola_stream(1);
    protocol_rig_clear(&cola);
    cola_turn(0, 1.0);
    assert_int_equal(cola.len, 2552);
}

/* ---- geometry and rates */

static void ranges_stand_at_their_angles(void **state)
{
    (void)state;
    for (int b = 0; b < 2; b++) {
        cola_open_tim("TiM571");
        cola_stream(b);
        cola_scan(0, 1.0, &lmd);
        assert_string_equal(lmd.verb, "sSN");
        assert_int_equal(lmd.serial, 17210001);
        assert_int_equal(lmd.scan_chz, 1500);
        assert_int_equal(lmd.meas_100hz, 162);
        assert_int_equal(lmd.n_16, 1);
        assert_int_equal(lmd.n_8, 1);
        const struct cola_channel *dist = &lmd.channel[0], *rssi = &lmd.channel[1];
        assert_string_equal(dist->name, "DIST1");
        assert_string_equal(rssi->name, "RSSI1");
        assert_int_equal(dist->start_e4, -450000);
        assert_int_equal(dist->step_e4, 3333);
        assert_int_equal(dist->n, 811);
        assert_int_equal(rssi->n, 811);
        for (uint32_t i = 0; i < 811; i++)
            assert_int_equal(dist->value[i], 1000 + 10 * i); /* counter-clockwise: with the steps */
    }
}

/* sick_tim warns where the step's time and 1 / measurement frequency differ by 10 us. */
static void rates_agree_as_sick_tim_asks(void **state)
{
    (void)state;
    for (int lms = 0; lms < 2; lms++) {
        if (lms)
            cola_open_lms();
        else
            cola_open_tim("TiM571");
        cola_stream(0);
        cola_scan(0, 1.0, &lmd);
        const double scan_s = 100.0 / lmd.scan_chz, step_deg = lmd.channel[0].step_e4 / 1e4;
        assert_true(fabs(scan_s * step_deg / 360.0 - 1.0 / (100.0 * lmd.meas_100hz)) < 1e-5);
        assert_int_equal(lmd.meas_100hz, lms ? 360 : 162);
    }
}

/* If a head turns clockwise, seen from above, its last step is sent first, as angles always grow counter-clockwise. A
 * mark is at one step, 30 degrees left of the front. */
static void a_mark_on_the_left_is_on_the_left(void **state)
{
    (void)state;
    for (int turn = -1; turn <= 1; turn += 2) {
        cola_open("mine");
        protocol_rig_planar(&cola, 720, 100, 500, 300, turn, 10);
        protocol_rig_describe(&cola, 0);
        cola_stream(0);
        for (int i = 0; i < 401; i++)
            shots[i] = (struct protocol_rig_shot){1, {5.0}, {0}, {0}};
        shots[300 - 100 - turn * 60].range_m[0] = 3.0; /* left is against the clock */
        protocol_rig_clear(&cola);
        protocol_rig_turn(&cola, 0, shots, 50);
        cola_read_lmd(0, &lmd);
        assert_int_equal(lmd.channel[0].n, 401);
        assert_int_equal(lmd.channel[0].start_e4, (90 - 100) * 10000);
        for (uint32_t i = 0; i < 401; i++) {
            const int32_t angle_e4 = lmd.channel[0].start_e4 + (int32_t)(i * lmd.channel[0].step_e4);
            assert_int_equal(lmd.channel[0].value[i], angle_e4 == (90 + 30) * 10000 ? 3000 : 5000);
        }
    }
}

static void far_heads_count_in_two_millimetres(void **state)
{
    (void)state;
    cola_open_tim("TiM571");
    cola.descriptor.range_max_m = 80.0;
    protocol_rig_describe(&cola, 0);
    cola_stream(0);
    cola_scan(0, 60.0, &lmd); /* to 68.1 m */
    assert_true(lmd.channel[0].scale == 2.0);
    for (uint32_t i = 0; i < 811; i++)
        assert_int_equal(lmd.channel[0].value[i], 30000 + 5 * i);
    cola_authorise();
    cola_expect("sWN LMDscandatascalefactor 3F800000", "sFA 5"); /* it would cut off */
    cola_scan(1, 130.0, &lmd);                                   /* 131.07 m is the end of 16 bits */
    assert_int_equal(lmd.channel[0].value[107], 65535);
    assert_int_equal(lmd.channel[0].value[108], 0);
    assert_int_equal(cola.count[PROTOCOL_POINTS_LOST], 811 - 108);
}

/* ---- echoes and signals */

static void echoes_go_to_their_channels(void **state)
{
    (void)state;
    cola_open_lms();
    cola.attributes = 1;
    protocol_rig_describe(&cola, 0);
    cola_authorise();
    memset(shots, 0, sizeof shots);
    for (int i = 0; i < 1081; i++)
        shots[i] = (struct protocol_rig_shot){(uint32_t)i % 4, {1.0, 2.0, 3.0}, {0, 0, 0}, {1000, 2000, 3000}};
    for (int filter = 0; filter <= 2; filter += 2)
        for (int wide = 0; wide < 2; wide++) {
            char cfg[64];
            snprintf(cfg, sizeof cfg, "sWN LMDscandatacfg 3 0 1 %d 0 0 0 0 0 0 0 1", wide);
            cola_expect(cfg, "sWA LMDscandatacfg");
            cola_expect(filter == 0 ? "sWN FREchoFilter 1" : "sWN FREchoFilter 2", "sWA FREchoFilter");
            cola_stream(wide);
            protocol_rig_clear(&cola);
            protocol_rig_turn(&cola, (uint32_t)(filter + wide), shots, 77);
            assert_int_equal(cola.n_units, 1);
            cola_read_lmd(0, &lmd);
            assert_int_equal(lmd.n_16, wide ? 4 : 2);
            assert_int_equal(lmd.n_8, wide ? 0 : 2);
            static const char *const names[] = {"DIST1", "DIST2", "RSSI1", "RSSI2"};
            for (int k = 0; k < 4; k++)
                assert_string_equal(lmd.channel[k].name, names[k]);
            /* 0.25 dB a count of 8 bit, 256 times finer with 16 */
            const uint32_t db = wide ? 1024 : 4;
            for (uint32_t i = 0; i < 1081; i++) {
                const uint32_t n = i % 4, one = filter == 0 && n != 0 ? 1 : n;
                assert_int_equal(lmd.channel[0].value[i], 1000 * one);
                assert_int_equal(lmd.channel[1].value[i], n > 1 ? 2000 : 0);
                assert_int_equal(lmd.channel[2].value[i], 10 * db * one);
                assert_int_equal(lmd.channel[3].value[i], n > 1 ? 20 * db : 0);
            }
        }
    cola_expect("sWN LMDscandatacfg 2 0 0 0 0 0 0 0 0 0 0 1", "sWA LMDscandatacfg");
    protocol_rig_clear(&cola);
    protocol_rig_turn(&cola, 4, shots, 77);
    cola_read_lmd(0, &lmd);
    assert_int_equal(lmd.n_16 + lmd.n_8, 1);
    assert_string_equal(lmd.channel[0].name, "DIST2");
}

static void signals_end_where_their_scale_ends(void **state)
{
    (void)state;
    static const int16_t refl_cdb[] = {0, 100, -6400, -10000, LINE_REFL_NONE, -2000};
    static const uint32_t wide[] = {65535, 65535, 1, 1, 0, 44 * 1024}, narrow[] = {255, 255, 1, 1, 0, 176};
    cola_open_tim("TiM571");
    cola_authorise();
    for (int i = 0; i < 811; i++)
        shots[i] = (struct protocol_rig_shot){1, {1.0}, {refl_cdb[i % 6]}, {0}};
    for (uint32_t bits = 0; bits < 2; bits++) {
        cola_expect(bits ? "sWN LMDscandatacfg 1 0 1 1 0 0 0 0 0 0 0 1" : "sWN LMDscandatacfg 1 0 1 0 0 0 0 0 0 0 0 1",
                    "sWA LMDscandatacfg");
        cola_stream(0);
        protocol_rig_clear(&cola);
        protocol_rig_turn(&cola, bits, shots, 100);
        cola_read_lmd(0, &lmd);
        for (uint32_t i = 0; i < 811; i++)
            assert_int_equal(lmd.channel[1].value[i], bits ? wide[i % 6] : narrow[i % 6]);
    }
}

/* ---- additions by LMDscandatacfg */

static void name_and_time_where_asked_for(void **state)
{
    (void)state;
    static const uint32_t known[7] = {2024, 2, 29, 12, 34, 57, 66666}, unknown[7] = {1970, 1, 1, 0, 0, 1, 66666};
    for (int b = 0; b < 2; b++)
        for (int utc = 0; utc < 2; utc++) {
            cola_open_tim("TiM571");
            cola.scan_t0_ns = INT64_C(1000000000);
            if (utc) cola.utc0_ns = INT64_C(1709210096) * 1000000000; /* 2024-02-29T12:34:56Z */
            cola_authorise();
            cola_expect("sWN LocationName C left bumper.", "sWA LocationName");
            cola_expect("sWN LMDscandatacfg 1 0 0 0 0 0 0 1 1 1 1 1", "sWA LMDscandatacfg");
            cola_stream(b);
            cola_turn(0, 1.0);
            cola_scan(1, 1.0, &lmd);
            assert_string_equal(lmd.name, "left bumper.");
            assert_int_equal(lmd.has_time, 1);
            /* step 0 of scan 1: 1.0666 s after power-up */
            assert_memory_equal(lmd.date, utc ? known : unknown, sizeof known);
        }
}

static void give_poses(double x0_m, double x1_m, int64_t t0_ns, int64_t t1_ns)
{
    uint8_t frame[1024];
    const struct native_pose pose[2] = {{t0_ns, {x0_m, 0, 0}, {1, 0, 0, 0}, 0, 0, 0},
                                        {t1_ns, {x1_m, 0, 0}, {1, 0, 0, 0}, 0, 0, 0}};
    cola.ops->frame(cola.protocol, frame, native_encode_poses(frame, sizeof frame, pose, 2, cola.scan_t0_ns, 0));
}

/* The encoder is a vehicle's: its way and its speed. The vehicle goes at 2 m/s, then back at 1 m/s, and the way
 * grows. */
static void the_encoder_counts_the_way(void **state)
{
    (void)state;
    cola_open_tim("TiM571");
    cola_authorise();
    cola_expect("sWN LMDscandatacfg 1 0 0 0 0 1 0 0 0 0 0 1", "sWA LMDscandatacfg");
    cola_stream(1);
    cola_scan(0, 1.0, &lmd); /* a head that stands */
    assert_int_equal(lmd.n_encoders, 1);
    assert_int_equal(lmd.position, 0);
    assert_int_equal(lmd.speed, 0);
    give_poses(10.0, 10.2, 0, 100000000);
    cola_turn(1, 1.0); /* its first pulse at 66.67 ms: 133 mm */
    cola_read_lmd(1, &lmd);
    assert_in_range(lmd.position, 133, 134);
    assert_int_equal(lmd.speed, 2000);
    give_poses(10.2, 10.0, 100000000, 300000000);
    cola_turn(2, 1.0); /* 133.33 ms: 200 mm, and 33.33 ms at 1 m/s */
    cola_read_lmd(2, &lmd);
    assert_in_range(lmd.position, 233, 234);
    assert_int_equal(lmd.speed, 1000);
    give_poses(10.0, 10.2, 0, 100000000); /* a replayed recording begins anew, in the same scan */
    cola_turn(1, 1.0);
    cola_read_lmd(3, &lmd);
    assert_in_range(lmd.position, 133, 134);
    assert_int_equal(lmd.speed, 2000);
}

static void add_way(struct cola_way *way, uint32_t scan, const struct native_pose *pose, uint32_t n)
{
    uint8_t frame[1024];
    const size_t len = native_encode_poses(frame, sizeof frame, pose, n, 0, 0);
    cola_way_add(way, scan, frame + NATIVE_HEADER_LEN, len - NATIVE_HEADER_LEN);
}

static void expect_way(const struct cola_way *way, uint32_t scan, int64_t t_ns, int32_t path_mm, int16_t speed_mm_s)
{
    const struct cola_encoder at = cola_way_at(way, scan, t_ns);
    if (at.path_mm != path_mm || at.speed_mm_s != speed_mm_s)
        fail_msg("at %lld ns %d mm, %d mm/s", (long long)t_ns, at.path_mm, at.speed_mm_s);
}

/* A way is known from a frame's first pose to its last one. Beyond them it is that of the nearer pose. */
static void a_way_ends_with_its_poses(void **state)
{
    (void)state;
    static const int64_t S = 1000000000;
    const struct native_pose pose[3] = {{0, {1, 1, 1}, {1, 0, 0, 0}, 0, 0, 0},
                                        {S, {4, 5, 13}, {1, 0, 0, 0}, 0, 0, 0}, /* 13 m on: 3, 4 and 12 */
                                        {2 * S, {4, 45, 13}, {1, 0, 0, 0}, 0, 0, 0}};
    struct cola_way way = {0};
    expect_way(&way, 0, S, 0, 0); /* a head that stands */
    add_way(&way, 3, pose, 2);
    static const struct {
        double t_s;
        int32_t path_mm;
    } row[] = {{-1, 0}, {0, 0}, {0.25, 3250}, {1, 13000}, {1.25, 13000}, {1.75, 13000}, {9, 13000}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++)
        expect_way(&way, 3, (int64_t)(row[i].t_s * 1e9), row[i].path_mm, 13000);
    expect_way(&way, 2, S, 0, 0);  /* of another scan */
    add_way(&way, 3, &pose[1], 2); /* 40 m in a second: faster than 16 bits can say */
    expect_way(&way, 3, 3 * S / 2, 33000, INT16_MAX);
    expect_way(&way, 3, 3 * S, 53000, INT16_MAX);
    add_way(&way, 4, pose, 2); /* a new scan begins at 0 */
    expect_way(&way, 4, S, 13000, 13000);
    expect_way(&way, 3, S, 0, 0);
    cola_way_add(&way, 4, (const uint8_t *)"", 0); /* no poses: nothing changes */
    expect_way(&way, 4, S, 13000, 13000);
}

/* A head gives each tick the poses around it: most frames repeat the poses of the frame before. */
static void repeated_poses_change_no_way(void **state)
{
    (void)state;
    static const int64_t S = 1000000000;
    const struct native_pose pose[4] = {{0, {0, 0, 0}, {1, 0, 0, 0}, 0, 0, 0},
                                        {S, {10, 0, 0}, {1, 0, 0, 0}, 0, 0, 0},
                                        {2 * S, {20, 0, 0}, {1, 0, 0, 0}, 0, 0, 0},
                                        {3 * S, {30, 0, 0}, {1, 0, 0, 0}, 0, 0, 0}};
    struct cola_way way = {0};
    for (int i = 0; i < 3; i++) {
        add_way(&way, 1, pose, 2);
        expect_way(&way, 1, S / 4, 2500, 10000); /* 10 m/s all the way */
    }
    for (int i = 0; i < 3; i++) {
        add_way(&way, 1, &pose[1], 3);
        expect_way(&way, 1, 5 * S / 2, 25000, 10000);
    }
    add_way(&way, 1, &pose[2], 2);
    expect_way(&way, 1, 5 * S / 2, 25000, 10000);
}

/* Poses each 8 ms at 25 m/s, and ticks of 5 ms that each have the poses around them. At the start of each tick the path
 * is 25 mm for each millisecond. */
static void a_tick_between_poses_has_its_own_path(void **state)
{
    (void)state;
    static const int64_t MS = 1000000;
    struct cola_way way = {0};
    for (int tick = 0; tick < 16; tick++) {
        const int from_ms = 5 * tick, first = from_ms / 8, last = (from_ms + 5 + 7) / 8;
        struct native_pose pose[3] = {0};
        for (int i = first; i <= last; i++)
            pose[i - first] = (struct native_pose){8 * i * MS, {0.2 * i, 0, 0}, {1, 0, 0, 0}, 0, 0, 0};
        add_way(&way, 1, pose, (uint32_t)(last - first + 1));
        expect_way(&way, 1, from_ms * MS, 25 * from_ms, 25000);
        expect_way(&way, 1, (from_ms + 4) * MS, 25 * (from_ms + 4), 25000);
    }
}

/* A frame of poses has one speed: its way, from the end of the frame before it, over its time. */
static void a_way_has_one_speed_a_frame(void **state)
{
    (void)state;
    static const int64_t S = 1000000000;
    const struct native_pose pose[3] = {{0, {0, 0, 0}, {1, 0, 0, 0}, 0, 0, 0},
                                        {S, {13, 0, 0}, {1, 0, 0, 0}, 0, 0, 0},
                                        {2 * S, {13, 40, 0}, {1, 0, 0, 0}, 0, 0, 0}},
                             later[2] = {{4 * S, {13, 40, 50}, {1, 0, 0, 0}, 0, 0, 0},
                                         {5 * S, {13, 40, 62}, {1, 0, 0, 0}, 0, 0, 0}};
    struct cola_way way = {0};
    add_way(&way, 1, pose, 3); /* 53 m in 2 s */
    expect_way(&way, 1, 3 * S / 2, 39750, 26500);
    add_way(&way, 1, later, 2); /* 62 m more, 3 s later */
    expect_way(&way, 1, 7 * S / 2, 84000, 20667);
    expect_way(&way, 1, 9 * S, 115000, 20667);
}

/* The longest telegram has all channels, 16 bits, hexadecimal, and everything in the tail. */
static void the_longest_telegram_has_room(void **state)
{
    (void)state;
    cola_open("LMS111");
    protocol_rig_planar(&cola, 3600, 0, 2999, 1500, -1, 10);
    cola.descriptor.range_max_m = 60.0;
    protocol_rig_describe(&cola, 0);
    cola_authorise();
    cola_expect("sWN LMDscandatacfg 3 0 1 1 0 1 0 1 1 1 1 1", "sWA LMDscandatacfg");
    for (int i = 0; i < 3000; i++)
        shots[i] = (struct protocol_rig_shot){2, {50.0, 60.0}, {-100, 0}, {0}};
    cola_stream(0);
    protocol_rig_clear(&cola);
    protocol_rig_turn(&cola, 0, shots, 500);
    cola_read_lmd(0, &lmd); /* the rig has checked it against max_unit */
    assert_true(cola.len > 60000 && cola.len <= 65535);
    /* One beam more is more than the module takes. The module says so, and nothing is sent. */
    cola.emitter.last_step = 3000;
    protocol_rig_describe(&cola, 0);
    protocol_rig_clear(&cola);
    shots[2999] = shots[0];
    protocol_rig_turn(&cola, 1, shots, 500);
    assert_int_equal(cola.n_units, 0);
    cola_expect("sRN LMPoutputRange", "sFA 4");
}

int main(void)
{
#define CASE(f) cmocka_unit_test_teardown(f, cola_teardown)
    const struct CMUnitTest tests[] = {
        CASE(a_telegram_in_a_is_this_text),       CASE(a_telegram_in_b_is_these_bytes),
        CASE(a_tim571_telegram_has_its_length),   CASE(ranges_stand_at_their_angles),
        CASE(rates_agree_as_sick_tim_asks),       CASE(a_mark_on_the_left_is_on_the_left),
        CASE(far_heads_count_in_two_millimetres), CASE(echoes_go_to_their_channels),
        CASE(signals_end_where_their_scale_ends), CASE(name_and_time_where_asked_for),
        CASE(the_encoder_counts_the_way),         CASE(a_way_ends_with_its_poses),
        CASE(repeated_poses_change_no_way),       CASE(a_tick_between_poses_has_its_own_path),
        CASE(a_way_has_one_speed_a_frame),        CASE(the_longest_telegram_has_room),
    };
    return cmocka_run_group_tests_name("cola scan", tests, NULL, NULL);
}
