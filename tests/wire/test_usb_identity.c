/* Heads on USB/IP with nothing configured of their identity: two that run at a time differ in serial number and bus id,
 * and in nothing that belongs to the stream; what is configured stays as it is. Numbers on the wire: the kernel's
 * Documentation/usb/usbip_protocol.rst, version 1.1.1. */
#include "tests/wire/room.h"

enum { DEVICE_LEN = 312, BUS_ID = 256, BUS_ID_LEN = 32 };

struct identity {
    char bus_id[BUS_ID_LEN + 1], serial[128], hash[65];
};

static void read_all(int fd, void *data, size_t len)
{
    for (uint8_t *at = data; len > 0;) {
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        const ssize_t n = read(fd, at, len);
        assert_true(n > 0);
        at += n;
        len -= (size_t)n;
    }
}

/* Imports the device by the bus id that the list has, and reads its string of the serial number: the one after the
 * model's four. */
static void ask_device(const char *endpoint, struct identity *out)
{
    static const uint8_t list[8] = {0x01, 0x11, 0x80, 0x05};
    uint8_t import[8 + BUS_ID_LEN] = {0x01, 0x11, 0x80, 0x03}, device[DEVICE_LEN], head[12];
    uint8_t submit[48] = {[3] = 1, [7] = 1, [15] = 1, [26] = 1, [40] = 0x80, 6, 5, 3, 0x09, 0x04, 0, 1}, reply[48];
    uint8_t string[256];
    int fd = raw_connect(endpoint);
    raw_write(fd, list, sizeof list);
    read_all(fd, head, 12);
    read_all(fd, device, DEVICE_LEN);
    memcpy(out->bus_id, device + BUS_ID, BUS_ID_LEN);
    read_all(fd, string, 3 * 4); /* its interfaces */
    memcpy(import + 8, out->bus_id, BUS_ID_LEN);
    raw_write(fd, import, sizeof import);
    read_all(fd, head, 8);
    assert_int_equal(head[7], 0);
    read_all(fd, device, DEVICE_LEN);
    memcpy(submit + 8, (const uint8_t[]){device[290], device[291], device[294], device[295]}, 4); /* bus, device */
    raw_write(fd, submit, sizeof submit);
    read_all(fd, reply, sizeof reply);
    assert_int_equal(reply[23], 0);
    assert_in_range(reply[27], 2, sizeof out->serial);
    read_all(fd, string, reply[27]);
    for (int i = 1; i < reply[27] / 2; i++)
        out->serial[i - 1] = (char)string[2 * i];
    out->serial[reply[27] / 2 - 1] = '\0';
    close(fd);
}

/* The scan over TCP, as its reader hashes it: the descriptor with the head's *IDN? is in it. */
static void scan(const struct head *head, struct identity *out)
{
    struct scanhead_frame frame;
    struct scanhead *sh = client_open(head_endpoint(head, "tcp"));
    scanhead_hash_start(sh);
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    scanhead_hash_hex(sh, out->hash);
    scanhead_close(sh);
}

static struct head start(struct wire *wire, const char *serial)
{
    char links[192];
    snprintf(links, sizeof links, "links: [{type: usb, port: 0%s}, {type: tcp, port: 0}]\n", serial);
    const struct room_config c = {
        .prr_hz = 20000, .lines_hz = 50, .pan_deg_s = 60, .pan_stop_deg = 6, .frames = 1, .links = links};
    const char *const more[] = {"--pace", "fast", NULL};
    return head_start(wire, room_config_write(wire, &c), more);
}

/* "usbip:127.0.0.1:PORT" as the socket that it is. */
static void ask(const struct head *head, struct identity *out)
{
    char at[128];
    const char *endpoint = head_endpoint(head, "usb");
    memset(out, 0, sizeof *out);
    snprintf(at, sizeof at, "tcp%s", strchr(endpoint, ':'));
    ask_device(at, out);
}

static void test_two_heads(void **state)
{
    struct wire *wire = *state;
    struct identity one, other, fixed;
    room_write(wire);
    struct head a = start(wire, ""), b = start(wire, ""), c = start(wire, ", serial: LAB-7");
    ask(&a, &one);
    ask(&b, &other);
    ask(&c, &fixed);
    assert_string_not_equal(one.bus_id, other.bus_id);
    assert_string_not_equal(one.serial, other.serial);
    assert_memory_equal(one.serial, "SIM-0001-", 9);
    assert_memory_equal(other.serial, "SIM-0001-", 9);
    assert_int_equal(strlen(one.serial), 17);
    assert_string_equal(fixed.serial, "LAB-7");
    assert_string_equal(fixed.bus_id, "1-1");
    scan(&a, &one);
    scan(&b, &other);
    scan(&c, &fixed);
    assert_string_equal(one.hash, other.hash); /* the stream knows nothing of it */
    assert_string_equal(one.hash, fixed.hash);
    head_end(&a, SIGTERM);
    head_end(&b, SIGTERM);
    head_end(&c, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_two_heads, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
