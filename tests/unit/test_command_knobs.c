/* SPDX-License-Identifier: MIT */
/* Ranges, noise and angular steps as settings, and settings that describe themselves. Expected values are worked out by
 * hand. */
#include "firmware_sim/command/row.h"
#include "firmware_sim/command/setting.h"
#include "tests/unit/command_device.h"

static void ranges_keep_apart(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    expect(&dev, "HEAD:RANG:MIN 2500 MM", "OK");
    assert_true(dev.settings.range_min_nm == 2500 * MICRO);
    expect(&dev, "HEAD:RANG:MAX 0.1 KM", "OK");
    expect(&dev, "HEAD:RANG:MAX?", "100");
    expect(&dev, "HEAD:RANG:MIN? MAX", "99.999999999");
    expect(&dev, "HEAD:RANG:MAX? MIN", "2.500000001");
    expect(&dev, "HEAD:RANG:MAX? MAX", "800");
    expect_error(&dev, 1, "HEAD:RANG:MIN 100", CMD_E_SETTINGS, "allowed 0.5 to 99.999999999 as HEAD:RANGe:MAX is 100");
    expect_error(&dev, 1, "HEAD:RANG:MIN 0.4", CMD_E_RANGE, "HEAD:RANGe:MIN 0.4 m, allowed 0.5 to 250");
    expect_error(&dev, 1, "HEAD:RANG:MAX 1.5", CMD_E_RANGE, "allowed 2 to 800"); /* one rate measures from 2 m on */
    expect_error(&dev, 1, "HEAD:RANG:MAX 900", CMD_E_RANGE, "allowed 2 to 800");
    expect_error(&dev, 1, "HEAD:RANG:MAX 5 DEG", CMD_E_SUFFIX, "takes M, MM or KM");
    expect(&dev, "*RST", "OK");
    expect(&dev, "HEAD:RANG:MAX?", "400");
    expect(&dev, "HEAD:RANG:MIN?", "1");
}

static void noise_has_kinds_and_sizes(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    expect(&dev, "HEAD:NOIS?", "OFF");
    expect(&dev, "HEAD:NOISE on", "OK");
    expect(&dev, "HEAD:NOIS? DEF", "OFF");
    expect(&dev, "HEAD:NOIS?", "ON");
    expect_error(&dev, 1, "HEAD:NOIS SIGN", CMD_E_SETTINGS, "HEAD:NOISe SIGNal needs signal.model: on");
    expect(&dev, "HEAD:NOIS:ANGL ON", "OK");
    dev.limits.angle_most = 0;
    expect(&dev, "HELP? HEAD:NOIS:ANGL", "word,\"\",,,OFF,,\"off boot idle spin-down fault\",\"OFF\"");
    expect_error(&dev, 1, "HEAD:NOIS:ANGL ON", CMD_E_SETTINGS,
                 "needs mirror_sigma_deg or pan_sigma_deg of the head profile");
    expect_error(&dev, 1, "HEAD:NOIS LOUD", CMD_E_DATA_TYPE, "HEAD:NOISe takes OFF, ON, SIGNal, DEF, not 'LOUD'");
    dev.limits.noise_most = 0; /* echoes are found in samples */
    expect_error(&dev, 1, "HEAD:NOIS SIGN", CMD_E_SETTINGS, "HEAD:NOISe SIGNal needs waveform.echoes: model");
    expect_error(&dev, 1, "HEAD:NOIS ON", CMD_E_SETTINGS, "HEAD:NOISe ON needs waveform.echoes: model");
    dev.limits.noise_most = 2;
    dev.limits.sigma_min_nm = 3 * MICRO;
    expect(&dev, "HEAD:NOIS SIGNAL", "OK");
    expect_error(&dev, 1, "HEAD:NOIS:SIGM 0.0029", CMD_E_RANGE, "HEAD:NOISe:SIGMa 0.0029 m, allowed 0.003 to 10");
    expect(&dev, "HEAD:NOIS:SIGM MIN", "OK");
    expect(&dev, "HEAD:NOIS:SIGM?", "0.003");
    expect(&dev, "HEAD:NOIS:BALL 0.000000001", "OK");
    expect_error(&dev, 1, "HEAD:NOIS:BALL 0.0000000001", CMD_E_RANGE, "allowed multiples of 0.000000001 m");
    expect_error(&dev, 1, "HEAD:NOIS:BALL 100.5", CMD_E_RANGE, "allowed 0 to 100");
}

/* A client can switch them within a scan, too, where the head samples them at all. */
static void waveforms_can_be_switched(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    expect(&dev, "SCAN:WAV?", "OFF");
    expect(&dev, "SCAN:WAVEFORM OFF", "OK");
    expect_error(&dev, 1, "SCAN:WAV ON", CMD_E_SETTINGS,
                 "SCAN:WAVeform ON needs waveform.send: on in the configuration");
    expect(&dev, "SCAN:WAV? MAX", "OFF");
    dev.limits.waves_most = 1;
    dev.settings.waves = dev.defaults.waves = 1;
    dev.state = HEAD_SCANNING;
    expect(&dev, "SCAN:WAV OFF", "OK");
    assert_int_equal(dev.settings.waves, 0);
    expect(&dev, "SCAN:WAV DEF", "OK");
    expect(&dev, "SCAN:WAV?", "ON");
    expect_error(&dev, 1, "SCAN:WAV 1", CMD_E_DATA_TYPE, "SCAN:WAVeform takes OFF, ON, DEF, not '1'");
}

static void what_is_planned_rests_in_a_scan(void **ctx)
{
    (void)ctx;
    static const char *const lines[] = {"HEAD:RANG:MIN 3",    "HEAD:RANG:MAX 30",   "HEAD:NOIS ON",
                                        "HEAD:NOIS:SIGM 0.1", "HEAD:NOIS:BALL 0.1", "HEAD:NOIS:ANGL ON"};
    struct command_device dev = command_test_device();
    for (int state = 0; state < HEAD_N_STATES; state++)
        for (size_t i = 0; i < sizeof lines / sizeof *lines; i++) {
            dev = command_test_device();
            dev.state = (enum head_state)state;
            if (state == HEAD_SPIN_UP || state == HEAD_SCANNING)
                expect_error(&dev, 1, lines[i], CMD_E_SETTINGS, "can't change in state");
            else
                expect(&dev, lines[i], "OK");
        }
    expect(&dev, "HEAD:PRR 200000", "OK"); /* rates may */
}

/* Worked out by hand, with 300 kHz, 100 lines/s, 18 deg/s and a sweep of 360 deg: 0.12 deg in the line, 0.18 between
 * lines. */
static void a_line_heads_step_sets_its_rates(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    expect(&dev, "SCAN:STEP:LINE?", "0.12");
    expect(&dev, "SCAN:STEP:PAN?", "0.18");
    expect(&dev, "SCAN:STEP?", "0.18");
    expect(&dev, "SCAN:STEP 0.15", "0.15"); /* 0.15 * 300000 / 360 = 125; 0.15 * 125 = 18.75 */
    assert_true(dev.settings.lines_uhz == 125 * MICRO && dev.settings.pan_udeg_s == 18750000);
    assert_true(dev.settings.prr_uhz == 300000 * MICRO && result.changes);
    /* 33.3333... lines/s and 1.3333... deg/s, each to its nearest 1e-6: 360 * 33.333333 / 300000 = 0.0399999996, and
     * 1.333333 / 33.333333 = 0.0399999904 */
    expect(&dev, "SCAN:STEP 40e-3 DEG", "0.04");
    assert_true(dev.settings.lines_uhz == 33333333 && dev.settings.pan_udeg_s == 1333333);
    expect(&dev, "SCAN:STEP:PAN?", "0.03999999");
    expect(&dev, "SCAN:STEP:LINE 0.06", "0.06"); /* alone: the pan stays as fast */
    assert_true(dev.settings.lines_uhz == 50 * MICRO && dev.settings.pan_udeg_s == 1333333);
    expect(&dev, "SCAN:STEP:PAN 0.3", "0.3");
    assert_true(dev.settings.lines_uhz == 50 * MICRO && dev.settings.pan_udeg_s == 15 * MICRO);
    expect(&dev, "SCAN:STEP DEF", "0.18");
    assert_true(dev.settings.lines_uhz == 100 * MICRO && dev.settings.pan_udeg_s == 18 * MICRO);
}

/* 1 to 2000 lines/s at 300 kHz are 0.0012 to 2.4 deg. The pan's 60 deg/s are 0.6 deg at 100 lines/s. For both steps the
 * limit is the root of 60 * 360 / 300000, as lines rise with the step: 0.2683281573. At 0.268328157 it would be
 * 223.6067975 lines/s, which is 223.606798, and 60.00000000001 deg/s. */
static void steps_stay_within_the_rates(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    expect(&dev, "SCAN:STEP:LINE? MIN", "0.0012");
    expect(&dev, "SCAN:STEP:LINE? MAX", "2.4");
    expect(&dev, "SCAN:STEP:PAN? MAX", "0.6");
    expect(&dev, "SCAN:STEP? MIN", "0.0012");
    expect(&dev, "SCAN:STEP? MAX", "0.268328156");
    expect_error(&dev, 1, "SCAN:STEP 0.27", CMD_E_SETTINGS, "allowed 0.0012 to 0.268328156 as HEAD:PRR is 300000");
    expect_error(&dev, 1, "SCAN:STEP:LINE 2.41", CMD_E_SETTINGS, "allowed 0.0012 to 2.4 as HEAD:PRR is 300000");
    expect_error(&dev, 1, "SCAN:STEP:PAN 0.61", CMD_E_SETTINGS, "allowed 0 to 0.6 as HEAD:LINes is 100");
    expect_error(&dev, 1, "SCAN:STEP 0", CMD_E_RANGE, "allowed 0.000000001 to 360");
    expect_error(&dev, 1, "SCAN:STEP 361", CMD_E_RANGE, "allowed 0.000000001 to 360");
    command_execute(&dev, 1, "SCAN:STEP MAX", &result);
    assert_true(result.error == 0 && dev.settings.pan_udeg_s == 60 * MICRO);
    expect(&dev, "SCAN:STEP:LINE MAX", "2.4");
    assert_true(dev.settings.lines_uhz == 2000 * MICRO);
    dev.limits.pan_max_udeg_s = dev.settings.pan_udeg_s = 0;
    expect_error(&dev, 1, "SCAN:STEP 0.1", CMD_E_SETTINGS, "the head has no pan; SCAN:STEP:LINE is its step");
    expect(&dev, "SCAN:STEP:LINE 0.1", "0.1");
}

/* 60 deg/s at 100 lines/s are 0.6 deg between lines, which is DEF's answer. Other numbers set both steps, to
 * 0.268328156 at most. */
static void what_def_answers_can_be_set(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    dev.defaults.pan_udeg_s = 60 * MICRO;
    expect(&dev, "SCAN:STEP? DEF", "0.6");
    expect(&dev, "SCAN:STEP 0.6", "0.6");
    assert_true(dev.settings.lines_uhz == 100 * MICRO && dev.settings.pan_udeg_s == 60 * MICRO);
    expect(&dev, "SCAN:STEP 0.12", "0.12");
    assert_true(dev.settings.pan_udeg_s == 12 * MICRO);
    expect_error(&dev, 1, "SCAN:STEP 0.59", CMD_E_SETTINGS, "allowed 0.0012 to 0.268328156 as HEAD:PRR is 300000");
    /* The default is not allowed where the lines of power-up give another step: 360 * 100 / 1000 deg. */
    expect(&dev, "HEAD:PRR 1000", "OK");
    expect(&dev, "SCAN:STEP:LINE? DEF", "0.12");
    expect_error(&dev, 1, "SCAN:STEP:LINE 0.12", CMD_E_SETTINGS, "allowed 0.36 to 360 as HEAD:PRR is 1000");
}

/* 360 kHz at 1 deg and 1000 rings/s. */
static struct command_device sphere(void)
{
    struct command_device dev = command_test_device();
    dev.limits.emitter = EMITTER_SPHERE;
    dev.limits.round = 1;
    dev.limits.line_pulses = 360;
    dev.limits.prr_max_uhz = 360000 * MICRO;
    dev.settings.step_udeg = 1 * MICRO;
    dev.settings.lines_uhz = 100 * MICRO;
    dev.settings.prr_uhz = 36000 * MICRO;
    dev.defaults = dev.settings;
    return dev;
}

static void a_spheres_step_divides_half_a_turn(void **ctx)
{
    (void)ctx;
    struct command_device dev = sphere();
    expect(&dev, "SCAN:STEP?", "1");
    expect(&dev, "SCAN:STEP? MIN", "0.1"); /* 3600 a ring, 100 rings/s */
    expect(&dev, "SCAN:STEP? MAX", "90");
    dev.settings.step_udeg = 700000; /* as a configuration may have it: 514 steps are the nearest */
    expect(&dev, "SCAN:STEP?", "0.700389105");
    expect(&dev, "SCAN:STEP 0.36", "0.36");
    expect(&dev, "HEAD:PRR?", "100000"); /* 1000 a ring */
    expect(&dev, "HEAD:LIN? MAX", "360");
    expect_error(&dev, 1, "HEAD:LIN 361", CMD_E_SETTINGS, "allowed 1 to 360 with this SCAN:STEP");
    expect_error(&dev, 1, "SCAN:STEP 0.37", CMD_E_RANGE,
                 "the nearest are 0.36 and 0.375 deg"); /* 500 and 480 to 180 deg */
    expect_error(&dev, 1, "SCAN:STEP 0.05", CMD_E_SETTINGS, "allowed 0.1 to 90 as HEAD:LINes is 100");
    expect_error(&dev, 1, "SCAN:STEP:LINE 1", CMD_E_SETTINGS, "allowed 0.36: SCAN:STEP sets both");
    dev.state = HEAD_SCANNING;
    expect_error(&dev, 1, "SCAN:STEP 1", CMD_E_SETTINGS, "can't change in state scanning");
    dev.state = HEAD_IDLE;
    expect(&dev, "SCAN:STEP DEF", "1");
    expect(&dev, "HEAD:PRR?", "36000");
    dev.limits.step_fixed = 1;
    expect_error(&dev, 1, "SCAN:STEP 2", CMD_E_SETTINGS, "allowed 1: the platform moves");
}

/* A step is its part of a turn, to the nearest micro-degree. It gives their number back if that is even. */
static void a_step_is_the_nearest_to_its_part_of_a_turn(void **ctx)
{
    (void)ctx;
    for (uint32_t steps = 4; steps <= 18000; steps++) {
        const int64_t left_udeg = head_step_udeg(steps) * steps - 360000000;
        if (2 * left_udeg > steps || 2 * left_udeg <= -(int64_t)steps) fail_msg("%u steps", steps);
        assert_true(steps % 2 != 0 || emitter_sphere_steps(head_step_udeg(steps)) == steps);
    }
}

static void steps_of_fixed_patterns_are_readings(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    dev.limits.emitter = EMITTER_PLANAR;
    dev.limits.line_pulses = 1440;
    expect(&dev, "SCAN:STEP?", "0.25");
    expect_error(&dev, 1, "SCAN:STEP 0.5", CMD_E_SETTINGS, "allowed 0.25: its steps are fixed");
    expect_error(&dev, 1, "SCAN:STEP:PAN?", CMD_E_SETTINGS, "the head has no pan");
    dev = command_test_device();
    dev.limits.emitter = EMITTER_BEAMS;
    dev.limits.sequence_ps = 55296000;
    dev.settings.lines_uhz = 20 * MICRO;
    expect(&dev, "SCAN:STEP:LINE?", "0.3981312"); /* 360 * 20 * 55.296e-6 */
    expect_error(&dev, 1, "SCAN:STEP 0.4", CMD_E_SETTINGS, "allowed 0.3981312 as HEAD:LINes is 20");
    dev.limits.emitter = EMITTER_DIRECTIONS;
    expect_error(&dev, 1, "SCAN:STEP?", CMD_E_SETTINGS, "the head has a list of directions, so no step");
}

static int too_far(void *owner, const struct head_settings *settings, char *why, size_t len)
{
    if (settings->range_max_nm <= *(const int64_t *)owner) return 0;
    snprintf(why, len, "it does not fit");
    return -1;
}

static void geometries_go_together(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    dev.limits.emitter = EMITTER_PLANAR;
    dev.limits.line_pulses = 720;
    dev.limits.lines_min_uhz = 25 * MICRO;
    dev.limits.lines_max_uhz = 50 * MICRO;
    dev.limits.n_geometries = 3;
    dev.limits.geometry[0] = (struct head_geometry){50 * MICRO, 720};
    dev.limits.geometry[1] = (struct head_geometry){25 * MICRO, 1440};
    dev.limits.geometry[2] = (struct head_geometry){25 * MICRO, 720};
    dev.settings.step_udeg = 500000;
    dev.settings.lines_uhz = 50 * MICRO;
    dev.settings.prr_uhz = 36000 * MICRO;
    dev.defaults = dev.settings;
    expect(&dev, "SCAN:STEP?", "0.5");
    expect_error(&dev, 1, "SCAN:STEP 0.25", CMD_E_RANGE, "SCAN:STEP 0.25, allowed 0.5 deg as HEAD:LINes is 50");
    expect_error(&dev, 1, "HEAD:LIN 30", CMD_E_RANGE, "allowed 25, 50 Hz with this SCAN:STEP");
    expect(&dev, "HEAD:LIN 25", "OK");
    assert_true(dev.settings.prr_uhz == 18000 * MICRO);
    expect_error(&dev, 1, "SCAN:STEP 0.3", CMD_E_RANGE, "allowed 0.25, 0.5 deg as HEAD:LINes is 25");
    expect(&dev, "SCAN:STEP? MIN", "0.25");
    expect(&dev, "SCAN:STEP? MAX", "0.5");
    expect(&dev, "HELP? SCAN:STEP",
           "number,\"deg\",0.25,0.5,0.5,0.000000001,\"off boot idle spin-down fault\",\"0.25 0.5\"");
    expect(&dev, "SCAN:STEP 0.25", "0.25");
    assert_true(dev.settings.prr_uhz == 36000 * MICRO);
    expect(&dev, "SCAN:STEP:LINE?", "0.25");
    expect_error(&dev, 1, "HEAD:LIN DEF", CMD_E_RANGE, "HEAD:LINes DEF, allowed 25 Hz with this SCAN:STEP");
    expect(&dev, "HEAD:LIN MAX", "OK");
    expect(&dev, "HEAD:LIN?", "25");
    dev.state = HEAD_SCANNING;
    expect_error(&dev, 1, "SCAN:STEP 0.5", CMD_E_SETTINGS, "can't change in state scanning");
    dev.state = HEAD_IDLE;
    expect(&dev, "SCAN:STEP DEF", "0.5");
    expect(&dev, "*RST", "OK");
    assert_true(dev.settings.prr_uhz == 36000 * MICRO);
}

static void what_can_not_be_planned_is_refused(void **ctx)
{
    (void)ctx;
    int64_t most_nm = 50 * NANO;
    struct command_device dev = command_test_device();
    dev.can_plan = too_far;
    dev.owner = &most_nm;
    expect_error(&dev, 1, "HEAD:RANG:MAX 51", CMD_E_SETTINGS, "HEAD:RANGe:MAX: it does not fit");
    expect(&dev, "HEAD:RANG:MAX 50", "OK");
}

static void settings_describe_themselves(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    expect(&dev, "HELP? HEAD:PRR", "number,\"Hz\",1000,1200000,300000,0.000001,\"all\",\"\"");
    expect(&dev, "HELP? :head:rang:min?", "number,\"m\",0.5,250,1,0.000000001,\"off boot idle spin-down fault\",\"\"");
    expect(&dev, "HELP? HEAD:NOISE", "word,\"\",,,OFF,,\"off boot idle spin-down fault\",\"OFF ON\"");
    expect(&dev, "HELP? SCAN:ECHOES", "word,\"\",,,ALL,,\"all\",\"ALL FIRSt LAST STRongest\"");
    expect(&dev, "HELP? SCAN:STEP", "number,\"deg\",0.0012,0.268328156,0.18,0.000000001,\"all\",\"\"");
    expect(&dev, "HELP? SCAN:STAR", "action,\"\",,,,,\"idle\",\"\"");
    expect(&dev, "HELP? TIME?", "query,\"\",,,,,\"all\",\"\"");
    dev.limits.n_rates = 2;
    dev.limits.rate_uhz[0] = 100000 * MICRO;
    dev.limits.rate_uhz[1] = 300000 * MICRO;
    expect(&dev, "HELP? HEAD:PRR", "number,\"Hz\",100000,300000,300000,0.000001,\"all\",\"100000 300000\"");
    dev.limits.pan_max_udeg_s = 0;
    expect(&dev, "HELP? SCAN:STEP", "number,\"deg\",,,,,\"\",\"\"");
    expect_error(&dev, 1, "HELP? HEAD", CMD_E_DATA_TYPE, "HELP? takes a header, not 'HEAD'");
}

/* The limits of HELP? are the answers to MIN, MAX and DEF, and none of them is refused. */
static void limits_are_those_that_hold(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    char names[COMMAND_MAX_REPLY], line[COMMAND_MAX_REPLY + 80], kind[16], field[3][40], *save = NULL;
    int n = 0;
    command_execute(&dev, 1, "HELP:SET?", &result);
    memcpy(names, result.reply, sizeof names);
    for (char *name = strtok_r(names, " ", &save); name != NULL; name = strtok_r(NULL, " ", &save), n++) {
        static const char *const special[] = {"MIN", "MAX", "DEF"};
        snprintf(line, sizeof line, "HELP? %s", name);
        command_execute(&dev, 1, line, &result);
        const int got =
            sscanf(result.reply, "%15[a-z],\"%*[^,],%39[^,],%39[^,],%39[^,],", kind, field[0], field[1], field[2]);
        if (strcmp(kind, "number") != 0) continue;
        assert_int_equal(got, 4);
        for (int i = 0; i < 3; i++) {
            struct command_device other = dev;
            snprintf(line, sizeof line, "%s? %s", name, special[i]);
            expect(&other, line, field[i]);
            snprintf(line, sizeof line, "%s %s", name, field[i]);
            command_execute(&other, 1, line, &result);
            if (result.error != 0) fail_msg("'%s' gives '%s'", line, result.reply);
        }
    }
    int settings = 0;
    for (const struct command_row *row = command_rows; row->header != NULL; row++)
        settings += row->setting != NULL; /* SITE:POSE has six values */
    assert_int_equal(n, settings);
}

/* Each member of the settings has a row; that of the step is SCAN:STEP. HELP:SETtings? lists each row that has a
 * setting. */
static void every_setting_is_listed(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    unsigned char has[sizeof(struct head_settings)] = {0};
    char listed[sizeof result.reply + 2], word[64];
    const size_t end = offsetof(struct head_settings, waves) + sizeof dev.settings.waves; /* of the last member */
    memset(has + offsetof(struct head_settings, step_udeg), 1, sizeof dev.settings.step_udeg);
    command_execute(&dev, 1, "HELP:SET?", &result);
    snprintf(listed, sizeof listed, " %s ", result.reply);
    for (const struct command_row *row = command_rows; row->header != NULL; row++) {
        if (row->setting == NULL) continue;
        snprintf(word, sizeof word, " %s ", row->header);
        if (strstr(listed, word) == NULL) fail_msg("%s is not listed", row->header);
        if (row->setting->derived == NULL) memset(has + row->setting->offset, 1, row->setting->is_u32 ? 4 : 8);
    }
    for (size_t i = 0; i < end; i++)
        if (!has[i]) fail_msg("no command has the setting at byte %zu of struct head_settings", i);
}

/* A setting that a recording lacks has no limits, and asking for them is no error. */
static void settings_that_a_recording_lacks_describe_themselves(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    dev.recorded = "a recording is replayed";
    dev.settings.pan_udeg_s = COMMAND_NOT_RECORDED;
    dev.settings.noise = COMMAND_NOT_RECORDED_U32;
    expect(&dev, "HELP? HEAD:PAN", "number,\"deg/s\",,,,0.000001,\"all\",\"\"");
    command_execute(&dev, 1, "HELP? HEAD:NOIS", &result);
    assert_int_equal(strncmp(result.reply, "word,\"\",,,,,", 12), 0);
    expect(&dev, "SYST:ERR:COUN?", "0");
}

/* A damaged recording may have rates of 0, and then its steps can't be worked out. */
static void a_recording_without_rates_has_no_step(void **ctx)
{
    (void)ctx;
    static const char *const asks[] = {"SCAN:STEP?", "SCAN:STEP? MAX", "SCAN:STEP:LINE?", "SCAN:STEP:LINE? MIN"};
    static const enum emitter_kind kinds[] = {EMITTER_LINE, EMITTER_PLANAR, EMITTER_SPHERE};
    for (size_t k = 0; k < N_OF(kinds); k++) {
        struct command_device dev = command_test_device();
        dev.recorded = "a recording is replayed";
        dev.limits.emitter = kinds[k];
        dev.limits.step_fixed = kinds[k] != EMITTER_LINE;
        dev.settings.prr_uhz = dev.settings.lines_uhz = 0;
        for (size_t i = 0; i < N_OF(asks); i++)
            expect_error(&dev, 1, asks[i], CMD_E_SETTINGS, "the recording does not have this value");
        expect(&dev, "HELP? SCAN:STEP", "number,\"deg\",,,,,\"\",\"\"");
        if (kinds[k] != EMITTER_PLANAR)
            expect_error(&dev, 1, "SCAN:STEP:PAN?", CMD_E_SETTINGS, "the recording does not have this value");
    }
}

/* The client of the time server looks at the settings now and then: it must see that the role has changed, though it
 * has come back to what it was. */
static void each_change_of_a_role_counts(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    dev.asks_server = 1;
    const struct command_time_server client = {.role = COMMAND_TIME_CLIENT, .address = {127, 0, 0, 1}, .update_s = 600};
    dev.server_default = (struct command_time_server){.address = {127, 0, 0, 1}, .update_s = 600};
    dev.server = client;
    expect(&dev, "*RST", "OK");
    assert_int_equal(dev.server.role, COMMAND_TIME_NONE);
    assert_int_equal(dev.server.n_roles, 1);
    expect(&dev, "TIME:SERV CLIENT,127.0.0.1,600,0,ETH", "OK");
    assert_int_equal(dev.server.n_roles, 2);
    expect(&dev, "TIME:SERV CLIENT,127.0.0.2,600,0,ETH", "OK");
    assert_int_equal(dev.server.n_roles, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_setting_is_listed),
        cmocka_unit_test(ranges_keep_apart),
        cmocka_unit_test(noise_has_kinds_and_sizes),
        cmocka_unit_test(waveforms_can_be_switched),
        cmocka_unit_test(what_is_planned_rests_in_a_scan),
        cmocka_unit_test(a_line_heads_step_sets_its_rates),
        cmocka_unit_test(steps_stay_within_the_rates),
        cmocka_unit_test(what_def_answers_can_be_set),
        cmocka_unit_test(a_spheres_step_divides_half_a_turn),
        cmocka_unit_test(a_step_is_the_nearest_to_its_part_of_a_turn),
        cmocka_unit_test(steps_of_fixed_patterns_are_readings),
        cmocka_unit_test(geometries_go_together),
        cmocka_unit_test(what_can_not_be_planned_is_refused),
        cmocka_unit_test(settings_describe_themselves),
        cmocka_unit_test(limits_are_those_that_hold),
        cmocka_unit_test(settings_that_a_recording_lacks_describe_themselves),
        cmocka_unit_test(a_recording_without_rates_has_no_step),
        cmocka_unit_test(each_change_of_a_role_counts),
    };
    return cmocka_run_group_tests_name("command knobs", tests, NULL, NULL);
}
