/* SPDX-License-Identifier: MIT */
/* Transfers: filling, short and zero-length packets, cancellation at each stage, halts, resets. */
#include "tests/unit/usb_host.h"
#include "tests/unit/usb_models.h"

static uint8_t pattern[8192], back[8192];

static struct host *configured(enum usb_rate rate)
{
    struct host *host = host_new(&pair_model, USB_RATE_SUPER, rate);
    host_configure(host);
    for (size_t i = 0; i < sizeof pattern; i++)
        pattern[i] = (uint8_t)(i * 7 + i / 256);
    return host;
}

/* The result of one write, by its length L, into transfers of 1024 bytes at each packet size. The write fills as many
 * transfers as fit, and one ends short. There is a zero-length packet exactly where L is a whole number of packets and
 * fills no transfer. */
static void test_fill(void **state)
{
    (void)state;
    static const unsigned packets[] = {64, 512, 1024};
    static const size_t lengths[] = {1, 63, 64, 65, 511, 512, 513, 1023, 1024, 1025, 1536, 2047, 2048, 3000, 4096};
    for (int rate = 0; rate < 3; rate++)
        for (size_t i = 0; i < sizeof lengths / sizeof lengths[0]; i++) {
            struct host *host = configured((enum usb_rate)rate);
            const size_t len = lengths[i];
            for (uint64_t id = 0; id < 8; id++)
                host_submit(host, id, 0x81, NULL, 1024);
            assert_int_equal(usb_device_write(host->device, 0x81, pattern, len), len);
            const size_t full = len / 1024, rest = len % 1024;
            size_t at = 0;
            assert_int_equal(host->n_done, full + (rest != 0));
            for (uint64_t id = 0; id < full; id++, at += 1024) {
                assert_memory_equal(host->done[0]->data, pattern + at, 1024);
                assert_int_equal(host->done[0]->zero_packet, 0);
                host_expect(host, id, USB_OK, 1024);
            }
            if (rest != 0) {
                assert_memory_equal(host->done[0]->data, pattern + at, rest);
                assert_int_equal(host->done[0]->zero_packet, rest % packets[rate] == 0);
                host_expect(host, full, USB_OK, (uint32_t)rest);
            }
            /* The next submitted one goes behind those that wait, and ends nothing. */
            host_submit(host, 99, 0x81, NULL, 1024);
            assert_int_equal(host->n_done, 0);
            usb_device_detach(host->device);
            assert_int_equal(host->n_done, 8 - full - (rest != 0) + 1);
            while (host->n_done > 0)
                host_expect(host, host->done[0]->id, USB_GONE, 0);
            host_free(host);
        }
}

/* If the last transfer is exactly full, the zero-length packet that ends the unit comes in the next one. */
static void test_zero_packet(void **state)
{
    (void)state;
    struct host *host = configured(USB_RATE_HIGH);
    host_submit(host, 1, 0x81, NULL, 1024);
    assert_int_equal(usb_device_write(host->device, 0x81, pattern, 1024), 1024);
    host_expect(host, 1, USB_OK, 1024);
    host_submit(host, 2, 0x81, NULL, 1024);
    host_expect(host, 2, USB_OK, 0);
    host_submit(host, 3, 0x81, NULL, 1024); /* only once */
    assert_int_equal(host->n_done, 0);
    /* The transfer is full, but more was to come: no end yet. */
    assert_int_equal(usb_device_write(host->device, 0x81, pattern, 1500), 1024);
    host_expect(host, 3, USB_OK, 1024);
    host_submit(host, 4, 0x81, NULL, 1024);
    assert_int_equal(host->n_done, 0);
    assert_int_equal(usb_device_write(host->device, 0x81, pattern + 1024, 476), 476);
    host_expect(host, 4, USB_OK, 476);
    /* The transfer is full, with a short packet at its end: the write ends there. */
    host_submit(host, 5, 0x81, NULL, 700);
    assert_int_equal(usb_device_write(host->device, 0x81, pattern, 700), 700);
    host_expect(host, 5, USB_OK, 700);
    host_submit(host, 6, 0x81, NULL, 1024);
    assert_int_equal(host->n_done, 0);
    /* An end is due, and then the host clears the endpoint. The host's next request is another transfer. */
    assert_int_equal(usb_device_write(host->device, 0x81, pattern, 1024), 1024);
    host_expect(host, 6, USB_OK, 1024);
    assert_int_equal(host_control(host, 0x02, USB_REQ_CLEAR_FEATURE, 0, 0x81, 0, NULL), 0);
    host_submit(host, 7, 0x81, NULL, 1024);
    assert_int_equal(host->n_done, 0);
    usb_device_detach(host->device);
    host_expect(host, 7, USB_GONE, 0);
    host_free(host);
}

/* The rest is smaller than the packet: that is babble, and the packet is still there for the next. */
static void test_overflow(void **state)
{
    (void)state;
    struct host *host = configured(USB_RATE_HIGH);
    host_submit(host, 1, 0x81, NULL, 700);
    host_submit(host, 2, 0x81, NULL, 100);
    host_submit(host, 3, 0x81, NULL, 1024);
    assert_int_equal(usb_device_write(host->device, 0x81, pattern, 1000), 1000);
    assert_memory_equal(host->done[0]->data, pattern, 512);
    host_expect(host, 1, USB_OVERFLOW, 512);
    host_expect(host, 2, USB_OVERFLOW, 0);
    assert_memory_equal(host->done[0]->data, pattern + 512, 488);
    host_expect(host, 3, USB_OK, 488);
    host_free(host);
}

static void test_out(void **state)
{
    (void)state;
    struct host *host = configured(USB_RATE_HIGH);
    uint32_t epoch;
    host_submit(host, 1, 0x02, pattern, 600);
    host_submit(host, 2, 0x02, NULL, 0); /* waits its turn */
    host_submit(host, 3, 0x02, pattern + 600, 400);
    assert_int_equal(host->n_done, 0);
    assert_int_equal(usb_device_can_read(host->device, 0x02, &epoch), 600);
    assert_int_equal(usb_device_read(host->device, 0x02, back, 599), 599);
    assert_int_equal(host->n_done, 0); /* not before the last byte is read */
    assert_int_equal(usb_device_read(host->device, 0x02, back + 599, 1), 1);
    host_expect(host, 1, USB_OK, 600);
    host_expect(host, 2, USB_OK, 0);
    assert_int_equal(usb_device_read(host->device, 0x02, back + 600, 4096), 400);
    host_expect(host, 3, USB_OK, 400);
    assert_memory_equal(back, pattern, 1000);
    host_submit(host, 4, 0x02, NULL, 0); /* and alone it is over at once */
    host_expect(host, 4, USB_OK, 0);
    assert_int_equal(usb_device_read(host->device, 0x02, back, 10), 0);
    /* Directions are kept apart. */
    host_submit(host, 5, 0x81, NULL, 512);
    assert_int_equal(usb_device_read(host->device, 0x81, back, 10), 0);
    assert_int_equal(usb_device_write(host->device, 0x02, pattern, 10), 0);
    assert_true(usb_device_cancel(host->device, 5));
    host_expect(host, 5, USB_CANCELLED, 0);
    host_free(host);
}

/* Transfers are cancelled while they wait (first, middle, last of the queue), half read, too late, and twice. */
static void test_cancel(void **state)
{
    (void)state;
    struct host *host = configured(USB_RATE_HIGH);
    for (int which = 1; which <= 3; which++) {
        for (uint64_t id = 1; id <= 3; id++)
            host_submit(host, id, 0x81, NULL, 512);
        assert_int_equal(usb_device_cancel(host->device, (uint64_t)which), 1);
        host_expect(host, (uint64_t)which, USB_CANCELLED, 0);
        assert_int_equal(usb_device_cancel(host->device, (uint64_t)which), 0);
        host_submit(host, 4, 0x81, NULL, 512);
        assert_int_equal(usb_device_write(host->device, 0x81, pattern, 1400), 1400);
        for (uint64_t id = 1; id <= 4; id++)
            if (id != (uint64_t)which) host_expect(host, id, USB_OK, id == 4 ? 376 : 512);
        assert_int_equal(usb_device_cancel(host->device, 4), 0); /* too late */
        assert_int_equal(host->n_done, 0);
    }
    /* OUT: the part that was read counts, and the next one begins at its start. */
    host_submit(host, 7, 0x02, pattern, 100);
    host_submit(host, 8, 0x02, pattern + 200, 50);
    host_submit(host, 9, 0x02, NULL, 0);
    assert_int_equal(usb_device_read(host->device, 0x02, back, 30), 30);
    assert_int_equal(usb_device_cancel(host->device, 7), 1);
    host_expect(host, 7, USB_CANCELLED, 30);
    assert_int_equal(usb_device_read(host->device, 0x02, back, 100), 50);
    assert_memory_equal(back, pattern + 200, 50);
    host_expect(host, 8, USB_OK, 50);
    host_expect(host, 9, USB_OK, 0);
    host_submit(host, 10, 0x02, pattern, 10); /* an empty one behind a cancelled one is not stuck */
    host_submit(host, 11, 0x02, NULL, 0);
    usb_device_cancel(host->device, 10);
    host_expect(host, 10, USB_CANCELLED, 0);
    host_expect(host, 11, USB_OK, 0);
    host_free(host);
}

/* An endpoint is halted by its host, or by an injected fault, until the host clears it. */
static void test_halt(void **state)
{
    (void)state;
    struct host *host = host_new(&pair_model, USB_RATE_SUPER, USB_RATE_HIGH);
    assert_false(usb_device_halt(host->device, 0x81)); /* not configured */
    host_configure(host);
    for (int by_fault = 0; by_fault < 2; by_fault++) {
        host_submit(host, 1, 0x81, NULL, 512);
        host_submit(host, 2, 0x81, NULL, 512);
        host_submit(host, 3, 0x02, pattern, 10);
        if (by_fault)
            assert_true(usb_device_halt(host->device, 0x81));
        else
            assert_int_equal(host_control(host, 0x02, USB_REQ_SET_FEATURE, 0, 0x81, 0, NULL), 0);
        host_expect(host, 1, USB_STALLED, 0);
        host_expect(host, 2, USB_STALLED, 0);
        assert_int_equal(host->n_done, 0); /* OUT is not concerned */
        host_submit(host, 4, 0x81, NULL, 512);
        host_expect(host, 4, USB_STALLED, 0);
        assert_int_equal(usb_device_write(host->device, 0x81, pattern, 10), 0);
        assert_int_equal(host_control(host, 0x02, USB_REQ_CLEAR_FEATURE, 0, 0x81, 0, NULL), 0);
        host_submit(host, 5, 0x81, NULL, 512);
        assert_int_equal(usb_device_write(host->device, 0x81, pattern, 10), 10);
        host_expect(host, 5, USB_OK, 10);
        assert_int_equal(host_control(host, 0x02, USB_REQ_SET_FEATURE, 0, 0x02, 0, NULL), 0);
        host_expect(host, 3, USB_STALLED, 0);
        assert_int_equal(host_control(host, 0x82, USB_REQ_GET_STATUS, 0, 0x02, 2, NULL), 2);
        assert_int_equal(host_in[0], 1);
        host_control(host, 0x02, USB_REQ_CLEAR_FEATURE, 0, 0x02, 0, NULL);
    }
    /* A clear on one that is not halted is allowed, and pending ones stay. */
    host_submit(host, 6, 0x81, NULL, 512);
    assert_int_equal(host_control(host, 0x02, USB_REQ_CLEAR_FEATURE, 0, 0x81, 0, NULL), 0);
    assert_int_equal(host->n_done, 0);
    usb_device_detach(host->device);
    host_expect(host, 6, USB_GONE, 0);
    host_free(host);
}

static void test_gone(void **state)
{
    (void)state;
    struct host *host = host_new(&two_model, USB_RATE_SUPER, USB_RATE_HIGH);
    host_submit(host, 1, 0x82, NULL, 512); /* not configured yet */
    host_expect(host, 1, USB_GONE, 0);
    host_configure(host);
    host_submit(host, 2, 0x81, NULL, 512); /* no such endpoint */
    host_expect(host, 2, USB_GONE, 0);
    host_submit(host, 3, 0x82, NULL, 512);
    assert_int_equal(host_control(host, 1, USB_REQ_SET_INTERFACE, 0, 0, 0, NULL), 0);
    assert_int_equal(host->n_done, 0); /* the other interface is not touched */
    assert_int_equal(host_control(host, 1, USB_REQ_SET_INTERFACE, 0, 1, 0, NULL), 0);
    host_expect(host, 3, USB_GONE, 0);
    host_submit(host, 4, 0x82, NULL, 512);
    for (int i = 0; i < 5; i++) { /* back-to-back resets */
        usb_device_reset(host->device);
        if (i == 0) host_expect(host, 4, USB_GONE, 0);
        assert_int_equal(host->n_done, 0);
    }
    assert_false(usb_device_can_write(host->device, 0x82));
    host_configure(host);
    host_submit(host, 5, 0x82, NULL, 512);
    usb_device_suspend(host->device, 1);
    assert_int_equal(usb_device_write(host->device, 0x82, pattern, 5), 0);
    usb_device_suspend(host->device, 0);
    assert_int_equal(usb_device_write(host->device, 0x82, pattern, 5), 5);
    host_expect(host, 5, USB_OK, 5);
    host_submit(host, 6, 0x82, NULL, 512);
    usb_device_free(host->device); /* unplugs */
    host_expect(host, 6, USB_GONE, 0);
    free(host);
}

/* Where an interface ends, what was under way ends with it: half-read transfers, requested short packets, a notice
 * of a reset, a zero-length packet. The epoch is a new one. When it begins again, all is as at first. */
static void test_begun_again(void **state)
{
    (void)state;
    struct host *host = configured(USB_RATE_HIGH);
    assert_int_equal(host->n_changes, 1); /* the model's only interface */
    host_submit(host, 1, 0x02, pattern, 100);
    host_submit(host, 2, 0x02, pattern, 100);
    assert_int_equal(usb_device_read(host->device, 0x02, back, 30), 30);
    host_submit(host, 3, 0x81, NULL, 512);
    assert_int_equal(usb_device_write(host->device, 0x81, pattern, 512), 512); /* a zero-length packet is due */
    host_expect(host, 3, USB_OK, 512);
    usb_device_shorten(host->device, 0x81, 1);
    usb_device_set_gone_due(host->device, 0x81, 1);
    const uint32_t out = usb_device_epoch(host->device, 0x02), in = usb_device_epoch(host->device, 0x81);
    assert_int_equal(host_control(host, 1, USB_REQ_SET_INTERFACE, 0, 0, 0, NULL), 0);
    assert_int_equal(host->n_changes, 3);
    assert_int_equal(usb_facts(host->device)->end, USB_END_CONFIGURED);
    host_expect(host, 1, USB_GONE, 30);
    host_expect(host, 2, USB_GONE, 0);
    assert_int_not_equal(usb_device_epoch(host->device, 0x02), out);
    assert_int_not_equal(usb_device_epoch(host->device, 0x81), in);
    host_submit(host, 4, 0x02, pattern + 100, 100);
    assert_int_equal(usb_device_read(host->device, 0x02, back, 200), 100); /* from its first byte */
    assert_memory_equal(back, pattern + 100, 100);
    host_expect(host, 4, USB_OK, 100);
    host_submit(host, 5, 0x81, NULL, 512);
    assert_int_equal(host->n_done, 0);
    assert_int_equal(usb_device_write(host->device, 0x81, pattern, 100), 100);
    host_expect(host, 5, USB_OK, 100);
    usb_device_reset(host->device);
    assert_int_equal(host->n_changes, 4);
    assert_int_equal(usb_facts(host->device)->end, USB_END_RESET);
    host_submit(host, 6, 0x81, NULL, 512); /* the endpoint is there no more */
    host_expect(host, 6, USB_GONE, 0);
    host_free(host);
}

/* A suspended device is unplugged, or its bus is reset: suspended no more, it writes again. */
static void test_suspended(void **state)
{
    (void)state;
    struct host *host = configured(USB_RATE_HIGH);
    for (int reset = 0; reset < 2; reset++) {
        usb_device_suspend(host->device, 1);
        if (reset)
            usb_device_reset(host->device);
        else
            host_attach(host, USB_RATE_HIGH);
        host_configure(host);
        host_submit(host, 1, 0x81, NULL, 512);
        assert_int_equal(usb_device_write(host->device, 0x81, pattern, 5), 5);
        host_expect(host, 1, USB_OK, 5);
    }
    host_free(host);
}

static void test_epochs(void **state)
{
    (void)state;
    struct host *host = configured(USB_RATE_HIGH);
    uint32_t epoch;
    host_submit(host, 1, 0x02, "old", 3);
    usb_device_next_epoch(host->device, 0x02);
    host_submit(host, 2, 0x02, "new", 3);
    usb_device_can_read(host->device, 0x02, &epoch);
    assert_int_not_equal(epoch, usb_device_epoch(host->device, 0x02));
    assert_int_equal(usb_device_read(host->device, 0x02, back, 100), 3); /* not across the border */
    assert_memory_equal(back, "old", 3);
    host_expect(host, 1, USB_OK, 3);
    host_submit(host, 3, 0x02, "x", 1);
    usb_device_next_epoch(host->device, 0x02);
    host_submit(host, 4, 0x02, "y", 1);
    usb_device_drop(host->device, 0x02);
    host_expect(host, 2, USB_OK, 3);
    host_expect(host, 3, USB_OK, 1);
    assert_int_equal(usb_device_read(host->device, 0x02, back, 100), 1);
    assert_int_equal(back[0], 'y');
    host_expect(host, 4, USB_OK, 1);
    host_free(host);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_fill),      cmocka_unit_test(test_zero_packet), cmocka_unit_test(test_overflow),
        cmocka_unit_test(test_out),       cmocka_unit_test(test_cancel),      cmocka_unit_test(test_halt),
        cmocka_unit_test(test_gone),      cmocka_unit_test(test_epochs),      cmocka_unit_test(test_begun_again),
        cmocka_unit_test(test_suspended),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
