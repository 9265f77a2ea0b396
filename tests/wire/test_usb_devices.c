/* SPDX-License-Identifier: MIT */
/* Heads that show themselves on USB as the device whose protocol they speak: ids, strings, interfaces, and a question
 * with its answer. A configured identity stays as it is. tests/guest has the kernel's drivers and libusb on the same
 * devices. */
#include "core/bytes.h"
#include "drivers/protocol/crc32c.h"
#include "drivers/protocol/native.h"
#include "tests/wire/room.h"
#include "tests/wire/usbip_host.h"

enum { MOST = 65535 };

static struct head start(struct wire *wire, const char *profile, const char *protocol, const char *more)
{
    char text[640];
    snprintf(text, sizeof text,
             "head: {profile: %s}\n"
             "scene:\n  meshes:\n    - {file: room.obj, up: z, scale: 1}\n"
             "stations:\n  - {position_m: [0, 0, 0]}\n"
             "links: [{type: usb, port: 0, protocol: %s%s}]\n",
             profile, protocol, more);
    wire_write_text(wire, "config.yaml", text);
    return head_start(wire, wire_path(wire, "config.yaml"), NULL);
}

static void expect_device(struct usbip_host *host, unsigned vid, unsigned pid, const char *serial)
{
    uint8_t d[18];
    char text[64];
    assert_int_equal(usbip_host_control(host, 0x80, 6, 0x0100, 0, d, 18), 18);
    assert_int_equal(d[8] | d[9] << 8, vid);
    assert_int_equal(d[10] | d[11] << 8, pid);
    assert_int_equal(host->device[300] << 8 | host->device[301], vid);
    assert_int_equal(host->device[302] << 8 | host->device[303], pid);
    usbip_host_string(host, d[16], text, sizeof text);
    if (serial != NULL) assert_string_equal(text, serial);
    assert_int_equal(usbip_host_control(host, 0x00, 9, 1, 0, NULL, 0), 0);
}

/* The host reads the version up to an empty line. */
static void expect_version(struct usbip_host *host)
{
    char text[512] = "";
    size_t n = 0;
    usbip_host_send(host, 1, "VV\n", 3);
    while (strstr(text, "\n\n") == NULL) {
        n += usbip_host_receive(host, 1, text + n, (uint32_t)(sizeof text - 1 - n));
        assert_true(n < sizeof text - 1);
        text[n] = '\0';
    }
    assert_memory_equal(text, "VV\n00P\nVEND:", 12);
}

static void test_hokuyo(void **state)
{
    static const uint8_t interfaces[8] = {2, 2, 0, 0, 10, 0, 0, 0};
    struct wire *wire = *state;
    room_write(wire);
    struct head head = start(wire, "hokuyo-urg-04lx", "scip", "");
    struct usbip_host host = usbip_host_open(&head);
    assert_int_equal(host.device[311], 2);
    assert_memory_equal(host.interface, interfaces, sizeof interfaces);
    expect_device(&host, 0x15d1, 0x0000, "");
    assert_int_equal(usbip_host_control(&host, 0x21, 0x22, 1, 0, NULL, 0), 0); /* DTR, as the kernel's driver */
    expect_version(&host);
    usbip_host_close(&host);
    head_end(&head, SIGTERM);
}

/* A read gets a whole reply, and nothing after it. */
static void test_sick(void **state)
{
    static const uint8_t interface[4] = {0xff, 0, 0, 0};
    static const char *const asked[] = {"sRI0", "sRN SCdevicestate", "sRN nothing"};
    static const char *const begin[] = {"sRA 0 6 TiM561 ", "sRA SCdevicestate ", "sFA "};
    struct wire *wire = *state;
    char text[64];
    static char back[MOST];
    room_write(wire);
    struct head head = start(wire, "sick-tim561", "cola", "");
    struct usbip_host host = usbip_host_open(&head);
    assert_int_equal(host.device[311], 1);
    assert_memory_equal(host.interface, interface, sizeof interface);
    expect_device(&host, 0x19a2, 0x5001, NULL);
    for (int i = 0; i < 3; i++) {
        usbip_host_send(&host, 2, text, (uint32_t)snprintf(text, sizeof text, "\002%s\003", asked[i]));
        const uint32_t n = usbip_host_receive(&host, 1, back, MOST);
        assert_true(n > 2 && back[0] == 2);
        assert_ptr_equal(memchr(back, 3, n), back + n - 1);
        assert_memory_equal(back + 1, begin[i], strlen(begin[i]));
    }
    usbip_host_close(&host);
    head_end(&head, SIGTERM);
}

static void test_configured(void **state)
{
    static const struct {
        const char *profile, *protocol;
    } kinds[] = {{"hokuyo-urg-04lx", "scip"}, {"sick-tim561", "cola"}};
    struct wire *wire = *state;
    room_write(wire);
    for (int i = 0; i < 2; i++) {
        struct head head =
            start(wire, kinds[i].profile, kinds[i].protocol, ", vid: 0x1234, pid: 0x0000, serial: LAB-7");
        struct usbip_host host = usbip_host_open(&head);
        expect_device(&host, 0x1234, 0x0000, "LAB-7");
        usbip_host_close(&host);
        head_end(&head, SIGTERM);
    }
}

/* A client begins the stream again in the middle of a frame that it has half of. The new stream begins with a frame. */
static void test_begun_again(void **state)
{
    struct wire *wire = *state;
    static const struct room_config endless = {.prr_hz = 100000,
                                               .lines_hz = 50,
                                               .pan_deg_s = 20,
                                               .pan_stop_deg = 360,
                                               .links = "links: [{type: usb, port: 0}]\n"};
    static uint8_t bytes[65536];
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &endless), (const char *const[]){"--start", NULL});
    struct usbip_host host = usbip_host_open(&head);
    assert_int_equal(usbip_host_control(&host, 0x00, 9, 1, 0, NULL, 0), 0);
    for (int i = 0; i < 5; i++) {
        assert_int_equal(usbip_host_control(&host, 0x41, 0x22, 1, 2, NULL, 0), 0);
        uint32_t n = 0;
        while (n < NATIVE_HEADER_LEN) /* a packet of no bytes may be the end of what was before */
            n += usbip_host_receive(&host, 3, bytes + n, 512);
        assert_int_equal(bytes[0], NATIVE_SYNC);
        assert_int_equal(crc32c(0, bytes, 24), le_get32(bytes + 24));
        int is_within = 0;
        for (uint32_t at = 0; !is_within && at < sizeof bytes - 512;) { /* up to a packet that ends within a frame */
            while (n < at + NATIVE_HEADER_LEN || n < at + native_frame_len(bytes + at)) {
                is_within |= n > at;
                n += usbip_host_receive(&host, 3, bytes + n, 512);
                if (is_within) break;
            }
            if (n >= at + NATIVE_HEADER_LEN) at += (uint32_t)native_frame_len(bytes + at);
        }
        assert_true(is_within);
    }
    usbip_host_close(&host);
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_hokuyo, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_sick, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_configured, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_begun_again, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
