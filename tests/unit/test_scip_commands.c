/* SPDX-License-Identifier: MIT */
/* SCIP, the sensor's side: commands and their answers. Expected answers were written from Hokuyo's description of the
 * protocol, with sums added up apart from this program. Whole replies of an URG-04LX are those that its maker has
 * published. */
#include "tests/unit/scip_rig.h"

#define VV_URG                                                                                                 \
    "VV\n00P\nVEND:Hokuyo Automatic Co.,Ltd.;[\nPROD:SOKUIKI Sensor URG-04LX;[\nFIRM:3.1.00(18/Jan./2007);`\n" \
    "PROT:SCIP 2.0;N\nSERI:H0614967;V\n\n"
#define PP_URG                                                                                               \
    "PP\n00P\nMODL:URG-04LX(Hokuyo Automatic Co.,Ltd.);N\nDMIN:20;4\nDMAX:5600;_\nARES:1024;\\\nAMIN:44;7\n" \
    "AMAX:725;o\nAFRT:384;6\nSCAN:600;e\n\n"

static void open_published(void)
{
    scip_open("URG-04LX");
    strcpy(rig.identity.firmware, "3.1.00(18/Jan./2007)");
    strcpy(rig.identity.serial, "H0614967");
}

/* urg_library sends these first, and needs their answers. */
static void urg_library_opens(void **state)
{
    (void)state;
    open_published();
    scip_ask("\n", "");
    scip_ask("QT\n", "QT\n00P\n\n");
    scip_ask("SS115200\n", "SS115200\n00P\n\n");
    scip_ask("PP\n", PP_URG);
    scip_ask("VV\n", VV_URG);
    scip_ask("QT\n", "QT\n00P\n\n");
}

/* rawlog-grabber sends these to a UTM-30LX on a serial line, up to the first scan's command. */
static void rawlog_grabber_opens(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("QT\n", "QT\n00P\n\n");
    scip_ask("SS115200\n", "SS115200\n03S\n\n");
    scip_ask("SCIP2.0\n", "SCIP2.0\n0Ee\n\n");
    scip_ask("BM\n", "BM\n00P\n\n");
    scip_ask("HS0\n", "HS0\n03S\n\n");
    scip_ask("PP\n", "PP\n00P\nMODL:UTM-30LX(Hokuyo Automatic Co.,Ltd.);U\nDMIN:100;c\nDMAX:30000;G\nARES:1440;^\n"
                     "AMIN:0;?\nAMAX:1080;Z\nAFRT:540;0\nSCAN:2400;U\n\n");
    scip_ask("MD0000108001000\n", "MD0000108001000\n00P\n\n");
}

static void state_of_the_sensor(void **state)
{
    (void)state;
    open_published();
    rig.ops->time(rig.protocol, (0x1000000 + 0x081615) * 1000000LL + 999999); /* wrapped once */
    scip_ask("II\n", "II\n00P\nMODL:URG-04LX(Hokuyo Automatic Co.,Ltd.);N\nLASR:OFF;7\n"
                     "SCSP:Initial(600[rpm])<-Default setting by user;A\nMESM:IDLE;:\n"
                     "SBPS:19200[bps]<-Default setting by user;A\nTIME:081615;N\nSTAT:Sensor works well.;8\n\n");
    EXPECT_IN("BM\nII\n", "\nLASR:ON;9\n", "\nMESM:CLASSIC;^\n");
    /* A UST sends the time as four characters: 16000000 is "m2@0" (C-42-03320B, encoding). */
    scip_open("UST-20LX");
    rig.ops->time(rig.protocol, 16000000000000);
    EXPECT_IN("II\n", "\nTIME:m2@0;");
}

static void a_model_of_ones_own(void **state)
{
    (void)state;
    scip_open("Mine 7");
    scip_ask("VV\n", "VV\n00P\nVEND:Hokuyo;V\nPROD:Mine 7;?\nFIRM:1.2.3;J\nPROT:SCIP 2.2;P\nSERI:17210001;i\n\n");
}

static void ends_of_lines_and_tags(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("QT\r", "QT\n00P\n\n");
    scip_ask("QT\r\n\n\r\r\n", "QT\n00P\n\n");
    scip_ask("QT;\n", "QT;\n00P\n\n");
    scip_ask("QT;aZ09 ._+@0123456\n", "QT;aZ09 ._+@0123456\n00P\n\n");
    scip_ask("QT;aZ09 ._+@01234567\n", "QT;aZ09 ._+@01234567\n0Gg\n\n");
    scip_ask("QT;a-b\n", "QT;a-b\n0Hh\n\n");
    scip_ask("QT;a;b\n", "QT;a;b\n0Hh\n\n");
    scip_ask("Q", "");
    scip_ask("T;in piec", "");
    scip_ask("es\n", "QT;in pieces\n00P\n\n");
}

static void what_is_no_command(void **state)
{
    (void)state;
    static const struct {
        const char *model, *line, *status;
    } rows[] = {
        {"UTM-30LX", "XX", "0Ee"},
        {"UTM-30LX", "V", "0Ee"},
        {"UTM-30LX", "vv", "0Ee"},
        {"UTM-30LX", "SCIP2.0", "0Ee"},
        {"UTM-30LX", ";tag", "0Ee"},
        {"UTM-30LX", "QTX", "0Dd"},
        {"UTM-30LX", "TM", "0Cc"},
        {"UTM-30LX", "TM00", "0Dd"},
        {"UTM-30LX", "GD00000", "0Cc"},
        {"UTM-30LX", "GD000000000100", "0Dd"},
        {"UTM-30LX", "MD", "0Cc"},
        {"UTM-30LX", "MD00001080010", "0Cc"},
        {"UTM-30LX", "MD0000108001;0", "0Cc"},
        {"UTM-30LX", "MF0000108001000", "0Ee"},
        {"UTM-30LX", "GF0000108001", "0Ee"},
        {"UTM-30LX", "MG0000108001000", "0Ee"},
        /* commands that a model does not have */
        {"URG-04LX", "ME0044072501000", "0Ee"},
        {"URG-04LX", "HD0044072501", "0Ee"},
        {"URG-04LX", "RB", "0Ee"},
        {"URG-04LX", "%SL", "0Ee"},
        {"UST-20LX", "NE0000108001000", "0Ee"},
        {"UST-20LX", "SS115200", "0Ff"},
        {"UST-20LX", "CR01", "04T"},
        {"UST-20LX", "DB02", "04T"},
        {"UTM-30LX", "CR01", "04T"},
        {"UTM-30LX", "HS1", "03S"},
        {"UTM-30LX", "HS2", "01Q"},
        {"UTM-30LX", "HS", "0Cc"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char line[80], answer[80];
        scip_open(rows[i].model);
        snprintf(line, sizeof line, "%s\n", rows[i].line);
        snprintf(answer, sizeof answer, "%s\n%s\n\n", rows[i].line, rows[i].status);
        scip_ask(line, answer);
        assert_int_equal(rig.count[PROTOCOL_WRONG], 1);
    }
}

static void laser(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    scip_ask("GD0000108001\n", "GD0000108001\n10Q\n\n");
    scip_ask("BM\n", "BM\n00P\n\n");
    scip_ask("BM\n", "BM\n02R\n\n");
    scip_ask("QT\n", "QT\n00P\n\n");
    scip_ask("BM\n", "BM\n00P\n\n");
    scip_ask("%SL\n", "%SL\n00P\n\n");
    scip_ask("GD0000108001\n", "GD0000108001\n10Q\n\n");
}

/* The head is started from rest, and is not asked while its scans come. */
static void the_head_is_started(void **state)
{
    (void)state;
    static const struct protocol_rig_reply idle[] = {{"HEAD:STATE?", "idle", 0}, {NULL, NULL, 0}},
                                           boot[] = {{"HEAD:STATE?", "boot", 0}, {NULL, NULL, 0}},
                                           fault[] = {{"HEAD:STATE?", "fault", 0}, {NULL, NULL, 0}},
                                           taken[] = {{"HEAD:STATE?", "idle", 0},
                                                      {"SCAN:START", "ERR -203", -203},
                                                      {NULL, NULL, 0}},
                                           scanning[] = {{"HEAD:STATE?", "scanning", 0}, {NULL, NULL, 0}};
    static const struct {
        const struct protocol_rig_reply *replies;
        const char *laser, *stream;
        uint32_t n_lines;
    } rows[] = {
        {idle, "00P", "00P", 2},  {boot, "10Q", "10Q", 1},     {fault, "01Q", "50U", 1},
        {taken, "10Q", "10Q", 2}, {scanning, "00P", "00P", 1},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char answer[80];
        scip_open("UTM-30LX");
        rig.replies = rows[i].replies;
        protocol_rig_input(&rig, "BM\n");
        assert_int_equal(rig.n_lines, rows[i].n_lines);
        assert_string_equal(rig.line[0], "HEAD:STATE?");
        if (rows[i].n_lines == 2) assert_string_equal(rig.line[1], "SCAN:START");
        snprintf(answer, sizeof answer, "BM\n%s\n\n", rows[i].laser);
        scip_expect(answer);
        snprintf(answer, sizeof answer, "MD0000108001000\n%s\n\n", rows[i].stream);
        scip_ask("MD0000108001000\n", answer);
    }
    scip_open("UTM-30LX");
    rig.replies = idle;
    scip_turn(0);
    scip_ask("BM\nQT\nMD0000108001000\n", "BM\n00P\n\nQT\n00P\n\nMD0000108001000\n00P\n\n");
    assert_int_equal(rig.n_lines, 0);
}

/* 16000000 ms are "m2@0" in C-42-03320B; the sum is 109 + 50 + 64 + 48 = 271, 271 - 4 * 64 + 48 = '?'. */
static void time_adjustment(void **state)
{
    (void)state;
    scip_open("URG-04LX");
    rig.ops->time(rig.protocol, 16000000 * 1000000LL);
    scip_ask("TM1\n", "TM1\n04T\n\n");
    scip_ask("TM2\n", "TM2\n03S\n\n");
    scip_ask("TM3\n", "TM3\n01Q\n\n");
    scip_ask("BM\nTM0;a\n", "BM\n00P\n\nTM0;a\n00P\n\n");
    scip_ask("TM1\n", "TM1\n00P\nm2@0?\n\n");
    scip_ask("TM0\n", "TM0\n02R\n\n");
    scip_ask("QT\n", "QT\n0Ee\n\n"); /* by which urg_library knows the mode */
    scip_ask("BM\n", "BM\n0Ee\n\n");
    scip_ask("TM2\n", "TM2\n00P\n\n");
    scip_ask("GD0044072501\n", "GD0044072501\n10Q\n\n"); /* the laser went off */

    scip_open("UTM-30LX");
    rig.ops->time(rig.protocol, 16000000 * 1000000LL);
    scip_ask("TM1\n", "TM1\n00P\nm2@0?\n\n"); /* as real devices answer */
    scip_ask("TM0\n", "TM0\n00P\n\n");
    scip_ask("BM\n", "BM\n10Q\n\n");
    scip_ask("MD0000108001000\n", "MD0000108001000\n10Q\n\n");
    scip_ask("QT\n", "QT\n00P\n\n");
    scip_ask("TM2\n", "TM2\n03S\n\n");
    scip_ask("MD0000108001000\n", "MD0000108001000\n00P\n\n");
    scip_ask("TM0\n", "TM0\n10Q\n\n");
}

static void bit_rate(void **state)
{
    (void)state;
    scip_open("URG-04LX");
    scip_ask("SS019200\n", "SS019200\n03S\n\n");
    scip_ask("SS115200\n", "SS115200\n00P\n\n");
    scip_ask("SS115200\n", "SS115200\n03S\n\n");
    scip_ask("SS115201\n", "SS115201\n02R\n\n");
    scip_ask("SS000000\n", "SS000000\n02R\n\n");
    scip_ask("SS11520x\n", "SS11520x\n01Q\n\n");
    scip_ask("RS\n", "RS\n00P\n\n");
    scip_ask("SS019200\n", "SS019200\n03S\n\n");
}

/* A head at its own rate, and one that CR has slowed down. */
static const struct protocol_rig_reply at10[] = {{"HEAD:LINES?", "10", 0}, {NULL, NULL, 0}},
                                       at9[] = {
                                           {"HEAD:LINES? DEF", "10", 0}, {"HEAD:LINES?", "9.1", 0}, {NULL, NULL, 0}};

static void motor_speed(void **state)
{
    (void)state;
    static const struct protocol_rig_reply thirds[] = {{"HEAD:LINES?", "33.333333", 0}, {NULL, NULL, 0}},
                                           narrow[] = {
                                               {"HEAD:LINES?", "10", 0}, {"HEAD:LINES ", "ERR", -222}, {NULL, NULL, 0}};
    scip_open("URG-04LX");
    rig.replies = at10;
    scip_ask("CR00\n", "CR00\n03S\n\n");
    scip_ask("CR99\n", "CR99\n03S\n\n");
    scip_ask("CR11\n", "CR11\n02R\n\n");
    scip_ask("CRx0\n", "CRx0\n01Q\n\n");
    assert_int_equal(rig.n_lines, 0);
    protocol_rig_input(&rig, "CR09\n");
    assert_string_equal(rig.line[rig.n_lines - 1], "HEAD:LINES 9.100000");
    scip_expect("CR09\n00P\n\n");
    rig.replies = at9;
    scip_ask("CR09\n", "CR09\n03S\n\n");
    EXPECT_IN("PP\n", "\nSCAN:600;e\n"); /* the standard speed, whatever it is now */
    EXPECT_IN("II\n", "\nSCSP:Initial(546[rpm]);");
    rig.replies = thirds; /* a rate that 100 does not divide */
    scip_ask("CR00\n", "CR00\n03S\n\n");
    protocol_rig_input(&rig, "CR01\n");
    assert_string_equal(rig.line[rig.n_lines - 1], "HEAD:LINES 32.999999");
    scip_expect("CR01\n00P\n\n");
    rig.replies = narrow;
    scip_ask("CR10\n", "CR10\n04T\n\n");
}

/* RS and RT bring the speed back, also one that an earlier session has set. */
static void speed_is_reset(void **state)
{
    (void)state;
    scip_open("URG-04LX");
    rig.replies = at9;
    protocol_rig_input(&rig, "RS\n");
    assert_string_equal(rig.line[rig.n_lines - 1], "HEAD:LINES DEF");
    scip_expect("RS\n00P\n\n");
    rig.replies = at10;
    protocol_rig_input(&rig, "RS\n");
    for (uint32_t i = 0; i < rig.n_lines; i++)
        assert_string_not_equal(rig.line[i], "HEAD:LINES DEF");
    scip_open("UTM-30LX"); /* it has no CR, and so another speed is not this client's affair */
    rig.replies = at9;
    scip_ask("RS\n", "RS\n00P\n\n");
    assert_int_equal(rig.n_lines, 0);
}

/* Another session controls the head. The stream goes on: its next scan comes. */
static void a_refused_reset_changes_nothing(void **state)
{
    (void)state;
    static const struct protocol_rig_reply taken[] = {
        {"HEAD:LINES? DEF", "10", 0}, {"HEAD:LINES?", "9.1", 0}, {"HEAD:LINES ", "ERR -203", -203}, {NULL, NULL, 0}};
    scip_open("URG-04LX");
    rig.replies = taken;
    scip_ask("MD0044004401000\n", "MD0044004401000\n00P\n\n");
    protocol_rig_input(&rig, "RS\n");
    assert_string_equal(rig.line[rig.n_lines - 1], "HEAD:LINES DEF");
    scip_expect("RS\n10Q\n\n");
    scip_turn(0);
    assert_true(rig.len > 0);
}

static void reset_and_reboot(void **state)
{
    (void)state;
    scip_open("UTM-30LX");
    rig.ops->time(rig.protocol, 16000000 * 1000000LL);
    scip_ask("BM\nRT\nTM1\n", "BM\n00P\n\nRT\n00P\n\nTM1\n00P\nm2@0?\n\n");
    scip_ask("BM\nRS\nTM1\n", "BM\n00P\n\nRS\n00P\n\nTM1\n00P\n00000\n\n");
    scip_ask("GD0000108001\n", "GD0000108001\n10Q\n\n");
    scip_ask("RB\n", "RB\n01Q\n\n");
    rig.ops->time(rig.protocol, 16000000 * 1000000LL + 1000000001); /* too late */
    scip_ask("RB\n", "RB\n01Q\n\n");
    rig.ops->time(rig.protocol, 16000000 * 1000000LL + 2000000001);
    scip_ask("BM\nRB\n", "BM\n00P\n\nRB\n00P\n\n");
    const uint32_t n_lines = rig.n_lines;
    rig.ops->time(rig.protocol, 16000000 * 1000000LL + 3000000000);
    assert_int_equal(rig.n_lines, n_lines);
    rig.ops->time(rig.protocol, 16000000 * 1000000LL + 3000000001);
    assert_string_equal(rig.line[rig.n_lines - 1], "HEAD:REBOOT");
    assert_false(rig.hung_up); /* the power cycle ends it */

    /* The laser is off from the second RB on, and sends no scan any more. */
    scip_open("UTM-30LX");
    scip_flat(1.0);
    scip_ask("BM\nMD0000000101000\n", "BM\n00P\n\nMD0000000101000\n00P\n\n");
    scip_ask("RB\nRB\n", "RB\n01Q\n\nRB\n00P\n\n");
    scip_turn(0);
    scip_turn(1);
    scip_expect("");

    /* There is no head to reboot. Only the session begins anew, and the device's time goes on. */
    static const struct protocol_rig_reply recorded[] = {{"HEAD:REBOOT", "ERR", -221}, {NULL, NULL, 0}};
    scip_open("UTM-30LX");
    rig.replies = recorded;
    scip_ask("BM\nRB\nRB\n", "BM\n00P\n\nRB\n01Q\n\nRB\n00P\n\n");
    rig.ops->time(rig.protocol, 16000000 * 1000000LL);
    assert_true(rig.hung_up);
    scip_ask("GD0000108001\nTM1\n", "GD0000108001\n10Q\n\nTM1\n00P\nm2@0?\n\n");
}

/* A client that closes before the reboot is due doesn't stop it; one that asked for none starts none (SCIP.md). */
static void a_client_that_goes_reboots_at_once(void **state)
{
    (void)state;
    for (int asks = 0; asks <= 2; asks++) {
        scip_open("UTM-30LX");
        for (int i = 0; i < asks; i++)
            protocol_rig_input(&rig, "RB\n");
        const uint32_t n_lines = rig.n_lines;
        rig.ops->gone(rig.protocol);
        assert_int_equal(rig.n_lines, n_lines + (asks == 2));
        if (asks == 2) assert_string_equal(rig.line[n_lines], "HEAD:REBOOT");
    }
}

/* If there is no head to reboot, all that a session had is as at power-up: time mode, sleep, bit rate, a scan that was
 * asked for, a malfunction. The reboot is over, too. */
static void a_reboot_begins_anew(void **state)
{
    (void)state;
    static const struct protocol_rig_reply recorded[] = {{"HEAD:REBOOT", "ERR", -221}, {NULL, NULL, 0}};
    static const char *const states[] = {"SS500000\n",       "TM0\n", "%SL\n", "DB02\n", "BM\nGD0000108001\n",
                                         "MD0000108000000\n"};
    for (size_t i = 0; i < sizeof states / sizeof *states; i++) {
        scip_open("mine");
        rig.replies = recorded;
        scip_ask("%ST\n", "%ST\n00P\n000@\n\n");
        protocol_rig_input(&rig, states[i]);
        protocol_rig_input(&rig, "RB\nRB\n");
        protocol_rig_input(&rig, states[i]);
        assert_true(rig.ops->owes(rig.protocol));
        rig.ops->time(rig.protocol, 1000000000);
        assert_true(rig.hung_up);
        assert_false(rig.ops->owes(rig.protocol));
        protocol_rig_clear(&rig);
        scip_ask("%ST\n", "%ST\n00P\n000@\n\n");
        EXPECT_IN("II\n", "\nLASR:OFF;7\n", "\nMESM:000 Idle;", "\nSBPS:115200[bps];", "\nSTAT:Stable 000 no error.;");
        const uint32_t n_lines = rig.n_lines;
        rig.ops->time(rig.protocol, 2000000000);
        for (uint32_t k = n_lines; k < rig.n_lines; k++)
            assert_string_not_equal(rig.line[k], "HEAD:REBOOT");
        scip_ask("RB\nDB10\n", "RB\n01Q\n\nDB10\n03S\n\n");
    }
}

/* A head that is not planar, or has more steps than a unit has room for, gives no scans. */
static void heads_that_dont_fit(void **state)
{
    (void)state;
    scip_teardown(NULL);
    protocol_rig_open(&rig, PROTOCOL_SCIP, "Hokuyo", "UTM-30LX");
    protocol_rig_input(&rig, "PP\nMD0000108001000\nVV\n"); /* before the head has described itself */
    assert_memory_equal(rig.bytes, "PP\n0Aa\n\nMD0000108001000\n0Aa\n\nVV\n00P\n", 36);
    scip_open_head("UTM-30LX", 5760, 0, 2879, 1440, -1, 40);
    protocol_rig_describe(&rig, 0);
    scip_ask("BM\nMD0000287901000\n", "BM\n00P\n\nMD0000287901000\n00P\n\n");
    scip_open_head("UTM-30LX", 5760, 0, 2880, 1440, -1, 40);
    protocol_rig_describe(&rig, 0);
    scip_ask("PP\nMD0000108001000\n", "PP\n0Aa\n\nMD0000108001000\n0Aa\n\n");
    scip_teardown(NULL);
    protocol_rig_open(&rig, PROTOCOL_SCIP, "Hokuyo", "UTM-30LX");
    protocol_rig_beams(&rig, 10);
    protocol_rig_describe(&rig, 0);
    scip_ask("PP\nGD0000108001\n", "PP\n0Aa\n\nGD0000108001\n0Aa\n\n");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(urg_library_opens),
        cmocka_unit_test(rawlog_grabber_opens),
        cmocka_unit_test(state_of_the_sensor),
        cmocka_unit_test(a_model_of_ones_own),
        cmocka_unit_test(ends_of_lines_and_tags),
        cmocka_unit_test(what_is_no_command),
        cmocka_unit_test(laser),
        cmocka_unit_test(the_head_is_started),
        cmocka_unit_test(time_adjustment),
        cmocka_unit_test(bit_rate),
        cmocka_unit_test(motor_speed),
        cmocka_unit_test(speed_is_reset),
        cmocka_unit_test(a_refused_reset_changes_nothing),
        cmocka_unit_test(reset_and_reboot),
        cmocka_unit_test(a_reboot_begins_anew),
        cmocka_unit_test(a_client_that_goes_reboots_at_once),
        cmocka_unit_test(heads_that_dont_fit),
    };
    return cmocka_run_group_tests(tests, NULL, scip_teardown);
}
