/* SPDX-License-Identifier: MIT */
/* In a recording settings keep their values, and scans begin and end at any time. Settings that follow from others have
 * ranges of their own. */
#include "tests/unit/command_device.h"

#define CONFLICT "ERR -221,\"Settings conflict; "

static struct command_device recorded(void)
{
    struct command_device dev = command_test_device();
    dev.recorded = "a recording is replayed";
    return dev;
}

static void a_recording_keeps_its_settings(void **state)
{
    (void)state;
    static const struct {
        const char *line, *reply;
    } cases[] = {
        {"HEAD:PRR 300 KHZ", "OK"},
        {"HEAD:PRR DEF", "OK"},
        {"HEAD:PRR MIN", CONFLICT "HEAD:PRR: a recording is replayed; it is 300000\""},
        {"HEAD:PRR MAX", CONFLICT "HEAD:PRR: a recording is replayed; it is 300000\""},
        {"HEAD:PRR 300000.0000001", CONFLICT "HEAD:PRR: a recording is replayed; it is 300000\""},
        {"HEAD:PRR 5", CONFLICT "HEAD:PRR: a recording is replayed; it is 300000\""},
        {"SCAN:ECHoes ALL", "OK"},
        {"SCAN:ECHoes DEF", "OK"},
        {"SCAN:ECHoes LAST", CONFLICT "SCAN:ECHoes: a recording is replayed; it is ALL\""},
        {"SCAN:ECHoes FIRSt", CONFLICT "SCAN:ECHoes: a recording is replayed; it is ALL\""},
        {"SCAN:STEP:LINE 0.12", "OK"},
        {"SCAN:STEP:LINE 0.13", CONFLICT "SCAN:STEP:LINE: a recording is replayed; it is 0.12\""},
        {"HEAD:REBoot", CONFLICT "HEAD:REBoot: a recording is replayed\""},
        {"TIME:SHIFt 5", CONFLICT "TIME:SHIFt: a recording is replayed\""},
    };
    struct command_device dev = recorded();
    const struct head_settings before = dev.settings;
    for (size_t i = 0; i < N_OF(cases); i++) {
        expect(&dev, cases[i].line, cases[i].reply);
        assert_int_equal(result.effect, COMMAND_NONE);
        assert_memory_equal(&dev.settings, &before, sizeof before);
    }
}

/* A recording may lack a value of 64 bits, or one of 32 bits. */
static void a_value_may_be_unknown(void **state)
{
    (void)state;
    struct command_device dev = recorded();
    dev.settings.prr_uhz = dev.settings.phase_udeg = COMMAND_NOT_RECORDED;
    dev.settings.echoes = dev.settings.frames = COMMAND_NOT_RECORDED_U32;
    dev.utc[0] = '\0';
    expect(&dev, "HEAD:PRR?", CONFLICT "HEAD:PRR: the recording does not have this value\"");
    expect(&dev, "HEAD:PRR 5000", CONFLICT "HEAD:PRR: the recording does not have this value\"");
    expect(&dev, "SCAN:FRAMes?", CONFLICT "SCAN:FRAMes: the recording does not have this value\"");
    expect(&dev, "SCAN:ECHoes ALL", CONFLICT "SCAN:ECHoes: the recording does not have this value\"");
    expect(&dev, "TIME:UTC?",
           CONFLICT "TIME:UTC? is not answered in a replay; telemetry has the value, if the recorded head had it\"");
    expect(&dev, "HEAD:PAN?", "18");
    dev.recorded = NULL; /* a head's value may be any number */
    expect(&dev, "SCAN:FRAMes?", "4294967295");
    dev.recorded = "a recording is replayed";
    dev.settings.lines_uhz = 0; /* damaged: the step would be divided by it */
    expect(&dev, "SCAN:STEP:LINE?", CONFLICT "SCAN:STEP:LINE: the recording does not have this value\"");
}

/* The state of the recorded head does not matter. */
static void it_is_played_and_stopped_in_any_state(void **state)
{
    (void)state;
    struct command_device dev = recorded();
    for (int s = 0; s < HEAD_N_STATES; s++) {
        dev.state = (enum head_state)s;
        dev.is_played = 1;
        expect(&dev, "SCAN:STARt", "OK");
        assert_int_equal(result.effect, COMMAND_START);
        expect(&dev, "SCAN:STOP", "OK");
        assert_int_equal(result.effect, COMMAND_STOP);
        dev.is_played = 0;
        say(&dev, 1, "SCAN:STOP"); /* as with a head */
        assert_int_equal(result.effect == COMMAND_STOP, head_next_state(dev.state, HEAD_EV_STOP) >= 0);
    }
    dev.moving = 2;
    expect(&dev, "SCAN:STARt", CONFLICT "SCAN:STARt waits for SITE:POSE: station 2 is being moved\"");
}

static void stations_of_others_are_no_limits(void **state)
{
    (void)state;
    struct command_device dev = command_test_device();
    dev.limits.n_stations = 5;
    dev.limits.elsewhere = 1 | 2 | 16;
    dev.settings.station = dev.defaults.station = 3;
    expect(&dev, "HEAD:STATION? MIN", "3");
    expect(&dev, "HEAD:STATION? MAX", "4");
    dev.limits.elsewhere = 1 | 2 | 8 | 16;
    expect(&dev, "HEAD:STATION? MIN", "3");
    expect(&dev, "HEAD:STATION? MAX", "3");
    dev.limits.elsewhere = 0;
    expect(&dev, "HEAD:STATION? MIN", "1");
    expect(&dev, "HEAD:STATION? MAX", "5");
}

/* With lines of 100 pulses the pulse rate has one value, and a line rate has its own limits. */
static void a_rate_may_follow_from_the_lines(void **state)
{
    (void)state;
    struct command_device dev = command_test_device();
    dev.limits.emitter = EMITTER_PLANAR;
    dev.limits.line_pulses = 100;
    dev.settings.prr_uhz = 10000 * MICRO;
    expect(&dev, "HEAD:PRR? MIN", "10000");
    expect(&dev, "HEAD:PRR? MAX", "10000");
    expect(&dev, "HEAD:LIN? MAX", "2000");
    expect(&dev, "HEAD:LIN? MIN", "1");
    expect(&dev, "HEAD:PRR 20000", CONFLICT "HEAD:PRR 20000 Hz, allowed 10000 as HEAD:LINes is 100\"");
    expect(&dev, "HEAD:LIN 50", "OK");
    expect(&dev, "HEAD:PRR?", "5000");
    assert_true(dev.settings.prr_uhz == 5000 * MICRO);
    expect(&dev, "HEAD:PRR MAX", "OK");
}

/* At 300 kHz over a turn 1 line/s has steps of 0.0012 deg, and 2000 lines/s of 2.4. The pan has up to 60 deg/s, so both
 * steps are the same up to sqrt(60 * 360 / 300000) = 0.26832816 deg. */
static void a_step_of_both_has_its_reason(void **state)
{
    (void)state;
    struct command_device dev = command_test_device();
    char high[64], want[160];
    expect(&dev, "SCAN:STEP? MIN", "0.0012");
    snprintf(high, sizeof high, "%s", say(&dev, 1, "SCAN:STEP? MAX"));
    assert_int_equal(strncmp(high, "0.268328", 8), 0);
    snprintf(want, sizeof want, CONFLICT "SCAN:STEP 1 deg, allowed 0.0012 to %s as HEAD:PRR is 300000\"", high);
    expect(&dev, "SCAN:STEP 1", want);
    expect(&dev, "SCAN:STEP:LINE 3", CONFLICT "SCAN:STEP:LINE 3 deg, allowed 0.0012 to 2.4 as HEAD:PRR is 300000\"");
    expect(&dev, "SCAN:STEP:PAN 3", CONFLICT "SCAN:STEP:PAN 3 deg, allowed 0 to 0.6 as HEAD:LINes is 100\"");
    dev.limits.emitter = EMITTER_SPHERE;
    dev.limits.line_pulses = 360;
    dev.limits.step_fixed = 1;
    dev.settings.step_udeg = dev.defaults.step_udeg = MICRO;
    expect(&dev, "SCAN:STEP 2", CONFLICT "SCAN:STEP 2 deg, allowed 1: the platform moves\"");
    expect(&dev, "SCAN:STEP:LINE 2", CONFLICT "SCAN:STEP:LINE 2 deg, allowed 1: SCAN:STEP sets both\"");
    expect(&dev, "SCAN:STEP:PAN 2", CONFLICT "SCAN:STEP:PAN 2 deg, allowed 1: SCAN:STEP sets both\"");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_recording_keeps_its_settings),        cmocka_unit_test(a_value_may_be_unknown),
        cmocka_unit_test(it_is_played_and_stopped_in_any_state), cmocka_unit_test(stations_of_others_are_no_limits),
        cmocka_unit_test(a_rate_may_follow_from_the_lines),      cmocka_unit_test(a_step_of_both_has_its_reason),
    };
    return cmocka_run_group_tests_name("recordings and ranges", tests, NULL, NULL);
}
