/* libscanhead over a bus that is played: what a device calls itself, permissions, transfers that fail, unplugging at
 * each moment, waiting for a head. What a real bus does is for tests/guest. */
#include "tests/unit/fake_libusb.h"

#include "drivers/host/scanhead.h"
#include "drivers/protocol/native_encode.h"

enum { TIMEOUT_MS = 5000 };

static size_t make_event(uint8_t *to, size_t room, uint32_t seq)
{
    struct native_event e = {.code = NATIVE_EV_ERROR, .a = seq};
    size_t len = native_encode_event(to, room, &e, 1, 0);
    native_seal(to, seq);
    return len;
}

static void script_events(uint32_t from, uint32_t to)
{
    uint8_t raw[512];
    for (uint32_t seq = from; seq < to; seq++)
        fake_script(FAKE_IN, LIBUSB_TRANSFER_COMPLETED, raw, make_event(raw, sizeof raw, seq));
}

static void expect_events(struct scanhead *sh, uint32_t from, uint32_t to)
{
    struct scanhead_frame frame;
    for (uint32_t seq = from; seq < to; seq++) {
        if (scanhead_next(sh, &frame, TIMEOUT_MS) != 0) fail_msg("frame %u: %s", (unsigned)seq, scanhead_error(sh));
        assert_int_equal(frame.seq, seq);
    }
}

static int begin(void **state)
{
    (void)state;
    fake_reset();
    bus.device[0] = (struct libusb_device){.present = 1, .maker = "Maker", .product = "Head", .serial = "SH-1"};
    return 0;
}

static int end(void **state)
{
    (void)state;
    fake_expect_nothing_left();
    return 0;
}

static struct scanhead *open_head(const char *source)
{
    struct scanhead *sh;
    char err[512];
    if (scanhead_open(source, &sh, err, sizeof err) != 0) fail_msg("%s", err);
    return sh;
}

static void close_head(struct scanhead *sh)
{
    scanhead_close(sh);
    assert_int_equal(bus.sessions, bus.gone ? 1 : 0);
}

/* ---- finding and opening */

#define BELLS(n) n n n n n n n n

static void test_strings(void **state)
{
    static const struct {
        const char *called, *shown;
    } cases[] = {
        {"SH-000 7", "SH-000 7"},
        {"\x1b[31mred\x1b[0m", "\\x1b[31mred\\x1b[0m"},
        {"two\r\nlines\t\x7f", "two\\x0d\\x0alines\\x09\\x7f"},
        {"nul\xff"
         "after",
         "nul\\x00after"},
        {"back\\x0aslash", "back\\x5cx0aslash"}, /* is not "back", LF, "slash" */
        {"~ !\"#$%", "~ !\"#$%"},
        /* 64 bells: 31 are what 127 characters have room for, and none is cut in two */
        {BELLS("\a\a\a\a\a\a\a\a"), "\\x07\\x07\\x07\\x07\\x07\\x07\\x07\\x07\\x07\\x07\\x07\\x07\\x07\\x07\\x07\\x07"
                                    "\\x07\\x07\\x07\\x07\\x07\\x07\\x07\\x07\\x07\\x07\\x07\\x07\\x07\\x07\\x07"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const char *called = cases[i].called;
        struct scanhead_usb_head head[FAKE_DEVICES];
        struct scanhead *sh;
        char err[512], other[256];
        bus.device[0] = (struct libusb_device){.present = 1, .maker = called, .product = called, .serial = called};
        bus.device[1] = (struct libusb_device){.present = 1, .other_class = 1, .serial = called};
        assert_int_equal(scanhead_list_usb(head, FAKE_DEVICES, err, sizeof err), 1);
        assert_string_equal(head[0].maker, cases[i].shown);
        assert_string_equal(head[0].product, cases[i].shown);
        assert_string_equal(head[0].serial, cases[i].shown);
        assert_string_equal(head[0].problem, "");
        snprintf(other, sizeof other, "usb:1209:0001:%s", cases[i].shown);
        assert_string_equal(head[0].source, other);
        close_head(open_head(head[0].source)); /* what is shown is what opens it */
        close_head(open_head("usb"));
        snprintf(other, sizeof other, "usb:1209:1:%.60sx", cases[i].shown);
        assert_int_equal(scanhead_open(other, &sh, err, sizeof err), SCANHEAD_ELOST);
        bus.device[2] = bus.device[0];
        assert_int_equal(scanhead_open("usb", &sh, err, sizeof err), SCANHEAD_EINPUT);
        for (const char *p = err; *p != '\0'; p++)
            assert_true(*p >= 0x20 && *p < 0x7f);
        bus.device[2].present = 0;
    }
}

/* The user reads one line, on a terminal or in a log, and can do what it says. */
static void expect_rule(const char *text)
{
    assert_non_null(strstr(text, "no permission"));
    assert_non_null(strstr(text, "make install"));
    assert_non_null(strstr(text, "drivers/host/70-scanhead.rules to /etc/udev/rules.d"));
    assert_non_null(strstr(text, "udevadm control --reload"));
    assert_non_null(strstr(text, "plug the head in again")); /* its end: nothing is cut */
}

static void test_no_permission(void **state)
{
    struct scanhead_usb_head head;
    struct scanhead *sh;
    char err[512];
    (void)state;
    bus.device[0].open_rc = LIBUSB_ERROR_ACCESS;
    assert_int_equal(scanhead_open("usb", &sh, err, sizeof err), SCANHEAD_EPERM);
    assert_null(sh);
    expect_rule(err);
    assert_non_null(strstr(err, "1209:0001, bus 1 device 2"));
    assert_int_equal(scanhead_list_usb(&head, 1, err, sizeof err), 1);
    expect_rule(head.problem);
    assert_string_equal(head.source, "usb:1209:0001");
    assert_string_equal(head.serial, "");
    /* a head that is in use as a second one does not matter where another is to be had */
    bus.device[1] = (struct libusb_device){.present = 1, .serial = "SH-2"};
    close_head(open_head("usb"));
}

static void test_several(void **state)
{
    static const char hundred[] =
        "0123456789012345678901234567890123456789012345678901234567890123456789012345678901234567"
        "890123456789";
    struct scanhead *sh;
    char err[512];
    (void)state;
    bus.device[1] = (struct libusb_device){.present = 1};
    assert_int_equal(scanhead_open("usb", &sh, err, sizeof err), SCANHEAD_EINPUT);
    assert_non_null(strstr(err, "2 heads"));
    assert_non_null(strstr(err, ": usb:1209:0001:SH-1, usb:1209:0002"));
    close_head(open_head("usb:1209:2"));
    for (int i = 0; i < 3; i++)
        bus.device[i] = (struct libusb_device){.present = 1, .serial = hundred};
    assert_int_equal(scanhead_open("usb", &sh, err, sizeof err), SCANHEAD_EINPUT);
    assert_non_null(strstr(err, "3 heads"));
    assert_string_equal(err + strlen(err) - 3, "...");
}

static void test_cannot_open(void **state)
{
    struct scanhead *sh;
    char err[512];
    (void)state;
    bus.init_rc = LIBUSB_ERROR_OTHER;
    assert_int_equal(scanhead_open("usb", &sh, err, sizeof err), SCANHEAD_EIO);
    bus.init_rc = 0;
    bus.device[0].open_rc = LIBUSB_ERROR_NO_MEM;
    assert_int_equal(scanhead_open("usb", &sh, err, sizeof err), SCANHEAD_EIO);
    bus.device[0].open_rc = 0;
    /* less than two reads under way are no stream; what was begun is taken back */
    bus.submit_room = 1;
    assert_int_equal(scanhead_open("usb", &sh, err, sizeof err), SCANHEAD_EIO);
    assert_int_equal(bus.sessions, 0);
    bus.submit_room = 2;
    script_events(0, 100);
    sh = open_head("usb");
    expect_events(sh, 0, 100);
    close_head(sh);
}

/* ---- the stream */

/* Empty packets, errors of the bus, a stalled endpoint, in between good ones: what came is there, in order. */
static void test_failures_pass(void **state)
{
    static const enum libusb_transfer_status failures[] = {LIBUSB_TRANSFER_ERROR, LIBUSB_TRANSFER_STALL,
                                                           LIBUSB_TRANSFER_OVERFLOW};
    (void)state;
    uint32_t seq = 0;
    struct scanhead *sh = open_head("usb");
    for (int round = 0; round < 9; round++) {
        script_events(seq, seq + 5);
        fake_script(FAKE_IN, LIBUSB_TRANSFER_COMPLETED, NULL, 0);
        script_events(seq + 5, seq + 7);
        fake_script(FAKE_IN, failures[round % 3], NULL, 0);
        if (round % 2) fake_script(FAKE_IN, failures[round % 3], NULL, 0);
        script_events(seq + 7, seq + 9);
        seq += 9;
    }
    expect_events(sh, 0, seq);
    assert_true(bus.n_clear_halts > 0);
    assert_int_equal(bus.done, bus.n_steps);
    close_head(sh);
}

/* A frame whose first half comes with the failure, as some controllers give it. */
static void test_data_with_a_failure(void **state)
{
    uint8_t raw[512];
    (void)state;
    const size_t len = make_event(raw, sizeof raw, 1);
    struct scanhead *sh = open_head("usb");
    script_events(0, 1);
    fake_script(FAKE_IN, LIBUSB_TRANSFER_ERROR, raw, len / 2);
    fake_script(FAKE_IN, LIBUSB_TRANSFER_COMPLETED, raw + len / 2, len - len / 2);
    script_events(2, 5);
    expect_events(sh, 0, 5);
    close_head(sh);
}

/* usbfs has no memory for a moment: the read is sent off again later, behind the others. */
static void test_submit_fails_for_a_while(void **state)
{
    (void)state;
    struct scanhead *sh = open_head("usb");
    script_events(0, 100);
    expect_events(sh, 0, 1);
    bus.submit_rc = LIBUSB_ERROR_NO_MEM;
    bus.submit_fails = 3;
    expect_events(sh, 1, 100);
    assert_int_equal(bus.submit_fails, 0);
    close_head(sh);
}

/* ---- unplugging */

static void unplug(void)
{
    bus.gone = 1;
    bus.device[0].present = 0;
}

static void expect_lost(struct scanhead *sh)
{
    struct scanhead_frame frame;
    char reply[64];
    for (int i = 0; i < 2; i++) {
        assert_int_equal(scanhead_next(sh, &frame, TIMEOUT_MS), SCANHEAD_ELOST);
        assert_non_null(strstr(scanhead_error(sh), "unplugged"));
        assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, TIMEOUT_MS), SCANHEAD_ELOST);
    }
    close_head(sh);
}

static void test_unplug_at_once(void **state)
{
    (void)state;
    struct scanhead *sh = open_head("usb");
    script_events(0, 8);
    expect_events(sh, 0, 1); /* the others are in, too */
    unplug();
    expect_events(sh, 1, 8);
    expect_lost(sh);
}

/* The bus shows a device that goes as errors first. */
static void test_unplug_with_errors(void **state)
{
    (void)state;
    struct scanhead *sh = open_head("usb");
    script_events(0, 4);
    for (int i = 0; i < 20; i++)
        fake_script(FAKE_IN, LIBUSB_TRANSFER_ERROR, NULL, 0);
    bus.clear_halt_rc = LIBUSB_ERROR_IO;
    bus.idle = unplug;
    expect_events(sh, 0, 4);
    expect_lost(sh);
}

/* Never a word from the hub: after a while the head is lost all the same. */
static void test_errors_without_end(void **state)
{
    (void)state;
    struct scanhead *sh = open_head("usb");
    bus.submit_rc = bus.clear_halt_rc = LIBUSB_ERROR_IO;
    bus.submit_fails = -1;
    for (int i = 0; i < 16; i++)
        fake_script(FAKE_IN, LIBUSB_TRANSFER_ERROR, NULL, 0);
    expect_lost(sh);
}

/* ---- writing */

static void ask(struct scanhead *sh)
{
    char reply[64];
    memset(bus.written, 0, sizeof bus.written);
    bus.answer = "12\r\n";
    if (scanhead_command(sh, "TIME?", reply, sizeof reply, TIMEOUT_MS) != 0) fail_msg("%s", scanhead_error(sh));
    assert_string_equal(reply, "12");
    assert_string_equal(bus.written, "TIME?\n"); /* it alone, and once */
}

/* The write fails after it was sent off: that command gets no reply, and the next one goes out. */
static void test_write_fails(void **state)
{
    static const enum libusb_transfer_status failures[] = {LIBUSB_TRANSFER_ERROR, LIBUSB_TRANSFER_STALL};
    char reply[64];
    (void)state;
    struct scanhead *sh = open_head("usb");
    ask(sh);
    for (int i = 0; i < 2; i++) {
        const int cleared = bus.n_clear_halts;
        fake_script(FAKE_OUT, failures[i], NULL, 0);
        assert_int_equal(scanhead_command(sh, "SCAN:STOP", reply, sizeof reply, 20), SCANHEAD_ETIMEOUT);
        ask(sh);
        assert_int_equal(bus.n_clear_halts, cleared + 1);
    }
    bus.submit_rc = LIBUSB_ERROR_NO_MEM;
    bus.submit_fails = 3;
    ask(sh);
    assert_int_equal(bus.submit_fails, 0);
    close_head(sh);
}

/* The bus still says that the device is there, and takes nothing for it: the read that is under way tells nothing. */
static void test_unplug_seen_by_writing(void **state)
{
    char reply[64];
    (void)state;
    struct scanhead *sh = open_head("usb");
    fake_script(FAKE_OUT, LIBUSB_TRANSFER_ERROR, NULL, 0);
    assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, 20), SCANHEAD_ETIMEOUT);
    bus.submit_rc = bus.clear_halt_rc = LIBUSB_ERROR_IO;
    bus.submit_fails = -1;
    assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, TIMEOUT_MS), SCANHEAD_ELOST);
    assert_non_null(strstr(scanhead_error(sh), "unplugged"));
    close_head(sh);
}

static void test_unplug_while_writing(void **state)
{
    char reply[64];
    (void)state;
    /* in between: the write fails, then the device is gone when the endpoint is to be started anew */
    struct scanhead *sh = open_head("usb");
    fake_script(FAKE_OUT, LIBUSB_TRANSFER_ERROR, NULL, 0);
    assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, 20), SCANHEAD_ETIMEOUT);
    bus.clear_halt_rc = LIBUSB_ERROR_NO_DEVICE;
    assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, TIMEOUT_MS), SCANHEAD_ELOST);
    close_head(sh);
    /* when it is sent off */
    bus.clear_halt_rc = 0;
    sh = open_head("usb");
    bus.submit_rc = LIBUSB_ERROR_NO_DEVICE;
    bus.submit_fails = 1;
    assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, TIMEOUT_MS), SCANHEAD_ELOST);
    close_head(sh);
    /* while its reply is awaited */
    bus.submit_rc = 0;
    sh = open_head("usb");
    bus.idle = unplug;
    assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, TIMEOUT_MS), SCANHEAD_ELOST);
    close_head(sh);
}

/* The head takes no command: closing takes the write back before anything is freed. */
static void test_close_while_writing(void **state)
{
    char reply[64];
    (void)state;
    struct scanhead *sh = open_head("usb");
    bus.hold_writes = 1;
    assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, 20), SCANHEAD_ETIMEOUT);
    assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, 20), SCANHEAD_ETIMEOUT); /* behind it */
    close_head(sh);
}

/* A transfer that does not end when it is taken back is forgotten with the device. */
static void test_close_with_a_stuck_transfer(void **state)
{
    (void)state;
    struct scanhead *sh = open_head("usb");
    bus.will_not_cancel = 1;
    close_head(sh);
}

/* ---- waiting for a head */

static int looks; /* how often the bus is still looked at before the head comes */

static void come(void)
{
    bus.device[0].present = looks-- <= 0;
    bus.gone = 0;
}

static void test_wait(void **state)
{
    char err[512];
    struct scanhead *sh;
    (void)state;
    bus.device[0].present = 0;
    bus.idle = come;
    looks = 0;
    assert_int_equal(scanhead_open_within("usb", -1, &sh, err, sizeof err), 0);
    assert_string_equal(err, "");
    assert_int_equal(bus.n_lists, 2); /* before, and when it had come; no time was spent between */
    assert_int_equal(bus.n_waits, 1);
    assert_true(bus.last_wait_ms > 500); /* not one of the short waits of polling */
    script_events(0, 3);
    expect_events(sh, 0, 3);
    unplug();
    struct scanhead_frame frame;
    assert_int_equal(scanhead_next(sh, &frame, TIMEOUT_MS), SCANHEAD_ELOST);
    bus.sessions = bus.n_lists = 0;
    assert_int_equal(scanhead_reattach(sh, TIMEOUT_MS), 0);
    assert_int_equal(bus.n_lists, 2);
    script_events(5, 6);
    expect_events(sh, 5, 6);
    close_head(sh);
}

/* Just plugged in, udev has not given the permission yet: tried again without another event. */
static void permit(void)
{
    bus.device[0].present = 1;
    bus.device[0].open_rc = looks-- > 0 ? LIBUSB_ERROR_ACCESS : 0;
}

static void test_wait_for_permission(void **state)
{
    char err[512];
    struct scanhead *sh;
    (void)state;
    bus.device[0].present = 0;
    bus.idle = permit;
    looks = 3;
    assert_int_equal(scanhead_open_within("usb", TIMEOUT_MS, &sh, err, sizeof err), 0);
    close_head(sh);
    assert_int_equal(scanhead_open_within("usb:x", TIMEOUT_MS, &sh, err, sizeof err), SCANHEAD_EINPUT);
    bus.device[0].open_rc = LIBUSB_ERROR_ACCESS;
    assert_int_equal(scanhead_open_within("usb", 0, &sh, err, sizeof err), SCANHEAD_EPERM);
    looks = 1 << 30;
    assert_int_equal(scanhead_open_within("usb", 60, &sh, err, sizeof err), SCANHEAD_EPERM);
    expect_rule(err);
}

/* Without hot-plug events the list is looked at again and again. */
static void test_wait_without_events(void **state)
{
    char err[512];
    struct scanhead *sh;
    (void)state;
    for (bus.no_hotplug = 0; bus.no_hotplug < 2; bus.no_hotplug++) {
        bus.no_udev = !bus.no_hotplug;
        bus.device[0].present = bus.n_lists = 0;
        assert_int_equal(scanhead_open_within("usb", 120, &sh, err, sizeof err), SCANHEAD_ELOST);
        assert_true(bus.n_lists >= 2);
        assert_int_equal(bus.n_waits, 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_strings, begin, end),
        cmocka_unit_test_setup_teardown(test_no_permission, begin, end),
        cmocka_unit_test_setup_teardown(test_several, begin, end),
        cmocka_unit_test_setup_teardown(test_cannot_open, begin, end),
        cmocka_unit_test_setup_teardown(test_failures_pass, begin, end),
        cmocka_unit_test_setup_teardown(test_data_with_a_failure, begin, end),
        cmocka_unit_test_setup_teardown(test_submit_fails_for_a_while, begin, end),
        cmocka_unit_test_setup_teardown(test_unplug_at_once, begin, end),
        cmocka_unit_test_setup_teardown(test_unplug_with_errors, begin, end),
        cmocka_unit_test_setup_teardown(test_errors_without_end, begin, end),
        cmocka_unit_test_setup_teardown(test_write_fails, begin, end),
        cmocka_unit_test_setup_teardown(test_unplug_seen_by_writing, begin, end),
        cmocka_unit_test_setup_teardown(test_unplug_while_writing, begin, end),
        cmocka_unit_test_setup_teardown(test_close_while_writing, begin, end),
        cmocka_unit_test_setup_teardown(test_close_with_a_stuck_transfer, begin, end),
        cmocka_unit_test_setup_teardown(test_wait, begin, end),
        cmocka_unit_test_setup_teardown(test_wait_for_permission, begin, end),
        cmocka_unit_test_setup_teardown(test_wait_without_events, begin, end),
    };
    return cmocka_run_group_tests_name("host_bus", tests, NULL, NULL);
}
