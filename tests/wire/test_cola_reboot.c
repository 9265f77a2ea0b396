/* SPDX-License-Identifier: MIT */
/* CoLa: mSCreboot reboots the head. All sessions end, its clock and counters begin anew, and it counts a power-up. */

#include "tests/wire/cola_client.h"
#include "tests/wire/room.h"
#include "tests/wire/wire.h"

/* Reads the counts of telegrams and scans, and the scan's start in us, of the next scan. */
static void read_scan(struct cola_client *c, unsigned *telegrams, unsigned *scans, unsigned *start_us)
{
    const char *scan = cola_client_ask(c, "sRN LMDscandata");
    assert_non_null(scan);
    assert_int_equal(sscanf(scan, "sRA LMDscandata 1 1 %*s 0 0 %X %X %X", telegrams, scans, start_us), 3);
}

static int64_t device_ns(const struct head *head)
{
    struct scanhead *sh = client_open(head_endpoint(head, "pty"));
    const int64_t t_ns = strtoll(client_ask(sh, "TIME?"), NULL, 10);
    scanhead_close(sh);
    return t_ns;
}

static void reboots(void **state)
{
    struct wire *wire = *state;
    static struct cola_client c, other;
    unsigned telegrams, scans, start_us;
    const struct room_config config = {
        .profile = "sick-lms111",
        .prr_hz = 36000,
        .lines_hz = 50,
        .links = "links: [{type: tcp, port: 0, protocol: cola}, {type: pty, path: native}]\n"};
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &config), NULL);
    c.fd = raw_connect(head_endpoint(&head, "tcp"));
    other.fd = raw_connect(head_endpoint(&head, "tcp"));
    cola_client_expect(&c, "sMN SetAccessMode 03 F4724744", "sAN SetAccessMode 1");
    cola_client_expect(&other, "sRN ODpwrc", "sRA ODpwrc 1");
    read_scan(&c, &telegrams, &scans, &start_us);
    read_scan(&c, &telegrams, &scans, &start_us);
    assert_int_equal(telegrams, 1);
    const int64_t before_ns = device_ns(&head);
    cola_client_reboot(&c, &head);
    assert_null(cola_client_next(&other)); /* all clients share the device */
    close(other.fd);
    cola_client_expect(&c, "sMN GetAccessMode", "sAN GetAccessMode 1");
    read_scan(&c, &telegrams, &scans, &start_us);
    assert_int_equal(telegrams, 0);
    assert_int_equal(scans, 0);
    assert_true((int64_t)start_us * 1000 <= device_ns(&head) - before_ns); /* it began after the reboot */
    close(c.fd);
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(reboots, wire_setup, wire_teardown)};
    return cmocka_run_group_tests_name("cola reboot", tests, NULL, NULL);
}
