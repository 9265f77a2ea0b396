/* SPDX-License-Identifier: MIT */
/* Descriptors against the published layouts: USB 2.0 tables 9-8 to 9-16, USB 3.2 section 9.6, Microsoft OS 2.0
 * Descriptors Specification tables 3 to 15. The bytes here are written out by hand from these. */
#include "tests/unit/usb_host.h"
#include "tests/unit/usb_models.h"

#include "drivers/usb/head_device.h"

static const enum usb_rate rates[] = {USB_RATE_FULL, USB_RATE_HIGH, USB_RATE_SUPER};

static void check(struct host *host, unsigned value, unsigned index, const uint8_t *bytes, size_t n)
{
    assert_int_equal(host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, value, index, 4096, NULL), (int)n);
    assert_memory_equal(host_in, bytes, n);
    /* Any shorter request gets the first bytes. */
    for (unsigned wish = 0; wish < n; wish++) {
        assert_int_equal(host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, value, index, wish, NULL), (int)wish);
        assert_memory_equal(host_in, bytes, wish);
    }
}

static void test_device(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        uint8_t bytes[] = {18, 1, 0x10, 0x02, 0, 0, 0, 64, 0x09, 0x12, 0x01, 0x00, 0x34, 0x02, 1, 2, 3, 1};
        if (rates[i] == USB_RATE_SUPER) bytes[2] = 0x20, bytes[3] = 0x03, bytes[7] = 9;
        struct host *host = host_new(&pair_model, USB_RATE_SUPER, rates[i]);
        check(host, 0x0100, 0, bytes, sizeof bytes);
        host_free(host);
    }
}

static void test_configuration(void **state)
{
    (void)state;
    static const uint8_t full[] = {9, 2, 32, 0, 1,    1, 0,  0x80, 50, 9, 4, 0, 0, 2,  0xff, 1,
                                   2, 2, 7,  5, 0x81, 2, 64, 0,    0,  7, 5, 2, 2, 64, 0,    0};
    static const uint8_t high[] = {9, 2, 32, 0, 1,    1, 0, 0x80, 50, 9, 4, 0, 0, 2, 0xff, 1,
                                   2, 2, 7,  5, 0x81, 2, 0, 2,    0,  7, 5, 2, 2, 0, 2,    0};
    static const uint8_t super[] = {9, 2, 44, 0, 1,  1, 0, 0x80, 13, 9, 4, 0, 0, 2, 0xff, 1, 2, 2,  7, 5, 0x81, 2,
                                    0, 4, 0,  6, 48, 3, 0, 0,    0,  7, 5, 2, 2, 0, 4,    0, 6, 48, 0, 0, 0,    0};
    static const uint8_t qualifier[] = {10, 6, 0x10, 0x02, 0, 0, 0, 64, 1, 0};
    uint8_t other[sizeof full];
    struct host *host = host_new(&pair_model, USB_RATE_SUPER, USB_RATE_FULL);
    check(host, 0x0200, 0, full, sizeof full);
    memcpy(other, high, sizeof other);
    other[1] = 7;
    check(host, 0x0700, 0, other, sizeof other);
    check(host, 0x0600, 0, qualifier, sizeof qualifier);
    host_free(host);
    host = host_new(&pair_model, USB_RATE_SUPER, USB_RATE_HIGH);
    check(host, 0x0200, 0, high, sizeof high);
    memcpy(other, full, sizeof other);
    other[1] = 7;
    check(host, 0x0700, 0, other, sizeof other);
    check(host, 0x0600, 0, qualifier, sizeof qualifier);
    host_free(host);
    host = host_new(&pair_model, USB_RATE_SUPER, USB_RATE_SUPER);
    check(host, 0x0200, 0, super, sizeof super); /* 100 mA in units of 8, rounded up */
    assert_int_equal(host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, 0x0700, 0, 99, NULL), USB_STALL);
    assert_int_equal(host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, 0x0600, 0, 99, NULL), USB_STALL);
    host_free(host);
    host = host_new(&pair_model, USB_RATE_FULL, USB_RATE_FULL); /* one that can't do more has no other speed */
    assert_int_equal(host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, 0x0600, 0, 10, NULL), USB_STALL);
    assert_int_equal(host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, 0x0700, 0, 99, NULL), USB_STALL);
    host_free(host);
}

static void test_strings(void **state)
{
    (void)state;
    static const uint8_t languages[] = {4, 3, 9, 4};
    static const uint8_t maker[] = {12, 3, 'M', 0, 'a', 0, 'k', 0, 'e', 0, 'r', 0};
    static const uint8_t product[] = {14, 3, 'B', 0, 0xe4, 0, 'r', 0, ' ', 0, 0x3d, 0xd8, 0x3b, 0xdc}; /* U+1F43B */
    static const uint8_t serial[] = {6, 3, 'S', 0, '1', 0};
    struct host *host = host_new(&pair_model, USB_RATE_HIGH, USB_RATE_HIGH);
    check(host, 0x0300, 0, languages, sizeof languages);
    check(host, 0x0301, 0x0409, maker, sizeof maker);
    check(host, 0x0302, 0x0409, product, sizeof product);
    check(host, 0x0303, 0x0409, serial, sizeof serial);
    assert_int_equal(host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, 0x0304, 0x0409, 255, NULL), USB_STALL);
    assert_int_equal(host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, 0x03ee, 0x0409, 255, NULL), USB_STALL);
    assert_int_equal(host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, 0x0301, 0x0407, 255, NULL), USB_STALL);
    assert_int_equal(host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, 0x0301, 0, 255, NULL), USB_STALL);
    host_free(host);
}

/* UTF-8 (RFC 3629) becomes UTF-16LE. What is malformed neither overruns nor vanishes: U+FFFD stands for it. */
static void test_utf16(void **state)
{
    (void)state;
    static const struct {
        const char *serial;
        uint8_t bytes[7];
    } cases[] = {
        {"\xe2\x82\xac", {4, 3, 0xac, 0x20}},
        {"\xf4\x8f\xbf\xbf", {6, 3, 0xff, 0xdb, 0xff, 0xdf}}, /* U+10FFFF is the last one */
        {"\xf4\x90\x80\x80", {4, 3, 0xfd, 0xff}},
        {"\xf7\xbf\xbf\xbf", {4, 3, 0xfd, 0xff}},
        {"\xc3", {4, 3, 0xfd, 0xff}}, /* it ends too early */
        {"\x80", {4, 3, 0xfd, 0xff}}, /* no character begins like this */
        {"\xff\x41", {6, 3, 0xfd, 0xff, 0x41, 0}},
        {"\xf8\x41", {6, 3, 0xfd, 0xff, 0x41, 0}},
        {"", {0}}, /* there is no such string */
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct usb_identity id = {.serial = ""};
        uint8_t out[16];
        snprintf(id.serial, sizeof id.serial, "%s", cases[i].serial);
        assert_int_equal(usb_describe_string(&pair_model, &id, 3, out, sizeof out), cases[i].bytes[0]);
        assert_memory_equal(out, cases[i].bytes, cases[i].bytes[0]);
    }
}

static const uint8_t platform_uuid[16] = {0xdf, 0x60, 0xdd, 0xd8, 0x89, 0x45, 0xc7, 0x4c,
                                          0x9c, 0xd2, 0x65, 0x9d, 0x9e, 0x64, 0x8a, 0x9f};

static void test_bos(void **state)
{
    (void)state;
    uint8_t bytes[] = {5, 15, 50, 0, 3, 7, 16, 2, 2, 0, 0, 0, 10, 16, 3, 0, 0x0e, 0, 1, 10, 0xff, 0x07, 28, 16,   5,
                       0, 0,  0,  0, 0, 0, 0,  0, 0, 0, 0, 0, 0,  0,  0, 0, 0,    0, 0, 3,  6,    178,  0,  0x42, 0};
    memcpy(bytes + 26, platform_uuid, 16);
    bytes[42] = 0, bytes[43] = 0, bytes[44] = 3, bytes[45] = 6;
    for (int i = 0; i < 3; i++) { /* the same at each speed */
        struct host *host = host_new(&pair_model, USB_RATE_SUPER, rates[i]);
        check(host, 0x0f00, 0, bytes, sizeof bytes);
        host_free(host);
    }
    /* A device without super speed has neither its capability nor a USB 2.0 extension, which would be empty. */
    uint8_t high[33] = {5, 15, 33, 0, 1};
    memcpy(high + 5, bytes + 22, 28);
    struct host *host = host_new(&pair_model, USB_RATE_HIGH, USB_RATE_HIGH);
    check(host, 0x0f00, 0, high, sizeof high);
    host_free(host);
}

/* Below super speed and without compatible ids a BOS would be empty: the device is one of USB 2.00. */
static void test_no_bos(void **state)
{
    (void)state;
    struct host *host = host_new(&two_model, USB_RATE_HIGH, USB_RATE_HIGH);
    assert_int_equal(host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, 0x0f00, 0, 200, NULL), USB_STALL);
    assert_int_equal(host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, 0x0100, 0, 18, NULL), 18);
    assert_int_equal(le_get16(host_in + 2), 0x0200);
    assert_int_equal(host_control(host, 0x80, USB_REQ_GET_DESCRIPTOR, 0x0600, 0, 10, NULL), 10);
    assert_int_equal(le_get16(host_in + 2), 0x0200);
    assert_int_equal(host_control(host, 0xc0, 0, 0, 7, 200, NULL), USB_STALL);
    host_free(host);
}

static void test_ms_os(void **state)
{
    (void)state;
    static const char name[] = "DeviceInterfaceGUIDs", guid[] = "{01234567-89AB-CDEF-0123-456789ABCDEF}";
    uint8_t bytes[178] = {10, 0, 0, 0, 0,   0,   3,   6,   178, 0, /* set header: Windows 8.1, all 178 bytes */
                          8,  0, 1, 0, 0,   0,   168, 0,           /* configuration 0 */
                          8,  0, 2, 0, 0,   0,   160, 0,           /* function from interface 0 on */
                          20, 0, 3, 0, 'W', 'I', 'N', 'U', 'S', 'B', 0, 0, 0,  0,
                          0,  0, 0, 0, 0,   0,   132, 0,   4,   0,   7, 0, 42, 0}; /* REG_MULTI_SZ, name of 42 bytes */
    size_t at = 54;
    for (size_t i = 0; i < sizeof name; i++, at += 2)
        bytes[at] = (uint8_t)name[i];
    bytes[at] = 80, at += 2; /* 38 characters, two NULs */
    for (size_t i = 0; i < sizeof guid; i++, at += 2)
        bytes[at] = (uint8_t)guid[i];
    assert_int_equal(at + 2, sizeof bytes);
    struct host *host = host_new(&pair_model, USB_RATE_HIGH, USB_RATE_HIGH);
    for (unsigned wish = 0; wish <= 300; wish++) {
        int n = wish < sizeof bytes ? (int)wish : (int)sizeof bytes;
        assert_int_equal(host_control(host, 0xc0, 0x42, 0, 7, wish, NULL), n);
        assert_memory_equal(host_in, bytes, (size_t)n);
    }
    assert_int_equal(host_control(host, 0xc0, 0x43, 0, 7, 200, NULL), USB_STALL); /* another vendor code */
    assert_int_equal(host_control(host, 0xc0, 0x42, 0, 8, 200, NULL), USB_STALL); /* alternate enumeration */
    assert_int_equal(host_control(host, 0xc0, 0x42, 1, 7, 200, NULL), USB_STALL);
    assert_int_equal(host_control(host, 0x40, 0x42, 0, 7, 0, NULL), USB_STALL);
    host_free(host);
}

/* The head's descriptors are walked as by a host, and every length and number is checked against its neighbours. */
static void test_head(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        const struct usb_identity id = {.highest = USB_RATE_SUPER, .serial = "X"};
        static const unsigned bulk[] = {64, 512, 1024};
        uint8_t d[USB_MAX_CONFIG];
        size_t len = usb_describe_config(&scanhead_usb_model, &id, rates[i], USB_DT_CONFIG, d, sizeof d), at = 0;
        int interfaces = 0, endpoints = 0, companions = 0, associations = 0, left = 0, cdc = 0, stream = 0;
        assert_in_range(len, 9, sizeof d);
        assert_int_equal(le_get16(d + 2), len);
        for (; at < len; at += d[at]) {
            assert_true(d[at] >= 2 && at + d[at] <= len);
            switch (d[at + 1]) {
            case USB_DT_INTERFACE:
                assert_int_equal(left, 0);
                assert_int_equal(d[at + 2], interfaces++);
                left = d[at + 4];
                if (d[at + 5] == USB_CLASS_COMM) assert_int_equal(d[at + 7], 0);
                stream += d[at + 5] == 0xff && d[at + 6] == 0x53 && d[at + 7] == 0x48;
                break;
            case USB_DT_INTERFACE_ASSOCIATION:
                assert_int_equal(interfaces, 0);
                static const uint8_t console[] = {8, 11, 0, 2, 2, 2, 0, 3}; /* protocol 0: no AT commands */
                assert_memory_equal(d + at, console, sizeof console);
                associations++;
                break;
            case USB_DT_CS_INTERFACE:
                assert_int_equal(interfaces, 1);
                cdc |= 1 << d[at + 2];
                break;
            case USB_DT_ENDPOINT:
                left--;
                endpoints++;
                if (d[at + 3] == 2) assert_int_equal(le_get16(d + at + 4), bulk[i]);
                break;
            case USB_DT_SS_ENDPOINT_COMP:
                assert_int_equal(d[at - 7 + 1], USB_DT_ENDPOINT);
                assert_int_equal(le_get16(d + at + 4), d[at - 4] == 3 ? 16 : 0);
                companions++;
            }
        }
        assert_int_equal(at, len);
        assert_int_equal(interfaces, d[4]);
        assert_int_equal(endpoints, 5);
        assert_int_equal(left, 0);
        assert_int_equal(stream, 1);
        assert_int_equal(associations, 1);
        assert_int_equal(companions, rates[i] == USB_RATE_SUPER ? 5 : 0);
        assert_int_equal(cdc, 1 << 0 | 1 << 1 | 1 << 2 | 1 << 6); /* header, call management, ACM, union */
        /* WinUSB is for the stream alone: one function subset, from interface 2 on. */
        uint8_t set[512];
        assert_in_range(usb_describe_ms_os(&scanhead_usb_model, set, sizeof set), 46, sizeof set);
        assert_int_equal(le_get16(set + 16) - 8, le_get16(set + 24));
        assert_int_equal(set[22], 2);
    }
}

static void test_contradictions(void **state)
{
    (void)state;
    struct usb_interface_row rows[2] = {pair_interfaces[0], pair_interfaces[0]};
    struct usb_model model = pair_model;
    struct usb_identity id = {.vid = 1};
    struct usb_hooks hooks = {0};
    struct usb_device *device = NULL;
    struct sh_err err;
    model.interface = rows;
    model.n_interfaces = 2;
    assert_int_equal(usb_device_create(&model, &id, &hooks, NULL, &device, &err), SH_EINPUT); /* twice interface 0 */
    assert_string_equal(err.text, "usb: interface row 1 is out of order");
    rows[1].number = 1;
    assert_int_equal(usb_device_create(&model, &id, &hooks, NULL, &device, &err), SH_EINPUT); /* endpoints shared */
    assert_string_equal(err.text, "usb: endpoint 81 is number 0, or taken twice");
    rows[1].n_endpoints = 0;
    model.n_interfaces = 0;
    assert_int_equal(usb_device_create(&model, &id, &hooks, NULL, &device, &err), SH_EINPUT);
    assert_string_equal(err.text, "usb: 0 interfaces; allowed 1 to 8");
    model.n_interfaces = 9;
    assert_int_equal(usb_device_create(&model, &id, &hooks, NULL, &device, &err), SH_EINPUT);
    assert_string_equal(err.text, "usb: 9 interfaces; allowed 1 to 8");
    model.n_interfaces = 2;
    assert_int_equal(usb_device_create(&model, &id, &hooks, NULL, &device, &err), SH_OK);
    usb_device_free(device);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_device),  cmocka_unit_test(test_configuration),
        cmocka_unit_test(test_strings), cmocka_unit_test(test_utf16),
        cmocka_unit_test(test_bos),     cmocka_unit_test(test_ms_os),
        cmocka_unit_test(test_head),    cmocka_unit_test(test_contradictions),
        cmocka_unit_test(test_no_bos),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
