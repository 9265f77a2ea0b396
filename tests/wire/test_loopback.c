/* SPDX-License-Identifier: MIT */
/* If no address is given, a head listens at 127.0.0.1 alone. 127.0.0.2 is loopback, too. A listener at all addresses
 * of the machine would accept a connection to it; one at 127.0.0.1 refuses it. So the test needs no other machine. */
#include <arpa/inet.h>

#include "tests/wire/room.h"

static const char LINKS[] = "links:\n"
                            "  - {type: tcp, port: 0}\n"
                            "  - {type: web, port: 0}\n"
                            "  - {type: usb, port: 0}\n"
                            "  - {type: usb, backend: usbredir, port: 0}\n";
enum { N_LINKS = 4 };

static struct sockaddr_in place(const char *address, int port)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    assert_int_equal(inet_pton(AF_INET, address, &at.sin_addr), 1);
    return at;
}

/* Returns 0, or the errno of a connection. On loopback both answers come at once. */
static int try_tcp(const char *address, int port)
{
    struct sockaddr_in at = place(address, port);
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_true(fd >= 0);
    int error = connect(fd, (struct sockaddr *)&at, sizeof at) == 0 ? 0 : errno;
    close(fd);
    return error;
}

/* Returns whether the system reports that nobody takes a datagram there. */
static int udp_is_refused(const char *address, int port)
{
    struct sockaddr_in at = place(address, port);
    int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0), error = 0;
    socklen_t len = sizeof error;
    assert_true(fd >= 0);
    assert_int_equal(connect(fd, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(send(fd, "x\n", 2, 0), 2);
    assert_int_equal(getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &len), 0);
    close(fd);
    return error == ECONNREFUSED;
}

static void every_service_is_for_this_machine_alone(void **state)
{
    struct wire *wire = *state;
    const struct room_config config = {.profile = "any-rate",
                                       .prr_hz = 100000,
                                       .lines_hz = 100,
                                       .pan_deg_s = 10,
                                       .pan_stop_deg = 90,
                                       .links = LINKS,
                                       .more = "platform: {kind: live, reach_m: 5}\ntime: {epoch: utc}\n"};
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &config), NULL);
    for (int i = 0; i < N_LINKS; i++) {
        const char *endpoint = head_link(&head, i);
        assert_non_null(strstr(endpoint, "127.0.0.1:"));
        const int port = endpoint_port(endpoint);
        assert_int_equal(try_tcp("127.0.0.1", port), 0);
        assert_int_equal(try_tcp("127.0.0.2", port), ECONNREFUSED);
    }
    const int port = endpoint_port(head_link(&head, N_LINKS)); /* of the poses */
    assert_false(udp_is_refused("127.0.0.1", port));
    assert_true(udp_is_refused("127.0.0.2", port));
    head_end(&head, SIGTERM);
}

/* There is a warning for an address that others may reach, once for the link. Links on
 * loopback have none. */
static void what_others_reach_is_said(void **state)
{
    struct wire *wire = *state;
    const struct room_config config = {.profile = "any-rate",
                                       .prr_hz = 100000,
                                       .lines_hz = 100,
                                       .pan_deg_s = 10,
                                       .pan_stop_deg = 90,
                                       .links = "links:\n"
                                                "  - {type: tcp, port: 0, address: 127.0.0.2}\n"
                                                "  - {type: web, port: 0, address: localhost}\n"
                                                "  - {type: tcp, port: 0, address: 0.0.0.0}\n"};
    size_t len;
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &config), NULL);
    const int port = endpoint_port(head_link(&head, 2));
    assert_int_equal(try_tcp("127.0.0.2", port), 0); /* the other test would see such a link */
    head_end(&head, SIGTERM);
    char *said = wire_read(wire_path(wire, "head.err"), &len), want[64];
    snprintf(want, sizeof want, "link tcp:0.0.0.0:%d: other machines can reach", port);
    const char *at = strstr(said, "other machines");
    assert_non_null(strstr(said, want));
    assert_null(strstr(at + 1, "other machines"));
    free(said);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(every_service_is_for_this_machine_alone, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(what_others_reach_is_said, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
