/* SPDX-License-Identifier: MIT */
/* CoLa's commands: the sequences of real clients, both forms, log-in, errors, and bytes that are no telegram. */
#include "tests/unit/cola_rig.h"

/* ---- start-up sequences of real clients, with the answers that they accept */

static void sick_tim_starts(void **state)
{
    (void)state;
    cola_open_tim("TiM571");
    strcpy(cola.identity.firmware, "V2.62-16.02.16"); /* as the profile says */
    cola_expect("sRI0", "sRA 0 6 TiM571 E V2.62-16.02.16");
    cola_expect("sRN SerialNumber", "sRA SerialNumber 8 17210001");
    cola_expect("sRN FirmwareVersion", "sRA FirmwareVersion 8 V2.62-16");
    cola_expect("sRN SCdevicestate", "sRA SCdevicestate 1");
    cola_expect("sEN LMDscandata 1", "sEA LMDscandata 1");
    cola_expect("sEN LMDscandata 0", "sEA LMDscandata 0");
    cola_expect("sMN SetAccessMode 03 F4724744", "sAN SetAccessMode 1");
    cola_expect("sMN mSCreboot", "sAN mSCreboot");
    assert_string_equal(cola.line[cola.n_lines - 1], "HEAD:REBoot");
    assert_int_equal(cola.hung_up, 0); /* the power cycle does that */
    assert_int_equal(cola.count[PROTOCOL_WRONG], 0);
}

/* A recording refuses a reboot: only the session begins anew. */
static void a_reboot_that_is_refused_ends_the_session(void **state)
{
    (void)state;
    static const struct protocol_rig_reply refuses[] = {
        {"HEAD:STATE?", "scanning", 0}, {"HEAD:REBoot", "ERR", -221}, {NULL, NULL, 0}};
    cola_open_lms();
    cola.replies = refuses;
    cola_authorise();
    cola_expect("sMN mSCreboot", "sAN mSCreboot");
    assert_int_equal(cola.hung_up, 1);
}

/* The clock and the hours count from power-up. Power-ups are counted, too. */
static void clocks_begin_at_power_up(void **state)
{
    (void)state;
    cola_open_lms();
    protocol_destroy(cola.ops, cola.protocol);
    cola.spec.power_ns = INT64_C(3600000000000);
    cola.spec.power_ons = 3;
    assert_int_equal(protocol_create(cola.ops, &cola.spec, &cola.protocol, NULL), 0);
    protocol_rig_describe(&cola, 0);
    cola.ops->time(cola.protocol, INT64_C(3600000000000) * 3 + INT64_C(5000000000));
    cola_expect("sRN ODpwrc", "sRA ODpwrc 3");
    cola_expect("sRN ODoprh", "sRA ODoprh 14"); /* two hours */
    cola_expect("sRN STlms", "sRA STlms 7 0 8 02:00:05 A 01.01.1970 0 0 0");
    assert_memory_equal(cola_ask("sRN LIDoutputstate"), "sRA LIDoutputstate 1 AD739340 ",
                        30); /* 7205 s in us, 32 bits */
}

/* sick_tim refuses firmware from 2.50 on of a TiM3xx, by this pattern. No model of ours may look like one. */
static void no_ident_is_an_old_tim(void **state)
{
    (void)state;
    static const char *const models[] = {"TiM561", "TiM571", "TiM781", "LMS111", "Scanner of my own"};
    for (size_t i = 0; i < sizeof models / sizeof models[0]; i++) {
        char part[3];
        cola_open_tim(models[i]);
        assert_int_not_equal(sscanf(cola_ask("sRI0"), "sRA 0 6 TiM3%1s%1s", part, part + 1), 2);
    }
    cola_open_tim("Scanner of my own");
    cola.identity.firmware[0] = 0;
    cola_expect("sRN DeviceIdent", "sRA DeviceIdent 11 Scanner of my own 5 V1.00");
}

static void sick_scan_xd_starts_in_a(void **state)
{
    (void)state;
    cola_open_tim("TiM571");
    cola_expect("sRN SCdevicestate", "sRA SCdevicestate 1");
    cola_expect("sMN SetAccessMode 3 F4724744", "sAN SetAccessMode 1");
    cola_expect("sWN EIHstCola 0", "sWA EIHstCola");
    cola_expect("sRN FirmwareVersion", "sRA FirmwareVersion 5 1.2.3");
    cola_expect("sRN ODoprh", "sRA ODoprh 0");
    cola_expect("sRN ODpwrc", "sRA ODpwrc 1");
    cola_expect("sRN LocationName", "sRA LocationName 3 rig");
    cola_expect("sRN LMPoutputRange", "sRA LMPoutputRange 1 D05 FFF92230 225510");
    cola_expect("sWN LMPoutputRange 1 D05 FFF92230 225510", "sWA LMPoutputRange");
    cola_expect("sRN LMPoutputRange", "sRA LMPoutputRange 1 D05 FFF92230 225510");
    cola_expect("sWN LMDscandatacfg 1 0 1 1 0 0 0 0 0 0 1 1", "sWA LMDscandatacfg");
    cola_expect("sRN LMDscandatacfg", "sRA LMDscandatacfg 1 0 1 1 0 0 0 0 0 0 1 1");
    cola_expect("sMN LMCstartmeas", "sAN LMCstartmeas 0");
    cola_expect("sMN Run", "sAN Run 1");
    cola_expect("sEN LMDscandata 1", "sEA LMDscandata 1");
}

static void sick_scan_xd_starts_in_b(void **state)
{
    (void)state;
    cola_open_tim("TiM571");
    EXPECT_B("sRN SCdevicestate", "sRA SCdevicestate \1");
    EXPECT_B("sMN SetAccessMode \3\xf4\x72\x47\x44", "sAN SetAccessMode \1");
    EXPECT_B("sWN EIHstCola \1", "sWA EIHstCola ");
    EXPECT_B("sRN FirmwareVersion", "sRA FirmwareVersion \0\5"
                                    "1.2.3");
    EXPECT_B("sRN ODoprh", "sRA ODoprh \0\0\0\0");
    EXPECT_B("sRN ODpwrc", "sRA ODpwrc \0\0\0\1");
    EXPECT_B("sRN LocationName", "sRA LocationName \0\3rig");
    EXPECT_B("sRN LCMstate", "sRA LCMstate \0");
    EXPECT_B("sRN STlms", "sRA STlms \0\7\0\0\x8"
                          "00:00:00\0\xa"
                          "01.01.1970\0\0\0\0\0\0");
#define RANGE "\0\1\0\0\x0d\x05\xff\xf9\x22\x30\x00\x22\x55\x10"
    EXPECT_B("sRN LMPoutputRange", "sRA LMPoutputRange " RANGE);
    EXPECT_B("sWN LMPoutputRange " RANGE, "sWA LMPoutputRange ");
    EXPECT_B("sRN LMPoutputRange", "sRA LMPoutputRange " RANGE);
#define CFG "\1\0\1\1\0\0\0\0\0\0\1\0\1"
    EXPECT_B("sWN LMDscandatacfg " CFG, "sWA LMDscandatacfg ");
    EXPECT_B("sRN LMDscandatacfg", "sRA LMDscandatacfg " CFG);
    EXPECT_B("sMN LMCstartmeas", "sAN LMCstartmeas \0");
    EXPECT_B("sMN Run", "sAN Run \1");
    EXPECT_B("sEN LMDscandata \1", "sEA LMDscandata \1");
    EXPECT_B("sEN LMDscandata \0", "sEA LMDscandata \0");
}

/* Frames as real scanners sent them, from public captures. */
static void frames_are_those_of_real_scanners(void **state)
{
    (void)state;
    static const char *const requests[] = {"sRN SCdevicestate", "sRN field010", "sMN SetAccessMode \3\1\1\1\1",
                                           "sWN EIHstCola \1"};
    static const size_t sizes[] = {17, 12, 23, 15};
    static const struct {
        size_t len;
        char bytes[40];
    } answers[] = {
        {28, "\2\2\2\2\0\0\0\x13sRA SCdevicestate \1\x1e"},
        {23, "\2\2\2\2\0\0\0\x0esRA field010 \0\x33"},
        {28, "\2\2\2\2\0\0\0\x13sAN SetAccessMode \0\x39"},
        {14, "\2\2\2\2\0\0\0\5sFA\0\n~"},
    };
    uint8_t frame[64];
    cola_open_lms();
    for (int i = 0; i < 4; i++) {
        protocol_rig_clear(&cola);
        cola_input(frame, cola_frame_b(frame, requests[i], sizes[i]));
        assert_int_equal(cola.len, answers[i].len);
        assert_memory_equal(cola.bytes, answers[i].bytes, cola.len);
    }
}

static void mrpt_starts(void **state)
{
    (void)state;
    cola_open_lms();
    cola_expect("sMN SetAccessMode 03 F4724744", "sAN SetAccessMode 1");
    cola_expect("sMN mLMPsetscancfg +2500 +1 +2500 -450000 +2250000", "sAN mLMPsetscancfg 0 9C4 1 9C4 FFF92230 225510");
    cola_expect("sWN LMDscandatacfg 01 00 0 1 0 00 00 0 0 0 0 +1", "sWA LMDscandatacfg");
    cola_expect("sMN LMCstartmeas", "sAN LMCstartmeas 0");
    cola_expect("sRN STlms", "sRA STlms 7 0 8 00:00:00 A 01.01.1970 0 0 0");
    assert_int_equal(cola.bytes[11], '7'); /* the byte that this client looks at */
}

/* ---- states and the head */

static void states_follow_the_head(void **state)
{
    (void)state;
    static const char *const head[] = {"off", "boot", "idle", "spin-up", "scanning", "spin-down", "fault"};
    static const char device[] = "0011112", lms[] = "1135740"; /* as the clients name the numbers: COLA.md */
    cola_open_lms();
    for (int i = 0; i < 7; i++) {
        cola_head_state(head[i]);
        assert_int_equal(cola_ask("sRN SCdevicestate")[18], device[i]);
        assert_int_equal(cola_ask("sRN STlms")[10], lms[i]);
    }
    cola_head_state("scanning");
    cola_authorise();
    cola_expect("sMN LMCstopmeas", "sAN LMCstopmeas 0");
    assert_int_equal(cola_ask("sRN STlms")[10], '6');
}

/* ---- log-in */

static void writing_needs_its_level(void **state)
{
    (void)state;
    static const char *const writes[] = {"sWN LMPoutputRange 1 9C4 0 0", "sWN EIHstCola 1",
                                         "sWN LocationName 1 x",         "sWN LMDscandatacfg 1 0 0 0 0 0 0 0 0 0 0 1",
                                         "sWN FREchoFilter 0",           "sWN LMDscandatascalefactor 3F800000"};
    static const char *const methods[] = {"sMN LMCstartmeas",
                                          "sMN LMCstopmeas",
                                          "sMN mSCreboot",
                                          "sMN mEEwriteall",
                                          "sMN mSCloadappdef",
                                          "sMN mLMPsetscancfg 9C4 1 9C4 FFF92230 225510",
                                          "sMN LSPsetdatetime 7E8 1 1 0 0 0 0"};
    cola_open_lms();
    for (int level = 0; level < 2; level++) {
        for (size_t i = 0; i < sizeof writes / sizeof writes[0]; i++)
            cola_expect(writes[i], "sFA A");
        for (size_t i = 0; i < sizeof methods / sizeof methods[0]; i++)
            cola_expect(methods[i], "sFA 1");
        cola_expect("sMN SetAccessMode 02 B21ACE26", "sAN SetAccessMode 1"); /* not enough */
    }
    assert_int_equal(cola.count[PROTOCOL_WRONG], 2 * 13);
    cola_expect("sMN GetAccessMode", "sAN GetAccessMode 2");
    cola_expect("sMN SetAccessMode 03 81BE23AA", "sAN SetAccessMode 0");
    cola_expect("sMN SetAccessMode 05 F4724744", "sAN SetAccessMode 0");
    cola_expect("sMN GetAccessMode", "sAN GetAccessMode 2"); /* it is as it was */
    cola_expect("sMN SetAccessMode 04 81BE23AA", "sAN SetAccessMode 1");
    cola_expect("sWN EIHstCola 1", "sWA EIHstCola");
    cola_expect("sMN CheckPassword 3 F4724744", "sAN CheckPassword 1");
    cola_expect("sMN CheckPassword 3 F4724745", "sAN CheckPassword 0");
    cola_expect("sMN GetAccessMode", "sAN GetAccessMode 4");
    cola_expect("sMN Run", "sAN Run 1");
    cola_expect("sWN EIHstCola 1", "sFA A");
}

/* ---- errors, by SICK's numbers */

static void errors_have_their_numbers(void **state)
{
    (void)state;
    static const struct {
        const char *request, *answer;
    } cases[] = {
        {"sMN NoSuchMethod", "sFA 2"},
        {"sRN NoSuchVariable", "sFA 3"},
        {"sWN NoSuchVariable 1", "sFA 3"},
        {"sEN NoSuchEvent 1", "sFA F"},
        {"sRI7", "sFA 3"},
        {"sRIO", "sFA 3"}, /* an MRPT client has an O for the 0 */
        {"sWN SCdevicestate 1", "sFA A"},
        {"sWN LMPscancfg 1", "sFA A"},
        {"sXN LMDscandata", "sFA C"},
        {"hello", "sFA C"},
        {"", "sFA C"},
        {"sWN LMPoutputRange 1 9C4 0", "sFA 8"},
        {"sWN LMPoutputRange 1 9C4 0 10 1", "sFA 7"},
        {"sWN LMPoutputRange 1 9C3 0 0", "sFA 5"},
        {"sWN LMPoutputRange 1 9C4 -451250 0", "sFA 5"}, /* half a step beyond the first beam, and the last */
        {"sWN LMPoutputRange 1 9C4 0 +2251250", "sFA 5"},
        {"sWN LMPoutputRange 1 9C4 +2252500 +2255000", "sFA 5"},
        {"sWN LMPoutputRange 1 9C4 -2147483648 0", "sFA 5"}, /* the least of four bytes, and one less */
        {"sWN LMPoutputRange 1 9C4 -2147483649 0", "sFA 10"},
        {"sWN LMPoutputRange 1 9C4 +20 +10", "sFA 5"},
        {"sWN LMDscandatacfg 100 0 1 1 0 0 0 0 0 0 1 1", "sFA 10"},
        {"sWN LMDscandatacfg -1 0 1 1 0 0 0 0 0 0 1 1", "sFA 10"},
        {"sWN LMDscandatacfg 0 0 1 1 0 0 0 0 0 0 1 1", "sFA 5"},
        {"sWN LMDscandatacfg 4 0 1 1 0 0 0 0 0 0 1 1", "sFA 5"},
        {"sWN LMDscandatacfg 1 0 1 1 0 0 0 0 0 0 1 0", "sFA 5"},
        {"sWN LMDscandatacfg 1 0 1 1 0 G 0 0 0 0 1 1", "sFA 11"},
        {"sWN EIHstCola 123456789", "sFA 10"},
        {"sWN EIHstCola 2", "sFA 5"},
        {"sWN EIHstCola +", "sFA 8"},
        {"sEN LMDscandata 2", "sFA 5"},
        {"sEN LMDscandata", "sFA 8"},
        {"sEN LMDscandata 1 1", "sFA 7"},
        {"sWN LocationName 11 12345678901234567", "sFA 10"},
        {"sWN LocationName 5 abc", "sFA 8"},
        {"sWN FREchoFilter 3", "sFA 5"},
        {"sMN LSPsetdatetime 7E8 2 1E 0 0 0", "sFA 8"},
    };
    cola_open_lms();
    cola_authorise();
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        cola_expect(cases[i].request, cases[i].answer);
    assert_int_equal(cola.count[PROTOCOL_WRONG], sizeof cases / sizeof cases[0]);
    cola_expect("sRN LMPoutputRange", "sRA LMPoutputRange 1 9C4 FFF92230 225510"); /* nothing has changed */
    EXPECT_B("sRN NoSuchVariable", "sFA\0\3");
    EXPECT_B("sWN FREchoFilter \2 ", "sFA\0\7"); /* a blank is a byte, too */
}

/* PCL's TimGrabber polls with a 1 after the name and two NULs after the telegram: \x02sRN LMDscandata 1\x03\0\0. */
static void values_of_a_read_are_ignored(void **state)
{
    (void)state;
    static const char poll[] = "\2sRN LMDscandata 1\3\0";
    cola_open_tim("TiM571");
    cola_turn(0, 1.0);
    for (uint32_t i = 0; i < 3; i++) {
        cola_input(poll, sizeof poll); /* with the second NUL */
        assert_int_equal(cola.n_units, i + 1);
        assert_memory_equal(cola.bytes + (i != 0 ? cola.end[i - 1] : 0), "\2sRA LMDscandata ", 17);
    }
    assert_int_equal(cola.count[PROTOCOL_INPUT_LOST], 6); /* the NULs */
    cola_expect("sRN LCMstate 0", "sRA LCMstate 0");
    cola_expect("sRI0 0", "sRA 0 6 TiM571 5 1.2.3");
    cola_expect("sRN EIHstCola x y", "sRA EIHstCola 0");
    cola_expect("sRN NoSuchVariable 1", "sFA 3");
    EXPECT_B("sRN LCMstate \1\2", "sRA LCMstate \0");
    assert_int_equal(cola.count[PROTOCOL_WRONG], 1);
}

static void a_geometry_that_the_head_has_not_is_refused(void **state)
{
    (void)state;
    cola_open_lms();
    cola_authorise();
#define HAS " 9C4 1 9C4 FFF92230 225510"
    cola_expect("sMN mLMPsetscancfg 9C4 1 9C4 FFF92230 225510", "sAN mLMPsetscancfg 0" HAS);
    cola_expect("sMN mLMPsetscancfg +5000 +1 +2500 -450000 +2250000", "sAN mLMPsetscancfg 1" HAS);
    cola_expect("sMN mLMPsetscancfg +2500 +1 +5000 -450000 +2250000", "sAN mLMPsetscancfg 2" HAS);
    cola_expect("sMN mLMPsetscancfg +2500 +1 +5000 0 +1800000", "sAN mLMPsetscancfg 3" HAS);
    cola_expect("sMN mLMPsetscancfg +2500 +1 +2500 0 +1800000", "sAN mLMPsetscancfg 4" HAS);
    cola_expect("sMN mLMPsetscancfg +2500 +2 +2500 -450000 +2250000", "sAN mLMPsetscancfg 5" HAS);
    cola_expect("sRN LMPscancfg", "sRA LMPscancfg" HAS);
    EXPECT_B("sRN LMPscancfg",
             "sRA LMPscancfg \0\0\x09\xc4\0\1\0\0\x09\xc4\xff\xf9\x22\x30\x00\x22\x55\x10"); /* u32 i16 u32 i32 i32 */
}

static void settings_are_kept_and_forgotten(void **state)
{
    (void)state;
    cola_open_lms();
    cola_authorise();
    cola_expect("sWN LocationName 5 a b c", "sWA LocationName");
    cola_expect("sRN LocationName", "sRA LocationName 5 a b c");
    cola_expect("sWN FREchoFilter 2", "sWA FREchoFilter");
    cola_expect("sRN FREchoFilter", "sRA FREchoFilter 2");
    cola_expect("sRN LMDscandatascalefactor", "sRA LMDscandatascalefactor 3F800000");
    cola_expect("sWN LMDscandatascalefactor 40000000", "sWA LMDscandatascalefactor");
    cola_expect("sRN LMDscandatascalefactor", "sRA LMDscandatascalefactor 40000000");
    cola_expect("sWN LMDscandatascalefactor 40400000", "sFA 5");
    cola_expect("sMN mEEwriteall", "sAN mEEwriteall 1");
    cola_expect("sRN LCMstate", "sRA LCMstate 0");
    cola_expect("sMN mSCloadappdef", "sAN mSCloadappdef");
    cola_expect("sRN LocationName", "sRA LocationName 3 rig");
    cola_expect("sRN FREchoFilter", "sRA FREchoFilter 0");
    cola_expect("sRN LMDscandatascalefactor", "sRA LMDscandatascalefactor 3F800000");
    cola_expect("sMN GetAccessMode", "sAN GetAccessMode 3"); /* still logged in */
    cola_expect("sMN mSCreboot", "sAN mSCreboot");
    cola_expect("sMN GetAccessMode", "sAN GetAccessMode 1"); /* where the link cannot hang up */
}

static void the_clock_can_be_set(void **state)
{
    (void)state;
    cola_open_lms();
    cola_authorise();
    cola.utc0_ns = INT64_C(1709210096) * 1000000000; /* 2024-02-29T12:34:56Z */
    cola_expect("sRN STlms", "sRA STlms 7 0 8 12:34:56 A 29.02.2024 0 0 0");
    cola.ops->time(cola.protocol, INT64_C(3600000000000) * 12);
    cola_expect("sRN STlms", "sRA STlms 7 0 8 00:34:56 A 01.03.2024 0 0 0");
    cola_expect("sRN ODoprh", "sRA ODoprh 78"); /* 120 tenths of an hour */
    cola_expect("sMN LSPsetdatetime 7CF C 1F 17 3B 3A 0", "sAN LSPsetdatetime 1");
    cola_expect("sRN STlms", "sRA STlms 7 0 8 23:59:58 A 31.12.1999 0 0 0");
    cola.ops->time(cola.protocol, INT64_C(3600000000000) * 12 + INT64_C(2000000000));
    cola_expect("sRN STlms", "sRA STlms 7 0 8 00:00:00 A 01.01.2000 0 0 0");
    cola_expect("sMN LSPsetdatetime 7E7 2 1D 0 0 0 0", "sAN LSPsetdatetime 0"); /* 29 February 2023 */
    cola_expect("sMN LSPsetdatetime 7E8 D 1 0 0 0 0", "sAN LSPsetdatetime 0");
    cola_expect("sRN STlms", "sRA STlms 7 0 8 00:00:00 A 01.01.2000 0 0 0");
    cola_expect("sMN LSPsetdatetime 7D0 2 1D 17 3B 3B 0", "sAN LSPsetdatetime 1"); /* a second time */
    cola_expect("sRN STlms", "sRA STlms 7 0 8 23:59:59 A 29.02.2000 0 0 0");
    cola_expect("sMN LSPsetdatetime 834 2 1D 0 0 0 0", "sAN LSPsetdatetime 0"); /* 2100 has no 29 February */
    cola_expect("sMN LSPsetdatetime 834 2 1C 17 3B 3B 0", "sAN LSPsetdatetime 1");
    cola.ops->time(cola.protocol, INT64_C(3600000000000) * 12 + INT64_C(3000000000));
    cola_expect("sRN STlms", "sRA STlms 7 0 8 00:00:00 A 01.03.2100 0 0 0");
    /* From the smallest shift to 2199: that is more than 2^63 ns, but the new shift is not. */
    const int64_t want_ns = cola.shift_ns + INT64_C(3121286400) * 1000000000; /* 98 years and 333 days */
    cola.shift_ns = INT64_C(-4600000000000000000);
    cola_expect("sMN LSPsetdatetime 897 1 1B 0 0 0 0", "sAN LSPsetdatetime 1");
    assert_int_equal(cola.shift_ns, want_ns);
}

int main(void)
{
#define CASE(f) cmocka_unit_test_teardown(f, cola_teardown)
    const struct CMUnitTest tests[] = {
        CASE(sick_tim_starts),
        CASE(a_reboot_that_is_refused_ends_the_session),
        CASE(clocks_begin_at_power_up),
        CASE(no_ident_is_an_old_tim),
        CASE(sick_scan_xd_starts_in_a),
        CASE(sick_scan_xd_starts_in_b),
        CASE(frames_are_those_of_real_scanners),
        CASE(mrpt_starts),
        CASE(states_follow_the_head),
        CASE(writing_needs_its_level),
        CASE(errors_have_their_numbers),
        CASE(values_of_a_read_are_ignored),
        CASE(a_geometry_that_the_head_has_not_is_refused),
        CASE(settings_are_kept_and_forgotten),
        CASE(the_clock_can_be_set),
    };
    return cmocka_run_group_tests_name("cola commands", tests, NULL, NULL);
}
