/* SPDX-License-Identifier: MIT */
/* libscanhead on a scripted bus: the names of a device, permissions, several heads, waiting for one. tests/guest has a
 * real bus. */
#include "tests/unit/bus_rig.h"

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
        char err[512] = "", other[256];
        bus.device[0] = (struct libusb_device){.present = 1, .maker = called, .product = called, .serial = called};
        bus.device[1] = (struct libusb_device){.present = 1, .other_class = 1, .serial = called};
        assert_int_equal(scanhead_list_usb(head, FAKE_DEVICES, err, sizeof err), 1);
        assert_string_equal(err, "");
        assert_string_equal(head[0].maker, cases[i].shown);
        assert_string_equal(head[0].product, cases[i].shown);
        assert_string_equal(head[0].serial, cases[i].shown);
        assert_string_equal(head[0].problem, "");
        snprintf(other, sizeof other, "usb:1209:0001:%s", cases[i].shown);
        assert_string_equal(head[0].source, other);
        close_head(open_head(head[0].source)); /* the shown name opens the head */
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

/* The user reads one line, on a terminal or in a log, and can follow it. */
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
    assert_memory_equal(err, "usb: 2 heads are plugged in; name one of them: usb:", 51);
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
    assert_string_equal(err, "usb: no USB on this system: some error");
    bus.init_rc = 0;
    bus.device[0].present = 0;
    assert_int_equal(scanhead_open("usb:1209:1", &sh, err, sizeof err), SCANHEAD_ELOST);
    assert_string_equal(err, "usb:1209:1: no such head on USB; scanhead list shows the heads");
    bus.device[0].present = 1;
    /* The head is 1209:0001. 0 is a number like any other, and the only number that fits is the head's. */
    static const char *const others[] = {"usb:0:1", "usb:1209:0", "usb:0:0", "usb:120a:1", "usb:1209:2"};
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++)
        assert_int_equal(scanhead_open(others[i], &sh, err, sizeof err), SCANHEAD_ELOST);
    bus.device[0].open_rc = LIBUSB_ERROR_NO_MEM;
    assert_int_equal(scanhead_open("usb", &sh, err, sizeof err), SCANHEAD_EIO);
    assert_memory_equal(err, "usb: cannot open the head 1209:0001, bus 1 device 2: ", 53);
    bus.device[0].open_rc = 0;
    /* Fewer than two reads under way are no stream, so the ones that were begun are undone. */
    bus.submit_room = 1;
    assert_int_equal(scanhead_open("usb", &sh, err, sizeof err), SCANHEAD_EIO);
    assert_int_equal(bus.sessions, 0);
    bus.submit_room = 2;
    script_events(0, 100);
    sh = open_head("usb");
    expect_events(sh, 0, 100);
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

/* A head was just plugged in, and udev has not given the permission yet. The head is tried again without another
 * event. */
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

/* The head is found, and can't be used: another program has it, it goes, it refuses, or the system has no room. */
static void test_cannot_use(void **state)
{
    static const struct {
        int claim_rc, session_rc, room, code;
        const char *why;
    } rows[] = {
        {LIBUSB_ERROR_BUSY, 0, 0, SCANHEAD_EIO, "another program has the head's interface 2"},
        {LIBUSB_ERROR_NO_DEVICE, 0, 0, SCANHEAD_ELOST, "unplugged while it was opened"},
        {LIBUSB_ERROR_ACCESS, 0, 0, SCANHEAD_EIO,
         "cannot claim the interface: Access denied (insufficient permissions)"},
        {0, LIBUSB_ERROR_NO_DEVICE, 0, SCANHEAD_ELOST, "the head does not open the stream: some error"},
        {0, LIBUSB_ERROR_PIPE, 0, SCANHEAD_EIO, "the head does not open the stream: some error"},
        {0, 0, 1, SCANHEAD_EIO, "cannot start reading: some error"},
        {0, 0, 2, SCANHEAD_OK, NULL}, /* fewer transfers work, too */
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct scanhead *sh = NULL;
        char err[512] = "", want[200];
        bus.claim_rc = rows[i].claim_rc;
        bus.session_rc = rows[i].session_rc;
        bus.submit_room = rows[i].room;
        assert_int_equal(scanhead_open("usb", &sh, err, sizeof err), rows[i].code);
        snprintf(want, sizeof want, "usb:1209:0001:SH-1: %s", rows[i].why);
        if (rows[i].code != SCANHEAD_OK) assert_string_equal(err, want);
        if (sh != NULL) close_head(sh);
        fake_expect_nothing_left();
    }
}

/* Without hot-plug events the list is read again and again. */
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
        cmocka_unit_test_setup_teardown(test_strings, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_no_permission, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_several, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_cannot_open, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_cannot_use, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_wait, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_wait_for_permission, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_wait_without_events, rig_begin, rig_end),
    };
    return cmocka_run_group_tests_name("host_bus", tests, NULL, NULL);
}
