/* SPDX-License-Identifier: MIT */
/* Tests of halted endpoints, zero-length packets, transfers cancelled at each stage, and resets back to back. */
#include "tests/guest/chapter9.h"

/* ---- endpoints */

static int is_halted(uint8_t endpoint)
{
    uint8_t status[2];
    assert_int_equal(control(EP_IN, LIBUSB_REQUEST_GET_STATUS, 0, endpoint, status, 2), 2);
    return status[0];
}

static void test_halt(void **state)
{
    (void)state;
    int n;
    const uint8_t endpoint[] = {usb.interface.in, usb.interface.out};
    open_session();
    for (size_t i = 0; i < 2; i++) {
        for (int again = 0; again < 3; again++) {
            ask();
            assert_int_equal(control(EP_OUT, LIBUSB_REQUEST_SET_FEATURE, HALT, endpoint[i], NULL, 0), 0);
            assert_int_equal(is_halted(endpoint[i]), 1);
            assert_int_equal(libusb_bulk_transfer(usb.dev, endpoint[i], buf, 1024, &n, MS), STALL);
            assert_int_equal(is_halted(endpoint[i]), 1);
            assert_int_equal(libusb_clear_halt(usb.dev, endpoint[i]), 0);
            assert_int_equal(is_halted(endpoint[i]), 0);
        }
        assert_int_equal(libusb_clear_halt(usb.dev, endpoint[i]), 0); /* this is allowed without a halt, too */
    }
    ask();
    if (!usb.has_kernel) /* dummy_hcd takes any feature of an endpoint for a halt */
        assert_int_equal(control(EP_OUT, LIBUSB_REQUEST_SET_FEATURE, 9, endpoint[0], NULL, 0), STALL);
    session(0);
}

static void test_zero_length(void **state)
{
    char line[1024];
    (void)state;
    open_session();
    for (int i = 0; i < 20; i++)
        send_bytes("", 0);
    ask();
    send_bytes("*ID", 3); /* the command comes in pieces, with empty packets between them */
    send_bytes("", 0);
    send_bytes("N", 1);
    send_bytes("?\n", 2);
    expect_reply("scanhead,");
    /* 128 commands of 8 bytes fill a whole number of packets, and a zero-length packet follows. */
    for (int i = 0; i < 1024; i += 8)
        memcpy(line + i, "  *IDN?\n", 8);
    send_bytes(line, 1024);
    send_bytes("", 0);
    for (int i = 0; i < 128; i++)
        expect_reply("scanhead,");
    session(0);
}

/* ---- cancelling */

static void LIBUSB_CALL on_done(struct libusb_transfer *transfer)
{
    *(int *)transfer->user_data = 1;
}

static void wait_done(int *done)
{
    struct timeval second = {.tv_sec = 5};
    while (!*done)
        assert_int_equal(libusb_handle_events_timeout_completed(usb.ctx, &second, done), 0);
}

/* Cancels one transfer after some events were handled. Returns how it ended. */
static enum libusb_transfer_status cancel_one(uint8_t endpoint, int len, int wait_us)
{
    int done = 0;
    struct libusb_transfer *transfer = libusb_alloc_transfer(0);
    assert_non_null(transfer);
    libusb_fill_bulk_transfer(transfer, usb.dev, endpoint, buf, len, on_done, &done, 0);
    assert_int_equal(libusb_submit_transfer(transfer), 0);
    struct timeval wait = {.tv_usec = wait_us};
    if (wait_us > 0) libusb_handle_events_timeout_completed(usb.ctx, &wait, &done);
    int rc = libusb_cancel_transfer(transfer);
    assert_true(rc == 0 || rc == LIBUSB_ERROR_NOT_FOUND); /* it may have been done just before */
    wait_done(&done);
    enum libusb_transfer_status status = transfer->status;
    libusb_free_transfer(transfer);
    return status;
}

static void test_cancel_without_session(void **state)
{
    (void)state;
    session(0);
    for (int i = 0; i < 50; i++)
        assert_int_equal(cancel_one(usb.interface.in, 16384, 500 * (i % 4)), LIBUSB_TRANSFER_CANCELLED);
}

/* In a session frames come at any time, so a read may be cancelled before, within or after its data. */
static void test_cancel_reads(void **state)
{
    (void)state;
    for (int i = 0; i < 40; i++) {
        open_session();
        enum libusb_transfer_status status = cancel_one(usb.interface.in, 16384, 150 * (i % 8));
        assert_true(status == LIBUSB_TRANSFER_CANCELLED || status == LIBUSB_TRANSFER_COMPLETED);
    }
    open_session();
    ask();
    session(0);
}

/* Many reads run at once. They are cancelled from the last to the first, from the first to the last, or every other one
 * first. */
static void test_cancel_many(void **state)
{
    enum { N = 16 };
    struct libusb_transfer *transfer[N];
    static uint8_t room[N][4096];
    int done[N];
    (void)state;
    session(0);
    for (int round = 0; round < 12; round++) {
        for (int i = 0; i < N; i++) {
            transfer[i] = libusb_alloc_transfer(0);
            done[i] = 0;
            libusb_fill_bulk_transfer(transfer[i], usb.dev, usb.interface.in, room[i], 4096, on_done, &done[i], 0);
            assert_int_equal(libusb_submit_transfer(transfer[i]), 0);
        }
        for (int i = 0; i < N; i++)
            libusb_cancel_transfer(transfer[round % 3 == 0   ? N - 1 - i
                                            : round % 3 == 1 ? i
                                                             : (i * 2 + i / (N / 2)) % N]);
        for (int i = 0; i < N; i++) {
            wait_done(&done[i]);
            assert_int_equal(transfer[i]->status, LIBUSB_TRANSFER_CANCELLED);
            libusb_free_transfer(transfer[i]);
        }
    }
}

/* Half a command that was cancelled on its way must not be glued to the first command of the next session. */
static void test_cancel_writes(void **state)
{
    (void)state;
    for (int i = 0; i < 20; i++) {
        open_session();
        memset(buf, 'x', 8);
        cancel_one(usb.interface.out, 8, 100 * (i % 3));
        session(0);
    }
    open_session();
    ask();
    session(0);
}

static void test_cancel_control(void **state)
{
    uint8_t setup[8 + 18];
    (void)state;
    for (int i = 0; i < 50; i++) {
        int done = 0;
        struct libusb_transfer *transfer = libusb_alloc_transfer(0);
        libusb_fill_control_setup(setup, EP0_IN, LIBUSB_REQUEST_GET_DESCRIPTOR, 0x0100, 0, 18);
        libusb_fill_control_transfer(transfer, usb.dev, setup, on_done, &done, MS);
        assert_int_equal(libusb_submit_transfer(transfer), 0);
        struct timeval wait = {.tv_usec = 50 * (i % 5)};
        if (i % 5 != 0) libusb_handle_events_timeout_completed(usb.ctx, &wait, &done);
        libusb_cancel_transfer(transfer);
        wait_done(&done);
        assert_true(transfer->status == LIBUSB_TRANSFER_CANCELLED || transfer->status == LIBUSB_TRANSFER_COMPLETED);
        libusb_free_transfer(transfer);
        assert_int_equal(get_descriptor(LIBUSB_DT_DEVICE, 0, 0, buf, 18), 18);
    }
}

/* ---- resets */

static void test_resets(void **state)
{
    (void)state;
    for (int i = 0; i < 5; i++)
        assert_int_equal(libusb_reset_device(usb.dev), 0);
    open_session();
    ask();
    for (int i = 0; i < 3; i++) { /* the session is open, and frames are on the way */
        assert_int_equal(libusb_reset_device(usb.dev), 0);
        open_session();
        ask();
    }
    session(0);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)
    const struct CMUnitTest tests[] = {
        TEST(test_halt),        TEST(test_zero_length),   TEST(test_cancel_without_session), TEST(test_cancel_reads),
        TEST(test_cancel_many), TEST(test_cancel_writes), TEST(test_cancel_control),         TEST(test_resets),
    };
    return cmocka_run_group_tests_name("chapter9_transfers", tests, NULL, NULL);
}
