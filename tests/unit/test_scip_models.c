/* SPDX-License-Identifier: MIT */
/* SCIP, the sensor's side: each model's description of itself, and of its state. Whole replies of the URG-04LX and the
 * UTM-30LX are those of real devices (SCIP.md, source D), with their sums. Sums of the others were added up apart from
 * this program. */
#include "drivers/protocol/scip_model.h"
#include "tests/unit/scip_rig.h"

static const struct protocol_rig_reply BOOTS[] = {{"HEAD:STATE?", "boot", 0}, {NULL, NULL, 0}},
                                       FAILED[] = {{"HEAD:STATE?", "fault", 0}, {NULL, NULL, 0}},
                                       AT_40[] = {{"HEAD:LINES?", "40", 0}, {NULL, NULL, 0}},
                                       AT_10[] = {{"HEAD:LINES?", "10", 0}, {NULL, NULL, 0}};

/* Opens a session of a model whose firmware is known when it begins. */
static void open_with(const char *model, const char *firmware, const char *serial, double min_m, double max_m)
{
    struct sh_err err;
    scip_open(model);
    strcpy(rig.identity.firmware, firmware);
    strcpy(rig.identity.serial, serial);
    protocol_destroy(rig.ops, rig.protocol);
    assert_int_equal(protocol_create(rig.ops, &rig.spec, &rig.protocol, &err), 0);
    rig.ops->open(rig.protocol, 0);
    rig.descriptor.range_min_m = min_m;
    rig.descriptor.range_max_m = max_m;
    protocol_rig_describe(&rig, 0);
    protocol_rig_clear(&rig);
}

static void time_is_ms(int64_t ms)
{
    rig.ops->time(rig.protocol, ms * 1000000);
}

static void a_utm_with_usb(void **state)
{
    (void)state;
    open_with("UTM-30LX", "P.1.05(17/Apr./2009)", "00903971", 0.023, 60);
    rig.replies = AT_40;
    time_is_ms(0x4991d0);
    scip_ask("VV\n", "VV\n00P\nVEND:Hokuyo Automatic Co.,Ltd.;[\nPROD:SOKUIKI Sensor TOP-URG UTM-30LX;P\n"
                     "FIRM:P.1.05(17/Apr./2009);M\nPROT:SCIP 2.0;N\nSERI:00903971;:\n\n");
    scip_ask("PP\n", "PP\n00P\nMODL:UTM-30LX(Hokuyo Automatic Co.,Ltd.);U\nDMIN:23;7\nDMAX:60000;J\nARES:1440;^\n"
                     "AMIN:0;?\nAMAX:1080;Z\nAFRT:540;0\nSCAN:2400;U\n\n");
    scip_ask("BM\n", "BM\n00P\n\n");
    scip_ask("II\n", "II\n00P\nMODL:UTM-30LX(Hokuyo Automatic Co.,Ltd.);U\nLASR:ON;9\n"
                     "SCSP:Initial(2400[rpm])<-Default setting by user;1\nMESM:CLASSIC;^\nSBPS:USB Full Speed;P\n"
                     "TIME:4991D0;d\nSTAT:Sensor works well.;8\n\n");
    scip_ask("CR00\n", "CR00\n04T\n\n");
    scip_ask("HD0000108001\nND0000108001000\n", "HD0000108001\n0Ee\n\nND0000108001000\n0Ee\n\n");
}

static void a_urg(void **state)
{
    (void)state;
    open_with("URG-04LX", "3.1.04(02/Aug./2007)", "H0706400", 0.02, 5.6);
    rig.replies = AT_10;
    time_is_ms(0x6a5404);
    scip_ask("VV\n", "VV\n00P\nVEND:Hokuyo Automatic Co.,Ltd.;[\nPROD:SOKUIKI Sensor URG-04LX;[\n"
                     "FIRM:3.1.04(02/Aug./2007);a\nPROT:SCIP 2.0;N\nSERI:H0706400;F\n\n");
    scip_ask("BM\n", "BM\n00P\n\n");
    scip_ask("II\n", "II\n00P\nMODL:URG-04LX(Hokuyo Automatic Co.,Ltd.);N\nLASR:ON;9\n"
                     "SCSP:Initial(600[rpm])<-Default setting by user;A\nMESM:CLASSIC;^\n"
                     "SBPS:19200[bps]<-Default setting by user;A\nTIME:6A5404;]\nSTAT:Sensor works well.;8\n\n");
    scip_ask("CR00\n", "CR00\n03S\n\n");
}

/* Clients look for UTM and UST at the beginning of PROD, and for three numbers in FIRM. */
static void a_utm_with_ethernet(void **state)
{
    (void)state;
    open_with("UTM-30LX-EW", "1.1.0 (2011-09-30)", "H0123456", 0.023, 60);
    rig.replies = AT_40;
    EXPECT_IN("VV\n", "\nVEND:Hokuyo Automatic Co., Ltd.;", "\nPROD:UTM-30LX-EW;", "\nFIRM:1.1.0 (2011-09-30);",
              "\nPROT:SCIP 2.2;");
    EXPECT_IN("PP\n", "\nMODL:UTM-30LX-EW;", "\nDMIN:23;", "\nDMAX:60000;");
    EXPECT_IN("II\n", "\nSCSP:2400;", "\nMESM:000 Idle;", "\nSBPS:Ethernet 100 [Mbps];",
              "\nSTAT:Stable 000 no error.;");
    scip_ask("SS115200\n", "SS115200\n0Ff\n\n");
    scip_ask("%TM1\n", "%TM1\n0Ee\n\n"); /* its firmware counts milliseconds */
    scip_ask("ND0000108001000\n", "ND0000108001000\n00P\n\n");
    EXPECT_IN("II\n", "\nMESM:004 Multi_scan;");
}

static void usts(void **state)
{
    (void)state;
    static const char *const names[] = {"UST-10LX", "UST-20LX"};
    for (size_t i = 0; i < 2; i++) {
        char prod[32], modl[32];
        snprintf(prod, sizeof prod, "\nPROD:%s;", names[i]);
        snprintf(modl, sizeof modl, "\nMODL:%s;", names[i]);
        open_with(names[i], "2.23.0000", "H1614934", 0.02, 30);
        rig.replies = AT_40;
        EXPECT_IN("VV\n", prod, "\nVEND:Hokuyo Automatic Co., Ltd.;", "\nPROT:SCIP 2.2;");
        EXPECT_IN("PP\n", modl, "\nDMIN:20;", "\nDMAX:30000;");
        EXPECT_IN("II\n", "\nSCSP:2400;", "\nMESM:Measuring by Sensitive Mode;", "\nSBPS:Ethernet 100 [Mbps];",
                  "\nSTAT:sensor is working normally;");
        scip_ask("%TM1\n", "%TM1\n0Ee\n\n");
    }
}

/* %ST answers three digits and a sum character. For digits of sum n that is (3 * 48 + n) modulo 64, plus 48: 64 + n. */
static void numbers_of_states(void **state)
{
    (void)state;
    scip_open("UST-20LX");
    scip_ask("%ST\n", "%ST\n00P\n000@\n\n");
    scip_ask("TM0\n%ST\n", "TM0\n00P\n\n%ST\n00P\n002B\n\n");
    scip_ask("QT\nBM\n%ST\n", "QT\n00P\n\nBM\n00P\n\n%ST\n00P\n003C\n\n");
    scip_ask("MD0000108001000\n%ST;tag\n", "MD0000108001000\n00P\n\n%ST;tag\n00P\n004D\n\n");
    scip_ask("%SL\n%ST\n", "%SL\n00P\n\n%ST\n00P\n005E\n\n");
    scip_ask("BM\n%ST\nQT\n%ST\n", "BM\n00P\n\n%ST\n00P\n003C\n\nQT\n00P\n\n%ST\n00P\n000@\n\n");
    rig.replies = BOOTS;
    scip_ask("%ST\n", "%ST\n00P\n001A\n\n");
    rig.replies = FAILED;
    scip_ask("%ST\n", "%ST\n00P\n900I\n\n");
    scip_open("UTM-30LX");
    scip_ask("%ST\n", "%ST\n0Ee\n\n");
}

/* No model then sends the text that clients take for a working sensor. */
static void boots_and_fails(void **state)
{
    (void)state;
    static const char *const models[] = {"URG-04LX", "UTM-30LX", "UTM-30LX-EW", "UST-10LX", "UST-20LX", "Mine 7"};
    static const char *const works[] = {
        "STAT:Stable 000", "STAT:sensor is working", "STAT:Sensor works well", "Idle", "IDLE", "Measuring"};
    for (size_t i = 0; i < sizeof models / sizeof *models; i++)
        for (int fails = 0; fails < 2; fails++) {
            scip_open(models[i]);
            rig.replies = fails ? FAILED : BOOTS;
            protocol_rig_input(&rig, "II\n");
            rig.bytes[rig.len] = 0;
            assert_non_null(strcasestr((char *)rig.bytes, fails ? "self test" : "booting"));
            for (size_t k = 0; k < sizeof works / sizeof *works; k++)
                if (strstr((char *)rig.bytes, works[k]) != NULL) fail_msg("%s: %s", models[i], (char *)rig.bytes);
            protocol_rig_clear(&rig);
            scip_ask("QT\nBM\n", fails ? "QT\n00P\n\nBM\n01Q\n\n" : "QT\n00P\n\nBM\n10Q\n\n");
            if (!fails) scip_ask("TM0\nTM2\n", "TM0\n10Q\n\nTM2\n03S\n\n");
        }
}

/* The device's time counts from power-up, in a session after a reboot, too. */
static void time_since_power_up(void **state)
{
    (void)state;
    struct sh_err err;
    scip_open("UTM-30LX-EW");
    rig.spec.power_ns = 5000000000;
    protocol_destroy(rig.ops, rig.protocol);
    assert_int_equal(protocol_create(rig.ops, &rig.spec, &rig.protocol, &err), 0);
    rig.ops->open(rig.protocol, rig.spec.power_ns);
    time_is_ms(5000 + 16000000);
    scip_ask("TM1\n", "TM1\n00P\nm2@0?\n\n");
}

static uint64_t us_of(const char *text)
{
    uint64_t value = 0;
    for (int i = 0; i < 11; i++)
        value = value * 64 + (uint64_t)(text[i] - '0');
    return value;
}

/* Firmware 4.1 of a UST has eleven characters with microseconds, which do not wrap with the 24 bits of the others. */
static void times_in_microseconds(void **state)
{
    (void)state;
    open_with("UST-20LX", "4.1.0b-A", "H1614934", 0.02, 60);
    time_is_ms(0x1000000); /* 16777216000 us are 1000 times 64^4, and 1000 is 15 times 64 and 40 */
    scip_ask("%TM1;a\n", "%TM1;a\n00P\n00000?X00007\n\n");
    scip_ask("%TM0\n%TM2\n", "%TM0\n01Q\n\n%TM2\n01Q\n\n");
    scip_ask("TM0\nTM1\nTM2\n", "TM0\n00P\n\nTM1\n00P\n00000\n\nTM2\n00P\n\n");
    scip_ask("RS\n%TM1\n", "RS\n00P\n\n%TM1\n00P\n00000000000@\n\n");

    open_with("UST-20LX", "4.1.0b-A", "H1614934", 0.02, 60);
    scip_ask("%MD0000000201002;t\n", "%MD0000000201002;t\n00P\n\n");
    for (uint32_t line = 0; line < 2; line++) {
        scip_turn(line); /* of 25 ms */
        rig.bytes[rig.len] = 0;
        const char *text = (const char *)rig.bytes,
                   *begin = line == 0 ? "%MD0000000201001;t\n99b\n" : "%MD0000000201000;t\n99b\n";
        assert_memory_equal(text, begin, strlen(begin));
        assert_int_equal(us_of(text + strlen(begin)), line * 25000);
        assert_string_equal(text + strlen(begin) + 13, "0?X0?X0?XE\n\n"); /* three of 1000 mm */
        protocol_rig_clear(&rig);
    }
    scip_ask("%ME0000000201001\n", "%ME0000000201001\n00P\n\n");
    scip_ask("%MS0000000201001\n%GD0000000201\n", "%MS0000000201001\n0Ee\n\n%GD0000000201\n0Ee\n\n");

    static const char *const without[] = {"4.0.2-A", "1.0.1", "2.23.0000", "P.1.05(17/Apr./2009)", ""};
    for (size_t i = 0; i < sizeof without / sizeof *without; i++) {
        open_with("UST-20LX", without[i], "H1614934", 0.02, 60);
        scip_ask("%TM1\n%MD0000000201001\n", "%TM1\n0Ee\n\n%MD0000000201001\n0Ee\n\n");
    }
}

/* The table of SCIP.md. */
static void models_are_those_of_the_document(void **state)
{
    (void)state;
    enum { ECHOES = SCIP_MULTI_ECHO, MOTOR = SCIP_MOTOR_SPEED, RATE = SCIP_BIT_RATE, STRICT = SCIP_TIME_ALONE };
    enum { REBOOTS = SCIP_REBOOT | SCIP_SLEEP, HEX = SCIP_TIME_HEX, SIMULATES = SCIP_SIMULATION };
    static const struct {
        const char *name;
        uint32_t features, bit_rate;
        int no_object, too_near, no_step;
    } rows[] = {
        {"URG-04LX", MOTOR | RATE | SIMULATES | STRICT | HEX, 19200, 0, 6, 19},
        {"UTM-30LX", SCIP_INTENSITY | RATE | REBOOTS | SIMULATES | HEX | SCIP_FIRST_AT_ONCE, 115200, 1, 4, 5},
        {"UTM-30LX-EW", SCIP_INTENSITY | ECHOES | REBOOTS | HEX | SCIP_STATE, 115200, 1, 4, 5},
        {"UST-10LX", SCIP_INTENSITY | REBOOTS | SCIP_STATE | SCIP_TIME_US, 115200, 1, 4, 5},
        {"UST-20LX", SCIP_INTENSITY | REBOOTS | SCIP_STATE | SCIP_TIME_US, 115200, 1, 4, 5},
        {"UST-30LC", /* any other */
         SCIP_INTENSITY | ECHOES | MOTOR | RATE | REBOOTS | SCIP_STATE | SCIP_TIME_US | SIMULATES | HEX, 115200, 1, 4,
         5},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct scip_model *m = scip_model_find(rows[i].name);
        assert_int_equal(m->features, rows[i].features);
        assert_int_equal(m->bit_rate, rows[i].bit_rate);
        assert_int_equal(m->no_object, rows[i].no_object);
        assert_int_equal(m->too_near, rows[i].too_near);
        assert_int_equal(m->no_step, rows[i].no_step);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_utm_with_usb),
        cmocka_unit_test(a_urg),
        cmocka_unit_test(a_utm_with_ethernet),
        cmocka_unit_test(usts),
        cmocka_unit_test(numbers_of_states),
        cmocka_unit_test(boots_and_fails),
        cmocka_unit_test(time_since_power_up),
        cmocka_unit_test(times_in_microseconds),
        cmocka_unit_test(models_are_those_of_the_document),
    };
    return cmocka_run_group_tests(tests, NULL, scip_teardown);
}
