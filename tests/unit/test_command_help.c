/* SPDX-License-Identifier: MIT */
/* HELP? of every command is compared whole: kind, unit, limits, default, step, states and values were worked out by
 * hand from the limits of command_device.c. A head with fixed pulse rates lists them for HEAD:PRR, and for no
 * other setting. */
#include "tests/unit/command_device.h"

#define ALL   "\"all\""
#define REST  "\"off boot idle spin-down fault\"" /* not in a scan */
#define FINE  "0.000001"
#define NANOS "0.000000001"

static struct command_device full_device(void)
{
    struct command_device dev = command_test_device();
    dev.limits.n_rates = 3;
    for (int i = 0; i < 3; i++)
        dev.limits.rate_uhz[i] = (const int64_t[]){1000, 300000, 1200000}[i] * MICRO;
    dev.limits.phase_lock_most = dev.limits.waves_most = 1;
    dev.limits.noise_most = 2;
    return dev;
}

static const struct {
    const char *header, *reply;
} rows[] = {
    {"HEAD:PRR", "number,\"Hz\",1000,1200000,300000," FINE "," ALL ",\"1000 300000 1200000\""},
    {"HEAD:LINes", "number,\"Hz\",1,2000,100," FINE "," ALL ",\"\""},
    {"HEAD:PAN", "number,\"deg/s\",0,60,18," FINE "," ALL ",\"\""},
    {"HEAD:STATION", "number,\"\",1,3,1,1," REST ",\"\""},
    {"HEAD:RANGe:MIN", "number,\"m\",0.5,250,1," NANOS "," REST ",\"\""},
    {"HEAD:RANGe:MAX", "number,\"m\",2,800,400," NANOS "," REST ",\"\""},
    {"HEAD:NOISe", "word,\"\",,,OFF,," REST ",\"OFF ON SIGNal\""},
    {"HEAD:NOISe:ANGLe", "word,\"\",,,OFF,," REST ",\"OFF ON\""},
    {"HEAD:NOISe:SIGMa", "number,\"m\",0,10,0.005," NANOS "," REST ",\"\""},
    {"HEAD:NOISe:BALL", "number,\"m\",0,100,0," NANOS "," REST ",\"\""},
    {"HEAD:PHASe", "number,\"deg\",0,359.999999,0," FINE "," ALL ",\"\""},
    {"HEAD:PHASe:LOCK", "word,\"\",,,OFF,," ALL ",\"OFF ON\""},
    /* 300 kHz over a turn, 1 to 2000 lines/s, up to 60 deg/s; at 100 lines/s and 18 deg/s */
    {"SCAN:STEP", "number,\"deg\",0.0012,0.268328156,0.18," NANOS "," ALL ",\"\""},
    {"SCAN:STEP:LINE", "number,\"deg\",0.0012,2.4,0.12," NANOS "," ALL ",\"\""},
    {"SCAN:STEP:PAN", "number,\"deg\",0,0.6,0.18," NANOS "," ALL ",\"\""},
    {"SCAN:LINE:STARt", "number,\"deg\",-40,49.999999,-30," FINE "," ALL ",\"\""},
    {"SCAN:LINE:STOP", "number,\"deg\",-29.999999,60,50," FINE "," ALL ",\"\""},
    {"SCAN:PAN:STARt", "number,\"deg\",-180,179.999999,0," FINE "," ALL ",\"\""},
    {"SCAN:PAN:STOP", "number,\"deg\",0.000001,360,180," FINE "," ALL ",\"\""},
    {"SCAN:FRAMes", "number,\"\",0,1000000,1,1," ALL ",\"\""},
    {"SCAN:ECHoes", "word,\"\",,,ALL,," ALL ",\"ALL FIRSt LAST STRongest\""},
    {"SCAN:WAVeform", "word,\"\",,,OFF,," ALL ",\"OFF ON\""},
    /* no settings; commands that depend on the state list the states of head.c */
    {"*RST", "action,\"\",,,,,\"idle spin-up scanning spin-down fault\",\"\""},
    {"*CLS", "action,\"\",,,,," ALL ",\"\""},
    {"*IDN", "query,\"\",,,,," ALL ",\"\""},
    {"SYSTem:CONTrol:TAKE", "action,\"\",,,,," ALL ",\"\""},
    {"HEAD:REBoot", "action,\"\",,,,," ALL ",\"\""},
    {"HEAD:STORe", "action,\"\",,,,," ALL ",\"\""},
    {"SCAN:STARt", "action,\"\",,,,,\"idle\",\"\""},
    {"SCAN:STOP", "action,\"\",,,,,\"spin-up scanning\",\"\""},
    {"SCAN:REPLay", "setting,\"s\",,,,," ALL ",\"\""},
    {"SITE:POSE", "setting,\"m, deg\",,,,,\"idle\",\"\""},
    {"FAULt:ADD", "action,\"\",,,,," ALL ",\"\""},
    {"FAULt:LIST", "query,\"\",,,,," ALL ",\"\""},
    {"TIME:STEP", "action,\"ns\",,,,," ALL ",\"\""},
    {"TIME:SHIFt", "setting,\"ns\",,,,," ALL ",\"\""},
    {"TIME:SERVer", "setting,\"s, h\",,,,," ALL ",\"\""},
};

static void every_setting_is_described_whole(void **state)
{
    (void)state;
    struct command_device dev = full_device();
    char settings[COMMAND_MAX_REPLY], line[64];
    for (size_t i = 0; i < N_OF(rows); i++) {
        snprintf(line, sizeof line, "HELP? %s", rows[i].header);
        expect(&dev, line, rows[i].reply);
    }
    snprintf(settings, sizeof settings, "%s", say(&dev, 1, "HELP:SETtings?"));
    size_t n = 0;
    for (char *header = strtok(settings, " "); header != NULL; header = strtok(NULL, " "), n++) {
        size_t i = 0;
        while (i < N_OF(rows) && strcmp(rows[i].header, header) != 0)
            i++;
        if (i == N_OF(rows)) fail_msg("%s is not in the table above", header);
    }
    assert_int_equal(n, 22);
}

/* On a head with fixed rates, all settings but the pulse rate still accept numbers other than those rates. */
static void other_settings_take_any_value(void **state)
{
    (void)state;
    static const char *const lines[] = {
        "HEAD:LINes 100.5",   "HEAD:PAN 17.5",       "HEAD:STATION 2",  "HEAD:RANGe:MIN 1.5",    "HEAD:RANGe:MAX 399.5",
        "HEAD:NOISe:SIGMa 1", "HEAD:NOISe:BALL 1.5", "HEAD:PHASe 90.5", "SCAN:LINE:STARt -29.5", "SCAN:LINE:STOP 49.5",
        "SCAN:PAN:STARt 0.5", "SCAN:PAN:STOP 179.5", "SCAN:FRAMes 17"};
    struct command_device dev = full_device();
    for (size_t i = 0; i < N_OF(lines); i++) {
        char query[64];
        expect(&dev, lines[i], "OK");
        snprintf(query, sizeof query, "%.*s?", (int)strcspn(lines[i], " "), lines[i]);
        expect(&dev, query, strchr(lines[i], ' ') + 1);
    }
    expect(&dev, "HEAD:PRR 1001", "ERR -222,\"Data out of range; HEAD:PRR 1001, allowed 1000, 300000, 1200000 Hz\"");
}

/* TIME:SERVer takes each value at its limit, and none beyond it. */
static void a_time_server_has_limits(void **state)
{
    (void)state;
    static const char *const good[] = {"NONE,0.0.0.0,1,-12,ETH", "SERVER,255.255.255.255,86400,12,CAN"};
    static const char *const wrong[] = {"NONE,256.0.0.0,1,0,ETH", "NONE,0.256.0.0,1,0,ETH", "NONE,0.0.256.0,1,0,ETH",
                                        "NONE,0.0.0.256,1,0,ETH", "NONE,0.0.0.0,0,0,ETH",   "NONE,0.0.0.0,86401,0,ETH",
                                        "NONE,0.0.0.0,1,13,ETH",  "NONE,0.0.0.0,1,-13,ETH", "NON,0.0.0.0,1,0,ETH",
                                        "NONE,0.0.0.0,1,0,ET"};
    struct command_device dev = command_test_device();
    char line[80];
    for (size_t i = 0; i < N_OF(good); i++) {
        snprintf(line, sizeof line, "TIME:SERVer %s", good[i]);
        expect(&dev, line, "OK");
        assert_int_equal(result.effect, COMMAND_SERVER);
        expect(&dev, "TIME:SERVer?", good[i]);
    }
    for (size_t i = 0; i < N_OF(wrong); i++) {
        snprintf(line, sizeof line, "TIME:SERVer %s", wrong[i]);
        expect(&dev, line,
               "ERR -222,\"Data out of range; TIME:SERVer: allowed are NONE, CLIENT, SERVER; 0 to 255; 1 to 86400 s; "
               "-12 to 12 h; ETH, CAN\"");
    }
    expect(&dev, "TIME:SERVer?", good[1]);
    dev.answers = (struct command_time_answers){1, -2, 3, 4, 5, 6, "SET"};
    expect(&dev, "TIME:SERVer? STATe", "SET,1,-2,3,4,5,6");
}

/* A clock can be shifted by 145 years either way. */
static void a_shift_has_limits(void **state)
{
    (void)state;
    struct command_device dev = command_test_device();
    expect(&dev, "TIME:SHIFt 4600000000 S", "OK");
    expect(&dev, "TIME:SHIFt?", "4600000000000000000");
    expect(&dev, "TIME:SHIFt -4600000000 S", "OK");
    assert_true(dev.shift_ns == -INT64_C(4600000000000000000));
    expect(&dev, "TIME:SHIFt 4600000000000000001",
           "ERR -222,\"Data out of range; TIME:SHIFt 4600000000000000001 ns, allowed -4600000000000000000 to "
           "4600000000000000000\"");
    expect(&dev, "TIME:SHIFt -4600000000000000001",
           "ERR -222,\"Data out of range; TIME:SHIFt -4600000000000000001 ns, allowed -4600000000000000000 to "
           "4600000000000000000\"");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_setting_is_described_whole),
        cmocka_unit_test(other_settings_take_any_value),
        cmocka_unit_test(a_time_server_has_limits),
        cmocka_unit_test(a_shift_has_limits),
    };
    return cmocka_run_group_tests_name("help and limits of commands", tests, NULL, NULL);
}
