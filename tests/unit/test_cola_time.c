/* SPDX-License-Identifier: MIT */
/* CoLa's variables of time synchronisation: bytes of the manuals' examples, and the lines for the head. */
#include "tests/unit/cola_rig.h"

static struct protocol_rig_reply replies[] = {
    {"TIME:SERVer? STATe", "SET,18000000000000,-5,500000000,3,1,0", 0},
    {"TIME:SERVer?", "CLIENT,192.168.0.11,600,-3,CAN", 0},
    {"TIME:SERVer", "OK", 0},
    {NULL, NULL, 0},
};

static void open_with_replies(void)
{
    cola_open_lms();
    replies[2].error = 0;
    cola.replies = replies;
}

/* 468CA000 is 18000 s, as a real scanner has answered (sick_scan_xd's examples of telegrams); 3F000000 is 0.5. */
static void variables_are_read(void **state)
{
    (void)state;
    open_with_replies();
    cola_expect("sRN TSCRole", "sRA TSCRole 1");
    cola_expect("sRN TSCTCInterface", "sRA TSCTCInterface 1");
    cola_expect("sRN TSCTCSrvAddr", "sRA TSCTCSrvAddr C0 A8 0 B");
    cola_expect("sRN TSCTCtimezone", "sRA TSCTCtimezone 9");
    cola_expect("sRN TSCTCupdatetime", "sRA TSCTCupdatetime 258");
    cola_expect("sRN TSCTCmaxoffset", "sRA TSCTCmaxoffset 468CA000");
    cola_expect("sRN TSCTCdelay", "sRA TSCTCdelay 3F000000");
    EXPECT_B("sRN TSCRole", "sRA TSCRole \1");
    EXPECT_B("sRN TSCTCSrvAddr", "sRA TSCTCSrvAddr \xC0\xA8\0\x0B");
    EXPECT_B("sRN TSCTCupdatetime", "sRA TSCTCupdatetime \0\0\2\x58");
    EXPECT_B("sRN TSCTCmaxoffset", "sRA TSCTCmaxoffset \x46\x8C\xA0\0");
}

/* Asks, and compares the last line for the head. */
static void expect_line(const char *request, const char *answer, const char *line)
{
    cola_expect(request, answer);
    assert_string_equal(cola.line[cola.n_lines - 1], line);
}

/* Frames of the LMS4000's and picoScan's manuals: address 192.168.0.11, 600 s; and the answer. */
static void frames_are_those_of_the_manuals(void **state)
{
    (void)state;
    static const uint8_t address[] = {2,    2,    2,    2,    0,    0,    0,    0x15, 0x73, 0x57,
                                      0x4E, 0x20, 0x54, 0x53, 0x43, 0x54, 0x43, 0x53, 0x72, 0x76,
                                      0x41, 0x64, 0x64, 0x72, 0x20, 0xC0, 0xA8, 0x00, 0x0B, 0x3E},
                         update[] = {2,    2,    2,    2,    0,    0,    0,    0x18, 0x73, 0x57, 0x4E,
                                     0x20, 0x54, 0x53, 0x43, 0x54, 0x43, 0x75, 0x70, 0x64, 0x61, 0x74,
                                     0x65, 0x74, 0x69, 0x6D, 0x65, 0x20, 0x00, 0x00, 0x02, 0x58, 0x67},
                         role[] = {2,    2,    2,    2,    0,    0,    0,    0x0C, 0x73, 0x57,
                                   0x41, 0x20, 0x54, 0x53, 0x43, 0x52, 0x6F, 0x6C, 0x65, 0x20};
    uint8_t frame[64];
    open_with_replies();
    cola_authorise();
    cola_input(address, sizeof address);
    assert_string_equal(cola.line[cola.n_lines - 1], "TIME:SERVer CLIENT,192.168.0.11,600,-3,CAN");
    cola_input(update, sizeof update);
    assert_string_equal(cola.line[cola.n_lines - 1], "TIME:SERVer CLIENT,192.168.0.11,600,-3,CAN");
    protocol_rig_clear(&cola);
    cola_input(frame, cola_frame_b(frame, "sWN TSCRole \2", 13));
    assert_memory_equal(cola.bytes, role, sizeof role);
    assert_string_equal(cola.line[cola.n_lines - 1], "TIME:SERVer SERVER,192.168.0.11,600,-3,CAN");
}

/* As sick_scan_xd and LMS1xx write them. */
static void variables_are_written(void **state)
{
    (void)state;
    open_with_replies();
    cola_expect("sWN TSCRole 1", "sFA A"); /* not logged in */
    cola_expect("sWN TSCTCdelay 0", "sFA A");
    cola_authorise();
    expect_line("sWN TSCRole 0", "sWA TSCRole", "TIME:SERVer NONE,192.168.0.11,600,-3,CAN");
    expect_line("sWN TSCTCInterface 0", "sWA TSCTCInterface", "TIME:SERVer CLIENT,192.168.0.11,600,-3,ETH");
    expect_line("sWN TSCTCSrvAddr 7F 00 00 01", "sWA TSCTCSrvAddr", "TIME:SERVer CLIENT,127.0.0.1,600,-3,CAN");
    expect_line("sWN TSCTCtimezone 18", "sWA TSCTCtimezone", "TIME:SERVer CLIENT,192.168.0.11,600,12,CAN");
    expect_line("sWN TSCTCupdatetime +5", "sWA TSCTCupdatetime", "TIME:SERVer CLIENT,192.168.0.11,5,-3,CAN");
    cola_expect("sWN TSCRole 3", "sFA 5");
    cola_expect("sWN TSCTCInterface 2", "sFA 5");
    cola_expect("sWN TSCTCtimezone 19", "sFA 5");
    cola_expect("sWN TSCTCSrvAddr 7F 0 0", "sFA 8");
    cola_expect("sWN TSCTCSrvAddr 7F 0 0 100", "sFA 10");
    cola_expect("sWN TSCTCmaxoffset 468CA000", "sFA A"); /* only read */
    cola_expect("sWN TSCRole 1 1", "sFA 7");
    replies[2].error = -222;
    cola_expect("sWN TSCTCupdatetime 0", "sFA 5");
    replies[2].error = -221; /* the head can't ask */
    cola_expect("sWN TSCRole 1", "sFA 4");
}

static void the_servers_clock_is_not_set_by_hand(void **state)
{
    (void)state;
    open_with_replies();
    cola_authorise();
    cola_expect("sMN LSPsetdatetime 7E8 1 1 0 0 0 0", "sAN LSPsetdatetime 0");
    assert_int_equal(cola.shift_ns, 0);
    replies[1].reply = "NONE,192.168.0.11,600,-3,CAN"; /* the head asks no server */
    cola_expect("sMN LSPsetdatetime 7E8 1 1 0 0 0 0", "sAN LSPsetdatetime 1");
    replies[1].reply = "CLIENT,192.168.0.11,600,-3,CAN";
    assert_int_not_equal(cola.shift_ns, 0);
}

/* A head that does not say its shift, or does not take one, has no clock that is set. */
static void a_head_without_a_shift_is_not_set(void **state)
{
    (void)state;
    static const struct protocol_rig_reply refuses[][2] = {
        {{"TIME:SHIFt?", "5", -221}}, {{"TIME:SHIFt?", "OK", 0}}, {{"TIME:SHIFt ", "ERR", -222}}};
    cola_open_lms();
    cola_authorise();
    for (size_t i = 0; i < sizeof refuses / sizeof refuses[0]; i++) {
        cola.replies = refuses[i];
        cola_expect("sMN LSPsetdatetime 7E8 1 1 0 0 0 0", "sAN LSPsetdatetime 0");
        assert_int_equal(cola.shift_ns, 0);
    }
}

int main(void)
{
#define CASE(f) cmocka_unit_test_teardown(f, cola_teardown)
    const struct CMUnitTest tests[] = {
        CASE(variables_are_read),
        CASE(frames_are_those_of_the_manuals),
        CASE(variables_are_written),
        CASE(the_servers_clock_is_not_set_by_hand),
        CASE(a_head_without_a_shift_is_not_set),
    };
    return cmocka_run_group_tests_name("cola time", tests, NULL, NULL);
}
