/* Chapter 9 of the USB specification asked of a head, over libusb and through a real kernel: every standard request,
 * wrong lengths and indices, halted endpoints, zero-length packets, transfers cancelled at each stage, resets back to
 * back.
 *
 * After each test the head must still answer a command, with nothing lost or garbled: a device that survives a wrong
 * request but is out of step afterwards has failed. Expected values come from the specification and from the device's
 * own descriptors, compared with each other.
 *
 * CHAPTER9_KERNEL=1: the device's kernel (composite gadget, FunctionFS) answers the standard requests, not the program;
 * what the specification leaves open is then not asked. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/host/usb.h"

enum { MS = 1000, EP0_IN = 0x80, IF_IN = 0x81, EP_IN = 0x82, DEV_OUT = 0x00, IF_OUT = 0x01, EP_OUT = 0x02 };
enum { VENDOR_IF_OUT = 0x41, HALT = 0, STALL = LIBUSB_ERROR_PIPE, BUFFER = 64 << 10 };

static struct {
    libusb_context *ctx;
    libusb_device_handle *dev;
    struct usb_interface interface;
    struct libusb_device_descriptor descriptor;
    struct libusb_config_descriptor *config;
    int speed, has_kernel;
} t;

static uint8_t buf[BUFFER];
static struct native_parser parser;

static int control(int type, int request, int value, int index, void *data, int len)
{
    return libusb_control_transfer(t.dev, (uint8_t)type, (uint8_t)request, (uint16_t)value, (uint16_t)index, data,
                                   (uint16_t)len, MS);
}

static int get_descriptor(int type, int index, int lang, void *data, int len)
{
    return control(EP0_IN, LIBUSB_REQUEST_GET_DESCRIPTOR, type << 8 | index, lang, data, len);
}

/* ---- the session: a command out, its reply in between the frames */

static void session(int open)
{
    assert_int_equal(control(VENDOR_IF_OUT, USB_REQUEST_SESSION, open, t.interface.number, NULL, 0), 0);
}

static void send_bytes(const void *data, int len)
{
    int sent = -1;
    assert_int_equal(libusb_bulk_transfer(t.dev, t.interface.out, (uint8_t *)(uintptr_t)data, len, &sent, MS), 0);
    assert_int_equal(sent, len);
}

/* The next reply line, within some reads; every frame in between with right checksums. */
static void expect_reply(const char *begin)
{
    for (int i = 0; i < 200; i++) {
        enum native_item item;
        while ((item = native_parser_next(&parser)) == NATIVE_FRAME) {
        }
        assert_int_equal(parser.stats.bad_bytes + parser.stats.bad_payload + parser.stats.seq_lost, 0);
        if (item == NATIVE_TEXT) {
            assert_memory_equal(parser.text, begin, strlen(begin));
            return;
        }
        size_t room;
        int got = 0;
        uint8_t *to = native_parser_room(&parser, &room);
        int rc = libusb_bulk_transfer(t.dev, t.interface.in, to, (int)(room < 16384 ? room : 16384) & ~1023, &got, MS);
        assert_true(rc == 0 || rc == LIBUSB_ERROR_TIMEOUT);
        native_parser_added(&parser, (size_t)got);
    }
    fail_msg("no reply that begins with %s", begin);
}

static void open_session(void)
{
    native_parser_init(&parser);
    session(1);
}

static void ask(void)
{
    send_bytes("*IDN?\n", 6);
    expect_reply("scanhead,");
}

static void find(void)
{
    libusb_device **list;
    assert_int_equal(libusb_init(&t.ctx), 0);
    ssize_t n = libusb_get_device_list(t.ctx, &list);
    for (ssize_t i = 0; i < n && t.dev == NULL; i++)
        if (host_usb_interface(list[i], &t.interface)) assert_int_equal(libusb_open(list[i], &t.dev), 0);
    libusb_free_device_list(list, 1);
    assert_non_null(t.dev);
    libusb_device *device = libusb_get_device(t.dev);
    t.speed = libusb_get_device_speed(device);
    assert_int_equal(libusb_get_device_descriptor(device, &t.descriptor), 0);
    assert_int_equal(libusb_get_active_config_descriptor(device, &t.config), 0);
    assert_int_equal(libusb_claim_interface(t.dev, t.interface.number), 0);
}

static int setup(void **state)
{
    (void)state;
    memset(&t, 0, sizeof t);
    t.has_kernel = getenv("CHAPTER9_KERNEL") != NULL;
    find();
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    open_session();
    ask();
    session(0);
    libusb_release_interface(t.dev, t.interface.number);
    libusb_free_config_descriptor(t.config);
    libusb_close(t.dev);
    libusb_exit(t.ctx);
    return 0;
}

/* ---- standard requests */

static void test_descriptor_lengths(void **state)
{
    static const int lengths[] = {1, 2, 8, 17, 18, 19, 64, 255, 4096};
    uint8_t whole[18];
    (void)state;
    assert_int_equal(get_descriptor(LIBUSB_DT_DEVICE, 0, 0, whole, 18), 18);
    assert_int_equal(whole[0], 18);
    assert_int_equal(whole[1], LIBUSB_DT_DEVICE);
    assert_int_equal(whole[17], 1); /* one configuration */
    for (size_t i = 0; i < sizeof lengths / sizeof lengths[0]; i++) {
        int expected = lengths[i] < 18 ? lengths[i] : 18;
        assert_int_equal(get_descriptor(LIBUSB_DT_DEVICE, 0, 0, buf, lengths[i]), expected);
        assert_memory_equal(buf, whole, (size_t)expected);
    }
    assert_int_equal(get_descriptor(LIBUSB_DT_DEVICE, 0, 0, buf, 0), 0);
    int total = get_descriptor(LIBUSB_DT_CONFIG, 0, 0, buf, 4096);
    assert_int_equal(total, buf[2] | buf[3] << 8);
    assert_int_equal(total, t.config->wTotalLength);
    for (int len = 1; len <= total; len += 7)
        assert_int_equal(get_descriptor(LIBUSB_DT_CONFIG, 0, 0, buf, len), len);
}

/* The descriptors of a configuration follow each other by their lengths, and their counts are what comes. */
static void check_config(const uint8_t *p, int total)
{
    int interfaces = 0, endpoints = 0, declared = 0, at = 0;
    uint32_t seen_interfaces = 0, seen_in = 0, seen_out = 0;
    for (; at < total; at += p[at]) {
        assert_true(p[at] >= 2 && at + p[at] <= total);
        if (p[at + 1] == LIBUSB_DT_INTERFACE) {
            assert_int_equal(endpoints, declared);
            endpoints = 0;
            declared = p[at + 4];
            interfaces += (seen_interfaces >> p[at + 2] & 1) == 0;
            seen_interfaces |= UINT32_C(1) << p[at + 2];
        } else if (p[at + 1] == LIBUSB_DT_ENDPOINT) {
            uint32_t *seen = p[at + 2] & 0x80 ? &seen_in : &seen_out, bit = UINT32_C(1) << (p[at + 2] & 15);
            assert_false(*seen & bit);
            *seen |= bit;
            endpoints++;
            int packet = p[at + 4] | p[at + 5] << 8;
            if ((p[at + 3] & 3) == LIBUSB_TRANSFER_TYPE_BULK)
                assert_int_equal(packet, t.speed >= LIBUSB_SPEED_SUPER  ? 1024
                                         : t.speed == LIBUSB_SPEED_HIGH ? 512
                                                                        : 64);
        }
    }
    assert_int_equal(at, total);
    assert_int_equal(endpoints, declared);
    assert_int_equal(interfaces, p[4]);
    assert_int_equal(seen_interfaces, (UINT32_C(1) << p[4]) - 1);
}

static void test_configuration_descriptor(void **state)
{
    (void)state;
    int total = get_descriptor(LIBUSB_DT_CONFIG, 0, 0, buf, 4096);
    assert_int_equal(buf[1], LIBUSB_DT_CONFIG);
    assert_int_equal(buf[7] & 0x9f, 0x80); /* bit 7 is 1, bits 4 to 0 are 0 */
    check_config(buf, total);
}

static void test_strings(void **state)
{
    (void)state;
    int n = get_descriptor(LIBUSB_DT_STRING, 0, 0, buf, 255);
    assert_true(n >= 4 && buf[0] == n && buf[1] == LIBUSB_DT_STRING);
    int lang = buf[2] | buf[3] << 8;
    const uint8_t used[] = {t.descriptor.iManufacturer, t.descriptor.iProduct, t.descriptor.iSerialNumber};
    for (size_t i = 0; i < sizeof used; i++) {
        assert_int_not_equal(used[i], 0);
        n = get_descriptor(LIBUSB_DT_STRING, used[i], lang, buf, 255);
        assert_true(n > 2 && n % 2 == 0);
        assert_int_equal(buf[0], n);
        assert_int_equal(get_descriptor(LIBUSB_DT_STRING, used[i], lang, buf, 3), 3);
        assert_int_equal(buf[0], n);
    }
    assert_int_equal(get_descriptor(LIBUSB_DT_STRING, 250, lang, buf, 255), STALL);
}

static void test_speeds(void **state)
{
    (void)state;
    int dual = t.speed == LIBUSB_SPEED_HIGH; /* another speed can be told of: full */
    int n = get_descriptor(6, 0, 0, buf, 64);
    assert_int_equal(n, t.speed == LIBUSB_SPEED_FULL && n > 0 ? 10 : dual ? 10 : STALL);
    if (n > 0) assert_int_equal(buf[8], 1);
    n = get_descriptor(7, 0, 0, buf, 4096);
    if (dual) {
        assert_int_equal(buf[1], 7);
        assert_int_equal(n, buf[2] | buf[3] << 8);
    } else if (t.speed >= LIBUSB_SPEED_SUPER) {
        assert_int_equal(n, STALL);
    }
    n = get_descriptor(LIBUSB_DT_BOS, 0, 0, buf, 4096);
    if (t.descriptor.bcdUSB < 0x0201) {
        assert_int_equal(n, STALL);
        return;
    }
    assert_int_equal(n, buf[2] | buf[3] << 8);
    int at = 5, count = 0;
    for (; at < n; at += buf[at], count++) {
        assert_true(buf[at] >= 3 && at + buf[at] <= n);
        assert_int_equal(buf[at + 1], LIBUSB_DT_DEVICE_CAPABILITY);
    }
    assert_int_equal(at, n);
    assert_int_equal(count, buf[4]);
}

static void test_status(void **state)
{
    uint8_t status[2];
    (void)state;
    assert_int_equal(control(EP0_IN, LIBUSB_REQUEST_GET_STATUS, 0, 0, status, 2), 2);
    assert_int_equal(status[0] & 1, t.config->bmAttributes >> 6 & 1); /* self-powered */
    assert_int_equal(status[1], 0);
    for (int i = 0; i < t.config->bNumInterfaces; i++) {
        const struct libusb_interface_descriptor *d = t.config->interface[i].altsetting;
        if (d->bInterfaceNumber != t.interface.number) continue; /* the others belong to a driver */
        assert_int_equal(control(IF_IN, LIBUSB_REQUEST_GET_STATUS, 0, d->bInterfaceNumber, status, 2), 2);
        assert_int_equal(status[0] | status[1], 0);
        for (int e = 0; e < d->bNumEndpoints; e++) {
            assert_int_equal(control(EP_IN, LIBUSB_REQUEST_GET_STATUS, 0, d->endpoint[e].bEndpointAddress, status, 2),
                             2);
            assert_int_equal(status[0] | status[1], 0);
        }
    }
    assert_int_equal(control(EP_IN, LIBUSB_REQUEST_GET_STATUS, 0, 0, status, 2), 2);
    assert_true(control(EP0_IN, LIBUSB_REQUEST_GET_STATUS, 0, 0, status, 1) <= 1);
}

static void test_configurations(void **state)
{
    uint8_t value = 0xee;
    (void)state;
    assert_int_equal(control(EP0_IN, LIBUSB_REQUEST_GET_CONFIGURATION, 0, 0, &value, 1), 1);
    assert_int_equal(value, t.config->bConfigurationValue);
    assert_int_equal(control(DEV_OUT, LIBUSB_REQUEST_SET_CONFIGURATION, 99, 0, NULL, 0), STALL);
    assert_int_equal(control(EP0_IN, LIBUSB_REQUEST_GET_CONFIGURATION, 0, 0, &value, 1), 1);
    assert_int_equal(value, t.config->bConfigurationValue);
    /* behind the host's back: unconfigured there are no interfaces and no endpoints */
    assert_int_equal(control(DEV_OUT, LIBUSB_REQUEST_SET_CONFIGURATION, 0, 0, NULL, 0), 0);
    assert_int_equal(control(EP0_IN, LIBUSB_REQUEST_GET_CONFIGURATION, 0, 0, &value, 1), 1);
    assert_int_equal(value, 0);
    assert_int_equal(control(IF_IN, LIBUSB_REQUEST_GET_INTERFACE, 0, t.interface.number, &value, 1), STALL);
    assert_int_equal(control(VENDOR_IF_OUT, USB_REQUEST_SESSION, 1, t.interface.number, NULL, 0), STALL);
    assert_int_equal(get_descriptor(LIBUSB_DT_DEVICE, 0, 0, buf, 18), 18);
    assert_int_equal(control(DEV_OUT, LIBUSB_REQUEST_SET_CONFIGURATION, t.config->bConfigurationValue, 0, NULL, 0), 0);
    /* the same once more begins anew: endpoints unhalted, data toggles at 0 on both sides */
    assert_int_equal(libusb_release_interface(t.dev, t.interface.number), 0);
    assert_int_equal(libusb_reset_device(t.dev), 0);
    assert_int_equal(libusb_claim_interface(t.dev, t.interface.number), 0);
}

static void test_interfaces(void **state)
{
    uint8_t value = 0xee;
    (void)state;
    assert_int_equal(control(IF_IN, LIBUSB_REQUEST_GET_INTERFACE, 0, t.interface.number, &value, 1), 1);
    assert_int_equal(value, 0);
    assert_int_equal(libusb_set_interface_alt_setting(t.dev, t.interface.number, 0), 0);
    assert_int_equal(control(IF_OUT, LIBUSB_REQUEST_SET_INTERFACE, 5, t.interface.number, NULL, 0), STALL);
    assert_int_equal(control(IF_IN, LIBUSB_REQUEST_GET_INTERFACE, 0, t.interface.number, &value, 1), 1);
    assert_int_equal(value, 0);
}

/* usbfs does not let a request to an interface or endpoint out that the configuration does not have; those of the
 * device and of types that it does not look into go out as they are. */
static void test_refused(void **state)
{
    static const struct {
        int type, request, value, index, len;
    } wrong[] = {
        {EP0_IN, LIBUSB_REQUEST_GET_DESCRIPTOR, 0x7700, 0, 64}, /* no such type */
        {EP0_IN, LIBUSB_REQUEST_GET_DESCRIPTOR, 0x0205, 0, 64}, /* no such configuration */
        {EP0_IN, LIBUSB_REQUEST_GET_DESCRIPTOR, 0x0400, 0, 64}, /* interface descriptors are not asked for alone */
        {EP0_IN, LIBUSB_REQUEST_GET_DESCRIPTOR, 0x0500, 0, 64}, /* nor endpoints */
        {DEV_OUT, LIBUSB_REQUEST_SET_FEATURE, 77, 0, 0},        /* no such feature */
        {DEV_OUT, LIBUSB_REQUEST_CLEAR_FEATURE, 77, 0, 0},
        {DEV_OUT, LIBUSB_REQUEST_SET_DESCRIPTOR, 0x0100, 0, 18}, /* optional, and not offered */
        {EP0_IN, 2, 0, 0, 2},                                    /* reserved */
        {EP0_IN, 4, 0, 0, 2},
        {EP0_IN, 255, 0, 0, 2},
        {DEV_OUT, 255, 0, 0, 0},
        {0xe0, 1, 0, 0, 2},   /* reserved type */
        {0xc0, 200, 0, 0, 8}, /* vendor, unknown */
        {0x40, 200, 0, 0, 0},
        {0xa0, 0x21, 0, 0, 7}, /* class request to the device */
    };
    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        memset(buf, 0, 64);
        int rc = control(wrong[i].type, wrong[i].request, wrong[i].value, wrong[i].index, buf, wrong[i].len);
        if (rc != STALL)
            print_message("request %02x %02x %04x: %d\n", wrong[i].type, wrong[i].request, wrong[i].value, rc);
        assert_int_equal(rc, STALL);
        assert_int_equal(get_descriptor(LIBUSB_DT_DEVICE, 0, 0, buf, 18),
                         18); /* the stall is over with the next setup */
    }
}

static void test_session_request(void **state)
{
    (void)state;
    int number = t.interface.number;
    assert_int_equal(control(VENDOR_IF_OUT, USB_REQUEST_SESSION, 2, number, NULL, 0), STALL);
    assert_int_equal(control(VENDOR_IF_OUT, USB_REQUEST_SESSION, 0xffff, number, NULL, 0), STALL);
    assert_int_equal(control(VENDOR_IF_OUT, USB_REQUEST_SESSION, 1, number, buf, 4), STALL);
    assert_int_equal(control(0xc1, USB_REQUEST_SESSION, 1, number, buf, 4), STALL);
    assert_int_equal(control(VENDOR_IF_OUT, USB_REQUEST_SESSION + 1, 1, number, NULL, 0), STALL);
    session(0); /* closed already: nothing happens */
    open_session();
    ask();
    open_session(); /* opened again: begins anew */
    ask();
    session(0);
    session(0);
}

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
    const uint8_t endpoint[] = {t.interface.in, t.interface.out};
    open_session();
    for (size_t i = 0; i < 2; i++) {
        for (int again = 0; again < 3; again++) {
            ask();
            assert_int_equal(control(EP_OUT, LIBUSB_REQUEST_SET_FEATURE, HALT, endpoint[i], NULL, 0), 0);
            assert_int_equal(is_halted(endpoint[i]), 1);
            assert_int_equal(libusb_bulk_transfer(t.dev, endpoint[i], buf, 1024, &n, MS), STALL);
            assert_int_equal(is_halted(endpoint[i]), 1);
            assert_int_equal(libusb_clear_halt(t.dev, endpoint[i]), 0);
            assert_int_equal(is_halted(endpoint[i]), 0);
        }
        assert_int_equal(libusb_clear_halt(t.dev, endpoint[i]), 0); /* not halted: allowed */
    }
    ask();
    if (!t.has_kernel) /* dummy_hcd takes any feature of an endpoint for a halt */
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
    send_bytes("*ID", 3); /* a command in pieces, empty packets in between */
    send_bytes("", 0);
    send_bytes("N", 1);
    send_bytes("?\n", 2);
    expect_reply("scanhead,");
    /* a whole number of packets, then its zero-length packet: 128 commands of 8 bytes */
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
        assert_int_equal(libusb_handle_events_timeout_completed(t.ctx, &second, done), 0);
}

/* One transfer, cancelled after some events were handled; how it ended. */
static enum libusb_transfer_status cancel_one(uint8_t endpoint, int len, int wait_us)
{
    int done = 0;
    struct libusb_transfer *transfer = libusb_alloc_transfer(0);
    assert_non_null(transfer);
    libusb_fill_bulk_transfer(transfer, t.dev, endpoint, buf, len, on_done, &done, 0);
    assert_int_equal(libusb_submit_transfer(transfer), 0);
    struct timeval wait = {.tv_usec = wait_us};
    if (wait_us > 0) libusb_handle_events_timeout_completed(t.ctx, &wait, &done);
    int rc = libusb_cancel_transfer(transfer);
    assert_true(rc == 0 || rc == LIBUSB_ERROR_NOT_FOUND); /* it was done just before */
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
        assert_int_equal(cancel_one(t.interface.in, 16384, 500 * (i % 4)), LIBUSB_TRANSFER_CANCELLED);
}

/* With a session frames come at any time: a read may be cancelled before, within or after its data. */
static void test_cancel_reads(void **state)
{
    (void)state;
    for (int i = 0; i < 40; i++) {
        open_session();
        enum libusb_transfer_status status = cancel_one(t.interface.in, 16384, 150 * (i % 8));
        assert_true(status == LIBUSB_TRANSFER_CANCELLED || status == LIBUSB_TRANSFER_COMPLETED);
    }
    open_session();
    ask();
    session(0);
}

/* Many reads at once, cancelled from the last to the first, from the first to the last, and every other one. */
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
            libusb_fill_bulk_transfer(transfer[i], t.dev, t.interface.in, room[i], 4096, on_done, &done[i], 0);
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

/* Half a command cancelled on its way must not be glued to the first of the next session. */
static void test_cancel_writes(void **state)
{
    (void)state;
    for (int i = 0; i < 20; i++) {
        open_session();
        memset(buf, 'x', 8);
        cancel_one(t.interface.out, 8, 100 * (i % 3));
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
        libusb_fill_control_transfer(transfer, t.dev, setup, on_done, &done, MS);
        assert_int_equal(libusb_submit_transfer(transfer), 0);
        struct timeval wait = {.tv_usec = 50 * (i % 5)};
        if (i % 5 != 0) libusb_handle_events_timeout_completed(t.ctx, &wait, &done);
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
        assert_int_equal(libusb_reset_device(t.dev), 0);
    open_session();
    ask();
    for (int i = 0; i < 3; i++) { /* with the session open and frames on the way */
        assert_int_equal(libusb_reset_device(t.dev), 0);
        open_session();
        ask();
    }
    session(0);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)
    const struct CMUnitTest tests[] = {
        TEST(test_descriptor_lengths),
        TEST(test_configuration_descriptor),
        TEST(test_strings),
        TEST(test_speeds),
        TEST(test_status),
        TEST(test_configurations),
        TEST(test_interfaces),
        TEST(test_refused),
        TEST(test_session_request),
        TEST(test_halt),
        TEST(test_zero_length),
        TEST(test_cancel_without_session),
        TEST(test_cancel_reads),
        TEST(test_cancel_many),
        TEST(test_cancel_writes),
        TEST(test_cancel_control),
        TEST(test_resets),
    };
    return cmocka_run_group_tests_name("chapter9", tests, NULL, NULL);
}
