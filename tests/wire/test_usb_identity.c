/* SPDX-License-Identifier: MIT */
/* Heads on USB/IP without a configured identity. Two that run at a time differ in serial number and bus id, and in
 * nothing that belongs to the stream. A configured identity stays as it is. */
#include "tests/wire/room.h"
#include "tests/wire/usbip_host.h"

struct identity {
    char bus_id[USBIP_BUS_ID_LEN + 1], serial[128], hash[65];
};

/* Reads the scan over TCP, and its hash by the reader. The descriptor with the head's *IDN? is in it. */
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

/* The serial number is the string after the model's four. */
static void ask(const struct head *head, struct identity *out)
{
    struct usbip_host host = usbip_host_open(head);
    memset(out, 0, sizeof *out);
    memcpy(out->bus_id, host.device + USBIP_BUS_ID, USBIP_BUS_ID_LEN);
    usbip_host_string(&host, 5, out->serial, sizeof out->serial);
    usbip_host_close(&host);
}

static struct head start_file(struct wire *wire, const char *name)
{
    const char *const more[] = {"--pace", "fast", NULL};
    return head_start(wire, wire_path(wire, name), more);
}

/* Two heads of different files are ended and started again in the other order. Each has its serial number
 * again. */
static void test_started_again(void **state)
{
    struct wire *wire = *state;
    struct identity one, other, again;
    const struct room_config c = {.prr_hz = 20000,
                                  .lines_hz = 50,
                                  .pan_deg_s = 60,
                                  .pan_stop_deg = 6,
                                  .frames = 1,
                                  .links = "links: [{type: usb, port: 0}]\n"};
    room_write(wire);
    char *text = wire_read(room_config_write(wire, &c), NULL);
    wire_write_text(wire, "other.yaml", text);
    free(text);
    for (int round = 0; round < 2; round++) {
        struct head a = start_file(wire, round == 0 ? "config.yaml" : "other.yaml");
        struct head b = start_file(wire, round == 0 ? "other.yaml" : "config.yaml");
        ask(&a, round == 0 ? &one : &again);
        if (round == 1) assert_string_equal(again.serial, other.serial);
        ask(&b, round == 0 ? &other : &again);
        if (round == 1) assert_string_equal(again.serial, one.serial);
        head_end(&a, SIGTERM);
        head_end(&b, SIGTERM);
    }
    assert_string_not_equal(one.serial, other.serial);
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
    assert_string_equal(one.hash, other.hash); /* the stream does not depend on it */
    assert_string_equal(one.hash, fixed.hash);
    head_end(&a, SIGTERM);
    head_end(&b, SIGTERM);
    head_end(&c, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_two_heads, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_started_again, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
