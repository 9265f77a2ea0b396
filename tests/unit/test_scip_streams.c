/* SPDX-License-Identifier: MIT */
/* SCIP, the sensor's side: the order of scans. Streams, their begin and end, losses between them, and time. */
#include "tests/unit/scip_rig.h"

static struct scip_decoded got;

/* Checks which of ten turns come, by their time stamps. */
static void check_turns(const char *command, const char *want)
{
    char line[40], times[80] = "";
    scip_open("UTM-30LX-EW");
    snprintf(line, sizeof line, "%s\n", command);
    protocol_rig_input(&rig, line);
    protocol_rig_clear(&rig);
    for (uint32_t k = 0; k < 10; k++) {
        scip_turn(k);
        if (rig.len == 0) continue;
        scip_decode_only(&got, 3, 0);
        snprintf(times + strlen(times), sizeof times - strlen(times), "%u:%.2s ", got.time_ms / 25, got.echo + 13);
    }
    assert_string_equal(times, want);
}

static void skipped_scans(void **state)
{
    (void)state;
    check_turns("MD0000108000003", "0:02 1:01 2:00 ");
    check_turns("MD0000108000103", "1:02 3:01 5:00 ");
    check_turns("MD0000108000302", "3:01 7:00 ");
    check_turns("MD0000108000400", "4:00 9:00 ");
    check_turns("MD0000108000999", "9:98 ");
}

/* Another client stops the head, and a client asks for scans while the last ones still come. */
static void asked_while_it_stops(void **state)
{
    (void)state;
    static const struct protocol_rig_reply stops[] = {{"HEAD:STATE?", "spin-down", 0}, {NULL, NULL, 0}},
                                           idle[] = {{"HEAD:STATE?", "idle", 0}, {NULL, NULL, 0}},
                                           scans[] = {{"HEAD:STATE?", "scanning", 0}, {NULL, NULL, 0}};
    scip_open("UTM-30LX");
    scip_turn(0);
    scip_ask("MD0000108001000\n", "MD0000108001000\n00P\n\n");
    assert_int_equal(rig.n_lines, 0);
    rig.replies = stops;
    scip_turn(1); /* a scan that was made before the stop: no other follows it */
    assert_true(rig.len > 3000);
    protocol_rig_clear(&rig);
    rig.ops->time(rig.protocol, 900000000);
    rig.replies = idle;
    rig.ops->time(rig.protocol, 950000000);
    assert_int_equal(rig.n_lines, 1); /* ten times a second at most */
    rig.ops->time(rig.protocol, 1000000000);
    assert_int_equal(rig.n_lines, 3);
    assert_string_equal(rig.line[2], "SCAN:START");
    /* The head scans. A stop after that is on purpose: the head is not started again. */
    rig.replies = scans;
    scip_turn(41);
    assert_true(rig.len > 3000);
    rig.replies = idle;
    protocol_rig_clear(&rig);
    rig.ops->time(rig.protocol, 9000000000);
    assert_int_equal(rig.n_lines, 0);
}

/* The session is at an earlier tick than the head, where the scan that the session has started is over. */
static void a_scan_of_its_own_may_be_over_when_it_comes(void **state)
{
    (void)state;
    static const struct protocol_rig_reply idle[] = {{"HEAD:STATE?", "idle", 0}, {NULL, NULL, 0}};
    scip_open("UTM-30LX");
    rig.replies = idle;
    protocol_rig_input(&rig, "BM\n");
    assert_int_equal(rig.n_lines, 2);
    assert_string_equal(rig.line[1], "SCAN:START");
    protocol_rig_input(&rig, "MD0000108001000\n");
    rig.ops->time(rig.protocol, 100000000);
    rig.identity.spin_up_ns = 1900000000; /* and the mirror is slow */
    rig.ops->time(rig.protocol, 1900000000);
    scip_turn(4);
    rig.ops->time(rig.protocol, 9000000000);
    for (uint32_t i = 2; i < rig.n_lines; i++)
        assert_string_equal(rig.line[i], "HEAD:STATE?");
}

/* A turn that is left out in any case may be a broken one. */
static void skipped_and_broken(void **state)
{
    (void)state;
    scip_open("UTM-30LX-EW");
    scip_ask("MD0000108000100\n", "MD0000108000100\n00P\n\n");
    scip_part(0, 0, 500);
    scip_line_end(0, 0);
    scip_turn(1);
    scip_decode_only(&got, 3, 0);
    assert_int_equal(got.time_ms, 25);
    scip_open("UTM-30LX-EW"); /* a broken turn is one of the three that are left out */
    scip_ask("MD0000108000300\n", "MD0000108000300\n00P\n\n");
    scip_part(0, 0, 500);
    scip_line_end(0, 0);
    for (uint32_t line = 1; line < 4; line++)
        scip_turn(line);
    scip_decode_only(&got, 3, 0);
    assert_int_equal(got.time_ms, 75);
}

/* A recording of a UTM-30LX has the first scan 27 ms after the answer to ME0000108001101 (SCIP.md, D). */
static void the_first_comes_at_once(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("MD0000108000202\n", "MD0000108000202\n00P\n\n");
    scip_turn(0);
    scip_decode_only(&got, 3, 0);
    assert_int_equal(got.time_ms, 0);
    scip_turn(1);
    scip_turn(2);
    scip_expect("");
    scip_turn(3);
    scip_decode_only(&got, 3, 0);
    assert_int_equal(got.time_ms, 75);
}

/* A scan is sent once its last step has come, before the turn is over. */
static void sent_after_the_last_step(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("MD0000108000000\n", "MD0000108000000\n00P\n\n");
    scip_part(0, 0, 700);
    scip_part(0, 701, 1079);
    scip_expect("");
    scip_part(0, 1080, 1080);
    scip_decode_only(&got, 3, 0);
    scip_line_end(0, 0);
    scip_expect("");
    assert_int_equal(rig.count[PROTOCOL_UNITS_LOST], 0);
}

/* QT ends a stream within a turn. A second M replaces the first one, and a refused one doesn't. */
static void streams_end(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("MD0000108000000\n", "MD0000108000000\n00P\n\n");
    scip_part(0, 0, 700);
    scip_ask("QT\n", "QT\n00P\n\n");
    scip_part(0, 701, 1080);
    scip_line_end(0, 0);
    scip_turn(1);
    scip_expect("");
    scip_ask("MD0000108000000\nMD0000000301002\n", "MD0000108000000\n00P\n\nMD0000000301002\n00P\n\n");
    scip_turn(2);
    scip_decode_only(&got, 3, 0);
    assert_string_equal(got.echo, "MD0000000301001");
    assert_int_equal(got.n_steps, 4);
    scip_ask("MD0003000001002\n", "MD0003000001002\n05U\n\n");
    scip_turn(3);
    scip_decode_only(&got, 3, 0);
    assert_string_equal(got.echo, "MD0000000301000");
}

/* M gives scans that were measured after it was asked for. G gives the next scan that is whole and was measured with
 * the laser on. */
static void measured_when(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_part(0, 0, 700);
    rig.ops->time(rig.protocol, 12000000);
    scip_ask("BM\nMD0000108000000\nGD0000000001\n", "BM\n00P\n\nMD0000108000000\n00P\n\n");
    scip_part(0, 701, 1080);
    scip_line_end(0, 0);
    scip_expect("");
    scip_turn(1);
    const char *at = (const char *)rig.bytes;
    scip_decode(&got, &at, 3, 0);
    assert_string_equal(got.echo, "GD0000000001");
    assert_string_equal(got.status, "00");
    assert_int_equal(got.time_ms, 25);
    scip_decode(&got, &at, 3, 0);
    assert_string_equal(got.echo, "MD0000108000000");
    assert_int_equal(got.time_ms, 25);
    protocol_rig_clear(&rig);
    scip_part(2, 0, 700);
    rig.ops->time(rig.protocol, 62000000);
    scip_ask("QT\nBM\nQT\n", "QT\n00P\n\nBM\n00P\n\nQT\n00P\n\n");
}

static void handshakes(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("BM\n", "BM\n00P\n\n");
    for (uint32_t k = 0; k < 5; k++) {
        scip_ask("GD0000108001\n", "");
        scip_turn(k);
        scip_decode_only(&got, 3, 0);
        assert_string_equal(got.status, "00");
        assert_int_equal(got.time_ms, 25 * k);
    }
    scip_ask("GD0000108001;a\nGD0000108001;b\n", "GD0000108001;b\n0Bb\n\n");
    scip_ask("QT\n", "GD0000108001;a\n10Q\n\nQT\n00P\n\n");
    scip_ask("BM\nGD0000108001;c\n", "BM\n00P\n\n");
    rig.ops->time(rig.protocol, 125000000 + 1999999999);
    scip_expect("");
    rig.ops->time(rig.protocol, 125000000 + 2000000000); /* no scan has come */
    scip_expect("GD0000108001;c\n0Aa\n\n");
    rig.ops->time(rig.protocol, 125000000 + 5000000000);
    scip_expect("");
}

/* A turn with missing frames is not sent, but counted. All requested ones come. */
static void lost_frames(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("MD0000108000003\n", "MD0000108000003\n00P\n\n");
    scip_part(0, 0, 500);
    scip_part(0, 502, 1080);
    scip_line_end(0, 0);
    scip_expect("");
    assert_int_equal(rig.count[PROTOCOL_UNITS_LOST], 1);
    scip_turn(1);
    scip_decode_only(&got, 3, 0);
    assert_string_equal(got.echo + 13, "02");
    scip_part(2, 0, 900); /* without the rest of turn 2, turns 3 and 4, the begin of turn 5 */
    scip_part(5, 100, 1080);
    scip_line_end(5, 0);
    scip_expect("");
    assert_int_equal(rig.count[PROTOCOL_UNITS_LOST], 5);
    scip_line_end(6, 0); /* without all points of turn 6 */
    assert_int_equal(rig.count[PROTOCOL_UNITS_LOST], 6);
    scip_turn(7);
    scip_decode_only(&got, 3, 0);
    assert_string_equal(got.echo + 13, "01");
    assert_int_equal(got.time_ms, 175);
}

/* A change of speed within a turn sends descriptor and emitter again, and does not change the turn. Another number of
 * steps begins anew. */
static void speed_changes_within_a_turn(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("MD0000108000000\n", "MD0000108000000\n00P\n\n");
    scip_part(0, 0, 600);
    rig.descriptor.lines_uhz = 39000000;
    rig.emitter.sequence_ns_den = 39 * 1440;
    protocol_rig_describe(&rig, 10000000);
    rig.descriptor.lines_uhz = 40000000;
    scip_part(0, 601, 1080);
    scip_decode_only(&got, 3, 0);
    assert_int_equal(got.n_steps, 1081);
    scip_part(1, 0, 600);
    rig.emitter.last_step = 600;
    protocol_rig_describe(&rig, 40000000);
    scip_part(1, 601, 601);
    scip_line_end(1, 0);
    scip_expect("");
    scip_ask("MD0000060100000\n", "MD0000060100000\n04T\n\n");
}

/* 2^24 ms are 4 h 39 min 37.216 s. The stamp is that of step 0, wherever the scan begins. */
static void the_clock_wraps(void **state)
{
    (void)state;
    scip_open("URG-04LX");
    rig.scan_t0_ns = 16777216000000 - 150000000;
    scip_ask("MD0044072500000\n", "MD0044072500000\n00P\n\n");
    static const uint32_t want_ms[] = {16777066, 16777166, 50, 150};
    for (uint32_t k = 0; k < 4; k++) {
        scip_turn(k);
        scip_decode_only(&got, 3, 0);
        assert_int_equal(got.time_ms, want_ms[k]);
    }
    protocol_rig_input(&rig, "RS\nMD0044072500000\n");
    protocol_rig_clear(&rig);
    scip_turn(4);
    scip_turn(5);
    const char *at = (const char *)rig.bytes;
    scip_decode(&got, &at, 3, 0);
    assert_int_equal(got.time_ms, 0);
    scip_decode(&got, &at, 3, 0);
    assert_int_equal(got.time_ms, 100);
}

/* Checks all replies since the last call: the two digits of each echo, and its status. */
static void check_played(const char *want)
{
    char text[512] = "";
    rig.bytes[rig.len] = 0;
    for (uint32_t i = 0; i < rig.n_units; i++) {
        const char *unit = (const char *)rig.bytes + (i == 0 ? 0 : rig.end[i - 1]);
        snprintf(text + strlen(text), sizeof text - strlen(text), "%.2s:%.2s ", unit + 13, unit + 16);
    }
    assert_string_equal(text, want);
    protocol_rig_clear(&rig);
}

static void turns_of_a_stream(uint32_t *line, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++)
        scip_turn((*line)++);
}

static void played_malfunctions(void **state)
{
    (void)state;
    uint32_t line = 0;
    scip_open("UTM-30LX");
    scip_ask("DB10\nDB06\nDB0x\nDB01\n", "DB10\n03S\n\nDB06\n01Q\n\nDB0x\n01Q\n\nDB01\n04T\n\n");
    scip_ask("MD0000108000000\nDB02\n", "MD0000108000000\n00P\n\nMD0000108000000\n50U\n\nDB02\n00P\n\n");
    scip_ask("DB02\nDB03\nBM\nMD0000108000000\n", "DB02\n02R\n\nDB03\n05U\n\nBM\n01Q\n\nMD0000108000000\n50U\n\n");
    turns_of_a_stream(&line, 1);
    scip_expect("");
    scip_ask("DB10\nBM\nQT\n", "DB10\n00P\n\nBM\n00P\n\nQT\n00P\n\n");

    scip_ask("DB03\nMD0000108000030\n", "DB03\n00P\n\nMD0000108000030\n00P\n\n");
    turns_of_a_stream(&line, 21);
    check_played("29:99 28:99 27:99 26:99 25:99 24:99 23:99 22:99 21:99 20:99 20:21 20:98 ");
    scip_turn(line++);
    check_played("19:99 ");
    scip_ask("DB10\nDB03\nDB10\n", "DB10\n03S\n\nDB03\n00P\n\nDB10\n00P\n\n"); /* it is over */
    scip_ask("QT\nDB04\nMD0000108000020\n", "QT\n00P\n\nDB04\n00P\n\nMD0000108000020\n00P\n\n");
    turns_of_a_stream(&line, 20); /* too short for it */
    assert_int_equal(rig.n_units, 20);
    protocol_rig_clear(&rig);
    scip_ask("MD0000108000021\n", "MD0000108000021\n00P\n\n");
    turns_of_a_stream(&line, 25);
    check_played("20:99 19:99 18:99 17:99 16:99 15:99 14:99 13:99 12:99 11:99 11:21 11:50 ");
    scip_ask("BM\nDB10\nDB05\n", "BM\n01Q\n\nDB10\n00P\n\nDB05\n00P\n\n");
    scip_ask("MD0000108000000\n", "MD0000108000000\n00P\n\n");
    turns_of_a_stream(&line, 25);
    check_played("00:99 00:99 00:99 00:99 00:99 00:99 00:99 00:99 00:99 00:99 00:50 ");
    scip_ask("RS\nBM\n", "RS\n00P\n\nBM\n00P\n\n");
    scip_ask("DB03\nMD0000108000000\n", "DB03\n00P\n\nMD0000108000000\n00P\n\n");
    turns_of_a_stream(&line, 14); /* it ends within the second phase, and the next one has all three */
    protocol_rig_clear(&rig);
    scip_ask("MD0000108000000\n", "MD0000108000000\n00P\n\n");
    turns_of_a_stream(&line, 21);
    check_played("00:99 00:99 00:99 00:99 00:99 00:99 00:99 00:99 00:99 00:99 00:21 00:98 ");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(skipped_scans),
        cmocka_unit_test(streams_end),
        cmocka_unit_test(sent_after_the_last_step),
        cmocka_unit_test(measured_when),
        cmocka_unit_test(handshakes),
        cmocka_unit_test(lost_frames),
        cmocka_unit_test(the_clock_wraps),
        cmocka_unit_test(speed_changes_within_a_turn),
        cmocka_unit_test(asked_while_it_stops),
        cmocka_unit_test(a_scan_of_its_own_may_be_over_when_it_comes),
        cmocka_unit_test(skipped_and_broken),
        cmocka_unit_test(the_first_comes_at_once),
        cmocka_unit_test(played_malfunctions),
    };
    return cmocka_run_group_tests(tests, NULL, scip_teardown);
}
