/* SPDX-License-Identifier: MIT */
/* Places of links that stand for several: names with two addresses, an interface of two networks. And connections that
 * don't come about: a signal comes, or the socket would be connected to itself. The link's own calls of the system go
 * through here. */
#include "tests/unit/link_test.h"

#include <arpa/inet.h>
#include <errno.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/syscall.h>

#include "drivers/host/scanhead.h"
#include "drivers/socket/socket.h"
#include "drivers/socket/stamped.h"
#include "drivers/usb/backend.h"

static const char TWO[] = "two.example";   /* 127.0.0.1, then 127.0.0.2 */
static const char BOTH[] = "both.example"; /* ::1, then 127.0.0.1 */

static struct addrinfo entry[2];
static struct sockaddr_in v4[2];
static struct sockaddr_in6 v6;

int getaddrinfo(const char *host, const char *port, const struct addrinfo *hints, struct addrinfo **list)
{
    const int is_both = strcmp(host, BOTH) == 0, n = is_both || strcmp(host, TWO) == 0 ? 2 : 1;
    for (int i = 0; i < n; i++) {
        v4[i] = (struct sockaddr_in){.sin_family = AF_INET,
                                     .sin_addr.s_addr = n == 1 ? inet_addr(host) : htonl(INADDR_LOOPBACK),
                                     .sin_port = htons((uint16_t)atoi(port))};
        entry[i] = (struct addrinfo){.ai_family = AF_INET,
                                     .ai_socktype = hints->ai_socktype,
                                     .ai_addr = (struct sockaddr *)&v4[i],
                                     .ai_addrlen = sizeof v4[i],
                                     .ai_next = i + 1 < n ? &entry[i + 1] : NULL};
    }
    if (n == 2 && !is_both) v4[1].sin_addr.s_addr = htonl(INADDR_LOOPBACK + 1);
    if (is_both) {
        v6 = (struct sockaddr_in6){
            .sin6_family = AF_INET6, .sin6_addr = IN6ADDR_LOOPBACK_INIT, .sin6_port = v4[0].sin_port};
        entry[0].ai_family = AF_INET6;
        entry[0].ai_addr = (struct sockaddr *)&v6;
        entry[0].ai_addrlen = sizeof v6;
    }
    *list = entry;
    return 0;
}

void freeaddrinfo(struct addrinfo *list)
{
    assert_ptr_equal(list, entry);
}

static struct sockaddr_in loopback(int port)
{
    return (struct sockaddr_in){
        .sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK), .sin_port = htons((uint16_t)port)};
}

/* ---- a name with two addresses */

/* While the link is unplugged, another program takes its port on the first address. The link does not come back on the
 * second one, where its clients don't look for it. */
static void a_link_comes_back_where_it_was(void **state)
{
    (void)state;
    static const struct link_spec specs[] = {
        {.type = LINK_TCP, .max_sessions = 1},
        {.type = LINK_WEB, .max_sessions = 1},
        {.type = LINK_USB, .backend = USB_BACKEND_USBIP, .vid = 1},
    };
    for (size_t i = 0; i < sizeof specs / sizeof specs[0]; i++) {
        struct link_spec spec = specs[i];
        snprintf(spec.address, sizeof spec.address, "%s", TWO);
        struct bench bench = bench_open(&spec);
        const struct sockaddr_in at = loopback(bench_port(&bench));
        const int one = 1, other = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        assert_int_equal(bench.ops->fault(bench.link, LINK_FAULT_UNPLUG, 0, 0, 0.0), SH_OK);
        bench_poll(&bench, 0, 0);
        setsockopt(other, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
        assert_int_equal(bind(other, (const struct sockaddr *)&at, sizeof at), 0);
        assert_int_equal(listen(other, 1), 0);
        assert_int_equal(bench.ops->fault(bench.link, LINK_FAULT_PLUG, 0, 0, 0.0), SH_ESTATE);
        close(other);
        assert_int_equal(bench.ops->fault(bench.link, LINK_FAULT_PLUG, 0, 0, 0.0), SH_OK);
        assert_int_equal(bench_port(&bench), ntohs(at.sin_port));
        close(dial(ntohs(at.sin_port)));
        bench_close(&bench);
    }
}

/* Datagrams go to the IPv4 address of a name that has both kinds: no answer would show a wrong choice. */
static void datagrams_go_by_ipv4(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_UDP, .port = 2368};
    char name[300];
    snprintf(spec.address, sizeof spec.address, "%s", BOTH);
    struct bench bench = bench_open(&spec);
    bench.ops->endpoint(bench.link, name, sizeof name);
    assert_string_equal(name, "udp:127.0.0.1:2368");
    bench_close(&bench);
}

/* ---- an interface of two networks */

static struct sockaddr_in own[2], mask, broadcast[2];
static struct ifaddrs interface[2];

/* The interface "two" has 127.0.4.9/24 and 127.0.5.9/24, which are addresses of the loopback. */
int getifaddrs(struct ifaddrs **list)
{
    static char name[] = "two";
    mask = (struct sockaddr_in){.sin_family = AF_INET, .sin_addr.s_addr = htonl(0xffffff00)};
    for (int i = 0; i < 2; i++) {
        own[i] = broadcast[i] = loopback(0);
        own[i].sin_addr.s_addr = htonl(0x7f000409 + 256 * (unsigned)i);
        broadcast[i].sin_addr.s_addr = htonl(0x7f0004ff + 256 * (unsigned)i);
        interface[i] = (struct ifaddrs){.ifa_name = name,
                                        .ifa_flags = IFF_BROADCAST,
                                        .ifa_addr = (struct sockaddr *)&own[i],
                                        .ifa_netmask = (struct sockaddr *)&mask,
                                        .ifa_next = i == 0 ? &interface[1] : NULL};
        interface[i].ifa_broadaddr = (struct sockaddr *)&broadcast[i];
    }
    *list = interface;
    return 0;
}

void freeifaddrs(struct ifaddrs *list)
{
    assert_ptr_equal(list, interface);
}

static int broadcasts; /* sockets that may send broadcasts */

int setsockopt(int fd, int level, int name, const void *value, socklen_t len)
{
    broadcasts += level == SOL_SOCKET && name == SO_BROADCAST && *(const int *)value != 0;
    return (int)syscall(SYS_setsockopt, fd, level, name, value, len);
}

/* A datagram goes to a receiver in either network, or to a broadcast. It comes from the address in the same network. */
static void packets_come_from_the_receivers_network(void **state)
{
    (void)state;
    static const struct {
        const char *to, *from;
        int broadcasts;
    } cases[] = {{"127.0.4.20", "127.0.4.9", 0},
                 {"127.0.5.20", "127.0.5.9", 0},
                 {"127.0.5.255", "127.0.5.9", 1},
                 {"127.0.4.255", "127.0.4.9", 1},
                 {"127.0.6.20", "127.0.4.9", 0}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct link_spec spec = {.type = LINK_UDP, .interface = "two"};
        struct sockaddr_in at = loopback(0), from;
        socklen_t len = sizeof at, from_len = sizeof from;
        char byte;
        const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
        at.sin_addr.s_addr = inet_addr(cases[i].to);
        assert_int_equal(bind(fd, (const struct sockaddr *)&at, sizeof at), 0);
        assert_int_equal(getsockname(fd, (struct sockaddr *)&at, &len), 0);
        snprintf(spec.address, sizeof spec.address, "%s", cases[i].to);
        spec.port = ntohs(at.sin_port);
        broadcasts = 0;
        struct bench bench = bench_open(&spec);
        assert_int_equal(broadcasts, cases[i].broadcasts);
        bench_expect(&bench, LINK_OPENED, 0);
        assert_int_equal(bench.ops->write(bench.link, 0, "a", 1), 1);
        assert_int_equal(recvfrom(fd, &byte, 1, 0, (struct sockaddr *)&from, &from_len), 1);
        assert_string_equal(inet_ntoa(from.sin_addr), cases[i].from);
        close(fd);
        bench_close(&bench);
    }
}

/* ---- connections that don't come about */

static int own_port;                /* each socket gets this port; 0: the system's choice */
static int is_interrupted, n_tries; /* whether a signal interrupts connect(); its calls */
static int last_socket;             /* the newest one */

int socket(int family, int type, int protocol)
{
    const struct sockaddr_in at = loopback(own_port);
    const int fd = last_socket = (int)syscall(SYS_socket, family, type, protocol);
    if (own_port != 0) assert_int_equal(bind(fd, (const struct sockaddr *)&at, sizeof at), 0);
    return fd;
}

int connect(int fd, const struct sockaddr *at, socklen_t len)
{
    n_tries++;
    errno = EINTR;
    return is_interrupted ? -1 : (int)syscall(SYS_connect, fd, at, len);
}

static int find_free_port(void)
{
    struct sockaddr_in at = loopback(0);
    socklen_t len = sizeof at;
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, len), 0);
    assert_int_equal(getsockname(fd, (struct sockaddr *)&at, &len), 0);
    close(fd);
    return ntohs(at.sin_port);
}

/* The ways to connect. Each returns 1 if it is connected. */
static int opens(const char *host, int port, struct sh_err *err)
{
    const struct socket_place place = {.what = "test", .host = host, .port = port, .connecting = 1};
    char name[80];
    int fd;
    const int rc = socket_open(&place, &fd, name, sizeof name, err);
    if (rc == SH_OK) close(fd);
    return rc == SH_OK;
}

static int opens_stamped(const char *host, int port, struct sh_err *err)
{
    int fd;
    const int rc = stamped_connect(host, port, 1000, &fd, err);
    if (rc == SH_OK) close(fd);
    return rc == SH_OK;
}

/* One program at a time reads a port of an address. */
static void a_port_has_one_reader(void **state)
{
    (void)state;
    struct sh_err err = {0};
    struct stamped_socket first, second;
    assert_int_equal(stamped_open("127.0.0.1", 0, &first, &err), SH_OK);
    const int port = ntohs(((const struct sockaddr_in *)&first.own)->sin_port);
    assert_int_not_equal(port, 0);
    assert_int_equal(stamped_open("127.0.0.1", port, &second, &err), SH_EINPUT);
    char want[128];
    snprintf(want, sizeof want, "udp:127.0.0.1:%d: Address already in use; another program reads it", port);
    assert_string_equal(err.text, want);
    stamped_close(&first);
    assert_int_equal(stamped_open("127.0.0.1", port, &second, &err), SH_OK);
    stamped_close(&second);
    assert_int_equal(stamped_open("192.0.2.1", 0, &second, &err), SH_EINPUT); /* of TEST-NET-1 (RFC 5737) */
    assert_string_equal(err.text, "udp:192.0.2.1:0: Cannot assign requested address; allowed are this machine's "
                                  "addresses, 0.0.0.0, broadcasts and groups");
}

static int opens_host(const char *host, int port, struct sh_err *err)
{
    char source[64];
    struct scanhead *sh;
    snprintf(source, sizeof source, "tcp:%s:%d", host, port);
    const int rc = scanhead_open(source, &sh, err->text, sizeof err->text);
    scanhead_close(sh);
    return rc == SCANHEAD_OK;
}

enum { WITH_SIGNALS = 2, ALL = 3 }; /* libscanhead does not block in connect(), so no signal interrupts it there */
static int (*const ways[ALL])(const char *host, int port, struct sh_err *err) = {opens, opens_stamped, opens_host};

/* The system gives the socket the port that it connects to, where nobody listens. */
static void nobody_is_connected_to_itself(void **state)
{
    (void)state;
    for (int i = 0; i < ALL; i++) {
        const int port = find_free_port();
        struct sh_err err = {0};
        own_port = port;
        const int is_open = ways[i]("127.0.0.1", port, &err);
        own_port = 0;
        assert_false(is_open);
        assert_non_null(strstr(err.text, "Connection refused"));
    }
}

/* Returns the number of an option of the newest socket. */
static int option(int level, int name)
{
    int value = 0;
    socklen_t len = sizeof value;
    assert_int_equal(getsockopt(last_socket, level, name, &value, &len), 0);
    return value;
}

/* A head that loses power says nothing. So its client asks: 10 s of silence, then three questions 5 s apart. */
static void a_client_learns_that_its_head_has_vanished(void **state)
{
    (void)state;
    struct sockaddr_in at = loopback(0);
    socklen_t len = sizeof at;
    struct scanhead *sh;
    char source[64], err[256];
    const int door = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(door, (struct sockaddr *)&at, len), 0);
    assert_int_equal(listen(door, 1), 0);
    assert_int_equal(getsockname(door, (struct sockaddr *)&at, &len), 0);
    snprintf(source, sizeof source, "tcp:127.0.0.1:%d", ntohs(at.sin_port));
    assert_int_equal(scanhead_open(source, &sh, err, sizeof err), 0);
    assert_int_equal(option(SOL_SOCKET, SO_KEEPALIVE), 1);
    assert_int_equal(
        option(IPPROTO_TCP, TCP_KEEPIDLE) + option(IPPROTO_TCP, TCP_KEEPINTVL) * option(IPPROTO_TCP, TCP_KEEPCNT), 25);
    scanhead_close(sh);
    close(door);
}

/* A signal ends the attempt: the name's second address is not tried. */
static void a_signal_ends_all_attempts(void **state)
{
    (void)state;
    for (int i = 0; i < WITH_SIGNALS; i++) {
        struct sh_err err = {0};
        is_interrupted = 1;
        n_tries = 0;
        const int is_open = ways[i](TWO, 9, &err);
        is_interrupted = 0;
        assert_false(is_open);
        assert_int_equal(n_tries, 1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_link_comes_back_where_it_was),
        cmocka_unit_test(datagrams_go_by_ipv4),
        cmocka_unit_test(packets_come_from_the_receivers_network),
        cmocka_unit_test(nobody_is_connected_to_itself),
        cmocka_unit_test(a_client_learns_that_its_head_has_vanished),
        cmocka_unit_test(a_port_has_one_reader),
        cmocka_unit_test(a_signal_ends_all_attempts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
