/* SPDX-License-Identifier: MIT */
/* Tests of chapter 9 of the USB specification: standard requests, wrong lengths and indices. */
#include "tests/guest/chapter9.h"

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
    assert_int_equal(total, usb.config->wTotalLength);
    for (int len = 1; len <= total; len += 7)
        assert_int_equal(get_descriptor(LIBUSB_DT_CONFIG, 0, 0, buf, len), len);
}

/* The descriptors of a configuration follow each other by their lengths, and their counts match what comes. */
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
                assert_int_equal(packet, usb.speed >= LIBUSB_SPEED_SUPER  ? 1024
                                         : usb.speed == LIBUSB_SPEED_HIGH ? 512
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
    assert_int_equal(buf[7] & 0x9f, 0x80); /* bit 7 is 1, and bits 4 to 0 are 0 */
    check_config(buf, total);
}

static void test_strings(void **state)
{
    (void)state;
    int n = get_descriptor(LIBUSB_DT_STRING, 0, 0, buf, 255);
    assert_true(n >= 4 && buf[0] == n && buf[1] == LIBUSB_DT_STRING);
    int lang = buf[2] | buf[3] << 8;
    const uint8_t used[] = {usb.descriptor.iManufacturer, usb.descriptor.iProduct, usb.descriptor.iSerialNumber};
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
    int dual = usb.speed == LIBUSB_SPEED_HIGH; /* it can then describe another speed, full speed */
    int n = get_descriptor(6, 0, 0, buf, 64);
    assert_int_equal(n, usb.speed == LIBUSB_SPEED_FULL && n > 0 ? 10 : dual ? 10 : STALL);
    if (n > 0) assert_int_equal(buf[8], 1);
    n = get_descriptor(7, 0, 0, buf, 4096);
    if (dual) {
        assert_int_equal(buf[1], 7);
        assert_int_equal(n, buf[2] | buf[3] << 8);
    } else if (usb.speed >= LIBUSB_SPEED_SUPER) {
        assert_int_equal(n, STALL);
    }
    n = get_descriptor(LIBUSB_DT_BOS, 0, 0, buf, 4096);
    if (usb.descriptor.bcdUSB < 0x0201) {
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
    assert_int_equal(status[0] & 1, usb.config->bmAttributes >> 6 & 1); /* self-powered */
    assert_int_equal(status[1], 0);
    for (int i = 0; i < usb.config->bNumInterfaces; i++) {
        const struct libusb_interface_descriptor *d = usb.config->interface[i].altsetting;
        if (d->bInterfaceNumber != usb.interface.number) continue; /* the others belong to a driver */
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
    assert_int_equal(value, usb.config->bConfigurationValue);
    assert_int_equal(control(DEV_OUT, LIBUSB_REQUEST_SET_CONFIGURATION, 99, 0, NULL, 0), STALL);
    assert_int_equal(control(EP0_IN, LIBUSB_REQUEST_GET_CONFIGURATION, 0, 0, &value, 1), 1);
    assert_int_equal(value, usb.config->bConfigurationValue);
    /* This happens behind the host's back: an unconfigured device has no interfaces and no endpoints. */
    assert_int_equal(control(DEV_OUT, LIBUSB_REQUEST_SET_CONFIGURATION, 0, 0, NULL, 0), 0);
    assert_int_equal(control(EP0_IN, LIBUSB_REQUEST_GET_CONFIGURATION, 0, 0, &value, 1), 1);
    assert_int_equal(value, 0);
    assert_int_equal(control(IF_IN, LIBUSB_REQUEST_GET_INTERFACE, 0, usb.interface.number, &value, 1), STALL);
    assert_int_equal(control(VENDOR_IF_OUT, USB_REQUEST_SESSION, 1, usb.interface.number, NULL, 0), STALL);
    assert_int_equal(get_descriptor(LIBUSB_DT_DEVICE, 0, 0, buf, 18), 18);
    assert_int_equal(control(DEV_OUT, LIBUSB_REQUEST_SET_CONFIGURATION, usb.config->bConfigurationValue, 0, NULL, 0),
                     0);
    /* A reset sets the same configuration again, and that begins anew: no endpoint is halted, and data toggles are 0 on
     * both sides. */
    assert_int_equal(libusb_release_interface(usb.dev, usb.interface.number), 0);
    assert_int_equal(libusb_reset_device(usb.dev), 0);
    assert_int_equal(libusb_claim_interface(usb.dev, usb.interface.number), 0);
}

static void test_interfaces(void **state)
{
    uint8_t value = 0xee;
    (void)state;
    assert_int_equal(control(IF_IN, LIBUSB_REQUEST_GET_INTERFACE, 0, usb.interface.number, &value, 1), 1);
    assert_int_equal(value, 0);
    assert_int_equal(libusb_set_interface_alt_setting(usb.dev, usb.interface.number, 0), 0);
    assert_int_equal(control(IF_OUT, LIBUSB_REQUEST_SET_INTERFACE, 5, usb.interface.number, NULL, 0), STALL);
    assert_int_equal(control(IF_IN, LIBUSB_REQUEST_GET_INTERFACE, 0, usb.interface.number, &value, 1), 1);
    assert_int_equal(value, 0);
}

/* usbfs lets no request out to an interface or endpoint that the configuration does not have. Requests to the device,
 * and those of types that usbfs does not look into, go out as they are. */
static void test_refused(void **state)
{
    static const struct {
        int type, request, value, index, len;
    } wrong[] = {
        {EP0_IN, LIBUSB_REQUEST_GET_DESCRIPTOR, 0x7700, 0, 64}, /* no such type */
        {EP0_IN, LIBUSB_REQUEST_GET_DESCRIPTOR, 0x0205, 0, 64}, /* no such configuration */
        {EP0_IN, LIBUSB_REQUEST_GET_DESCRIPTOR, 0x0400, 0, 64}, /* interface descriptors are not asked for alone */
        {EP0_IN, LIBUSB_REQUEST_GET_DESCRIPTOR, 0x0500, 0, 64}, /* neither are endpoint descriptors */
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
        assert_int_equal(get_descriptor(LIBUSB_DT_DEVICE, 0, 0, buf, 18), 18); /* the stall ends with the next setup */
    }
}

static void expect_open(int open)
{
    assert_int_equal(control(0xc1, USB_REQUEST_SESSION, 0, usb.interface.number, buf, 1), 1);
    assert_int_equal(buf[0], open);
}

static void test_session_request(void **state)
{
    (void)state;
    int number = usb.interface.number;
    assert_int_equal(control(VENDOR_IF_OUT, USB_REQUEST_SESSION, 2, number, NULL, 0), STALL);
    assert_int_equal(control(VENDOR_IF_OUT, USB_REQUEST_SESSION, 0xffff, number, NULL, 0), STALL);
    assert_int_equal(control(VENDOR_IF_OUT, USB_REQUEST_SESSION, 1, number, buf, 4), STALL);
    assert_int_equal(control(0xc1, USB_REQUEST_SESSION, 1, number, buf, 4), STALL);
    assert_int_equal(control(VENDOR_IF_OUT, USB_REQUEST_SESSION + 1, 1, number, NULL, 0), STALL);
    session(0); /* the session is closed already, so nothing happens */
    expect_open(0);
    open_session();
    ask();
    open_session(); /* a session that is opened again begins anew */
    expect_open(1);
    ask();
    session(0);
    session(0);
    expect_open(0);
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
    };
    return cmocka_run_group_tests_name("chapter9", tests, NULL, NULL);
}
