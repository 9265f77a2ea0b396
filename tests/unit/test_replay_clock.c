/* SPDX-License-Identifier: MIT */
/* The times of day of a recording that is replayed: the head's clock, which may drift and jump, and the receiver's. */
#include <stdlib.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/replay/replay_state.h"
#include "tests/common/cases.h"
#include "tests/unit/event_recording.h"
#include "tests/unit/file_rig.h"

#define S UTC_SECOND_NS

/* Seconds since 1970 by `date -u -d`: 2026-03-31 12:35:00, and 2017-01-01, before which there was a leap second (IERS
 * Bulletin C 52). */
static const int64_t MINUTE_S = 1774960500, NEW_YEAR_S = 1483228800;

static struct replay_clock the_clock;

static size_t telemetry_of(uint8_t frame[512], int64_t t_ns, int64_t utc_ns)
{
    const struct native_telemetry t = {.utc_ns = utc_ns};
    return native_encode_telemetry(frame, 512, &t, t_ns, 0);
}

static size_t pps_of(uint8_t frame[512], int64_t t_ns, int64_t second, const char *text)
{
    struct native_event e = {.code = NATIVE_EV_PPS, .a = (uint64_t)second, .b = (uint64_t)t_ns};
    snprintf(e.text, sizeof e.text, "%s", text);
    return native_encode_event(frame, 512, &e, t_ns, 0);
}

static void take_telemetry(int64_t t_ns, int64_t utc_ns)
{
    uint8_t frame[512];
    assert_true(telemetry_of(frame, t_ns, utc_ns) > 0);
    replay_clock_take(&the_clock, frame, 0);
}

static void take_pps(int64_t t_ns, int64_t second, const char *text)
{
    uint8_t frame[512];
    assert_true(pps_of(frame, t_ns, second, text) > 0);
    replay_clock_take(&the_clock, frame, 0);
}

static void expect_head(int64_t t_ns, int64_t utc_ns)
{
    const int64_t got_ns = replay_clock_head_ns(&the_clock, t_ns);
    if (got_ns != utc_ns) fail_msg("at %lld ns: %lld, not %lld", (long long)t_ns, (long long)got_ns, (long long)utc_ns);
}

static void expect_receiver(int64_t t_ns, int hour, int minute, int second)
{
    struct utc_time utc;
    replay_clock_receiver_utc(&the_clock, t_ns, &utc);
    if (utc.hour != hour || utc.minute != minute || utc.second != second)
        fail_msg("at %lld ns: %d:%d:%d", (long long)t_ns, utc.hour, utc.minute, utc.second);
}

/* Each telemetry renews the head's clock from its own time on. What was before stays, for sessions that lag. The
 * receiver's time goes on with device time. */
static void the_head_drifts_and_the_receiver_does_not(void **state)
{
    (void)state;
    enum { GAIN_NS = 100000, MANY = 3 * REPLAY_CLOCK_KEPT };
    replay_clock_begin(&the_clock, S / 2, MINUTE_S * S);
    for (int i = 1; i < MANY; i++)
        take_telemetry(i * S + S / 2, (MINUTE_S + i) * S + i * GAIN_NS);
    expect_head((MANY - 1) * S, (MINUTE_S + MANY - 2) * S + S / 2 + (MANY - 2) * GAIN_NS);
    expect_head((MANY - 60) * S, (MINUTE_S + MANY - 61) * S + S / 2 + (MANY - 61) * GAIN_NS);
    assert_true(replay_clock_receiver_ns(&the_clock, MANY * S) == (MINUTE_S + MANY - 1) * S + S / 2);
}

/* The second of a PPS counts at once, whichever way the clock has jumped. A pulse that is late by less than half a
 * second changes nothing. */
static void a_jump_counts_from_the_next_pulse_on(void **state)
{
    (void)state;
    replay_clock_begin(&the_clock, 0, MINUTE_S * S);
    take_pps(S + S / 3, MINUTE_S + 1, "2026-03-31T12:35:01Z");
    expect_head(2 * S, (MINUTE_S + 2) * S);
    take_pps(3 * S, MINUTE_S + 103, "2026-03-31T12:36:43Z");
    expect_head(3 * S - 1, (MINUTE_S + 3) * S - 1);
    expect_head(3 * S, (MINUTE_S + 103) * S);
    take_pps(4 * S, MINUTE_S - 10, "2026-03-31T12:34:50Z");
    expect_head(4 * S + 5, (MINUTE_S - 10) * S + 5);
    expect_receiver(4 * S, 12, 35, 4);
    take_pps(5 * S, INT64_MAX, "");
    take_telemetry(5 * S, -5);
    expect_head(5 * S, (MINUTE_S - 9) * S);
}

/* UTC has 12:34:60, whose number is that of 12:35:00, and telemetry in it goes on evenly. Only the PPS shows it. */
static void a_pulse_shows_a_leap_second_that_no_table_has(void **state)
{
    (void)state;
    replay_clock_begin(&the_clock, 0, (MINUTE_S - 2) * S);
    take_pps(S, MINUTE_S - 1, "2026-03-31T12:34:59Z");
    take_pps(2 * S, MINUTE_S, "2026-03-31T12:34:60Z");
    take_telemetry(2 * S + S / 2, MINUTE_S * S + S / 2);
    take_pps(3 * S, MINUTE_S, "2026-03-31T12:35:00Z");
    take_telemetry(3 * S + S / 2, MINUTE_S * S + S / 2);
    expect_head(2 * S + 1, MINUTE_S * S + 1);
    expect_head(3 * S + 1, MINUTE_S * S + 1);
    expect_receiver(S, 12, 34, 59);
    expect_receiver(2 * S, 12, 34, 60);
    expect_receiver(3 * S - 1, 12, 34, 60);
    expect_receiver(3 * S, 12, 35, 0);
    expect_receiver(4 * S, 12, 35, 1);
    assert_true(replay_clock_receiver_ns(&the_clock, 4 * S) == (MINUTE_S + 1) * S);
}

/* The head's clock jumps back by 2 s, so its 12:34:60 comes when the receiver's second after it is over. The receiver,
 * which showed no leap second, goes on evenly. A pulse that is late by 0.4 s still shows it. */
static void a_receiver_does_not_go_back(void **state)
{
    (void)state;
    replay_clock_begin(&the_clock, 0, (MINUTE_S - 2) * S);
    take_pps(S, MINUTE_S - 3, "2026-03-31T12:34:57Z");
    expect_receiver(4 * S - 1, 12, 35, 1);
    take_pps(4 * S, MINUTE_S, "2026-03-31T12:34:60Z");
    expect_head(4 * S, MINUTE_S * S);
    expect_receiver(4 * S, 12, 35, 2);
    expect_receiver(5 * S, 12, 35, 3);
    replay_clock_begin(&the_clock, 0, (MINUTE_S - 2) * S);
    take_pps(2 * S + S / 5 * 2, MINUTE_S, "2026-03-31T12:34:60Z");
    expect_receiver(3 * S - 1, 12, 34, 60);
    expect_receiver(3 * S, 12, 35, 0);
}

static void a_leap_second_that_is_known_needs_no_pulse(void **state)
{
    (void)state;
    replay_clock_begin(&the_clock, 7, (NEW_YEAR_S - 1) * S);
    expect_receiver(7, 23, 59, 59);
    expect_receiver(7 + S, 23, 59, 60);
    expect_receiver(7 + 2 * S, 0, 0, 0);
    replay_clock_shift(&the_clock, 5 * S);
    expect_receiver(7 + 6 * S, 23, 59, 60);
    expect_head(7 + 6 * S, NEW_YEAR_S * S);
}

static void a_clock_that_has_not_begun_takes_nothing(void **state)
{
    (void)state;
    static const int64_t none_ns[] = {INT64_MIN, 0, INT64_C(7258118400) * S, INT64_MAX};
    for (size_t i = 0; i < sizeof none_ns / sizeof none_ns[0]; i++) {
        replay_clock_begin(&the_clock, 0, none_ns[i]);
        take_telemetry(0, MINUTE_S * S);
        take_pps(0, MINUTE_S, "2026-03-31T12:35:00Z");
        assert_true(replay_clock_head_ns(&the_clock, 0) == INT64_MIN);
        assert_true(replay_clock_receiver_ns(&the_clock, 0) == INT64_MIN);
    }
}

/* ---- a replay */

static void put_pulse(FILE *f, int64_t t_ns)
{
    static uint32_t zero[1];
    static int16_t refl_cdb[1];
    static uint16_t label[1];
    static uint8_t echo[1];
    uint8_t frame[512];
    const struct line_block block = {.n_pulses = 1,
                                     .n_points = 1,
                                     .t0_ns = t_ns,
                                     .dt_ns = zero,
                                     .a = zero,
                                     .b = zero,
                                     .c = zero,
                                     .refl_cdb = refl_cdb,
                                     .echo = echo,
                                     .label = label};
    recording_put(f, frame, native_encode_points(frame, sizeof frame, &block, 0));
}

/* The head's clock is 100 s ahead at 1 s, and 200 s at 2 s. */
static void write_recording(void)
{
    const struct native_anchor anchor = {.lat_deg = 50.0, .scale_m = 1e-6};
    uint8_t frame[1024];
    FILE *f = recording_begin(file_path);
    recording_put_head(f, "", 0);
    recording_put(f, frame, native_encode_anchor(frame, sizeof frame, &anchor, 0, 0));
    recording_put(f, frame, telemetry_of(frame, 0, MINUTE_S * S));
    put_pulse(f, S / 2);
    recording_put(f, frame, telemetry_of(frame, S, (MINUTE_S + 101) * S));
    put_pulse(f, 7 * S / 4);
    recording_put(f, frame, telemetry_of(frame, 2 * S, (MINUTE_S + 202) * S));
    recording_end(f);
}

static struct replay *open_replay(struct config *cfg, double from_s)
{
    struct replay *r;
    struct sh_err err;
    cfg->loop.tick_hz = 10;
    cfg->n_links = 1;
    cfg->link[0].type = LINK_TCP;
    cfg->link[0].protocol = PROTOCOL_NMEA;
    if (replay_open(cfg,
                    &(struct replay_options){.path = file_path, .speed = 1, .start = 1, .loop = 1, .from_s = from_s},
                    &r, &err) != SH_OK)
        fail_msg("%s", err.text);
    return r;
}

/* The first round begins with tick 7, of 0.1 s, which has the first pulse: that at 0.5 s, or of a part that at 1.75 s.
 * So the run is 0.2 s later than the recording, or 1 s earlier. Later rounds repeat the frames, and the clock goes on. */
static void the_first_round_has_the_recorded_times(void **state)
{
    (void)state;
    enum { FIRST = 7, TICKS = 60 };
    static const struct {
        double from_s;
        int64_t shift_ns;
    } rows[] = {{0.0, S / 5}, {1.5, -S}};
    struct config *cfg = calloc(1, sizeof *cfg);
    struct ring_tick tick;
    assert_non_null(cfg);
    write_recording();
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        const int64_t shift_ns = rows[k].shift_ns;
        struct replay *r = open_replay(cfg, rows[k].from_s);
        for (uint64_t i = FIRST; i < FIRST + TICKS; i++)
            assert_int_equal(replay_source.next(r, i, 0, 0, &tick), LOOP_SOURCE_TICK);
        assert_true(r->times > 2);
        assert_true(replay_date_ns(r, S + shift_ns - 1) == (MINUTE_S + 1) * S - 1);
        assert_true(replay_date_ns(r, S + shift_ns) == (MINUTE_S + 101) * S);
        assert_true(replay_date_ns(r, 2 * S + shift_ns - 1) == (MINUTE_S + 102) * S - 1);
        assert_true(replay_date_ns(r, 2 * S + shift_ns) == (MINUTE_S + 202) * S);
        assert_true(replay_date_ns(r, 6 * S + shift_ns) == (MINUTE_S + 206) * S);
        replay_free(r);
    }
    free(cfg);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_head_drifts_and_the_receiver_does_not),
        cmocka_unit_test(a_jump_counts_from_the_next_pulse_on),
        cmocka_unit_test(a_pulse_shows_a_leap_second_that_no_table_has),
        cmocka_unit_test(a_receiver_does_not_go_back),
        cmocka_unit_test(a_leap_second_that_is_known_needs_no_pulse),
        cmocka_unit_test(a_clock_that_has_not_begun_takes_nothing),
        cmocka_unit_test(the_first_round_has_the_recorded_times),
    };
    return cmocka_run_group_tests_name("replay clock", tests, make_file, remove_file);
}
