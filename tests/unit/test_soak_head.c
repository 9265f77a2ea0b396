/* SPDX-License-Identifier: MIT */
/* Faults in the head, by the states, times and PTP states that a client of a soak gets: each is noticed at its bound
 * and not beyond, hidden where no client can notice it, and missed otherwise. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/native.h"
#include "drivers/protocol/native_encode.h"
#include "firmware_sim/app/studio/soak/link.h"
#include "firmware_sim/app/studio/soak/soak.h"
#include "firmware_sim/command/head.h"
#include "firmware_sim/config/config.h"

#define S INT64_C(1000000000)

static struct config cfg;
static struct soak *soak;
static struct soak_link *at;

static int make(void **state)
{
    (void)state;
    memset(&cfg, 0, sizeof cfg);
    cfg.profile.emitter.kind = EMITTER_LINE;
    cfg.output.layout = LINE_POLAR;
    cfg.time.ptp.announce_ms = 2000;
    soak = calloc(1, sizeof *soak);
    if (soak == NULL) return -1;
    soak->cfg = &cfg;
    soak->realtime = 1;
    soak->n_links = 1;
    soak->faults.n = 1;
    at = &soak->link[0];
    at->soak = soak;
    at->usable = 1;
    at->frames = 1; /* the next frame is the first */
    return pthread_mutex_init(&at->lock, NULL);
}

static int end(void **state)
{
    (void)state;
    free(soak);
    return 0;
}

static void begin(enum fault_kind kind, double t_s, double for_ms)
{
    const struct fault_note note = {.fault = 1, .kind = kind, .t_ns = (int64_t)(t_s * 1e9), .for_ms = for_ms};
    soak_heard_head(at, &note);
}

static void stop(enum fault_kind kind, double t_s, uint64_t n)
{
    const struct fault_note note = {.fault = 1, .kind = kind, .t_ns = (int64_t)(t_s * 1e9), .ended = 1, .n = n};
    soak_heard_head(at, &note);
}

static void event(uint32_t kind, double t_s, uint64_t a, uint64_t b, uint64_t c)
{
    const struct scanhead_frame frame = {
        .type = SCANHEAD_EVENT, .event = kind, .t_ns = (int64_t)(t_s * 1e9), .event_value = {a, b, c}};
    soak_saw_inside(at, &frame);
    at->frames++;
}

/* The clock's time at a device time, s. */
static void time_is(double t_s, double gps_s)
{
    event(SCANHEAD_EV_TIME, t_s, 0, (uint64_t)llround(t_s * 1e9), (uint64_t)llround(gps_s * 1e9));
}

static void pps(double t_s, uint64_t utc_s, uint64_t gps_s)
{
    event(SCANHEAD_EV_PPS, t_s, utc_s, (uint64_t)llround(t_s * 1e9), gps_s);
}

/* Checks a row, and makes it anew, with no fault left. */
static void expect(enum fault_kind kind, int injected, int noticed, const char *why)
{
    struct soak_row *row = &at->row[kind];
    soak_judge_head(at);
    if ((int)row->injected != injected || (int)row->noticed != noticed ||
        (int)row->hidden != (why != NULL ? injected - noticed : 0) ||
        (int)row->missed != (why == NULL ? injected - noticed : 0))
        fail_msg("kind %d: %llu injected, %llu noticed, %llu hidden, %llu missed", kind,
                 (unsigned long long)row->injected, (unsigned long long)row->noticed, (unsigned long long)row->hidden,
                 (unsigned long long)row->missed);
    if (why != NULL) assert_string_equal(row->why, why);
    *row = (struct soak_row){0};
    assert_int_equal(at->n_moments, 0);
}

static void some_kinds_are_hidden(void **state)
{
    static const char receiver[] = "only the receiver's sentences and a VLP-16's packets show it",
                      dates[] = "only the dates of a SICK scanner's scans show it",
                      mirror[] = "only the polar layout of a line head has the encoder of the mirror";
    static const struct {
        enum fault_kind kind;
        const char *why;
    } rows[] = {{FAULT_PAN_SLIP, "no encoder shows it; only points that no longer fit do"},
                {FAULT_WINDOW_SOILED, "amplitudes fall: a client has no others to compare with"},
                {FAULT_COUNTERS_HIGH, "counters continue after their wrap"},
                {FAULT_NMEA_LOST, receiver},
                {FAULT_NMEA_LATE, receiver},
                {FAULT_NMEA_VOID, receiver},
                {FAULT_NMEA_CHECKSUM, receiver},
                {FAULT_NTP_SILENT, dates},
                {FAULT_NTP_KISS, dates},
                {FAULT_NTP_UNSYNC, dates},
                {FAULT_NTP_STEP, dates},
                {FAULT_PTP_ASYMMETRY, "a follower can't see it; only another clock does"},
                {FAULT_PTP_JITTER, "the noise of the path looks the same"},
                {FAULT_PTP_NO_SYNC, "the follower keeps its states; only its offset no longer changes"}};
    static const enum fault_kind of_mirror[] = {FAULT_MIRROR_SLOW, FAULT_MIRROR_STUCK, FAULT_MIRROR_WOBBLE};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        begin(rows[i].kind, 1, 0);
        expect(rows[i].kind, 1, 0, rows[i].why);
    }
    for (int i = 0; i < 3; i++) {
        begin(of_mirror[i], 1, 0);
        expect(of_mirror[i], 1, 0, NULL); /* the encoder shows it */
        cfg.output.layout = LINE_GEO;
        begin(of_mirror[i], 1, 0);
        expect(of_mirror[i], 1, 0, mirror);
        cfg.output.layout = LINE_POLAR;
        cfg.profile.emitter.kind = EMITTER_PLANAR;
        begin(of_mirror[i], 1, 0);
        expect(of_mirror[i], 1, 0, mirror);
        cfg.profile.emitter.kind = EMITTER_LINE;
    }
    assert_int_equal(at->ask.others, 14 + 9);
    struct soak_datagrams *const some = (struct soak_datagrams *)&cfg;
    at->datagrams = some;
    begin(FAULT_SELF_TEST, 1, 0);
    expect(FAULT_SELF_TEST, 1, 0, "the clean packets come from the same head, so they have this fault, too");
    at->usable = 0;
    begin(FAULT_SELF_TEST, 1, 0);
    expect(FAULT_SELF_TEST, 1, 0, "the link has no client here");
}

static void so_many_are_kept(void **state)
{
    (void)state;
    for (int i = 0; i <= SOAK_MAX_MOMENTS; i++)
        begin(FAULT_SELF_TEST, 1, 0);
    assert_int_equal(at->n_moments, SOAK_MAX_MOMENTS);
    assert_string_equal(at->row[FAULT_SELF_TEST].why, "too many at a time");
    event(SCANHEAD_EV_STATE, 0.5, HEAD_FAULT, HEAD_BOOT, 0); /* before them */
    assert_int_equal(at->row[FAULT_SELF_TEST].noticed, 0);
    event(SCANHEAD_EV_STATE, 1, HEAD_FAULT, HEAD_BOOT, 0);
    assert_int_equal(at->row[FAULT_SELF_TEST].noticed, SOAK_MAX_MOMENTS);
}

/* The jump is of 0.5 s. The jump is noticed where the clock is ahead by 0.25 to 0.75 s. */
static void a_jump_of_the_clock(void **state)
{
    static const struct {
        double by_s;
        int noticed;
    } rows[] = {{0.5, 1}, {0.26, 1}, {0.74, 1}, {0.24, 0}, {0.76, 0}, {-0.5, 0}, {0.0, 0}};
    (void)state;
    soak->faults.fault[0].jump_s = 0.5;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        at->times = (struct soak_times){0};
        time_is(1, 1000);
        begin(FAULT_CLOCK_JUMP, 1.5, 0);
        time_is(2, 1001 + rows[i].by_s);
        expect(FAULT_CLOCK_JUMP, 1, rows[i].noticed, NULL);
    }
    at->times = (struct soak_times){0};
    begin(FAULT_CLOCK_JUMP, 1, 0);
    time_is(1, 1000); /* there was no time before */
    expect(FAULT_CLOCK_JUMP, 1, 0, "it was before the client had a time");
    begin(FAULT_CLOCK_JUMP, 3, 0);
    time_is(2, 1001.5); /* a jump that is not its own */
    expect(FAULT_CLOCK_JUMP, 1, 0, NULL);
    event(SCANHEAD_EV_TIME, 9, 0, 9 * S, 0); /* no time is known: it counts for nothing */
    assert_int_equal(at->times.at_ns, 2 * S);
    begin(FAULT_CLOCK_JUMP, 3, 0);
    event(SCANHEAD_EV_SCAN_START, 4, 0, 4 * S, 1004 * (uint64_t)S); /* it was at 1001.5 s 2 s ago: 0.5 s more */
    expect(FAULT_CLOCK_JUMP, 1, 1, NULL);
}

/* A clock that stopped falls behind by more than a millisecond; one that drifts is off by more than a microsecond, and
 * by less than a millisecond. */
static void a_clock_that_stops_or_drifts(void **state)
{
    static const struct {
        enum fault_kind kind;
        double by_s;
        int noticed;
    } rows[] = {{FAULT_CLOCK_STOP, -1.1e-3, 1}, {FAULT_CLOCK_STOP, -0.9e-3, 0},  {FAULT_CLOCK_STOP, 1.1e-3, 0},
                {FAULT_CLOCK_DRIFT, 1.1e-6, 1}, {FAULT_CLOCK_DRIFT, -1.1e-6, 1}, {FAULT_CLOCK_DRIFT, 0.9e-6, 0},
                {FAULT_CLOCK_DRIFT, 0.9e-3, 1}, {FAULT_CLOCK_DRIFT, -1.1e-3, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        at->times = (struct soak_times){0};
        time_is(1, 10);
        begin(rows[i].kind, 1.2, 0);
        stop(rows[i].kind, 1.4, 0);
        time_is(2, 11 + rows[i].by_s);
        expect(rows[i].kind, 1, rows[i].noticed, NULL);
        begin(rows[i].kind, 1.2, 0);
        stop(rows[i].kind, 1.4, 0); /* over before the last time */
        time_is(3, 12 + 2 * rows[i].by_s);
        expect(rows[i].kind, 1, 0, NULL);
        at->times = (struct soak_times){0};
        begin(rows[i].kind, 1.2, 0);
        stop(rows[i].kind, 1.4, 0);
        time_is(1.5, 10);
        expect(rows[i].kind, 1, 0, "it was before the client had a time");
        at->times = (struct soak_times){0};
        begin(rows[i].kind, 1.2, 0); /* this one goes on after the first time */
        time_is(1.5, 10);
        assert_int_equal(at->n_moments, 1);
        time_is(2, 10.5 + rows[i].by_s);
        expect(rows[i].kind, 1, rows[i].noticed, NULL);
    }
}

/* More than 1.5 s pass without a pulse. */
static void a_pulse_is_lost(void **state)
{
    (void)state;
    time_is(0.5, 100); /* the first frame */
    begin(FAULT_PPS_LOST, 0.4, 0);
    stop(FAULT_PPS_LOST, 0.6, 0);
    pps(1, 82, 100);
    expect(FAULT_PPS_LOST, 1, 0, "it was before the client had a frame");
    begin(FAULT_PPS_LOST, 1.2, 0);
    time_is(2.5, 101.5);
    assert_int_equal(at->n_moments, 1);
    time_is(2.6, 101.6);
    expect(FAULT_PPS_LOST, 1, 1, NULL);
    begin(FAULT_PPS_LOST, 1.2, 0);
    pps(3, 84, 102); /* the next one also shows it */
    expect(FAULT_PPS_LOST, 1, 1, NULL);
    begin(FAULT_PPS_LOST, 3.2, 0);
    pps(4, 85, 103);
    expect(FAULT_PPS_LOST, 1, 0, NULL);
}

/* A pulse 40 ms late or early, give or take a quarter of that, is noticed. */
static void a_pulse_is_late(void **state)
{
    static const struct {
        double late_s;
        int noticed;
    } rows[] = {{0.04, 1}, {0.031, 1}, {0.049, 1}, {0.029, 0}, {0.051, 0}, {-0.04, 1}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        at->times = (struct soak_times){0};
        pps(1, 82, 100);
        begin(FAULT_PPS_JITTER, 1.5, 40);
        pps(2 + rows[i].late_s, 83, 101);
        expect(FAULT_PPS_JITTER, 1, rows[i].noticed, NULL);
    }
    begin(FAULT_PPS_JITTER, 1.5, 40);
    stop(FAULT_PPS_JITTER, 1.6, 0);
    expect(FAULT_PPS_JITTER, 1, 0, "no PPS came while the fault lasted");
    begin(FAULT_PPS_JITTER, 1.5, 40);
    stop(FAULT_PPS_JITTER, 1.6, 1);
    expect(FAULT_PPS_JITTER, 1, 0, NULL);
}

/* At a leap second UTC falls one second further behind GPS time. */
static void a_leap_second(void **state)
{
    (void)state;
    pps(1, 82, 100);
    begin(FAULT_LEAP_SECOND, 1.5, 0);
    pps(2, 83, 101);
    assert_int_equal(at->n_moments, 1);
    assert_int_equal(soak_is_head_seen(at), 1); /* it need not be noticed: the minute may not be over */
    pps(3, 83, 102);
    expect(FAULT_LEAP_SECOND, 1, 1, NULL);
    begin(FAULT_LEAP_SECOND, 4, 0);
    expect(FAULT_LEAP_SECOND, 1, 0, "the minute with the leap second was not over");
}

static void states_show_boots(void **state)
{
    (void)state;
    begin(FAULT_SLOW_BOOT, 1, 500);
    event(SCANHEAD_EV_STATE, 1.49, HEAD_IDLE, HEAD_BOOT, 0);
    event(SCANHEAD_EV_STATE, 2, HEAD_SCANNING, HEAD_IDLE, 0);
    assert_int_equal(soak_is_head_seen(at), 0);
    event(SCANHEAD_EV_STATE, 1.5, HEAD_IDLE, HEAD_BOOT, 0);
    expect(FAULT_SLOW_BOOT, 1, 1, NULL);
    begin(FAULT_SLOW_BOOT, 1, 500);
    soak_saw_state(at, "scanning");
    soak_saw_state(at, "fault");
    assert_int_equal(at->row[FAULT_SLOW_BOOT].noticed, 0);
    soak_saw_state(at, "boot"); /* as the client asked for it */
    expect(FAULT_SLOW_BOOT, 1, 1, NULL);
    begin(FAULT_SELF_TEST, 1, 0);
    soak_saw_state(at, "boot");
    assert_int_equal(at->row[FAULT_SELF_TEST].noticed, 0);
    soak_saw_state(at, "fault");
    expect(FAULT_SELF_TEST, 1, 1, NULL);
    begin(FAULT_SLOW_BOOT, 1, 500);
    expect(FAULT_SLOW_BOOT, 1, 0, NULL);
    soak->realtime = 0;
    begin(FAULT_SLOW_BOOT, 1, 500);
    assert_int_equal(soak_is_head_seen(at), 0); /* it is waited for all the same */
    expect(FAULT_SLOW_BOOT, 1, 0, "at this pace it may end before a client connects");
}

static void faults_from_before_the_first_frame(void **state)
{
    static const char before[] = "it was before the client had a frame";
    const struct scanhead_frame idle = {.type = SCANHEAD_EVENT, .event = SCANHEAD_EV_STATE, .t_ns = 2 * S},
                                points = {.type = SCANHEAD_POINTS, .t_ns = 2 * S};
    (void)state;
    begin(FAULT_SLOW_BOOT, 1, 1000);
    soak_head_begins(at, &idle); /* this event ends the boot */
    assert_int_equal(at->n_moments, 1);
    soak_head_begins(at, &points);
    expect(FAULT_SLOW_BOOT, 1, 0, before);
    begin(FAULT_SLOW_BOOT, 1, 1001);
    soak_head_begins(at, &points); /* the boot goes on */
    expect(FAULT_SLOW_BOOT, 1, 0, NULL);
    begin(FAULT_POWER_CYCLE, 1.9, 0);
    begin(FAULT_POWER_CYCLE, 2, 0);
    soak_head_begins(at, &points);
    assert_int_equal(at->n_moments, 1);
    assert_int_equal(soak_saw_power_go(at, 2 * S - 1), 0);
    assert_int_equal(soak_saw_power_go(at, 2 * S), 1);
    assert_int_equal(soak_saw_power_go(at, 2 * S), 0);
    assert_true(at->row[FAULT_POWER_CYCLE].noticed == 1 && at->row[FAULT_POWER_CYCLE].hidden == 1);
    assert_string_equal(at->row[FAULT_POWER_CYCLE].why, before);
}

static void telemetry(double t_s, const struct native_telemetry *t)
{
    uint8_t raw[1024];
    const size_t len = native_encode_telemetry(raw, sizeof raw, t, (int64_t)(t_s * 1e9), 0);
    const struct scanhead_frame frame = {.type = SCANHEAD_TELEMETRY,
                                         .t_ns = (int64_t)(t_s * 1e9),
                                         .payload = raw + NATIVE_HEADER_LEN,
                                         .payload_len = (uint32_t)(len - NATIVE_HEADER_LEN)};
    soak_saw_inside(at, &frame);
}

/* A master that is away shows as a state of the port, also for the 2 s until it announces itself again. */
static void states_of_a_follower(void **state)
{
    static const char unseen[] = "the follower's state and offset showed nothing of it in that time";
    static const struct {
        enum fault_kind kind;
        struct native_telemetry shows, hides;
    } rows[] = {{FAULT_PTP_LOST, {.ptp_port = NATIVE_PTP_LISTENING}, {.ptp_port = NATIVE_PTP_FAULTY}},
                {FAULT_PTP_FAULTY, {.ptp_port = NATIVE_PTP_FAULTY}, {.ptp_port = NATIVE_PTP_LISTENING}},
                {FAULT_PTP_GRANDMASTER, {.ptp_port = 1, .ptp_grandmaster = 77}, {.ptp_port = 1, .ptp_grandmaster = 78}},
                {FAULT_PTP_STEP, {.ptp_port = 1, .ptp_offset_ns = -500}, {.ptp_port = 1, .ptp_offset_ns = -499}}};
    (void)state;
    soak->faults.fault[0].grandmaster = 77;
    soak->faults.fault[0].ns = 1000;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        begin(rows[i].kind, 1, 0);
        telemetry(0.9, &rows[i].shows); /* before it */
        telemetry(1.5, &rows[i].hides);
        stop(rows[i].kind, 2, 0);
        telemetry(4.1, &rows[i].shows); /* too late */
        assert_int_equal(at->n_moments, 1);
        telemetry(4, &rows[i].shows);
        expect(rows[i].kind, 1, 1, NULL);
        begin(rows[i].kind, 1, 0);
        telemetry(1, &rows[i].shows);
        expect(rows[i].kind, 1, 1, NULL);
        begin(rows[i].kind, 1, 0);
        assert_int_equal(soak_is_head_seen(at), 1);
        expect(rows[i].kind, 1, 0, unseen);
    }
    begin(FAULT_PTP_LOST, 1, 0);
    event(SCANHEAD_EV_PTP, 1.5, NATIVE_PTP_LISTENING | 256, 1500000000, 0); /* the servo's state is above the port's */
    expect(FAULT_PTP_LOST, 1, 1, NULL);
    begin(FAULT_PTP_GRANDMASTER, 1, 0);
    event(SCANHEAD_EV_PTP, 1.5, 1, 1500000000, 77);
    expect(FAULT_PTP_GRANDMASTER, 1, 1, NULL);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, make, end)
    const struct CMUnitTest tests[] = {TEST(some_kinds_are_hidden),
                                       TEST(so_many_are_kept),
                                       TEST(a_jump_of_the_clock),
                                       TEST(a_clock_that_stops_or_drifts),
                                       TEST(a_pulse_is_lost),
                                       TEST(a_pulse_is_late),
                                       TEST(a_leap_second),
                                       TEST(states_show_boots),
                                       TEST(faults_from_before_the_first_frame),
                                       TEST(states_of_a_follower)};
    return cmocka_run_group_tests_name("soak, the head", tests, NULL, NULL);
}
