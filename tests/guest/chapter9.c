/* SPDX-License-Identifier: MIT */
#include "tests/guest/chapter9.h"

#include "drivers/protocol/native.h"

struct usb_under_test usb;
uint8_t buf[BUFFER];
static struct native_parser parser;

int control(int type, int request, int value, int index, void *data, int len)
{
    return libusb_control_transfer(usb.dev, (uint8_t)type, (uint8_t)request, (uint16_t)value, (uint16_t)index, data,
                                   (uint16_t)len, MS);
}

int get_descriptor(int type, int index, int lang, void *data, int len)
{
    return control(EP0_IN, LIBUSB_REQUEST_GET_DESCRIPTOR, type << 8 | index, lang, data, len);
}

void session(int open)
{
    assert_int_equal(control(VENDOR_IF_OUT, USB_REQUEST_SESSION, open, usb.interface.number, NULL, 0), 0);
}

void send_bytes(const void *data, int len)
{
    int sent = -1;
    assert_int_equal(libusb_bulk_transfer(usb.dev, usb.interface.out, (uint8_t *)(uintptr_t)data, len, &sent, MS), 0);
    assert_int_equal(sent, len);
}

void expect_reply(const char *begin)
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
        int rc =
            libusb_bulk_transfer(usb.dev, usb.interface.in, to, (int)(room < 16384 ? room : 16384) & ~1023, &got, MS);
        assert_true(rc == 0 || rc == LIBUSB_ERROR_TIMEOUT);
        native_parser_added(&parser, (size_t)got);
    }
    fail_msg("no reply that begins with %s", begin);
}

void open_session(void)
{
    native_parser_init(&parser);
    session(1);
}

void ask(void)
{
    send_bytes("*IDN?\n", 6);
    expect_reply("scanhead,");
}

static void find(void)
{
    libusb_device **list;
    assert_int_equal(libusb_init(&usb.ctx), 0);
    ssize_t n = libusb_get_device_list(usb.ctx, &list);
    for (ssize_t i = 0; i < n && usb.dev == NULL; i++)
        if (host_usb_interface(list[i], &usb.interface)) assert_int_equal(libusb_open(list[i], &usb.dev), 0);
    libusb_free_device_list(list, 1);
    assert_non_null(usb.dev);
    libusb_device *device = libusb_get_device(usb.dev);
    usb.speed = libusb_get_device_speed(device);
    assert_int_equal(libusb_get_device_descriptor(device, &usb.descriptor), 0);
    assert_int_equal(libusb_get_active_config_descriptor(device, &usb.config), 0);
    assert_int_equal(libusb_claim_interface(usb.dev, usb.interface.number), 0);
}

int setup(void **state)
{
    (void)state;
    memset(&usb, 0, sizeof usb);
    usb.has_kernel = getenv("CHAPTER9_KERNEL") != NULL;
    find();
    return 0;
}

int teardown(void **state)
{
    (void)state;
    open_session();
    ask();
    session(0);
    libusb_release_interface(usb.dev, usb.interface.number);
    libusb_free_config_descriptor(usb.config);
    libusb_close(usb.dev);
    libusb_exit(usb.ctx);
    return 0;
}
