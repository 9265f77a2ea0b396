/* SPDX-License-Identifier: MIT */
/* Command lines one by one: replies, errors, the status byte, places, faults on request. */
#include "tests/unit/command_device.h"

struct wrong {
    const char *line;
    int number;
};

static void expect_errors(struct command_device *dev, const struct wrong *wrong, size_t n)
{
    for (size_t i = 0; i < n; i++)
        expect_error(dev, 1, wrong[i].line, wrong[i].number, "");
}

static void replies_of_queries(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    expect(&dev, "*IDN?", "Maker,Model,Serial,1.0");
    expect(&dev, "*OPC?", "1");
    expect(&dev, "SYST:VERS?", "1999.0");
    expect(&dev, "SYST:ERR?", "0,\"No error\"");
    expect(&dev, "SYST:ERR:COUN?", "0");
    expect(&dev, "SYST:CONT?", "0");
    expect(&dev, "HEAD:PRR?", "300000");
    expect(&dev, "HEAD:LIN?", "100");
    expect(&dev, "SCAN:LINE:STAR?", "-30");
    expect(&dev, "SCAN:COUN?", "7");
    expect(&dev, "TIME?", "1234567890123");
    expect(&dev, "TIME:UTC?", "2026-01-01T00:20:34.567890123Z");
    expect(&dev, "TIME:GPS?", "2399,346852.567890123");
    expect(&dev, "TIME:PTP?", "SLAVE,s2,-12,850,00b0ae.fffe.000001,6,0x21,1");
    dev.settings.line_start_udeg = -1;
    expect(&dev, "SCAN:LINE:STAR?", "-0.000001");
    dev.settings.line_start_udeg = -1500000;
    expect(&dev, "SCAN:LINE:STAR?", "-1.5");
    expect(&dev, "", "");
    expect(&dev, " \t ", "");
    assert_int_equal(dev.queue.count, 0);
    assert_int_equal(dev.control, 0); /* reading takes no control */
}

static void status_byte(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    expect(&dev, "*STB?", "0");
    dev.state = HEAD_SCANNING;
    expect(&dev, "*STB?", "128");
    command_queue_push(&dev.queue, CMD_E_PULSES, NULL);
    expect(&dev, "*STB?", "132");
    dev.state = HEAD_SPIN_DOWN;
    expect(&dev, "*STB?", "4");
    expect(&dev, "*CLS", "OK");
    expect(&dev, "*STB?", "0");
}

static void state_names_and_control(void **ctx)
{
    (void)ctx;
    static const char *const names[] = {"off", "boot", "idle", "spin-up", "scanning", "spin-down", "fault"};
    struct command_device dev = command_test_device();
    for (int state = 0; state < HEAD_N_STATES; state++) {
        dev.state = (enum head_state)state;
        expect(&dev, "HEAD:STAT?", names[state]);
    }
}

static void wrong_lines_give_one_error(void **ctx)
{
    (void)ctx;
    static const struct wrong wrong[] = {
        {";", CMD_E_SYNTAX},
        {"*IDN?;*RST", CMD_E_SYNTAX},
        {"HEAD:PRR 300000;", CMD_E_SYNTAX},
        {"?", CMD_E_SYNTAX},
        {"300000", CMD_E_HEADER},
        {"HEAD:PRR?MAX", CMD_E_SYNTAX},
        {"HEAD:PRR,300000", CMD_E_SYNTAX},
        {"HEAD:PRR~", CMD_E_SYNTAX},
        {"\x01\x02", CMD_E_SYNTAX},
        {"HEAD:PRR\xc2\xa0"
         "5",
         CMD_E_SYNTAX},
        {":*IDN?", CMD_E_SYNTAX},
        {"*", CMD_E_HEADER},
        {":", CMD_E_SYNTAX},
        {"FOO", CMD_E_HEADER},
        {"HEAD::PRR 5", CMD_E_HEADER},
        {"HEAD:PRR: 5", CMD_E_HEADER},
        {"SYST:NEXT?", CMD_E_HEADER},
        {"SYST:ERR:NEXT:NEXT?", CMD_E_HEADER},
        {"HEAD:STAT 2", CMD_E_HEADER},
        {"*RST?", CMD_E_HEADER},
        {"TIME:STEP?", CMD_E_HEADER},
        {"*IDN", CMD_E_HEADER},
        {"*RST 1", CMD_E_NOT_ALLOWED},
        {"*IDN? 1", CMD_E_NOT_ALLOWED},
        {"SCAN:START 5", CMD_E_NOT_ALLOWED},
        {"HEAD:PRR 1,2", CMD_E_NOT_ALLOWED},
        {"HEAD:PRR 1,", CMD_E_NOT_ALLOWED},
        {"HEAD:PRR? 300000", CMD_E_NOT_ALLOWED},
        {"HEAD:PRR? MAX,MIN", CMD_E_NOT_ALLOWED},
        {"HEAD:STAT? MAX", CMD_E_NOT_ALLOWED},
        {"HEAD:PRR", CMD_E_MISSING},
        {"TIME:STEP ", CMD_E_MISSING},
        {"HEAD:PRR fast", CMD_E_DATA_TYPE},
        {"HEAD:PRR \"300000\"", CMD_E_DATA_TYPE},
        {"HEAD:PRR #HFFFF", CMD_E_DATA_TYPE},
        {"HEAD:PRR 300 000", CMD_E_DATA_TYPE},
        {"HEAD:PRR 1.2.3", CMD_E_DATA_TYPE},
        {"HEAD:PRR .", CMD_E_DATA_TYPE},
        {"HEAD:PRR +-5", CMD_E_DATA_TYPE},
        {"HEAD:PRR - 5", CMD_E_DATA_TYPE},
        {"HEAD:PRR e5", CMD_E_DATA_TYPE},
        {"HEAD:PRR NAN", CMD_E_DATA_TYPE},
        {"HEAD:PRR INF", CMD_E_DATA_TYPE},
        {"HEAD:PRR MAXI", CMD_E_DATA_TYPE},
        {"HEAD:PRR ?", CMD_E_DATA_TYPE},
        {"TIME:STEP MAX", CMD_E_DATA_TYPE},
        {"HEAD:PRR 0x1000", CMD_E_SUFFIX},
        {"HEAD:PRR 300000 DEG", CMD_E_SUFFIX},
        {"HEAD:PRR 300000 HZ HZ", CMD_E_SUFFIX},
        {"HEAD:PRR 300000e", CMD_E_SUFFIX},
        {"HEAD:PRR 3e+ HZ", CMD_E_SUFFIX},
        {"SCAN:LINE:STOP 1 HZ", CMD_E_SUFFIX},
        {"HEAD:PAN 1 DEG", CMD_E_SUFFIX},
        {"SCAN:FRAMES 2 HZ", CMD_E_SUFFIX},
        {"TIME:STEP 5", CMD_E_SETTINGS},
    };
    struct command_device dev = command_test_device();
    expect_errors(&dev, wrong, N_OF(wrong));
    /* A query says what it takes. */
    expect_error(&dev, 1, "HEAD:STAT? MAX", CMD_E_NOT_ALLOWED, "HEAD:STATe? takes no parameter\"");
    expect_error(&dev, 1, "HEAD:PRR? 5", CMD_E_NOT_ALLOWED, "HEAD:PRR? takes no parameter but MIN, MAX or DEF\"");
    expect_error(&dev, 1, "TIME:STEP?", CMD_E_HEADER, "TIME:STEP has no query form");
    expect_error(&dev, 1, "HEAD:PRR 300000 DEG", CMD_E_SUFFIX, "'DEG'; HEAD:PRR takes ");
    /* A number without a setting has no MIN, MAX or DEF, and the error does not offer them. */
    expect_error(&dev, 1, "TIME:STEP MAX", CMD_E_DATA_TYPE, "TIME:STEP takes a number, not 'MAX'");
    expect_error(&dev, 1, "HEAD:PRR fast", CMD_E_DATA_TYPE, "HEAD:PRR takes a number, MIN, MAX or DEF, not 'fast'");
}

static void a_line_too_long_is_dropped_whole(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    char line[COMMAND_MAX_LINE + 2];
    memset(line, ' ', sizeof line);
    memcpy(line, "HEAD:PRR 5000", 13);
    line[COMMAND_MAX_LINE] = '\0';
    expect(&dev, line, "OK");
    assert_int_equal(dev.settings.prr_uhz, 5000 * MICRO);
    line[COMMAND_MAX_LINE] = ' ';
    line[COMMAND_MAX_LINE + 1] = '\0';
    expect_error(&dev, 1, line, CMD_E_OVERRUN, "");
}

static void a_head_without_the_time_says_so(void **ctx)
{
    (void)ctx;
    struct command_device dev = command_test_device();
    dev.utc[0] = dev.gps[0] = dev.ptp[0] = '\0';
    expect_error(&dev, 1, "TIME:UTC?", CMD_E_SETTINGS, "");
    expect_error(&dev, 1, "TIME:GPS?", CMD_E_SETTINGS, "");
    expect_error(&dev, 1, "TIME:PTP?", CMD_E_SETTINGS, "");
}

/* Station 2 has numbers that are hard to print (command_device.c). */
static void a_place_is_read_and_said(void **ctx)
{
    (void)ctx;
    static const struct wrong wrong[] = {
        {"SITE:POSE", CMD_E_MISSING},
        {"SITE:POSE 1", CMD_E_MISSING},
        {"SITE:POSE 1,0,0,0,0,0", CMD_E_MISSING},
        {"SITE:POSE 1,0,0,0,0,0,0,0", CMD_E_NOT_ALLOWED},
        {"SITE:POSE 1,DEF,0", CMD_E_NOT_ALLOWED},
        {"SITE:POSE 1,MAX", CMD_E_DATA_TYPE},
        {"SITE:POSE 1,0,0,0,0,0,", CMD_E_DATA_TYPE},
        {"SITE:POSE 1,0,0,0x10,0,0,0", CMD_E_SUFFIX},
        {"SITE:POSE 1,0,nan,0,0,0,0", CMD_E_DATA_TYPE},
        {"SITE:POSE 1,0,inf,0,0,0,0", CMD_E_DATA_TYPE},
        {"SITE:POSE one,0,0,0,0,0,0", CMD_E_DATA_TYPE},
        {"SITE:POSE 1,0,0,0,0 M,0,0", CMD_E_SUFFIX},
        {"SITE:POSE 1,0 DEG,0,0,0,0,0", CMD_E_SUFFIX},
        {"SITE:POSE 1,1e300,0,0,0,0,0", CMD_E_RANGE},
        {"SITE:POSE 1,1e32000,0,0,0,0,0", CMD_E_RANGE},
        {"SITE:POSE 1,1000000001,0,0,0,0,0", CMD_E_RANGE},
        {"SITE:POSE 1,0,0,0,360.1,0,0", CMD_E_RANGE},
        {"SITE:POSE 1,0,0,0,0,-90.001,0", CMD_E_RANGE},
        {"SITE:POSE 1,0,0,0,0,0,181", CMD_E_RANGE},
        {"SITE:POSE 0,0,0,0,0,0,0", CMD_E_RANGE},
        {"SITE:POSE 4,0,0,0,0,0,0", CMD_E_RANGE},
        {"SITE:POSE -1,0,0,0,0,0,0", CMD_E_RANGE},
        {"SITE:POSE 1.5,0,0,0,0,0,0", CMD_E_RANGE},
        {"SITE:POSE 4294967297,0,0,0,0,0,0", CMD_E_RANGE},
        {"SITE:POSE? ", CMD_E_MISSING},
        {"SITE:POSE? 4", CMD_E_RANGE},
        {"SITE:POSE? 1,2", CMD_E_NOT_ALLOWED},
        {"SITE:POSE? 1,MIN,MAX", CMD_E_NOT_ALLOWED},
        {"SITE:POSE? 1,", CMD_E_NOT_ALLOWED},
    };
    struct command_device dev = command_test_device();
    expect_errors(&dev, wrong, N_OF(wrong));
    expect(&dev, "SITE:POSE? 2", "-0.1,5e-07,1000000000,359.5,-90,0.3333333333333333");
    expect(&dev, "SITE:POSE? 2, MIN", "-1000000000,-1000000000,-1000000000,-360,-90,-180");
    expect(&dev, "SITE:POSE? 2 , DEFault", "4,5,6,0,0,0");
    expect(&dev, "SITE:POSE 2, 1e0 m , +.5 M,-0,  3.6E2 deg,90, -180", "OK");
    const double *v = result.place.v;
    assert_true(result.effect == COMMAND_MOVE && result.station == 2 && !result.to_first && result.changes);
    assert_true(v[0] == 1.0 && v[1] == 0.5 && v[2] == 0.0 && v[3] == 360.0 && v[4] == 90.0 && v[5] == -180.0);
    expect(&dev, "SITE:POSE 2, 1 E2, 2e 1,-3 e -1 M,0,0,0", "OK"); /* blanks as in IEEE 488.2, 7.7.2.4.1 */
    assert_true(v[0] == 100.0 && v[1] == 20.0 && v[2] == -0.3);
    expect(&dev, "SITE:POSE 2, DEF", "OK");
    assert_true(result.effect == COMMAND_MOVE && result.to_first);
    dev.moving = 2;
    expect_error(&dev, 1, "SITE:POSE 1,0,0,0,0,0,0", CMD_E_SETTINGS, "");
    expect_error(&dev, 1, "SCAN:STAR", CMD_E_SETTINGS, "");
    dev.moving = 0;
    dev.limits.elsewhere = 2;
    expect_error(&dev, 1, "SITE:POSE 2,0,0,0,0,0,0", CMD_E_SETTINGS, "");
    dev.fixed = "it flies";
    expect_error(&dev, 1, "SITE:POSE 1,0,0,0,0,0,0", CMD_E_SETTINGS, "");
    expect(&dev, "SITE:POSE? 1", "1,2,3,0,0,0");
}

/* test_fault_config.c tests what faults mean. This test has only the commands and their replies; command_device.c
 * stands for the list of faults. */
static void faults_are_added_listed_counted_and_cleared(void **ctx)
{
    (void)ctx;
    static const struct wrong wrong[] = {
        {"FAUL:ADD", CMD_E_MISSING},
        {"FAUL:ADD drop", CMD_E_DATA_TYPE},
        {"FAUL:ADD 3", CMD_E_DATA_TYPE},
        {"FAUL:ADD {kind: dorp}", CMD_E_RANGE},
        {"FAUL:ADD? {kind: drop}", CMD_E_HEADER},
        {"FAUL:CLE", CMD_E_MISSING},
        {"FAUL:CLE 2", CMD_E_RANGE},
        {"FAUL:CLE 0", CMD_E_DATA_TYPE},
        {"FAUL:CLE -1", CMD_E_DATA_TYPE},
        {"FAUL:CLE 1.5", CMD_E_DATA_TYPE},
        {"FAUL:CLE 4294967296", CMD_E_DATA_TYPE},
        {"FAUL:CLE 1 HZ", CMD_E_DATA_TYPE},
        {"FAUL:CLE 1,2", CMD_E_DATA_TYPE},
        {"FAUL:CLE NONE", CMD_E_DATA_TYPE},
        {"FAUL:INJ 1", CMD_E_HEADER},
        {"FAUL:INJ? 3", CMD_E_RANGE},
        {"FAUL:INJ? drop", CMD_E_DATA_TYPE},
        {"FAUL:LIST? 1", CMD_E_NOT_ALLOWED},
        {"FAUL:LIST", CMD_E_HEADER},
    };
    struct command_device dev = command_test_device();
    expect_errors(&dev, wrong, N_OF(wrong));
    dev.control = 0;
    expect(&dev, "FAUL:ADD   {kind: drop}  ", "3");
    assert_true(result.changes && result.took_control && result.effect == COMMAND_FAULTS);
    expect(&dev, "FAUL:LIST?", "1 drop");
    assert_false(result.changes);
    expect(&dev, "FAUL:INJ?", "40");
    expect(&dev, "FAUL:INJ? ALL", "40");
    expect(&dev, "FAUL:INJ? 2", "42"); /* one that was taken out */
    expect(&dev, "FAUL:CLE 1", "OK");
    assert_true(result.changes && result.effect == COMMAND_FAULTS);
    expect(&dev, "FAUL:CLE all", "OK");
    expect_error(&dev, 2, "FAUL:ADD {kind: drop}", CMD_E_PROTECTED, ""); /* session 1 has control */
    expect_error(&dev, 2, "FAUL:CLE ALL", CMD_E_PROTECTED, "");
    dev.faults = NULL;
    expect_error(&dev, 1, "FAUL:ADD {kind: drop}", CMD_E_SETTINGS, "");
    expect_error(&dev, 1, "FAUL:LIST?", CMD_E_SETTINGS, "");
    expect_error(&dev, 1, "FAUL:INJ?", CMD_E_SETTINGS, "");
    expect_error(&dev, 1, "FAUL:CLE 1", CMD_E_SETTINGS, "");
}

/* TIME:SERVer and TIME:SHIFt. Both commands are open to sessions without control, as a scanner's clients have none. */
static void a_time_server_is_set_and_read(void **ctx)
{
    (void)ctx;
    static const struct wrong wrong[] = {
        {"TIME:SERV", CMD_E_MISSING},
        {"TIME:SERV CLIENT", CMD_E_DATA_TYPE},
        {"TIME:SERV CLIENT,127.0.0.1,600,0,ETH,1", CMD_E_DATA_TYPE},
        {"TIME:SERV CLIENT,127.0.0.1.1,600,0,ETH", CMD_E_DATA_TYPE},
        {"TIME:SERV CLIENT,localhost,600,0,ETH", CMD_E_DATA_TYPE},
        {"TIME:SERV CLIENTS,127.0.0.1,600,0,ETH", CMD_E_RANGE},
        {"TIME:SERV CLIENT,127.0.0.256,600,0,ETH", CMD_E_RANGE},
        {"TIME:SERV CLIENT,127.0.0.1,0,0,ETH", CMD_E_RANGE},
        {"TIME:SERV CLIENT,127.0.0.1,86401,0,ETH", CMD_E_RANGE},
        {"TIME:SERV CLIENT,127.0.0.1,600,13,ETH", CMD_E_RANGE},
        {"TIME:SERV CLIENT,127.0.0.1,600,0,USB", CMD_E_RANGE},
        {"TIME:SERV CLIENT,127.0.0.1,600,0,ETH", CMD_E_SETTINGS}, /* nobody is there who asks */
        {"TIME:SERV? ALL", CMD_E_NOT_ALLOWED},
        {"TIME:SHIF 1e19", CMD_E_RANGE},
        {"TIME:SHIF 0.5", CMD_E_RANGE},
        {"TIME:SHIF", CMD_E_MISSING},
    };
    struct command_device dev = command_test_device();
    dev.server.update_s = 600;
    expect_errors(&dev, wrong, N_OF(wrong));
    expect(&dev, "TIME:SERV?", "NONE,0.0.0.0,600,0,ETH");
    expect(&dev, "TIME:SERV? STAT", "OFF,0,0,0,0,0,0");
    dev.control = 2;
    dev.asks_server = 1;
    expect(&dev, "time:server client , 10.0.0.255, 86400, -12, can", "OK");
    assert_true(result.changes && result.effect == COMMAND_SERVER && dev.control == 2);
    expect(&dev, "TIME:SERV?", "CLIENT,10.0.0.255,86400,-12,CAN");
    expect(&dev, "TIME:SHIF -1.5 S", "OK");
    assert_true(result.changes && result.effect == COMMAND_CLOCK);
    expect(&dev, "TIME:SHIF?", "-1500000000");
    expect(&dev, "TIME:SHIF 4.6e18", "OK");
    assert_true(dev.shift_ns == INT64_C(4600000000000000000));
    dev.recorded = "a recording";
    expect_error(&dev, 1, "TIME:SHIF 1", CMD_E_SETTINGS, "");
    expect_error(&dev, 1, "TIME:SERV NONE,127.0.0.1,5,0,ETH", CMD_E_SETTINGS, "");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(replies_of_queries),
        cmocka_unit_test(status_byte),
        cmocka_unit_test(state_names_and_control),
        cmocka_unit_test(wrong_lines_give_one_error),
        cmocka_unit_test(a_line_too_long_is_dropped_whole),
        cmocka_unit_test(a_head_without_the_time_says_so),
        cmocka_unit_test(a_place_is_read_and_said),
        cmocka_unit_test(faults_are_added_listed_counted_and_cleared),
        cmocka_unit_test(a_time_server_is_set_and_read),
    };
    return cmocka_run_group_tests_name("command", tests, NULL, NULL);
}
