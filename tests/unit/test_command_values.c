/* SPDX-License-Identifier: MIT */
/* Numbers, ranges, control and effects of the command set. */
#include "tests/unit/command_device.h"

static void numbers_in_nrf_forms_are_exact(void **ctx)
{
    (void)ctx;
    static const struct {
        const char *text;
        int64_t prr_uhz;
    } cases[] = {
        {"300000", INT64_C(300000000000)},
        {"+300000", INT64_C(300000000000)},
        {"300000.", INT64_C(300000000000)},
        {"0300000.000000000", INT64_C(300000000000)},
        {"3e5", INT64_C(300000000000)},
        {"3E+05", INT64_C(300000000000)},
        {"3 E 5", INT64_C(300000000000)},
        {".3e6", INT64_C(300000000000)},
        {"300000000000e-6", INT64_C(300000000000)},
        {"12345.678901", INT64_C(12345678901)},
        {"1000.1", INT64_C(1000100000)}, /* no double is 1000.1: the text must not go through one */
        {"1199999.999999", INT64_C(1199999999999)},
        {"300000HZ", INT64_C(300000000000)},
        {"300000 Hz", INT64_C(300000000000)},
        {"300 kHz", INT64_C(300000000000)},
        {"0.3MHZ", INT64_C(300000000000)},
        {"3e-1 mhz", INT64_C(300000000000)},
        {"1.000000001 KHZ", INT64_C(1000000001)},
        {"MIN", INT64_C(1000000000)},
        {"minimum", INT64_C(1000000000)},
        {"Max", INT64_C(1200000000000)},
        {"MAXIMUM", INT64_C(1200000000000)},
    };
    for (size_t i = 0; i < N_OF(cases); i++) {
        struct command_device dev = command_test_device();
        char line[80];
        snprintf(line, sizeof line, "HEAD:PRR %s", cases[i].text);
        expect(&dev, line, "OK");
        if (dev.settings.prr_uhz != cases[i].prr_uhz) fail_msg("%s is %lld uHz", line, (long long)dev.settings.prr_uhz);
        assert_int_equal(result.effect, COMMAND_SETTINGS);
    }
}

static void what_is_not_exact_is_refused_not_rounded(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    expect_error(&dev, 1, "HEAD:PRR 5000.0000001", CMD_E_RANGE, "5000.0000001, allowed multiples of 0.000001 Hz");
    expect_error(&dev, 1, "HEAD:PRR 5.0000000001 KHZ", CMD_E_RANGE, "multiples of 0.000001 Hz");
    expect_error(&dev, 1, "HEAD:PRR 5e-99999999999", CMD_E_RANGE, "multiples of");
    expect_error(&dev, 1, "SCAN:FRAMES 1.5", CMD_E_RANGE, "1.5, allowed whole numbers");
    expect_error(&dev, 1, "HEAD:STATION 0.1e1.", CMD_E_DATA_TYPE, "not '0.1e1.'");
    expect(&dev, "SCAN:FRAMES 0.2e1", "OK");
    assert_int_equal(dev.settings.frames, 2);
    expect(&dev, "SCAN:FRAMES 0e-99999", "OK"); /* nought is nought */
    assert_int_equal(dev.settings.frames, 0);
}

static void numbers_beyond_64_bits_are_out_of_range(void **ctx)
{
    (void)ctx;
    /* The last two would be 5000 after a wrap of the 64 bits of the value, or of the 32 of the exponent. */
    static const char *const numbers[] = {"1e99999999999",         "-1e30",
                                          "9223372036854.775808",  "99999999999999999999999999999999999999",
                                          "18446744078709.551616", "5e4294967299"};
    struct command_device dev = command_test_device();
    for (size_t i = 0; i < N_OF(numbers); i++) {
        char line[80];
        snprintf(line, sizeof line, "HEAD:PRR %s", numbers[i]);
        expect_error(&dev, 1, line, CMD_E_RANGE, ", allowed 1000 to 1200000\"");
    }
    /* The largest number of 64 bits is out of range like others. The next one is quoted as it was sent. */
    dev.step_allowed = 1;
    expect_error(&dev, 1, "TIME:STEP 9223372036854775807", CMD_E_RANGE, " 9223372036854775807 ns, allowed");
    expect_error(&dev, 1, "TIME:STEP 9223372036854775808", CMD_E_RANGE, " 9223372036854775808, allowed");
    dev.step_allowed = 0;
    /* Four frames more than 2^32 must not become four. */
    expect_error(&dev, 1, "SCAN:FRAMES 4294967300", CMD_E_RANGE, "allowed 0 to 1000000");
    expect(&dev, "SCAN:FRAMES 1000000", "OK");
    expect_error(&dev, 1, "HEAD:STATION 4294967297", CMD_E_RANGE, "allowed 1 to 3");
    /* If one value is left, it is given alone. */
    dev.limits.pan_max_udeg_s = 0;
    expect_error(&dev, 1, "HEAD:PAN 1", CMD_E_RANGE, "HEAD:PAN 1 deg/s, allowed 0\"");
}

/* Each range is tried from both ends. The values are the test profile's, narrowed by the other setting. */
static void each_range_holds_at_both_ends(void **ctx)
{
    (void)ctx;
    static const struct {
        const char *header, *below, *min, *max, *above;
        int below_error, above_error;
    } ranges[] = {
        {"HEAD:PRR", "999.999999", "1000", "1200000", "1200000.000001", -222, -222},
        {"HEAD:LINES", "0.999999", "1", "2000", "2000.000001", -222, -222},
        {"HEAD:PAN", "-0.000001", "0", "60", "60.000001", -222, -222},
        {"HEAD:STATION", "0", "1", "3", "4", -222, -222},
        {"SCAN:FRAMES", "-1", "0", "1000000", "1000001", -222, -222},
        {"SCAN:LINE:START", "-40.000001", "-40", "49.999999", "50", -222, -221},
        {"SCAN:LINE:STOP", "-30", "-29.999999", "60", "60.000001", -221, -222},
        {"SCAN:PAN:START", "-180.000001", "-180", "179.999999", "180", -222, -221},
        {"SCAN:PAN:STOP", "0", "0.000001", "360", "360.000001", -221, -222},
    };
    for (size_t i = 0; i < N_OF(ranges); i++) {
        struct command_device dev = command_test_device();
        char line[80], allowed[80];
        snprintf(allowed, sizeof allowed, "allowed %s to %s", ranges[i].min, ranges[i].max);
        if (ranges[i].below_error == -222 && ranges[i].above_error == -222) {
            snprintf(line, sizeof line, "%s %s", ranges[i].header, ranges[i].below);
            expect_error(&dev, 1, line, -222, allowed);
        }
        snprintf(line, sizeof line, "%s %s", ranges[i].header, ranges[i].below);
        expect_error(&dev, 1, line, ranges[i].below_error, ", allowed ");
        snprintf(line, sizeof line, "%s %s", ranges[i].header, ranges[i].above);
        expect_error(&dev, 1, line, ranges[i].above_error, ", allowed ");
        snprintf(line, sizeof line, "%s? MIN", ranges[i].header);
        expect(&dev, line, ranges[i].min);
        snprintf(line, sizeof line, "%s? MAX", ranges[i].header);
        expect(&dev, line, ranges[i].max);
        const char *const good[] = {ranges[i].min, ranges[i].max};
        for (size_t k = 0; k < 2; k++) {
            snprintf(line, sizeof line, "%s %s", ranges[i].header, good[k]);
            expect(&dev, line, "OK");
            snprintf(line, sizeof line, "%s?", ranges[i].header);
            expect(&dev, line, good[k]);
        }
    }
}

static void settings_narrow_each_other(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    dev.limits.lines_max_uhz = 5000 * MICRO;
    expect(&dev, "HEAD:PRR 2000", "OK");
    expect_error(&dev, 1, "HEAD:LINES 2000.000001", CMD_E_SETTINGS,
                 "HEAD:LINes 2000.000001 Hz, allowed 1 to 2000 as HEAD:PRR is 2000");
    expect(&dev, "HEAD:LINES MAX", "OK");
    expect(&dev, "HEAD:LINES?", "2000");
    expect_error(&dev, 1, "HEAD:PRR 1999", CMD_E_SETTINGS, "allowed 2000 to 1200000 as HEAD:LINes is 2000");
    /* A turn is the most that the pan may span. */
    expect(&dev, "SCAN:PAN:STOP 360", "OK");
    expect_error(&dev, 1, "SCAN:PAN:START -0.000001", CMD_E_SETTINGS, "allowed 0 to 359.999999");
    expect(&dev, "SCAN:PAN:STOP 100", "OK");
    expect(&dev, "SCAN:PAN:START -180", "OK");
    expect_error(&dev, 1, "SCAN:PAN:STOP 181", CMD_E_SETTINGS, "allowed -179.999999 to 180");
    /* A default may contradict other settings; then it is refused like any number. */
    expect(&dev, "SCAN:PAN:START -180", "OK");
    expect(&dev, "SCAN:PAN:STOP -90", "OK");
    expect_error(&dev, 1, "SCAN:PAN:START DEF", CMD_E_SETTINGS, "SCAN:PAN:STARt 0 deg");
    expect(&dev, "SCAN:PAN:START? DEFAULT", "0");
    expect(&dev, "SCAN:PAN:STOP DEF", "OK");
    expect(&dev, "SCAN:PAN:STOP?", "180");
}

static void control_goes_to_the_first_who_changes(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    expect_error(&dev, 3, "HEAD:PRR 1", CMD_E_RANGE, "HEAD:PRR"); /* a refused change takes nothing */
    assert_string_equal(say(&dev, 3, "HEAD:PRR?"), "300000");
    assert_int_equal(dev.control, 0);
    assert_string_equal(say(&dev, 3, "HEAD:PRR 5000"), "OK");
    assert_true(result.took_control && result.changes);
    assert_string_equal(say(&dev, 2, "SYST:CONT?"), "3");
    static const char *const changing[] = {"HEAD:PRR 6000", "*RST", "SCAN:START", "SYST:CONT:REL", "SCAN:FRAMES MAX"};
    for (size_t i = 0; i < N_OF(changing); i++)
        expect_error(&dev, 2, changing[i], CMD_E_PROTECTED, "session 3 has control, this is session 2");
    assert_string_equal(say(&dev, 2, "SYST:CONT:WHO?"), "\"\"");
    command_set_peer(&dev, 3, "tcp 127.0.0.1:40312");
    expect_error(&dev, 2, changing[0], CMD_E_PROTECTED,
                 "tcp 127.0.0.1:40312 has control (session 3), this is session 2");
    assert_string_equal(say(&dev, 2, "SYST:CONT:WHO?"), "\"tcp 127.0.0.1:40312\"");
    expect_error(&dev, 2, "HEAD:PRR x", CMD_E_DATA_TYPE, "x"); /* an invalid line is reported first */
    assert_string_equal(say(&dev, 2, "HEAD:PRR?"), "5000");
    assert_string_equal(say(&dev, 2, "*CLS"), "OK");
    assert_string_equal(say(&dev, 3, "HEAD:PRR 6000"), "OK");
    assert_false(result.took_control);
    assert_string_equal(say(&dev, 3, "SYST:CONT:REL"), "OK");
    assert_int_equal(result.effect, COMMAND_RELEASE);
    assert_false(result.changes || result.took_control);
    assert_string_equal(say(&dev, 3, "SYST:CONT:REL"), "OK"); /* nothing left to give back */
    assert_int_equal(result.effect, COMMAND_NONE);
    assert_string_equal(say(&dev, 2, "SCAN:START"), "OK");
    assert_int_equal(dev.control, 2);
}

static void the_device_itself_needs_no_control(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    assert_string_equal(say(&dev, 0, "HEAD:PRR 5000"), "OK");
    assert_int_equal(dev.control, 0);
    assert_true(result.changes && !result.took_control);
    dev.control = 2;
    assert_string_equal(say(&dev, 0, "HEAD:PRR 6000"), "OK");
    assert_int_equal(dev.control, 2);
}

/* The answer in each state, from the state diagram: S start, P stop, R reset, B reboot; '.' refused. */
static void effects_follow_the_state_machine(void **ctx)
{
    (void)ctx;
    static const char *const accepted[HEAD_N_STATES] = {"...B", "...B", "S.RB", ".PRB", ".PRB", "..RB", "..RB"};
    static const char *const lines[] = {"SCAN:START", "SCAN:STOP", "*RST", "HEAD:REBOOT"};
    static const enum command_effect effects[] = {COMMAND_START, COMMAND_STOP, COMMAND_RESET, COMMAND_REBOOT};
    for (int state = 0; state < HEAD_N_STATES; state++)
        for (size_t i = 0; i < 4; i++) {
            struct command_device dev = command_test_device();
            dev.state = (enum head_state)state;
            dev.settings.frames = 9;
            if (accepted[state][i] == '.') {
                expect_error(&dev, 1, lines[i], CMD_E_SETTINGS, head_state_name(dev.state));
                continue;
            }
            expect(&dev, lines[i], "OK");
            assert_int_equal(result.effect, effects[i]);
            assert_true(result.changes);
            assert_int_equal(dev.state, state); /* the loop changes it, not the command */
            assert_int_equal(dev.settings.frames, effects[i] == COMMAND_RESET ? 1 : 9);
        }
}

static void a_station_stays_during_a_scan(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    for (int state = HEAD_SPIN_UP; state <= HEAD_SCANNING; state++) {
        dev.state = (enum head_state)state;
        expect_error(&dev, 1, "HEAD:STATION 2", CMD_E_SETTINGS, head_state_name(dev.state));
        expect(&dev, "HEAD:STATION 1", "OK"); /* it is there already */
        expect(&dev, "HEAD:PRR 5000", "OK");
    }
    dev.state = HEAD_SPIN_DOWN;
    expect(&dev, "HEAD:STATION 2", "OK");
}

static void steps_of_time(void **ctx)
{
    (void)ctx;
    static const struct {
        const char *line;
        int64_t step_ns;
    } steps[] = {{"TIME:STEP 1", 1},           {"TIME:STEP 1000000", 1000000},
                 {"TIME:STEP 2.5 US", 2500},   {"TIME:STEP 20 ms", 20000000},
                 {"TIME:STEP 1S", 1000000000}, {"TIME:STEP 86400 S", 86400000000000}};
    struct command_device dev = command_test_device();
    expect_error(&dev, 1, "TIME:STEP 1", CMD_E_SETTINGS, "pace step");
    dev.step_allowed = 1;
    dev.t_ns = 1;
    for (size_t i = 0; i < N_OF(steps); i++) {
        expect(&dev, steps[i].line, "OK");
        assert_int_equal(result.effect, COMMAND_STEP);
        assert_true(result.step_ns == steps[i].step_ns && result.changes);
    }
    expect_error(&dev, 1, "TIME:STEP 0", CMD_E_RANGE, "allowed 1 to 86400000000000");
    expect_error(&dev, 1, "TIME:STEP -5", CMD_E_RANGE, "TIME:STEP -5 ns");
    expect_error(&dev, 1, "TIME:STEP 0.5", CMD_E_RANGE, "whole numbers of ns");
    expect_error(&dev, 1, "TIME:STEP 86400000000001", CMD_E_RANGE, "allowed 1 to"); /* more than a day */
    expect_error(&dev, 1, "TIME:STEP 9223372036854775808", CMD_E_RANGE, "allowed 1 to");
    expect_error(&dev, 1, "TIME:STEP -9300000000000000000", CMD_E_RANGE, "STEP -9300000000000000000, allowed 1 to");
}

/* A blank may stand on both sides of the E (IEEE 488.2, 7.7.2.4.1), in every number of a command. */
static void numbers_may_have_blanks_in_their_exponents(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    dev.step_allowed = dev.pose_allowed = 1;
    dev.pose_reach_m = 1000.0;
    expect(&dev, "TIME:STEP 1 E3, 1 E2,2e 1, -3 e -1,0,9 E 1,0", "OK");
    const double *pose = result.pose;
    assert_true(result.step_ns == 1000 && pose[0] == 100.0 && pose[1] == 20.0 && pose[2] == -0.3 && pose[4] == 90.0);
    expect(&dev, "SCAN:REPL 1 E2, 2 e 1", "OK");
    assert_true(result.replay.position_s == 100.0 && result.replay.speed == 20.0);
    expect(&dev, "HEAD:PRR 2 E 5", "OK");
    assert_true(dev.settings.prr_uhz == 200000 * MICRO);
}

/* A client that goes to the end sends the length that SCAN:REPLay? gave, cut to 1e-6 s. */
static void the_length_that_is_said_is_allowed(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    dev.replay.length_s = 100.1234566;
    dev.replay.position_s = 99.9999999;
    expect(&dev, "SCAN:REPL?", "IDLE,99.999999,100.123456,1,OFF");
    expect(&dev, "SCAN:REPL 100.123456", "OK");
    expect_error(&dev, 1, "SCAN:REPL 100.123457", CMD_E_RANGE, "allowed 0 to 100.1234566");
}

/* A setting of words takes each in short and long form, and DEF, but no other word. */
static void words(void **state)
{
    (void)state;
    struct command_device dev = command_test_device();
    static const char *const set[] = {"FIRS", "first", "LAST", "STR", "strongest", "ALL"};
    static const char *const get[] = {"FIRSt", "FIRSt", "LAST", "STRongest", "STRongest", "ALL"};
    for (int i = 0; i < 6; i++) {
        char line[40];
        snprintf(line, sizeof line, "SCAN:ECH %s", set[i]);
        expect(&dev, line, "OK");
        expect(&dev, "SCAN:ECHOES?", get[i]);
    }
    expect(&dev, "SCAN:ECHOES LAST", "OK");
    expect(&dev, "SCAN:ECHOES DEF", "OK");
    expect(&dev, "SCAN:ECHOES?", "ALL");
    expect_error(&dev, 1, "SCAN:ECHOES 2", CMD_E_DATA_TYPE, "takes ALL, FIRSt, LAST, STRongest, DEF, not '2'");
    expect_error(&dev, 1, "SCAN:ECHOES MAX", CMD_E_DATA_TYPE, "not 'MAX'");
    expect_error(&dev, 1, "SCAN:ECHOES", CMD_E_MISSING, "takes a word");
}

/* A head with fixed pulse rates takes no others, and its limits are among them. */
static void fixed_rates_are_the_only_ones(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    dev.limits.n_rates = 4;
    for (int i = 0; i < 4; i++)
        dev.limits.rate_uhz[i] = (const int64_t[]){1000, 1500, 300000, 1200000}[i] * MICRO;
    static const char refused[] = "allowed 1000, 1500, 300000, 1200000 Hz";
    static const char *const others[] = {"1000.000001", "299999.999999", "500 KHZ", "999",
                                         "1200001",     "1e30",          "1e-9",    "-1000"};
    for (size_t i = 0; i < N_OF(others); i++) {
        char line[64];
        snprintf(line, sizeof line, "HEAD:PRR %s", others[i]);
        expect_error(&dev, 1, line, CMD_E_RANGE, refused);
    }
    expect(&dev, "HEAD:PRR 1.2 MHZ", "OK");
    expect(&dev, "HEAD:PRR?", "1200000");
    expect(&dev, "HEAD:PRR DEF", "OK");
    expect(&dev, "HEAD:PRR?", "300000");
    expect(&dev, "HEAD:PRR MIN", "OK");
    expect(&dev, "HEAD:PRR?", "1000");
    expect(&dev, "HEAD:PRR? MAX", "1200000");
    /* 1200 lines/s need 1200 pulses/s: the smallest rate above is 1500 */
    expect(&dev, "HEAD:PRR 300000", "OK");
    expect(&dev, "HEAD:LINES 1200", "OK");
    expect(&dev, "HEAD:PRR? MIN", "1500");
    expect_error(&dev, 1, "HEAD:PRR 1000", CMD_E_SETTINGS,
                 "HEAD:PRR 1000 Hz, allowed 1500 to 1200000 as HEAD:LINes is 1200");
    expect(&dev, "HEAD:PRR MIN", "OK");
    expect(&dev, "HEAD:PRR?", "1500");
    /* Settings that are no rates keep their own range. */
    expect(&dev, "HEAD:LINES? MAX", "1500");
    expect(&dev, "HEAD:LINES 77.7", "OK");
    expect(&dev, "HEAD:PAN 12.5", "OK");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_in_nrf_forms_are_exact),
        cmocka_unit_test(what_is_not_exact_is_refused_not_rounded),
        cmocka_unit_test(numbers_beyond_64_bits_are_out_of_range),
        cmocka_unit_test(each_range_holds_at_both_ends),
        cmocka_unit_test(settings_narrow_each_other),
        cmocka_unit_test(control_goes_to_the_first_who_changes),
        cmocka_unit_test(the_device_itself_needs_no_control),
        cmocka_unit_test(effects_follow_the_state_machine),
        cmocka_unit_test(a_station_stays_during_a_scan),
        cmocka_unit_test(steps_of_time),
        cmocka_unit_test(numbers_may_have_blanks_in_their_exponents),
        cmocka_unit_test(the_length_that_is_said_is_allowed),
        cmocka_unit_test(words),
        cmocka_unit_test(fixed_rates_are_the_only_ones),
    };
    return cmocka_run_group_tests_name("command values", tests, NULL, NULL);
}
