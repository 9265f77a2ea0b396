/* SPDX-License-Identifier: MIT */
/* The device for sessions of other protocols than the native one: commands without lasting control, the head's present
 * state, UTC and fixes. */
#include "firmware_sim/device/scanner_clock.h"
#include "tests/unit/device_rig.h"

static int once(struct rig *rig, uint32_t session, const char *line)
{
    struct command_result result;
    device_command_once(rig->device, session, line, rig->next, &result);
    return result.error;
}

static int lasting(struct rig *rig, uint32_t session, const char *line)
{
    struct command_result result;
    device_command(rig->device, session, line, rig->next, &result);
    return result.error;
}

/* Returns how many CONTROL events are in the next tick. */
static uint32_t count_control_events(struct rig *rig)
{
    uint32_t n = 0;
    assert_true(rig_claim(rig));
    for (uint32_t i = 0; i < rig->work.n_events; i++)
        n += rig->work.event[i].code == NATIVE_EV_CONTROL;
    return n;
}

static void control_is_given_back_at_once(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, 300);
    assert_int_equal(once(rig, 2, "HEAD:LINES 20"), 0);
    assert_int_equal(count_control_events(rig), 0); /* nobody has or had control */
    assert_int_equal(lasting(rig, 1, "HEAD:LINES 21"), 0);
    assert_int_equal(count_control_events(rig), 1);
    assert_int_equal(once(rig, 2, "HEAD:LINES 22"), CMD_E_PROTECTED);
    assert_int_equal(once(rig, 2, "HEAD:LINES?"), 0); /* to ask is free */
    assert_int_equal(once(rig, 1, "HEAD:LINES 23"), 0);
    assert_int_equal(once(rig, 2, "HEAD:LINES 24"), CMD_E_PROTECTED); /* session 2's command gave nothing back */
    assert_int_equal(lasting(rig, 1, "SYST:CONT:REL"), 0);
    assert_int_equal(once(rig, 2, "HEAD:LINES 25"), 0);
    rig_close(rig);
}

static void expect_control(struct rig *rig, uint64_t session, const char *text)
{
    assert_true(rig_claim(rig));
    const struct native_event *event = rig_event(rig, NATIVE_EV_CONTROL);
    assert_non_null(event);
    assert_true(event->a == session && event->b == 0 && event->c == 0);
    assert_string_equal(event->text, text);
}

/* An event says which session has control now, or 0 for none. Its text is the client's name, or else the change. */
static void control_is_announced(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, 300);
    device_session_opened(rig->device, 2, "tcp 127.0.0.1:9");
    assert_int_equal(lasting(rig, 2, "SYST:CONT:REL"), 0); /* nobody had it */
    assert_int_equal(count_control_events(rig), 0);
    assert_int_equal(lasting(rig, 2, "HEAD:LINES 21"), 0);
    expect_control(rig, 2, "tcp 127.0.0.1:9");
    assert_int_equal(lasting(rig, 2, "SYST:CONT:REL"), 0);
    expect_control(rig, 0, "released");
    assert_int_equal(lasting(rig, 3, "HEAD:LINES 22"), 0);
    expect_control(rig, 3, "taken");
    rig_close(rig);
}

/* Asking for the head's description changes nothing that it will report. */
static void to_describe_it_changes_nothing(void **state)
{
    (void)state;
    struct rig *rig[2];
    static struct device_work now;
    for (int i = 0; i < 2; i++)
        rig[i] = rig_open(&(struct device_options){.start = 1}, NULL, 0);
    for (uint64_t tick = 0; tick < 1500; tick++) {
        if (tick % 7 == 0) {
            device_describe_now(rig[1]->device, &now);
            assert_true(now.describe && now.describe_flags == NATIVE_REPEAT && !now.scanning && now.n_events == 0);
        }
        assert_true(rig_claim(rig[0]) && rig_claim(rig[1]));
        assert_int_equal(rig[0]->work.describe, rig[1]->work.describe);
        assert_int_equal(rig[0]->work.describe_flags, rig[1]->work.describe_flags);
        if (!rig[1]->work.describe) continue;
        assert_memory_equal(&rig[0]->work.descriptor, &rig[1]->work.descriptor, sizeof now.descriptor);
        device_describe_now(rig[1]->device, &now);
        assert_memory_equal(&rig[1]->work.descriptor, &now.descriptor, sizeof now.descriptor);
        assert_memory_equal(&rig[1]->work.anchor, &now.anchor, sizeof now.anchor);
    }
    rig_close(rig[0]);
    rig_close(rig[1]);
}

static void no_time_no_fixes(void **state)
{
    (void)state;
    struct nmea_fix fix;
    struct rig *rig = rig_open(NULL, NULL, 0);
    assert_true(device_date_ns(rig->device, 5000000) == 5000000); /* since power-up */
    assert_true(device_next_fix_ns(rig->device, 0) == INT64_MAX);
    assert_int_equal(device_fix(rig->device, 1000000000, &fix), 0);
    rig_close(rig);
}

/* Power-up is a quarter of a second before a full one, and there are two fixes a second. */
static void fixes_lie_at_their_times_of_utc(void **state)
{
    (void)state;
    static const char *const sets[] = {"time.epoch=2026-01-01T00:00:00.75Z",
                                       "gnss.rate_hz=2",
                                       "stations[0].lat_deg=49",
                                       "stations[0].lon_deg=8",
                                       "stations[0].height_m=100",
                                       "stations[1].lat_deg=1",
                                       "stations[1].lon_deg=2",
                                       "stations[1].height_m=3",
                                       "links[0].type=null",
                                       "links[0].protocol=nmea"};
    const int64_t ms = 1000000, power_up_ns = 1767225600750 * ms; /* date -u -d 2026-01-01 +%s */
    struct nmea_fix fix;
    struct rig *rig = rig_open(NULL, sets, sizeof sets / sizeof *sets);
    assert_true(device_date_ns(rig->device, 0) == power_up_ns);
    assert_true(device_date_ns(rig->device, 5 * ms) == power_up_ns + 5 * ms);
    assert_true(device_next_fix_ns(rig->device, 0) == 250 * ms);
    assert_true(device_next_fix_ns(rig->device, 250 * ms) == 250 * ms);
    assert_true(device_next_fix_ns(rig->device, 250 * ms + 1) == 750 * ms);
    assert_int_equal(device_fix(rig->device, 250 * ms - 1, &fix), 0);
    assert_int_equal(device_fix(rig->device, 250 * ms, &fix), 1);
    assert_true(fix.second == 1 && fix.hundredth == 0 && fix.quality == 1);
    assert_int_equal(device_fix(rig->device, 749 * ms, &fix), 1);
    assert_true(fix.second == 1 && fix.hundredth == 0);
    assert_int_equal(device_fix(rig->device, 750 * ms, &fix), 1);
    assert_true(fix.second == 1 && fix.hundredth == 50);
    rig_close(rig);
}

/* Lets ticks pass until the event comes, and checks all that it says. */
static void expect_event(struct rig *rig, enum native_event_code code, uint64_t a, uint64_t b, const char *text)
{
    const struct native_event *event = rig_wait(rig, code, 1000);
    if (event->a != a || event->b != b || event->c != 0 || strcmp(event->text, text) != 0)
        fail_msg("event %d: %d, %d, %d, %s", (int)code, (int)event->a, (int)event->b, (int)event->c, event->text);
}

static void states_and_control_are_events(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    expect_event(rig, NATIVE_EV_STATE, HEAD_BOOT, HEAD_OFF, "boot");
    expect_event(rig, NATIVE_EV_STATE, HEAD_IDLE, HEAD_BOOT, "idle");
    rig_tell(rig, "SYST:CONT:TAKE", rig->next);
    expect_event(rig, NATIVE_EV_CONTROL, 1, 0, "taken");
    rig_tell(rig, "SYST:CONT:REL", rig->next);
    expect_event(rig, NATIVE_EV_CONTROL, 0, 0, "released");
    device_session_opened(rig->device, 1, "tcp 127.0.0.1:5");
    rig_tell(rig, "SCAN:STAR", rig->next);
    expect_event(rig, NATIVE_EV_STATE, HEAD_SPIN_UP, HEAD_IDLE, "spin-up");
    expect_event(rig, NATIVE_EV_STATE, HEAD_SCANNING, HEAD_SPIN_UP, "scanning");
    rig_tell(rig, "SYST:CONT:REL", rig->next);
    expect_event(rig, NATIVE_EV_CONTROL, 0, 0, "released");
    rig_tell(rig, "SYST:CONT:TAKE", rig->next);
    expect_event(rig, NATIVE_EV_CONTROL, 1, 0, "tcp 127.0.0.1:5");
    rig_tell(rig, "SCAN:STOP", rig->next);
    expect_event(rig, NATIVE_EV_STATE, HEAD_SPIN_DOWN, HEAD_SCANNING, "spin-down");
    expect_event(rig, NATIVE_EV_STATE, HEAD_IDLE, HEAD_SPIN_DOWN, "idle");
    rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(states_and_control_are_events),
        cmocka_unit_test(control_is_given_back_at_once),
        cmocka_unit_test(control_is_announced),
        cmocka_unit_test(to_describe_it_changes_nothing),
        cmocka_unit_test(no_time_no_fixes),
        cmocka_unit_test(fixes_lie_at_their_times_of_utc),
    };
    return cmocka_run_group_tests_name("device, other protocols", tests, make_folder, remove_folder);
}
