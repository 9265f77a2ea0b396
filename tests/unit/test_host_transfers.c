/* SPDX-License-Identifier: MIT */
/* libscanhead on a scripted bus: transfers that fail, unplugging at each moment, closing with some under way.
 * tests/guest has a real bus. */
#include "tests/unit/bus_rig.h"

/* ---- the stream */

/* Empty packets, errors of the bus and a stalled endpoint come between good transfers. The received bytes are there, in
 * order. */
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

/* Reads that fail together are one failure: the endpoint is started again once, and nothing is lost after it. */
static void test_failures_together(void **state)
{
    (void)state;
    struct scanhead *sh = open_head("usb");
    script_events(0, 1); /* so that the first to fail is not the first of the ring */
    expect_events(sh, 0, 1);
    for (int i = 0; i < 4; i++)
        fake_script(FAKE_IN, i % 2 ? LIBUSB_TRANSFER_STALL : LIBUSB_TRANSFER_ERROR, NULL, 0);
    script_events(1, 3);
    expect_events(sh, 1, 3);
    assert_int_equal(bus.n_clear_halts, 1);
    for (int i = 0; i < 16; i++) /* all reads */
        fake_script(FAKE_IN, LIBUSB_TRANSFER_ERROR, NULL, 0);
    script_events(3, 5);
    expect_events(sh, 3, 5);
    assert_int_equal(bus.n_clear_halts, 2);
    close_head(sh);
}

/* The first half of a frame comes with the failure, as some controllers give it. */
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

/* usbfs has no memory for a moment. The read is submitted again later, after the others. */
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
    assert_int_equal(bus.n_clear_halts, 1); /* the three are one failure */
    close_head(sh);
}

/* ---- unplugging */

static void expect_lost(struct scanhead *sh)
{
    struct scanhead_frame frame;
    char reply[64];
    for (int i = 0; i < 2; i++) {
        assert_int_equal(scanhead_next(sh, &frame, TIMEOUT_MS), SCANHEAD_ELOST);
        assert_string_equal(scanhead_error(sh), "usb:1209:0001:SH-1: the head was unplugged, or no longer answers");
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

/* An unplugging shows as errors of the bus at first. */
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

/* The hub never reports the unplugging. After a while the head is lost all the same. */
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

/* Another program resets the bus. The kernel ends all transfers as if the device had gone, but it still answers. A
 * reset is not an unplugging: earlier frames are there, and a new session goes on with the same head. */
static void bus_resets(enum libusb_transfer_status status)
{
    struct scanhead_frame frame;
    char reply[64];
    struct scanhead *sh = open_head("usb");
    script_events(0, 4);
    for (int i = 0; i < 16; i++)
        fake_script(FAKE_IN, status, NULL, 0);
    bus.was_reset = 1;
    expect_events(sh, 0, 4);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(scanhead_next(sh, &frame, TIMEOUT_MS), SCANHEAD_ERESET);
        assert_string_equal(scanhead_error(sh), "usb:1209:0001:SH-1: the USB bus was reset: the head is still plugged "
                                                "in, and its session is over");
        assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, TIMEOUT_MS), SCANHEAD_ERESET);
    }
    bus.n_steps = bus.done = 0; /* the reset is over */
    assert_int_equal(scanhead_reattach(sh, TIMEOUT_MS), 0);
    script_events(6, 9);
    expect_events(sh, 6, 9);
    unplug();
    assert_int_equal(scanhead_next(sh, &frame, TIMEOUT_MS), SCANHEAD_ELOST); /* this is an unplugging */
    close_head(sh);
}

static void test_bus_reset(void **state)
{
    (void)state;
    bus_resets(LIBUSB_TRANSFER_NO_DEVICE);
}

/* A reader that was not running meanwhile finds transfers that ended without a byte. The kernel takes new ones, which
 * nobody answers: the session is over. */
static void test_bus_reset_behind_its_back(void **state)
{
    (void)state;
    bus_resets(LIBUSB_TRANSFER_COMPLETED);
}

/* Transfers also end without a byte within a session, after a unit of whole packets. */
static void test_empty_transfers(void **state)
{
    (void)state;
    for (int old = 0; old < 2; old++) {
        struct scanhead *sh = open_head("usb");
        bus.no_question = old;
        bus.n_steps = bus.done = 0;
        script_events(0, 4);
        for (int i = 0; i < 20; i++)
            fake_script(FAKE_IN, LIBUSB_TRANSFER_COMPLETED, NULL, 0);
        script_events(4, 8);
        expect_events(sh, 0, 8);
        close_head(sh);
    }
}

/* ---- writing */

static void ask_after(struct scanhead *sh, const char *settling)
{
    char reply[64], written[64];
    memset(bus.written, 0, sizeof bus.written);
    bus.answer = "12\r\n";
    if (scanhead_command(sh, "TIME?", reply, sizeof reply, TIMEOUT_MS) != 0) fail_msg("%s", scanhead_error(sh));
    assert_string_equal(reply, "12");
    snprintf(written, sizeof written, "%sTIME?\n", settling);
    assert_string_equal(bus.written, written); /* nothing else, and once */
}

static void ask(struct scanhead *sh)
{
    ask_after(sh, "");
}

/* The write fails after it was submitted. The written command gets no reply, and the next one is sent. */
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
        ask_after(sh, "\n*IDN?\n"); /* it finds its place among the replies first */
        ask(sh);
        assert_int_equal(bus.n_clear_halts, cleared + 1);
    }
    bus.submit_rc = LIBUSB_ERROR_NO_MEM;
    bus.submit_fails = 3;
    ask(sh);
    assert_int_equal(bus.submit_fails, 0);
    close_head(sh);
}

/* The bus still reports the device, but takes no writes for it. The read that is under way shows nothing. */
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
    assert_string_equal(scanhead_error(sh), "usb:1209:0001:SH-1: the head was unplugged, or no longer answers");
    close_head(sh);
}

static void test_unplug_while_writing(void **state)
{
    char reply[64];
    (void)state;
    /* The failure comes in between: the write fails, then the device is gone when the endpoint is to be started
     * anew. */
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

static void script_one(void)
{
    bus.idle = NULL;
    script_events(0, 1);
}

/* The system fails, or a signal comes, while events are taken in: within a read, within a wait, and before a write. */
static void test_events_fail(void **state)
{
    static const struct {
        int rc, in, limit_ms, code;
        const char *why; /* NULL: the frame comes all the same */
    } rows[] = {
        {LIBUSB_ERROR_IO, 0, TIMEOUT_MS, SCANHEAD_EIO, "cannot read: Input/output error"},
        {LIBUSB_ERROR_IO, 1, TIMEOUT_MS, SCANHEAD_EIO, "Input/output error"},
        {LIBUSB_ERROR_INTERRUPTED, 0, TIMEOUT_MS, SCANHEAD_OK, NULL},
        {LIBUSB_ERROR_INTERRUPTED, 1, TIMEOUT_MS, SCANHEAD_OK, NULL},
        {LIBUSB_ERROR_INTERRUPTED, 1, -1, SCANHEAD_ETIMEOUT, "a signal interrupted the wait"},
    };
    struct scanhead_frame frame;
    char reply[64], want[100];
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct scanhead *sh = open_head("usb");
        bus.events_rc = rows[i].rc;
        bus.events_in = rows[i].in;
        bus.n_steps = bus.done = 0;
        bus.idle = rows[i].why == NULL ? script_one : NULL;
        assert_int_equal(scanhead_next(sh, &frame, rows[i].limit_ms), rows[i].code);
        if (rows[i].why == NULL)
            assert_int_equal(frame.seq, 0);
        else
            snprintf(want, sizeof want, "usb:1209:0001:SH-1: %s", rows[i].why);
        if (rows[i].why != NULL) assert_string_equal(scanhead_error(sh), want);
        assert_int_equal(bus.events_rc, 0);
        close_head(sh);
    }
    struct scanhead *sh = open_head("usb");
    bus.hold_writes = 1;
    assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, 20), SCANHEAD_ETIMEOUT);
    bus.events_in = 0;
    bus.events_rc = LIBUSB_ERROR_IO; /* that write is still under way, so events are taken in first */
    assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, TIMEOUT_MS), SCANHEAD_EIO);
    close_head(sh);
}

/* The head takes no command. Closing cancels the write before anything is freed. */
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

/* A transfer that does not end when it is cancelled is forgotten with the device. */
static void test_close_with_a_stuck_transfer(void **state)
{
    (void)state;
    struct scanhead *sh = open_head("usb");
    bus.will_not_cancel = 1;
    close_head(sh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_failures_pass, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_failures_together, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_data_with_a_failure, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_submit_fails_for_a_while, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_unplug_at_once, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_unplug_with_errors, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_errors_without_end, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_bus_reset, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_bus_reset_behind_its_back, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_empty_transfers, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_write_fails, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_unplug_seen_by_writing, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_unplug_while_writing, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_close_while_writing, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_events_fail, rig_begin, rig_end),
        cmocka_unit_test_setup_teardown(test_close_with_a_stuck_transfer, rig_begin, rig_end),
    };
    return cmocka_run_group_tests_name("host_transfers", tests, NULL, NULL);
}
