/* SPDX-License-Identifier: MIT */
/* CoLa's LMDscandata: its times and counters, lost scans, and the moment of sending. */
#include <math.h>

#include "drivers/protocol/native_encode.h"
#include "tests/unit/cola_rig.h"

static struct cola_lmd lmd;
static struct protocol_rig_shot shots[3001];

/* ---- times and counters */

static void ticks_count_modulo_32_bits(void **state)
{
    (void)state;
    cola_open_tim("TiM571");
    cola_stream(1);
    /* scans from a second before 2^32 us on: the 15th lies across */
    cola.scan_t0_ns = INT64_C(4294967296000) - INT64_C(1000000000);
    protocol_rig_clear(&cola);
    for (uint32_t line = 0; line < 30; line++) {
        cola_turn(line, 1.0);
        cola_read_lmd(line, &lmd);
        const int64_t start_ns = cola.scan_t0_ns + (int64_t)line * 1000000000 / 15;
        const int64_t end_ns = cola.scan_t0_ns + (int64_t)(line + 1) * 1000000000 / 15;
        assert_int_equal(lmd.scan_us, (uint32_t)(start_ns / 1000 % INT64_C(4294967296)));
        assert_int_equal(lmd.send_us, (uint32_t)(end_ns / 1000 % INT64_C(4294967296)));
    }
    assert_true(lmd.scan_us < 1000000);
}

/* sick_scan_xd fits a line through ticks and the times of arrival; here the latter are device time. Over half an hour
 * with the wrap in it the line's slope is 1, and no scan is farther from it than the 1 us of a tick. */
static void ticks_are_on_a_line_with_time(void **state)
{
    (void)state;
    cola_open_tim("TiM571");
    cola_stream(1);
    cola.scan_t0_ns = INT64_C(4294967296000) - INT64_C(900000000000);
    double first_us = 0.0;
    uint32_t before_us = 0;
    int64_t wraps = 0;
    for (uint32_t line = 0; line < 27000; line += line % 2 == 0 ? 1 : 899) {
        cola_scan(line, 1.0, &lmd);
        if (lmd.scan_us < before_us) wraps++;
        before_us = lmd.scan_us;
        const double tick_us = (double)lmd.scan_us + 4294967296.0 * (double)wraps;
        const double true_us = (double)cola.scan_t0_ns / 1e3 + line * (1e6 / 15.0);
        if (line == 0) first_us = tick_us - true_us;
        assert_true(fabs(tick_us - true_us - first_us) <= 1.0);
    }
    assert_int_equal(wraps, 1);
}

static void counters_count_modulo_16_bits(void **state)
{
    (void)state;
    cola_open("TiM571");
    protocol_rig_planar(&cola, 8, 2, 5, 4, -1, 10);
    protocol_rig_describe(&cola, 0);
    cola_stream(1);
    memset(shots, 0, sizeof shots);
    for (uint32_t line = 3; line < 65540; line++) {
        protocol_rig_clear(&cola);
        protocol_rig_turn(&cola, line, shots, 1);
        if (line > 10 && line < 65530) continue;
        cola_read_lmd(0, &lmd);
        if (lmd.scan != line % 65536 || lmd.telegram != (line - 3) % 65536)
            fail_msg("line %u: %u %u", line, lmd.scan, lmd.telegram);
    }
    /* the next scan of the head starts its lines again; the scanner's counter goes on */
    cola.descriptor.scan = 2;
    protocol_rig_describe(&cola, 0);
    protocol_rig_clear(&cola);
    protocol_rig_turn(&cola, 0, shots, 1);
    cola_read_lmd(0, &lmd);
    assert_int_equal(lmd.scan, 65540 % 65536);
}

/* ---- losses */

/* Feeds n steps of a turn, from `from` on. */
static void part_of_turn(uint32_t line, uint32_t from, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++)
        shots[i] = (struct protocol_rig_shot){1, {5.0}, {0}, {0}};
    protocol_rig_part(&cola, line, from, n, shots);
}

static void a_scan_with_a_hole_is_not_sent(void **state)
{
    (void)state;
    cola_open_tim("TiM571");
    cola_stream(0);
    protocol_rig_clear(&cola);
    cola_turn(0, 1.0);
    part_of_turn(1, 0, 200); /* of 811 pulses one is missing */
    part_of_turn(1, 200, 200);
    part_of_turn(1, 401, 200);
    part_of_turn(1, 601, 210);
    cola_turn(2, 1.0);
    cola_turn(5, 1.0); /* and two whole turns */
    assert_int_equal(cola.n_units, 3);
    assert_int_equal(cola.count[PROTOCOL_UNITS_LOST], 3);
    static const uint32_t scan[] = {0, 2, 5};
    for (uint32_t i = 0; i < 3; i++) {
        cola_read_lmd(i, &lmd);
        assert_int_equal(lmd.scan, scan[i]); /* a client sees the gap here, */
        assert_int_equal(lmd.telegram, i);   /* and not here */
        assert_int_equal(lmd.channel[0].value[0], 1000);
    }
}

/* Feeds attributes of another frame, which do not belong to the points before. */
static void give_attributes(uint32_t line, uint64_t pulse0, uint32_t n)
{
    uint8_t frame[NATIVE_HEADER_LEN + NATIVE_ATTRIBUTES_HEAD_LEN + 4 * 811] = {NATIVE_SYNC, NATIVE_ATTRIBUTES, 1};
    uint8_t *payload = frame + NATIVE_HEADER_LEN;
    le_put32(frame + 4, NATIVE_ATTRIBUTES_HEAD_LEN + 4 * n);
    le_put64(payload, pulse0);
    le_put32(payload + 8, line);
    le_put32(payload + 12, n);
    cola.ops->frame(cola.protocol, frame, native_frame_len(frame));
}

/* Feeds a turn in which one frame of points has no attributes, others', or its own. */
static void attributes_of_one_frame(uint32_t line, int own, int others)
{
    for (uint32_t from = 0; from < 811; from += 200) {
        cola.attributes = from != 200;
        part_of_turn(line, from, from == 800 ? 11 : 200);
        if (from == 200 && others) give_attributes(line, (uint64_t)line * 1080, 200);
        if (from == 200 && own) give_attributes(line, (uint64_t)line * 1080 + 200, 200);
    }
    cola.ops->time(cola.protocol, (int64_t)line * 66666667 + 60000000);
}

static void attributes_are_those_of_their_points(void **state)
{
    (void)state;
    cola_open_tim("TiM571");
    cola.attributes = 1;
    protocol_rig_describe(&cola, 0);
    cola_stream(0);
    protocol_rig_clear(&cola);
    attributes_of_one_frame(0, 1, 0);
    assert_int_equal(cola.n_units, 1);
    attributes_of_one_frame(1, 0, 0);
    attributes_of_one_frame(2, 0, 1);
    attributes_of_one_frame(3, 1, 0);
    assert_int_equal(cola.n_units, 2);
    assert_int_equal(cola.count[PROTOCOL_UNITS_LOST], 2);
}

/* A scan is sent once it is done, even where the next one's points come before a tick's end. */
static void two_scans_in_a_tick_are_both_sent(void **state)
{
    (void)state;
    cola_open_tim("TiM571");
    cola_stream(1);
    protocol_rig_clear(&cola);
    for (uint32_t line = 0; line < 3; line++)
        for (uint32_t from = 0; from < 811; from += 200)
            part_of_turn(line, from, from == 800 ? 11 : 200);
    assert_int_equal(cola.n_units, 2);
    cola.ops->time(cola.protocol, 200000000);
    assert_int_equal(cola.n_units, 3);
    for (uint32_t i = 0; i < 3; i++) {
        cola_read_lmd(i, &lmd);
        assert_int_equal(lmd.scan, i);
    }
}

static void what_nobody_asked_for_is_not_lost(void **state)
{
    (void)state;
    cola_open_tim("TiM571");
    part_of_turn(7, 600, 211); /* joined in the middle */
    cola_stream(0);
    protocol_rig_clear(&cola);
    cola_turn(8, 1.0);
    assert_int_equal(cola.n_units, 1);
    cola_expect("sEN LMDscandata 0", "sEA LMDscandata 0");
    protocol_rig_clear(&cola);
    cola_turn(11, 1.0);
    assert_int_equal(cola.n_units, 0);
    cola_stream(0);
    protocol_rig_clear(&cola);
    part_of_turn(12, 0, 100); /* the scan is stopped */
    protocol_rig_turn_end(&cola, 12, LINE_PARTIAL);
    assert_int_equal(cola.n_units, 0);
    assert_int_equal(cola.count[PROTOCOL_UNITS_LOST], 0);
}

static void a_client_that_does_not_read_loses_whole_scans(void **state)
{
    (void)state;
    cola_open_tim("TiM571");
    cola_stream(1);
    protocol_rig_clear(&cola);
    cola.room = 3000;
    for (uint32_t line = 0; line < 5; line++)
        cola_turn(line, 1.0);
    assert_int_equal(cola.n_units, 1);
    cola.room = SIZE_MAX;
    cola_turn(5, 1.0);
    cola_read_lmd(1, &lmd);
    assert_int_equal(lmd.telegram, 1);
    assert_int_equal(lmd.scan, 5);
}

/* ---- polled, every second one, stopped */

static void expect_bytes(const char *bytes)
{
    assert_int_equal(cola.len, strlen(bytes));
    assert_memory_equal(cola.bytes, bytes, cola.len);
    protocol_rig_clear(&cola);
}

static void a_poll_gets_the_last_scan(void **state)
{
    (void)state;
    cola_open_lms();
    protocol_rig_input(&cola, "\2sRN LMDscandata\3");
    EXPECT_B("sRN LCMstate", "sRA LCMstate \0"); /* none yet: it waits, and others are answered */
    protocol_rig_clear(&cola);
    cola_turn(0, 1.0);
    assert_int_equal(cola.n_units, 1);
    cola_read_lmd(0, &lmd);
    assert_string_equal(lmd.verb, "sRA");
    assert_int_equal(lmd.channel[0].n, 1081);
    protocol_rig_clear(&cola);
    cola_turn(1, 2.0);
    assert_int_equal(cola.n_units, 0); /* not asked for */
    for (int b = 0; b < 2; b++) {
        uint8_t frame[64];
        if (b)
            cola_input(frame, cola_frame_b(frame, "sRN LMDscandata", 15));
        else
            protocol_rig_input(&cola, "\2sRN LMDscandata\3");
        cola_read_lmd((uint32_t)b, &lmd);
        assert_int_equal(lmd.scan, 1);
        assert_int_equal(lmd.telegram, 1 + b);
        assert_int_equal(lmd.channel[0].value[1080], 12800);
    }
    cola_head_state("idle"); /* a resting head is woken */
    cola_open_lms();
    cola_head_state("idle");
    protocol_rig_input(&cola, "\2sRN LMDscandata\3");
    assert_string_equal(cola.line[1], "SCAN:START");
    cola_head_state("fault");
    protocol_rig_clear(&cola);
    protocol_rig_input(&cola, "\2sRN LMDscandata\3");
    expect_bytes("\2sFA 4\3\2sFA 4\3"); /* the one that has waited is refused, too */
}

/* Another session controls the head. */
static const struct protocol_rig_reply refused[] = {
    {"HEAD:STATE?", "idle", 0}, {"SCAN:START", "ERR", -203}, {NULL, NULL, 0}};

/* Somebody stops the head before the first scan has come. A waiting poll starts the head again, but not after that
 * scan. A start that is refused is not repeated. */
static void a_waiting_poll_starts_the_head_again(void **state)
{
    (void)state;
    cola_open_lms();
    cola_head_state("idle");
    protocol_rig_input(&cola, "\2sRN LMDscandata\3");
    assert_string_equal(cola.line[1], "SCAN:START");
    protocol_rig_clear(&cola);
    cola.ops->time(cola.protocol, 1000000000);
    assert_int_equal(cola.n_lines, 2);
    assert_string_equal(cola.line[1], "SCAN:START");
    protocol_rig_clear(&cola);
    cola.ops->time(cola.protocol, 1001000000);
    assert_int_equal(cola.n_lines, 0); /* ten times a second at most */
    cola_turn(41, 1.0);
    assert_int_equal(cola.n_units, 1);
    protocol_rig_clear(&cola);
    cola.ops->time(cola.protocol, 9000000000);
    assert_int_equal(cola.n_lines, 0);
    cola_open_lms(); /* a poll also waits if its session has then stopped measuring */
    cola_head_state("boot");
    cola_authorise();
    protocol_rig_input(&cola, "\2sRN LMDscandata\3");
    cola_expect("sMN LMCstopmeas", "sAN LMCstopmeas 0");
    cola_head_state("idle");
    protocol_rig_clear(&cola);
    cola.ops->time(cola.protocol, 1000000000);
    assert_int_equal(cola.n_lines, 2);
    assert_string_equal(cola.line[1], "SCAN:START");
    cola_open_lms();
    cola.replies = refused;
    cola_expect("sRN LMDscandata", "sFA 4");
    protocol_rig_clear(&cola);
    cola.ops->time(cola.protocol, 1000000000);
    assert_int_equal(cola.n_lines, 0);
}

/* The head fails while a poll waits, or may not be started any more: the poll is refused, once. Where another request
 * reveals the failure, the refusal comes before that request's answer. */
static void a_waiting_poll_is_refused(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        cola_open_lms();
        cola_head_state("boot");
        cola_authorise();
        protocol_rig_clear(&cola);
        protocol_rig_input(&cola, "\2sRN LMDscandata\3");
        cola_head_state("fault");
        if (i == 1) cola.replies = refused;
        if (i == 2) protocol_rig_input(&cola, "\2sMN LMCstartmeas\3");
        cola.ops->time(cola.protocol, 1000000000);
        cola.ops->time(cola.protocol, 2000000000);
        expect_bytes(i == 2 ? "\2sFA 4\3\2sAN LMCstartmeas 1\3" : "\2sFA 4\3");
        cola_turn(41, 1.0);
        assert_int_equal(cola.n_units, 0);
    }
}

/* Two polls wait for the first scan: each answer has the form of its request. */
static void waiting_polls_keep_their_forms(void **state)
{
    (void)state;
    uint8_t frame[64];
    cola_open_lms();
    protocol_rig_input(&cola, "\2sRN LMDscandata\3");
    cola_input(frame, cola_frame_b(frame, "sRN LMDscandata", 15));
    protocol_rig_clear(&cola);
    cola_turn(0, 1.0);
    assert_int_equal(cola.n_units, 2);
    assert_memory_equal(cola.bytes, "\2sRA", 4);
    assert_memory_equal(cola.bytes + cola.end[0], "\2\2\2\2", 4);
}

static void every_nth_scan_on_request(void **state)
{
    (void)state;
    cola_open_tim("TiM571");
    cola_authorise();
    cola_expect("sWN LMDscandatacfg 1 0 0 0 0 0 0 0 0 0 0 +3", "sWA LMDscandatacfg");
    cola_stream(0);
    protocol_rig_clear(&cola);
    for (uint32_t line = 0; line < 9; line++)
        cola_turn(line, 1.0);
    assert_int_equal(cola.n_units, 3);
    for (uint32_t i = 0; i < 3; i++) {
        cola_read_lmd(i, &lmd);
        assert_int_equal(lmd.scan, 3 * i);
        assert_int_equal(lmd.n_8, 0);
    }
    cola_expect("sMN LMCstopmeas", "sAN LMCstopmeas 0");
    protocol_rig_clear(&cola);
    cola_turn(9, 1.0);
    assert_int_equal(cola.n_units, 0);
    cola_expect("sMN LMCstartmeas", "sAN LMCstartmeas 0");
    protocol_rig_clear(&cola);
    for (uint32_t line = 10; line < 13; line++)
        cola_turn(line, 1.0);
    assert_int_equal(cola.n_units, 1);
    assert_int_equal(cola.count[PROTOCOL_UNITS_LOST], 0);
}

/* Streamed telegrams have the form of the last request, or that of EIHstCola. */
static void the_stream_has_the_chosen_form(void **state)
{
    (void)state;
    cola_open_tim("TiM571");
    cola_authorise();
    cola_stream(0);
    cola_expect("sWN EIHstCola 1", "sWA EIHstCola");
    protocol_rig_clear(&cola);
    cola_turn(0, 1.0);
    assert_memory_equal(cola.bytes, "\2\2\2\2", 4);
    cola_expect("sRN EIHstCola", "sRA EIHstCola 1"); /* in the form of this request, */
    protocol_rig_clear(&cola);
    cola_turn(1, 1.0);
    assert_memory_equal(cola.bytes, "\2sSN", 4); /* so is the scan that follows */
    EXPECT_B("sRN EIHstCola", "sRA EIHstCola \1");
    protocol_rig_clear(&cola);
    cola_turn(2, 1.0);
    assert_memory_equal(cola.bytes, "\2\2\2\2", 4);
}

int main(void)
{
#define CASE(f) cmocka_unit_test_teardown(f, cola_teardown)
    const struct CMUnitTest tests[] = {
        CASE(ticks_count_modulo_32_bits),
        CASE(ticks_are_on_a_line_with_time),
        CASE(counters_count_modulo_16_bits),
        CASE(a_scan_with_a_hole_is_not_sent),
        CASE(attributes_are_those_of_their_points),
        CASE(two_scans_in_a_tick_are_both_sent),
        CASE(what_nobody_asked_for_is_not_lost),
        CASE(a_client_that_does_not_read_loses_whole_scans),
        CASE(a_poll_gets_the_last_scan),
        CASE(a_waiting_poll_starts_the_head_again),
        CASE(a_waiting_poll_is_refused),
        CASE(waiting_polls_keep_their_forms),
        CASE(every_nth_scan_on_request),
        CASE(the_stream_has_the_chosen_form),
    };
    return cmocka_run_group_tests_name("cola times", tests, NULL, NULL);
}
