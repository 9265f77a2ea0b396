/* SPDX-License-Identifier: MIT */
/* The steps of a recording: which commands it sends and when, how long it waits, how it ends a scan, and what it says
 * is missing. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/command/head.h"
#include "tests/unit/recording_steps_rig.h"

static void expect(const char *expected)
{
    assert_string_equal(trace, expected);
}

static void one_scan(void **state)
{
    static const struct turn script[] = {START,
                                         POINTS(100, 100),
                                         {.frame = {.type = SCANHEAD_LINE_END}},
                                         {.frame = {.type = SCANHEAD_LINE_END, .flags = 1}},
                                         {.frame = {.type = SCANHEAD_WAVES}},
                                         {.frame = {.type = SCANHEAD_WAVES, .flags = 1}},
                                         POINTS(100, 200),
                                         OVER(50),
                                         LAST};
    (void)state;
    turns = script;
    options.hash = 1;
    stats.frames = 77;
    run_it(SH_OK);
    expect("hash HEAD:STAT?@0 prepare0@0 SCAN:STAR@0 ");
    assert_true(result.frames == 8 && result.points == 14 && result.empty == 6 && result.with_reflectance == 4);
    assert_true(result.crowded == 1 && result.faint == 2 && result.unfit == 3 && result.lost_samples == 5);
    assert_true(result.counts.scans == 1 && result.counts.pulses == 20 && result.stream.frames == 77);
    assert_true(result.wall_s > 0.2499 && result.wall_s < 0.2501);
    assert_string_equal(result.sha256, "12ab");
    assert_string_equal(result.missing, "");
}

static void several_stations(void **state)
{
    static const struct turn script[] = {POINTS(100, 100), OVER(0), POINTS(100, 100), OVER(0), LAST};
    (void)state;
    turns = script;
    options.first_station = 2;
    options.last_station = 3;
    options.frames = 4;
    run_it(SH_OK);
    expect(
        "HEAD:STAT?@0 prepare2@0 HEAD:STATION 2@0 SCAN:FRAM 4@0 SCAN:STAR@0 HEAD:STAT?@100 prepare3@100 HEAD:STATION "
        "3@100 SCAN:FRAM 4@100 SCAN:STAR@100 ");
    assert_true(result.counts.scans == 2 && result.sha256[0] == '\0');
    /* Each scan has a start of its own: the second one is 5 s later, as its points say. */
    static const struct turn halves[] = {
        START,
        POINTS(100, 500),
        OVER(0),
        {.ms = 100, .frame = {.type = SCANHEAD_POINTS, .t_ns = AT(5100), .scan_t0_ns = 100 * MS}},
        {.ms = 100, .frame = {.type = SCANHEAD_POINTS, .t_ns = AT(5500), .scan_t0_ns = 500 * MS}},
        OVER(0),
        LAST};
    make_recording(NULL);
    turns = halves;
    options.first_station = 2;
    options.last_station = 3;
    options.duration_s = 0.5;
    run_it(SH_OK);
    assert_non_null(strstr(trace, "SCAN:STOP@100 "));
    assert_null(strstr(trace, "SCAN:STOP@200 "));
    assert_non_null(strstr(trace, "SCAN:STOP@300 "));
}

/* It waits for 30 s until the head is idle, and takes what comes meanwhile. */
static void a_head_that_boots(void **state)
{
    static const struct reply_is boots[] = {
        {"HEAD:STAT?", "boot", 0}, {"HEAD:STAT?", "spin-down", 0}, {"HEAD:STAT?", "idle", 0}, {NULL, NULL, 0}};
    static const struct reply_is never[] = {{"HEAD:STAT?", "boot", 0}, {NULL, NULL, 0}};
    static const struct turn script[] = {OVER(20), NOTHING(20), POINTS(100, 100), OVER(0), LAST};
    static const struct turn slow[] = {NOTHING(15000), NOTHING(14999), NOTHING(1), LAST};
    (void)state;
    turns = script;
    replies = boots;
    run_it(SH_OK);
    expect("HEAD:STAT?@0 HEAD:STAT?@20 HEAD:STAT?@40 prepare0@40 SCAN:STAR@40 ");
    make_recording(NULL);
    turns = slow;
    replies = never;
    options.second = NULL;
    run_it(SH_ETIMEOUT);
    expect("HEAD:STAT?@0 HEAD:STAT?@15000 HEAD:STAT?@29999 ");
    assert_string_equal(err.text, "the head was not idle within 30 s");
}

static void heads_that_can_not_start(void **state)
{
    static const struct {
        struct reply_is reply[3];
        int rc;
        const char *text;
    } rows[] = {
        {{{"HEAD:STAT?", "scanning", 0}},
         SH_ESTATE,
         "the state of the head is scanning; --listen records it without commands"},
        {{{"HEAD:STAT?", "fault", 0}},
         SH_ESTATE,
         "the state of the head is fault; --listen records it without commands"},
        {{{"HEAD:STAT?", "off", 0}}, SH_ESTATE, "the state of the head is off; --listen records it without commands"},
        {{{"HEAD:STAT?", "", SCANHEAD_ETIMEOUT}}, SH_ETIMEOUT, "HEAD:STAT?: it broke"},
        {{{"HEAD:STAT?", "idle", 0}, {"SCAN:STAR", "ERR -200,\"x\"", 0}},
         SH_ESTATE,
         "the head refused SCAN:STAR: ERR -200,\"x\""},
        {{{"HEAD:STAT?", "idle", 0}, {"HEAD:STATION 2", "ERR -222", 0}},
         SH_ESTATE,
         "the head refused HEAD:STATION 2: ERR -222"},
        {{{"HEAD:STAT?", "idle", 0}, {"SCAN:FRAM 9", "", SCANHEAD_ECLOSED}}, SH_ECLOSED, "SCAN:FRAM 9: it broke"}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        make_recording(NULL);
        options.first_station = options.last_station = 2;
        options.frames = 9;
        replies = rows[i].reply;
        run_it(rows[i].rc);
        assert_string_equal(err.text, rows[i].text);
    }
}

/* The mirror never came to speed, or power went. */
static void scans_without_an_end(void **state)
{
    static const struct turn gives_up[] = {STATE(HEAD_IDLE, HEAD_SPIN_UP), LAST},
                             later[] = {STATE(HEAD_SCANNING, HEAD_SPIN_UP), POINTS(1, 1),
                                        STATE(HEAD_IDLE, HEAD_SPIN_UP), OVER(1), LAST},
                             begun[] = {START, STATE(HEAD_IDLE, HEAD_SPIN_UP), POINTS(1, 1), OVER(1), LAST},
                             off[] = {POINTS(1, 1), STATE(HEAD_OFF, HEAD_SCANNING), LAST},
                             full[] = {POINTS(1, 1), {.frame = {.type = SCANHEAD_LINE_END, .flags = 99}}, LAST},
                             closed[] = {POINTS(1, 1), {.rc = SCANHEAD_ECLOSED}, LAST};
    (void)state;
    turns = gives_up;
    run_it(SH_ESTATE);
    assert_string_equal(err.text, "the head ended the scan before its first pulse");
    make_recording(NULL);
    turns = later;
    run_it(SH_OK);
    make_recording(NULL);
    turns = begun;
    run_it(SH_OK);
    make_recording(NULL);
    turns = off;
    run_it(SH_ELOST);
    assert_string_equal(err.text, "the head lost power, so the scan has no end");
    make_recording(NULL);
    turns = full;
    run_it(SH_EIO);
    assert_string_equal(err.text, "the disk is full");
    make_recording(NULL);
    turns = closed;
    run_it(SH_ECLOSED);
    assert_string_equal(err.text, "the stream ended in the middle of a scan");
}

/* ---- the end of a scan */

/* A scan is told to end with the first frame at its duration. */
static void a_duration(void **state)
{
    static const struct turn script[] = {START, POINTS(100, 499), POINTS(100, 500), POINTS(100, 510), OVER(100), LAST};
    (void)state;
    turns = script;
    options.duration_s = 0.5;
    run_it(SH_OK);
    expect("HEAD:STAT?@0 prepare0@0 SCAN:STAR@0 SCAN:STOP@200 ");
    assert_string_equal(result.missing, "");
    make_recording(NULL);
    turns = script;
    options.duration_s = 0.5;
    options.head_ends = 1;
    run_it(SH_OK);
    expect("HEAD:STAT?@0 prepare0@0 SCAN:STAR@0 ");
}

/* After SCAN:STOP the end has 20 s from the last pulses on, and 60 s in all. */
static void an_end_that_does_not_come(void **state)
{
    static const struct turn silent[] = {POINTS(0, 500), NOTHING(20000), NOTHING(1), LAST},
                             pulses[] = {POINTS(0, 500), POINTS(19999, 501), NOTHING(20000), NOTHING(1), LAST},
                             endless[] = {POINTS(0, 500),     POINTS(20000, 501), POINTS(20000, 502),
                                          POINTS(20000, 503), POINTS(1, 504),     LAST};
    static const struct {
        const struct turn *script;
        const char *text;
    } rows[] = {{silent, "the head did not end the scan in 20 s after SCAN:STOP"},
                {pulses, "the head did not end the scan in 40 s after SCAN:STOP"},
                {endless, "the head did not end the scan in 60 s after SCAN:STOP"}};
    (void)state;
    for (size_t i = 0; i < 3; i++) {
        make_recording(NULL);
        options.duration_s = 0.5;
        options.second = NULL;
        turns = rows[i].script;
        run_it(SH_ETIMEOUT);
        assert_string_equal(err.text, rows[i].text);
        assert_int_equal(turns->rc, 1); /* not before */
    }
}

/* An interruption ends the scan at hand, and says what is missing. */
static void interruptions(void **state)
{
    static const struct {
        int stop_ms;
        uint32_t first, last, end, frames;
        const char *stop_reply, *missing;
    } rows[] = {{1, 0, 0, 0, 1, "OK", "the end of the scan"},
                {1, 0, 0, 0, 1, "ERR -221", ""}, /* it has just ended */
                {1, 0, 0, 0, 0, "OK", ""},       /* it has no end of its own */
                {1, 2, 2, 0, 1, "OK", "the end of the scan from station 2"},
                {1, 2, 3, 0, 1, "OK", "the end of the scan from station 2 and the scan from station 3"},
                {1, 2, 4, 0, 1, "OK", "the end of the scan from station 2 and the scans from stations 3 to 4"},
                {1, 2, 2, 4, 1, "OK", "the end of the scan from station 2 and the scans from stations 3 to 4"},
                {1, 2, 3, 0, 1, "ERR", "the scan from station 3"},
                {-1, 0, 0, 0, 1, "OK", "the scan"},
                {-1, 2, 2, 0, 1, "OK", "the scan from station 2"},
                {-1, 2, 3, 0, 1, "OK", "the scans from stations 2 to 3"}};
    static const struct turn script[] = {POINTS(100, 100), OVER(100), LAST};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct reply_is some[] = {
            {"HEAD:STAT?", "idle", 0}, {"SCAN:STOP", rows[i].stop_reply, 0}, {NULL, NULL, 0}};
        make_recording(NULL);
        turns = script;
        replies = some;
        stop_ms = rows[i].stop_ms;
        options.first_station = rows[i].first;
        options.last_station = rows[i].last;
        options.end_station = rows[i].end;
        info.frames = rows[i].frames;
        run_it(SH_OK);
        assert_string_equal(result.missing, rows[i].missing);
        assert_int_equal(strstr(trace, "SCAN:STOP@100 ") != NULL, rows[i].stop_ms > 0);
    }
    make_recording(NULL);
    const struct reply_is broken[] = {{"HEAD:STAT?", "idle", 0}, {"SCAN:STOP", "", SCANHEAD_EIO}, {NULL, NULL, 0}};
    turns = script;
    replies = broken;
    stop_ms = 1;
    run_it(SH_EIO);
    assert_string_equal(err.text, "SCAN:STOP: it broke");
}

/* ---- progress */

/* Once a second it reports the share of the whole: by the duration of a scan, or that of the user if it is shorter, and
 * by the stations. */
static void shares(void **state)
{
    static const struct {
        double scan_s, duration_s;
        int rings;
        uint32_t first, last, begin, end;
        uint64_t source_bytes;
        const char *share;
    } rows[] = {
        {4, 0, 0, 0, 0, 0, 0, 0, "0.250"},   {4, 2, 0, 0, 0, 0, 0, 0, "0.500"},  {4, 8, 0, 0, 0, 0, 0, 0, "0.250"},
        {0, 8, 0, 0, 0, 0, 0, 0, "0.125"},   {0, 0, 0, 0, 0, 0, 0, 0, "-1.000"}, {0.5, 0, 0, 0, 0, 0, 0, 0, "1.000"},
        {2, 0, 4, 0, 0, 0, 0, 0, "0.125"},   {4, 0, 0, 3, 4, 0, 0, 0, "0.125"},  {4, 0, 0, 3, 3, 2, 5, 0, "0.312"},
        {4, 0, 0, 0, 0, 0, 0, 400, "0.750"}, {4, 0, 0, 0, 0, 0, 0, 200, "1.000"}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct turn script[] = {{.frame = {.type = SCANHEAD_DESCRIPTOR}},
                                      {.frame = {.type = SCANHEAD_EMITTER}},
                                      START,
                                      POINTS(900, 1000),
                                      NOTHING(100),
                                      OVER(0),
                                      OVER(0),
                                      LAST};
        char expected[96];
        make_recording(NULL);
        turns = script;
        scan_s = rows[i].scan_s;
        rings = rows[i].rings;
        stats.bytes = 300;
        options.progress = 1;
        options.head_ends = 1;
        options.duration_s = rows[i].duration_s;
        options.first_station = rows[i].first;
        options.last_station = rows[i].last;
        options.begin_station = rows[i].begin;
        options.end_station = rows[i].end;
        options.source_bytes = rows[i].source_bytes;
        run_it(SH_OK);
        snprintf(expected, sizeof expected, "1000 recording: 0.00 M points, 0.00 M pulses: %s\n", rows[i].share);
        assert_string_equal(progress, expected);
        assert_non_null(strstr(trace, "second@1000 "));
    }
}

/* ---- listening */

static void a_listener(void **state)
{
    static const struct turn none[] = {{.rc = SCANHEAD_ECLOSED}, LAST},
                             scans[] = {POINTS(1, 1), OVER(1), POINTS(1, 1), OVER(1), {.rc = SCANHEAD_ECLOSED}, LAST},
                             within[] = {POINTS(1, 1), {.rc = SCANHEAD_ECLOSED}, LAST},
                             off[] = {
                                 POINTS(1, 1), STATE(HEAD_OFF, HEAD_SCANNING), OVER(1), {.rc = SCANHEAD_ECLOSED}, LAST};
    static const struct {
        const struct turn *script;
        int rc;
        unsigned n_scans;
    } rows[] = {{none, SH_EFORMAT, 0}, {scans, SH_OK, 2}, {within, SH_ECLOSED, 0}, {off, SH_OK, 1}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        make_recording(NULL);
        options.listen = 1;
        turns = rows[i].script;
        run_it(rows[i].rc);
        expect("");
        assert_int_equal(result.counts.scans, rows[i].n_scans);
    }
    make_recording(NULL);
    options.listen = 1;
    stop_ms = 600; /* nothing comes */
    run_it(SH_OK);
    expect("");
    make_recording(NULL);
    options.listen = 1;
    stats.seq_lost = 1;
    stop_ms = 9000; /* its source may be unable to answer */
    options.second = NULL;
    run_it(SH_OK);
    expect("");
}

/* Frames that the library refuses end no recording. The first one is named; an end that is among them is asked for. */
static void frames_that_are_refused(void **state)
{
    static const struct turn script[] = {
        POINTS(1, 1), {.rc = 2, .frame = {.seq = 7}}, {.rc = 2, .frame = {.seq = 8}}, POINTS(1, 2), OVER(1), LAST};
    (void)state;
    turns = script;
    run_it(SH_OK);
    assert_int_equal(result.counts.scans, 1);
    assert_string_equal(warned, "frame 7 at byte 1234 is left out: it is wrong\n");
    make_recording(NULL);
    stats.refused = 1; /* the head is idle, and nothing more comes */
    run_it(SH_OK);
    assert_string_equal(warned, "the scan's end was lost; the head is idle\n");
}

/* ---- a head that goes and comes back */

static void a_head_that_is_gone(void **state)
{
    static const int whys[] = {SCANHEAD_ELOST, SCANHEAD_ERESET, SCANHEAD_ECLOSED};
    (void)state;
    for (int i = 0; i < 3; i++)
        for (int scans = 0; scans < 2; scans++) {
            const struct turn script[] = {POINTS(1, 1), {.rc = whys[i]}, OVER(1), LAST};
            const struct reply_is some[] = {
                {"HEAD:STAT?", "idle", 0}, {"HEAD:STAT?", scans ? "scanning" : "idle", 0}, {NULL, NULL, 0}};
            make_recording(NULL);
            turns = script;
            replies = some;
            options.replug_s = 5;
            options.second = NULL;
            back_ms = 2001;
            run_it(SH_OK);
            expect(scans
                       ? "HEAD:STAT?@0 prepare0@0 SCAN:STAR@0 reattach@1001 reattach@2001 HEAD:STAT?@2001 "
                       : "HEAD:STAT?@0 prepare0@0 SCAN:STAR@0 reattach@1001 reattach@2001 HEAD:STAT?@2001 count_end ");
            assert_string_equal(warned, "it broke; waiting for it\nthe head is back\n");
            assert_true(result.broken_scans == 1 && result.replugs + result.bus_resets == 1);
            assert_int_equal(result.bus_resets, whys[i] == SCANHEAD_ERESET);
        }
    const struct turn script[] = {POINTS(1, 1), {.rc = SCANHEAD_ELOST}, LAST};
    make_recording(NULL);
    turns = script;
    options.second = NULL;
    options.replug_s = 2;
    run_it(SH_ELOST);
    assert_string_equal(err.text, "the head did not come back: it broke");
    expect("HEAD:STAT?@0 prepare0@0 SCAN:STAR@0 reattach@1001 reattach@2001 ");
    make_recording(NULL);
    turns = script; /* without --replug it is over */
    run_it(SH_ELOST);
    assert_string_equal(err.text, "it broke");
    make_recording(NULL);
    turns = script;
    options.replug_s = 9;
    options.second = NULL;
    stop_ms = 1500;
    run_it(SH_ELOST);
    expect("HEAD:STAT?@0 prepare0@0 SCAN:STAR@0 reattach@1001 reattach@2001 ");
}

/* A scan counts as broken once, however often the head was away in it. */
static void scans_that_are_broken(void **state)
{
    static const struct turn script[] = {POINTS(1, 1), {.rc = SCANHEAD_ELOST}, {.rc = SCANHEAD_ELOST}, POINTS(1, 2),
                                         OVER(1),      POINTS(1, 1),           {.rc = SCANHEAD_ELOST}, OVER(1),
                                         LAST};
    static const struct reply_is some[] = {{"HEAD:STAT?", "idle", 0},     {"HEAD:STAT?", "scanning", 0},
                                           {"HEAD:STAT?", "scanning", 0}, {"HEAD:STAT?", "idle", 0},
                                           {"HEAD:STAT?", "scanning", 0}, {NULL, NULL, 0}};
    (void)state;
    turns = script;
    replies = some;
    options.first_station = 1;
    options.last_station = 2;
    options.replug_s = 5;
    options.second = NULL;
    back_ms = 1;
    run_it(SH_OK);
    assert_true(result.replugs == 3 && result.broken_scans == 2 && result.counts.scans == 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(one_scan, make_recording),
        cmocka_unit_test_setup(several_stations, make_recording),
        cmocka_unit_test_setup(a_head_that_boots, make_recording),
        cmocka_unit_test_setup(heads_that_can_not_start, make_recording),
        cmocka_unit_test_setup(scans_without_an_end, make_recording),
        cmocka_unit_test_setup(a_duration, make_recording),
        cmocka_unit_test_setup(an_end_that_does_not_come, make_recording),
        cmocka_unit_test_setup(interruptions, make_recording),
        cmocka_unit_test_setup(shares, make_recording),
        cmocka_unit_test_setup(a_listener, make_recording),
        cmocka_unit_test_setup(frames_that_are_refused, make_recording),
        cmocka_unit_test_setup(a_head_that_is_gone, make_recording),
        cmocka_unit_test_setup(scans_that_are_broken, make_recording),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
