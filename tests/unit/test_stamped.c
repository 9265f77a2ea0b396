/* SPDX-License-Identifier: MIT */
/* Sockets whose bytes have times: what is read of each datagram and stream, and what is refused. */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "drivers/socket/stamped.h"

enum { WAIT_MS = 60000 };

static struct stamped_socket keeper;
static int has_stamps; /* QEMU's user mode has none, so bytes have the time at which they were read */

static struct sockaddr_in v4(const char *host, int port)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    assert_int_equal(inet_pton(AF_INET, host, &at.sin_addr), 1);
    return at;
}

static int port_of(int fd)
{
    struct sockaddr_storage at;
    socklen_t len = sizeof at;
    assert_int_equal(getsockname(fd, (struct sockaddr *)&at, &len), 0);
    return ntohs(((struct sockaddr_in *)&at)->sin_port); /* an address of IPv6 has it at the same place */
}

static int bound(int type, const char *host)
{
    const struct sockaddr_in at = v4(host, 0);
    const int fd = socket(AF_INET, type | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(fd, (const struct sockaddr *)&at, sizeof at), 0);
    return fd;
}

static void open_ok(const char *host, int port, struct stamped_socket *s)
{
    struct sh_err err;
    if (stamped_open(host, port, s, &err) != SH_OK) fail_msg("%s", err.text);
}

static void expect_refused(const char *host, int port, const char *text)
{
    struct stamped_socket s;
    struct sh_err err = {0, ""};
    assert_int_equal(stamped_open(host, port, &s, &err), SH_EINPUT);
    assert_string_equal(err.text, text);
    assert_int_equal(s.fd, -1);
    stamped_close(&s);
}

/* Returns the time at which there surely is something to read. */
static int64_t wait_ns(int fd)
{
    struct pollfd slot = {.fd = fd, .events = POLLIN};
    assert_int_equal(poll(&slot, 1, WAIT_MS), 1);
    return has_stamps ? stamped_now_ns() : INT64_MAX;
}

static struct stamped_datagram take(const struct stamped_socket *s, const char *text)
{
    char got[1024];
    struct stamped_datagram d;
    struct sh_err err;
    wait_ns(s->fd);
    assert_int_equal(stamped_take(s, got, sizeof got, &d, &err), 1);
    assert_int_equal(d.len, strlen(text));
    assert_memory_equal(got, text, d.len);
    return d;
}

/* Several programs may wait for the kernel's stamps at the same time. Each keeper has a port of its own. */
static void a_second_keeper_is_open_beside_the_first(void **state)
{
    (void)state;
    struct stamped_socket second;
    stamped_begin(&second);
    assert_true(second.fd >= 0);
    assert_int_not_equal(port_of(second.fd), port_of(keeper.fd));
    stamped_close(&second);
}

/* All addresses of the machine are read; the datagram has the one that it was sent to. The time is when it came. */
static void a_datagram_has_its_addresses_and_time(void **state)
{
    (void)state;
    struct stamped_socket s;
    struct stamped_datagram d;
    struct sh_err err;
    char got[16];
    open_ok("0.0.0.0", 0, &s);
    const int port = port_of(s.fd), sender = bound(SOCK_DGRAM, "127.0.0.2");
    const struct sockaddr_in to = v4("127.0.0.3", port), from = v4("127.0.0.2", port_of(sender));
    assert_int_equal(stamped_take(&s, got, sizeof got, &d, &err), 0);
    const int64_t before_ns = stamped_now_ns();
    assert_int_equal(sendto(sender, "abcde", 5, 0, (const struct sockaddr *)&to, sizeof to), 5);
    const int64_t there_ns = wait_ns(s.fd);
    assert_int_equal(stamped_take(&s, got, sizeof got, &d, &err), 1);
    assert_int_equal(d.len, 5);
    assert_memory_equal(got, "abcde", 5);
    assert_in_range(d.t_ns, before_ns, there_ns);
    assert_memory_equal(&d.from, &from, sizeof from);
    assert_memory_equal(&d.to, &to, sizeof to);
    assert_int_equal(d.dropped, 0);
    assert_int_equal(stamped_take(&s, got, sizeof got, &d, &err), 0);
    close(sender);
    stamped_close(&s);
    assert_int_equal(s.fd, -1);
}

static void a_datagram_of_ipv6_too(void **state)
{
    (void)state;
    struct stamped_socket s, other;
    struct sh_err err;
    if (stamped_open("::1", 0, &other, &err) != SH_OK) skip(); /* a machine without IPv6 */
    open_ok("::", 0, &s);
    struct stamped_socket v4_too; /* an address of IPv6 leaves the port of IPv4 free */
    open_ok("0.0.0.0", port_of(s.fd), &v4_too);
    stamped_close(&v4_too);
    struct sockaddr_in6 to = {.sin6_family = AF_INET6, .sin6_port = htons((uint16_t)port_of(s.fd))};
    to.sin6_addr = in6addr_loopback;
    const int64_t before_ns = stamped_now_ns();
    assert_int_equal(sendto(other.fd, "abc", 3, 0, (const struct sockaddr *)&to, sizeof to), 3);
    const int64_t there_ns = wait_ns(s.fd);
    const struct stamped_datagram d = take(&s, "abc");
    assert_in_range(d.t_ns, before_ns, there_ns);
    assert_memory_equal(&((const struct sockaddr_in6 *)&d.to)->sin6_addr, &in6addr_loopback, 16);
    assert_int_equal(((const struct sockaddr_in6 *)&d.to)->sin6_port, to.sin6_port);
    assert_int_equal(((const struct sockaddr_in6 *)&d.from)->sin6_port, htons((uint16_t)port_of(other.fd)));
    stamped_close(&s);
    stamped_close(&other);
}

/* Datagrams without room are counted, by the socket at once and by the next datagram that comes. */
static void lost_datagrams_are_counted(void **state)
{
    (void)state;
    enum { SENT = 100 };
    struct stamped_socket s;
    struct stamped_datagram d;
    struct sh_err err;
    char text[500] = "";
    if (!has_stamps) skip(); /* nor has it counts of losses */
    const int least = 0, sender = bound(SOCK_DGRAM, "127.0.0.1");
    unsigned taken = 0;
    open_ok("127.0.0.1", 0, &s);
    assert_int_equal(setsockopt(s.fd, SOL_SOCKET, SO_RCVBUF, &least, sizeof least), 0);
    assert_int_equal(stamped_dropped(&s), 0);
    for (int i = 0; i < SENT; i++)
        assert_int_equal(sendto(sender, text, sizeof text, 0, (struct sockaddr *)&s.own, s.own_len), sizeof text);
    while (stamped_take(&s, text, sizeof text, &d, &err) == 1) {
        assert_int_equal(d.dropped, 0); /* none of those that had room came after a loss */
        taken++;
    }
    assert_in_range(taken, 1, SENT - 1);
    assert_int_equal(stamped_dropped(&s), SENT - taken);
    assert_int_equal(sendto(sender, "x", 1, 0, (struct sockaddr *)&s.own, s.own_len), 1);
    assert_int_equal(take(&s, "x").dropped, SENT - taken);
    stamped_close(&s);
    assert_int_equal(stamped_dropped(&s), 0);
    close(sender);
}

/* The system may give a socket up to 16 MiB for what waits. To a program without privileges it gives less. */
static void it_has_the_largest_buffer(void **state)
{
    (void)state;
    const int size = 16 << 20, other = bound(SOCK_DGRAM, "127.0.0.1");
    struct stamped_socket s;
    int is = 0, most = 0;
    socklen_t len = sizeof is;
    if (setsockopt(other, SOL_SOCKET, SO_RCVBUFFORCE, &size, sizeof size) != 0)
        setsockopt(other, SOL_SOCKET, SO_RCVBUF, &size, sizeof size);
    assert_int_equal(getsockopt(other, SOL_SOCKET, SO_RCVBUF, &most, &len), 0);
    open_ok("127.0.0.1", 0, &s);
    assert_int_equal(getsockopt(s.fd, SOL_SOCKET, SO_RCVBUF, &is, &len), 0);
    assert_int_equal(is, most);
    stamped_close(&s);
    close(other);
}

/* Two programs may read a group, each on the interface that it names. */
static void a_group_has_several_readers(void **state)
{
    (void)state;
    struct stamped_socket a, b;
    const int sender = bound(SOCK_DGRAM, "127.0.0.1");
    const struct in_addr own = {htonl(INADDR_LOOPBACK)};
    open_ok("239.77.1.2%lo", 0, &a);
    open_ok("239.77.1.2%lo", port_of(a.fd), &b);
    const struct sockaddr_in to = v4("239.77.1.2", port_of(a.fd));
    assert_int_equal(setsockopt(sender, IPPROTO_IP, IP_MULTICAST_IF, &own, sizeof own), 0);
    assert_int_equal(sendto(sender, "all", 3, 0, (const struct sockaddr *)&to, sizeof to), 3);
    struct stamped_datagram d = take(&a, "all");
    assert_memory_equal(&d.to, &to, sizeof to);
    take(&b, "all");
    stamped_close(&a);
    stamped_close(&b);
    open_ok("255.255.255.255", 0, &a);
    open_ok("255.255.255.255", port_of(a.fd), &b);
    stamped_close(&a);
    stamped_close(&b);
    close(sender);
}

static void refusals_name_what_is_allowed(void **state)
{
    (void)state;
    struct stamped_socket s;
    char want[200];
    open_ok("127.0.0.1", 0, &s);
    snprintf(want, sizeof want, "udp:127.0.0.1:%d: Address already in use; another program reads it", port_of(s.fd));
    expect_refused("127.0.0.1", port_of(s.fd), want);
    stamped_close(&s);
    expect_refused("192.0.2.1", 4000,
                   "udp:192.0.2.1:4000: Cannot assign requested address; allowed are this machine's addresses, "
                   "0.0.0.0, broadcasts and groups"); /* RFC 5737: nobody has it */
    expect_refused("239.77.1.2%nosuch0", 4000, "udp:239.77.1.2%nosuch0: there is no interface nosuch0");
}

/* A stream has the time of its bytes, its end, and a reset, which is no end. */
static void a_stream_has_times_and_an_end(void **state)
{
    (void)state;
    const struct linger at_once = {.l_onoff = 1};
    const int listener = bound(SOCK_STREAM, "127.0.0.1"), port = port_of(listener);
    struct sh_err err = {0, ""};
    char got[16], want[100];
    int64_t t_ns = 0;
    int fd;
    assert_int_equal(listen(listener, 1), 0);
    for (int is_reset = 0; is_reset < 2; is_reset++) {
        if (stamped_connect("127.0.0.1", port, WAIT_MS, &fd, &err) != SH_OK) fail_msg("%s", err.text);
        assert_true((fcntl(fd, F_GETFL) & O_NONBLOCK) != 0);
        int is_tuned = 0;
        socklen_t len = sizeof is_tuned;
        assert_int_equal(getsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &is_tuned, &len), 0);
        assert_int_equal(is_tuned, 1); /* a device that vanishes ends the connection */
        const int peer = accept(listener, NULL, NULL);
        assert_int_equal(stamped_read(fd, got, sizeof got, &t_ns), 0);
        const int64_t before_ns = stamped_now_ns();
        assert_int_equal(write(peer, "abc", 3), 3);
        const int64_t there_ns = wait_ns(fd);
        assert_int_equal(stamped_read(fd, got, sizeof got, &t_ns), 3);
        assert_memory_equal(got, "abc", 3);
        assert_in_range(t_ns, before_ns, there_ns);
        if (is_reset) assert_int_equal(setsockopt(peer, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once), 0);
        close(peer);
        const int64_t ended_ns = stamped_now_ns();
        wait_ns(fd);
        assert_int_equal(stamped_read(fd, got, sizeof got, &t_ns), is_reset ? SH_ERESET : SH_ECLOSED);
        assert_in_range(t_ns, ended_ns, stamped_now_ns());
        close(fd);
    }
    close(listener);
    assert_int_equal(stamped_connect("127.0.0.1", port, WAIT_MS, &fd, &err), SH_EIO);
    snprintf(want, sizeof want, "tcp:127.0.0.1:%d: cannot connect: Connection refused", port);
    assert_string_equal(err.text, want);
}

static int set_up(void **state)
{
    (void)state;
    stamped_begin(&keeper);
    socklen_t len = sizeof has_stamps;
    if (getsockopt(keeper.fd, SOL_SOCKET, SO_TIMESTAMPNS, &has_stamps, &len) != 0) has_stamps = 0;
    return keeper.fd >= 0 ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    stamped_close(&keeper);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_second_keeper_is_open_beside_the_first),
        cmocka_unit_test(a_datagram_has_its_addresses_and_time),
        cmocka_unit_test(a_datagram_of_ipv6_too),
        cmocka_unit_test(lost_datagrams_are_counted),
        cmocka_unit_test(it_has_the_largest_buffer),
        cmocka_unit_test(a_group_has_several_readers),
        cmocka_unit_test(refusals_name_what_is_allowed),
        cmocka_unit_test(a_stream_has_times_and_an_end),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
