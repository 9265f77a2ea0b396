/* SPDX-License-Identifier: MIT */
/* The contents of the device's ticks, as a client adds them up. No pulse and no line is lost or doubled, however a scan
 * goes on and ends. */
#include "tests/common/cases.h"
#include "tests/unit/device_rig.h"

#include <math.h>

#include "core/schedule.h"

#define HZ INT64_C(1000000)

struct tally {
    uint64_t pulse_next; /* all pulses before were in some tick */
    uint64_t line_next;  /* first pulse of the line to end next */
    uint64_t n_cast, n_fired, cast_in_lines, points, lines, partial;
    int64_t t_line;
};

static void tally_line(struct tally *tally, const struct line_end *end)
{
    assert_true(end->pulse0 == tally->line_next && end->line == tally->lines);
    assert_true(end->t0_ns == tally->t_line && end->t1_ns >= end->t0_ns);
    tally->line_next = end->pulse0 + end->n_fired;
    tally->t_line = end->t1_ns;
    tally->cast_in_lines += end->n_cast;
    tally->lines++;
    tally->partial += (end->status & LINE_PARTIAL) != 0;
}

/* Fills the last claimed tick and adds it up, as a client that reads the frames. */
static void tally_tick(struct rig *rig, struct tally *tally)
{
    const struct ring_tick *tick = rig_fill(rig);
    if (rig->work.scanning) {
        assert_true(rig->work.pulse0 == tally->pulse_next && rig->work.pulse_end >= rig->work.pulse0);
        tally->pulse_next = rig->work.pulse_end;
    }
    tally->n_cast += tick->n_cast;
    tally->n_fired += tick->n_fired;
    assert_true((rig->work.scanning ? rig->work.n_cast : 0) == tick->n_cast);
    for (uint32_t at = 0; at < tick->len;) {
        const uint8_t *frame = tick->bytes + at, *payload = frame + NATIVE_HEADER_LEN;
        uint32_t len = (uint32_t)native_frame_len(frame) - NATIVE_HEADER_LEN;
        assert_int_equal(frame[0], NATIVE_SYNC);
        struct native_points points;
        struct line_end end;
        if (frame[1] == NATIVE_POINTS) {
            assert_int_equal(native_decode_points(payload, len, &points), 0);
            assert_true(points.pulse0 >= tally->line_next && points.line == tally->lines &&
                        points.line_t0_ns == tally->t_line);
            tally->points += points.n_points;
        } else if (frame[1] == NATIVE_LINE_END) {
            assert_int_equal(native_decode_line_end(payload, len, &end), 0);
            tally_line(tally, &end);
        }
        at += NATIVE_HEADER_LEN + len;
    }
}

/* After the scan's end every pulse was in a tick, in a line end, and, when cast, a point. */
static void check_tally(const struct tally *tally, uint64_t pulses)
{
    assert_true(tally->pulse_next == pulses && tally->n_fired == pulses);
    assert_true(tally->line_next == pulses);
    assert_true(tally->points == tally->n_cast && tally->cast_in_lines == tally->n_cast);
}

static void a_whole_scan_adds_up(void **state)
{
    (void)state;
    struct rig *rig = rig_open(&(struct device_options){.start = 1, .one_scan = 1}, NULL, 0);
    struct tally tally = {0};
    while (rig_claim(rig))
        tally_tick(rig, &tally);
    check_tally(&tally, 150000);
    assert_true(tally.lines == 50 && tally.partial == 0);
    rig_close(rig);
}

/* Runs a scan that is stopped when `ticks` ticks of it are claimed. Returns its pulses. */
static uint64_t stopped_scan(struct rig *rig, const char *prr, uint64_t ticks, struct tally *tally)
{
    memset(tally, 0, sizeof *tally);
    rig_tell(rig, prr, rig->next);
    rig_tell(rig, "SCAN:START", rig->next);
    while (!rig->work.scanning) {
        assert_true(rig_claim(rig));
        if (!rig->work.scanning) continue;
        if (ticks == 0) break;
        tally_tick(rig, tally);
    }
    for (uint64_t i = 1; i < ticks && rig_claim(rig); i++)
        tally_tick(rig, tally);
    rig_tell(rig, "SCAN:STOP", rig->next);
    assert_true(rig_claim(rig));
    tally_tick(rig, tally);
    const struct native_event *end = rig_event(rig, NATIVE_EV_SCAN_END);
    assert_non_null(end);
    uint64_t pulses = end->b;
    rig_go_to(rig, rig->next + 100);
    return pulses;
}

/* A stop ends the running line. At 1.6 MHz, 100 whole packets a tick, the ticks before it have taken all pulses. */
static void a_stop_ends_the_line_at_hand_as_partial(void **state)
{
    (void)state;
    static const uint64_t prr_hz[] = {300000, 1600000, 1000000, 16000, 1000, 777777};
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, 300);
    for (size_t i = 0; i < sizeof prr_hz / sizeof *prr_hz; i++)
        for (uint64_t ticks = 1; ticks < 24; ticks++) {
            char prr[32];
            struct tally tally;
            snprintf(prr, sizeof prr, "HEAD:PRR %u", (unsigned)prr_hz[i]);
            uint64_t pulses = stopped_scan(rig, prr, ticks, &tally);
            /* These pulses fired before the tick in which the stop took effect. */
            assert_true(pulses == (ticks * prr_hz[i] + 999) / 1000);
            check_tally(&tally, pulses);
            uint64_t lines = (pulses - 1) * 100 / prr_hz[i] + 1, whole = (lines * prr_hz[i] + 99) / 100;
            assert_true(tally.lines == lines && tally.partial == (pulses != whole));
        }
    rig_close(rig);
}

/* Writes the last line end of the last claimed tick. Returns 0 where it has none. */
static int last_line_end(struct rig *rig, struct line_end *end)
{
    const struct ring_tick *tick = rig_fill(rig);
    int found = 0;
    for (uint32_t at = 0, len; at < tick->len; at += len) {
        const uint8_t *frame = tick->bytes + at;
        len = (uint32_t)native_frame_len(frame);
        if (frame[1] != NATIVE_LINE_END) continue;
        assert_int_equal(native_decode_line_end(frame + NATIVE_HEADER_LEN, len - NATIVE_HEADER_LEN, end), 0);
        found = 1;
    }
    return found;
}

/* A rate changes, and the scan stops before a pulse fires at the new rate: 1.6 MHz is 100 whole packets a tick, so none
 * is left over. The encoders have the axes' angles. Three facets and a gain of two are 240 degrees a line of 10 ms,
 * from -40 on. The pan turns 180 degrees a second. The encoders may be read at the last pulse or at the next one: 0.015
 * degrees of the mirror. */
static void a_stop_right_after_a_change_has_its_angles(void **state)
{
    (void)state;
    static const char *const change[] = {"HEAD:PRR MIN", "HEAD:PRR MAX", "HEAD:LINES 37", "HEAD:PAN 7"};
    const double counts = 1048576.0 / 360.0;
    struct rig *rig = rig_open(NULL, NULL, 0);
    struct line_end end;
    rig_go_to(rig, 300);
    for (uint64_t ticks = 1; ticks < 10 * 4; ticks++) {
        if (ticks % 10 == 0) continue; /* no line is running */
        rig_tell(rig, "*RST", rig->next);
        rig_tell(rig, "HEAD:PRR 1600000", rig->next);
        rig_tell(rig, "SCAN:START", rig->next);
        rig_wait(rig, NATIVE_EV_SCAN_START, 100);
        rig_go_to(rig, rig->next + ticks - 1);
        rig_tell(rig, change[ticks % 4], rig->next);
        rig_tell(rig, "SCAN:STOP", rig->next);
        assert_true(rig_claim(rig) && rig->work.pulse_end == rig->work.segment.k0 && rig->work.cut_short);
        assert_true(last_line_end(rig, &end) && (end.status & LINE_PARTIAL) != 0);
        const double mirror_deg = -40.0 + 24.0 * (double)(ticks % 10), pan_deg = 0.18 * (double)ticks;
        const double mirror = counts * (mirror_deg < 0 ? mirror_deg + 360.0 : mirror_deg);
        assert_true(fabs((double)end.mirror_count - mirror) <= 0.015 * counts + 1.0);
        assert_true(fabs((double)end.pan_count - counts * pan_deg) <= 180.0 / 1600000.0 * counts + 1.0);
        rig_go_to(rig, rig->next + 100);
    }
    rig_close(rig);
}

static void settings_change_in_mid_scan(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    struct tally tally = {0};
    rig_go_to(rig, 300);
    rig_tell(rig, "SCAN:FRAMES 0", 300);
    rig_tell(rig, "SCAN:START", 300);
    rig_go_to(rig, 330);
    for (int i = 0; i < 13; i++) {
        assert_true(rig_claim(rig));
        tally_tick(rig, &tally);
    }
    uint64_t first = rig->work.pulse_end;
    rig_tell(rig, "HEAD:PRR 100000", rig->next);
    rig_tell(rig, "HEAD:LINES 37", rig->next);
    rig_tell(rig, "SCAN:LINE:STOP 20", rig->next);
    assert_true(rig_claim(rig));
    assert_true(rig->work.segment.k0 == first && rig->work.pulse0 == first);
    uint32_t said = 0;
    for (uint32_t i = 0; i < rig->work.n_events; i++)
        said += rig->work.event[i].code == NATIVE_EV_SETTINGS && rig->work.event[i].a == first &&
                i < rig->work.n_events_before;
    assert_int_equal(said, 3);
    assert_true(rig->work.describe && rig->work.describe_flags == 0);
    assert_true(rig->work.descriptor.prr_uhz == 100000 * HZ && rig->work.descriptor.lines_uhz == 37 * HZ);
    assert_true(rig->work.descriptor.line_stop_udeg == 20 * HZ);
    tally_tick(rig, &tally);
    for (int i = 0; i < 100; i++) {
        assert_true(rig_claim(rig) && !rig->work.describe);
        tally_tick(rig, &tally);
    }
    rig_tell(rig, "SCAN:STOP", rig->next);
    assert_true(rig_claim(rig));
    tally_tick(rig, &tally);
    check_tally(&tally, rig_event(rig, NATIVE_EV_SCAN_END)->b);
    rig_close(rig);
}

/* Slots have room for a usual tick from the start. No tick that has only points takes more, and the longest takes at
 * least three quarters of it. So the room is for the rates that are set, not for the profile's. */
static void a_usual_tick_is_what_a_slot_has_room_for(void **state)
{
    (void)state;
    const char *const sets[] = {"head.prr_hz=300000"};
    struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, 1);
    const uint32_t usual = worker_usual_bytes(rig->site);
    uint32_t longest = 0;
    int ticks = 0;
    assert_true(usual < worker_tick_bytes(rig->site) / 4); /* the profile's fastest rate is 2 MHz */
    while (ticks < 200 && rig_claim(rig)) {
        if (!rig->work.scanning || rig->work.describe || rig->work.surfaces_n != 0 || rig->work.telemetry ||
            rig->work.n_events != 0)
            continue;
        const struct ring_tick *tick = rig_fill(rig);
        assert_true(tick->len + tick->n_marks * sizeof *tick->mark <= usual + sizeof *tick->mark);
        if (tick->len > longest) longest = tick->len;
        ticks++;
    }
    assert_true(ticks == 200 && longest > usual / 4 * 3);
    rig_close(rig);
}

/* Rates go from the slowest to the fastest and back. The pulses since the last cut come at the new rate, more than a
 * tick has. No buffer overflows, and the head catches up. */
static void a_jump_of_the_rates_fits_into_a_tick(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, 300);
    rig_tell(rig, "SCAN:FRAMES 0", 300);
    rig_tell(rig, "SCAN:LINE:START MIN", 300);
    for (int round = 0; round < 5; round++) {
        struct tally tally = {0};
        rig_tell(rig, "HEAD:LINES MIN", rig->next);
        rig_tell(rig, "HEAD:PRR MIN", rig->next);
        rig_tell(rig, "SCAN:START", rig->next);
        rig_go_to(rig, rig->next + 30);
        for (int tick = 0; tick < 400; tick++) {
            if (tick == 14 + round || tick == 300) {
                rig_tell(rig, "HEAD:PRR MAX", rig->next);
                rig_tell(rig, "HEAD:LINES MAX", rig->next);
            }
            if (tick == 200) {
                rig_tell(rig, "HEAD:LINES MIN", rig->next);
                rig_tell(rig, "HEAD:PRR MIN", rig->next);
            }
            assert_true(rig_claim(rig));
            tally_tick(rig, &tally);
            /* The head has caught up: all pulses that fired by the tick's end are there, but for less than a packet. */
            int64_t by = (int64_t)rig->next * 1000000 - rig->work.scan_t0_ns;
            if (tick == 199 || tick == 399)
                assert_true(schedule_pulse_at(&rig->work.segment, by) - rig->work.pulse_end < SCHEDULE_PACKET);
        }
        rig_tell(rig, "SCAN:STOP", rig->next);
        assert_true(rig_claim(rig));
        tally_tick(rig, &tally);
        check_tally(&tally, rig_event(rig, NATIVE_EV_SCAN_END)->b);
        rig_go_to(rig, rig->next + 100);
    }
    rig_close(rig);
}

/* The slowest loop and the fastest mirror of a profile give 100 lines a tick. */
static void many_lines_fit_into_a_tick(void **state)
{
    (void)state;
    static char profile[4096], fast[4096], path[96];
    snprintf(path, sizeof path, "%s/head.yaml", folder);
    FILE *f = fopen(path, "r+");
    assert_non_null(f);
    size_t n = fread(profile, 1, sizeof profile - 1, f);
    profile[n] = '\0';
    char *at = strstr(profile, "lines_max_hz: { value: 2000");
    assert_non_null(at);
    snprintf(fast, sizeof fast, "%.*slines_max_hz: { value: 10000%s", (int)(at - profile), profile,
             at + strlen("lines_max_hz: { value: 2000"));
    rewind(f);
    fputs(fast, f);
    fclose(f);
    struct rig *rig =
        rig_open(&(struct device_options){.start = 1, .one_scan = 1},
                 (const char *const[]){"loop.tick_hz=100", "head.lines_hz=10000", "head.prr_hz=2000000"}, 3);
    assert_int_equal(write_profile(), 0);
    struct tally tally = {0};
    while (rig_claim(rig))
        tally_tick(rig, &tally);
    check_tally(&tally, 1000000);
    assert_true(tally.lines == 5000 && tally.partial == 0);
    rig_close(rig);
}

/* --- the end of a run --- */

static void a_run_ends_after_its_duration(void **state)
{
    (void)state;
    struct rig *rig = rig_open(&(struct device_options){.start = 1, .duration_s = 0.1234}, NULL, 0);
    struct tally tally = {0};
    while (rig_claim(rig))
        tally_tick(rig, &tally);
    assert_true(rig->next == 230 + 124 + 1); /* ticks begun within the duration, and the one that says so */
    assert_non_null(rig_event(rig, NATIVE_EV_SCAN_END));
    check_tally(&tally, 37200);
    rig_close(rig);
    rig = rig_open(&(struct device_options){.duration_s = 0.5}, NULL, 0);
    while (rig_claim(rig))
        assert_false(rig->work.scanning);
    assert_true(rig->next == 501);
    rig_close(rig);
}

static void an_end_from_outside_stops_the_scan_first(void **state)
{
    (void)state;
    struct rig *rig = rig_open(&(struct device_options){.start = 1}, NULL, 0);
    struct tally tally = {0};
    rig_go_to(rig, 230);
    for (int i = 0; i < 12; i++) {
        assert_true(rig_claim(rig));
        tally_tick(rig, &tally);
    }
    device_end(rig->device);
    assert_true(rig_claim(rig));
    tally_tick(rig, &tally);
    assert_true(rig_event(rig, NATIVE_EV_SCAN_END)->b == 3600);
    check_tally(&tally, 3600);
    assert_true(tally.partial == 1);
    assert_false(rig_claim(rig));
    rig_close(rig);
}

/* Random commands come scan after scan. Whatever changes and whenever, the frames of each scan add up. */
static void whatever_is_commanded_adds_up(void **state)
{
    (void)state;
    static const char *const line[] = {"SCAN:STOP",         "*RST",
                                       "SCAN:FRAMES 0",     "SCAN:FRAMES 2",
                                       "HEAD:PRR MIN",      "HEAD:PRR MAX",
                                       "HEAD:LINES MIN",    "HEAD:LINES MAX",
                                       "HEAD:PAN 0",        "HEAD:PAN MAX",
                                       "SCAN:LINE:STOP 0",  "SCAN:LINE:STOP MAX",
                                       "SCAN:PAN:STOP 3",   "SCAN:PAN:STOP MAX",
                                       "SCAN:PAN:START MIN"};
    struct rig *rig = rig_open(NULL, NULL, 0);
    struct tally tally = {0};
    uint64_t seed = 5, ended = 0;
    for (int i = 0; i < 6000 && rig_claim(rig); i++) {
        if (rig_event(rig, NATIVE_EV_SCAN_START) != NULL) memset(&tally, 0, sizeof tally);
        tally_tick(rig, &tally);
        const struct native_event *end = rig_event(rig, NATIVE_EV_SCAN_END);
        if (end != NULL) {
            check_tally(&tally, end->b);
            ended++;
        }
        struct command_result result;
        char text[40];
        int64_t what = case_between(&seed, 0, 59);
        if (what < 15) {
            device_command(rig->device, 0, line[what], rig->next, &result);
        } else if (what < 18) {
            snprintf(text, sizeof text, "HEAD:PRR %d.%06d", (int)case_between(&seed, 1000, 100000),
                     (int)case_between(&seed, 0, 999999));
            device_command(rig->device, 0, text, rig->next, &result);
        } else if (what < 20) {
            snprintf(text, sizeof text, "HEAD:LINES %d.%03d", (int)case_between(&seed, 1, 1000),
                     (int)case_between(&seed, 0, 999));
            device_command(rig->device, 0, text, rig->next, &result);
        } else if (!rig->work.scanning) {
            device_command(rig->device, 0, "SCAN:START", rig->next, &result);
        }
    }
    assert_true(ended > 10);
    rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_whole_scan_adds_up),
        cmocka_unit_test(a_stop_ends_the_line_at_hand_as_partial),
        cmocka_unit_test(a_stop_right_after_a_change_has_its_angles),
        cmocka_unit_test(settings_change_in_mid_scan),
        cmocka_unit_test(a_usual_tick_is_what_a_slot_has_room_for),
        cmocka_unit_test(a_jump_of_the_rates_fits_into_a_tick),
        cmocka_unit_test(many_lines_fit_into_a_tick),
        cmocka_unit_test(a_run_ends_after_its_duration),
        cmocka_unit_test(an_end_from_outside_stops_the_scan_first),
        cmocka_unit_test(whatever_is_commanded_adds_up),
    };
    return cmocka_run_group_tests_name("device lines", tests, make_folder, remove_folder);
}
