/* SPDX-License-Identifier: MIT */
/* The udp link: a write is a datagram, with or without a receiver; allowed and refused destinations. */
#include "tests/unit/link_test.h"

#include <arpa/inet.h>
#include <net/if.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

/* Opens a receiver, and writes the spec of a link to it. */
static int open_receiver(struct link_spec *spec)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t len = sizeof at;
    int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(getsockname(fd, (struct sockaddr *)&at, &len), 0);
    *spec = (struct link_spec){.type = LINK_UDP, .port = ntohs(at.sin_port)};
    return fd;
}

static void expect_datagram(int fd, const void *data, size_t len)
{
    char got[4096];
    struct pollfd wait = {.fd = fd, .events = POLLIN};
    assert_int_equal(poll(&wait, 1, DEADLINE_MS), 1);
    assert_int_equal(recv(fd, got, sizeof got, MSG_DONTWAIT), (ssize_t)len);
    assert_memory_equal(got, data, len);
}

static void a_write_is_a_datagram(void **state)
{
    (void)state;
    struct link_spec spec;
    char text[64], want[64], data[1206];
    int fd = open_receiver(&spec);
    struct bench bench = bench_open(&spec);
    snprintf(want, sizeof want, "udp:127.0.0.1:%d", spec.port);
    bench.ops->endpoint(bench.link, text, sizeof text);
    assert_string_equal(text, want);
    assert_null(bench.ops->capacity);
    assert_null(bench.ops->end);
    bench_expect(&bench, LINK_OPENED, 0);
    bench_expect(&bench, LINK_WRITABLE, 1);
    for (size_t i = 0; i < sizeof data; i++)
        data[i] = (char)(i * 31);
    assert_int_equal(bench.ops->write(bench.link, 0, data, sizeof data), sizeof data);
    assert_int_equal(bench.ops->write(bench.link, 0, "x", 1), 1);
    assert_int_equal(bench.ops->write(bench.link, 0, data, 512), 512);
    assert_int_equal(bench.ops->write(bench.link, 1, data, 512), SH_ECLOSED);
    expect_datagram(fd, data, sizeof data);
    expect_datagram(fd, "x", 1);
    expect_datagram(fd, data, 512);
    assert_int_equal(bench_poll(&bench, 0, 0), 0);
    bench_close(&bench);
    close(fd);
}

/* Opens a link to a port without a receiver. */
static struct bench open_without_receiver(struct sockaddr_in *at)
{
    struct link_spec spec;
    socklen_t len = sizeof *at;
    const int fd = open_receiver(&spec);
    assert_int_equal(getsockname(fd, (struct sockaddr *)at, &len), 0);
    close(fd);
    struct bench bench = bench_open(&spec);
    bench_expect(&bench, LINK_OPENED, 0);
    return bench;
}

/* A receiver comes to that port, and gets the next datagrams. */
static void end_with_receiver(struct bench *bench, const struct sockaddr_in *at)
{
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(fd, (const struct sockaddr *)at, sizeof *at), 0);
    assert_int_equal(bench->ops->write(bench->link, 0, "here", 4), 4);
    expect_datagram(fd, "here", 4);
    assert_true(bench->ops->refused(bench->link) > 0); /* earlier datagrams were refused, this one was not */
    bench_close(bench);
    close(fd);
}

/* Without a receiver each send succeeds, and poll stays calm. A receiver that comes later gets the next datagrams. */
static void a_receiver_that_is_not_there(void **state)
{
    (void)state;
    struct sockaddr_in at;
    struct bench bench = open_without_receiver(&at);
    for (int i = 0; i < 100; i++) {
        assert_int_equal(bench.ops->write(bench.link, 0, "gone", 4), 4);
        bench_poll(&bench, 0, 0); /* refusals of the system may wake it; they are taken */
        assert_int_equal(bench_poll(&bench, 0, 0), 0);
    }
    assert_true(bench.ops->refused(bench.link) == 100);
    end_with_receiver(&bench, &at);
}

/* Here a write meets the refusal, and not poll. No later datagram is lost by it. */
static void a_refusal_costs_no_later_datagram(void **state)
{
    (void)state;
    struct sockaddr_in at;
    struct bench bench = open_without_receiver(&at);
    assert_int_equal(bench.ops->write(bench.link, 0, "gone", 4), 4); /* over lo the refusal is there at once */
    end_with_receiver(&bench, &at);
}

static void what_arrives_can_be_read(void **state)
{
    (void)state;
    struct link_spec spec;
    struct sockaddr_in from;
    socklen_t len = sizeof from;
    char got[16];
    int fd = open_receiver(&spec);
    struct bench bench = bench_open(&spec);
    bench_expect(&bench, LINK_OPENED, 0);
    assert_int_equal(bench.ops->write(bench.link, 0, "a", 1), 1);
    assert_int_equal(recvfrom(fd, got, sizeof got, 0, (struct sockaddr *)&from, &len), 1);
    assert_int_equal(sendto(fd, "back", 4, 0, (struct sockaddr *)&from, len), 4);
    bench_expect(&bench, LINK_READABLE, 0);
    assert_int_equal(bench.ops->read(bench.link, 0, got, sizeof got), 4);
    assert_memory_equal(got, "back", 4);
    assert_int_equal(bench.ops->read(bench.link, 0, got, sizeof got), 0);
    assert_int_equal(bench_poll(&bench, 0, 0), 0);
    bench.wake = eventfd(1, EFD_CLOEXEC);
    bench_expect(&bench, LINK_WOKEN, 0);
    close(bench.wake);
    bench_close(&bench);
    close(fd);
}

static void where_packets_may_go(void **state)
{
    (void)state;
    static const struct {
        const char *address, *interface;
        int port;
        const char *why; /* NULL: it opens */
    } cases[] = {
        {"", "", 2368, NULL},
        {"localhost", "", 2368, NULL},
        {"127.0.0.1", "lo", 2368, NULL},
        {"127.0.0.1", "", 0, "udp:127.0.0.1:0: allowed ports are 1 to 65535"},
        {"127.0.0.1", "", 65536, "allowed ports are 1 to 65535"},
        {"300.1.1.1", "", 2368, "udp:300.1.1.1:2368: no such address"},
        {"239.1.2.3", "", 2368, "udp:239.1.2.3:2368: multicast needs the key interface"},
        {"ff02::1", "", 2368, "multicast"},
        {"255.255.255.255", "", 2368, "a broadcast needs the key interface"},
        {"255.255.255.255", "lo", 2368, "interface lo has no broadcast"},
        {"127.0.0.1", "no-such-if", 2368, "interface no-such-if doesn't exist"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct link_spec spec = {.type = LINK_UDP, .port = cases[i].port};
        void *link = NULL;
        struct sh_err err = {0};
        snprintf(spec.address, sizeof spec.address, "%s", cases[i].address);
        snprintf(spec.interface, sizeof spec.interface, "%s", cases[i].interface);
        int rc = link_ops_get(LINK_UDP)->open(&spec, &link, &err);
        if (cases[i].why == NULL) {
            assert_int_equal(rc, SH_OK);
            link_ops_get(LINK_UDP)->close(link);
            continue;
        }
        assert_int_equal(rc, SH_EINPUT);
        if (strstr(err.text, cases[i].why) == NULL) fail_msg("%s: %s", cases[i].why, err.text);
    }
}

/* Takes the next datagram, and checks the source's address and port, and TTL where the socket asks for it. */
static void expect_from(int fd, const char *address, int port, int ttl)
{
    struct sockaddr_in from;
    char got[16], control[64];
    struct iovec room = {got, sizeof got};
    struct msghdr message = {&from, sizeof from, &room, 1, control, sizeof control, 0};
    struct pollfd wait = {.fd = fd, .events = POLLIN};
    assert_int_equal(poll(&wait, 1, DEADLINE_MS), 1);
    assert_true(recvmsg(fd, &message, MSG_DONTWAIT) > 0);
    assert_string_equal(inet_ntoa(from.sin_addr), address);
    if (port != 0) assert_int_equal(ntohs(from.sin_port), port);
    const struct cmsghdr *head = CMSG_FIRSTHDR(&message);
    int had = 0;
    if (ttl != 0) assert_non_null(head);
    if (ttl != 0) memcpy(&had, CMSG_DATA(head), sizeof had);
    assert_int_equal(had, ttl);
}

/* Three heads on one machine send from a port that their receiver has, too. The receiver tells the heads apart by
 * address, and gets all their datagrams. No datagrams, theirs or others', come back to the heads. */
static void sources_share_their_port(void **state)
{
    (void)state;
    static const char *const source[3] = {"", "127.0.0.7", "127.0.0.8"}, *const from[3] = {"127.0.0.2", "127.0.0.7",
                                                                                           "127.0.0.8"};
    struct bench bench[3];
    struct link_spec spec;
    struct sockaddr_in at = {.sin_family = AF_INET};
    const int one = 1, first = open_receiver(&spec);
    close(first);
    at.sin_port = htons((uint16_t)spec.port);
    spec.source_port = spec.port;
    for (int i = 0; i < 3; i++) { /* the heads first, then a receiver at all addresses */
        snprintf(spec.source, sizeof spec.source, "%s", source[i]);
        bench[i] = bench_open(&spec);
        bench_expect(&bench[i], LINK_OPENED, 0);
    }
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    assert_int_equal(setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one), 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(bench[i].ops->write(bench[i].link, 0, "head", 4), 4);
        expect_from(fd, from[i], spec.port, 0);
    }
    const int other = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    at.sin_addr.s_addr = inet_addr("127.0.0.7"); /* where a head has its source */
    assert_int_equal(sendto(other, "other", 5, 0, (struct sockaddr *)&at, sizeof at), 5);
    expect_from(fd, "127.0.0.1", 0, 0);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(bench_poll(&bench[i], 0, 0), 0);
        bench_close(&bench[i]);
    }
    close(other);
    close(fd);
}

/* Another program has the port for itself. If the port is only the usual one, that is reported once. If it was asked
 * for, the link is refused. The receiver's own place is no source. */
static void a_source_port_that_is_taken(void **state)
{
    (void)state;
    struct link_spec spec, taken;
    struct sh_err err;
    void *link;
    const int fd = open_receiver(&spec), owner = open_receiver(&taken);
    spec.source_port = taken.port;
    spec.usual_port = 1;
    struct bench bench = bench_open(&spec); /* a receiver here, and no source: the port is left to others */
    bench_expect(&bench, LINK_OPENED, 0);
    assert_int_equal(bench_poll(&bench, 0, 0), 0);
    bench_close(&bench);
    snprintf(spec.source, sizeof spec.source, "127.0.0.1");
    bench = bench_open(&spec);
    bench_expect(&bench, LINK_OPENED, 0);
    bench_expect(&bench, LINK_NOTICE, 0);
    assert_int_equal(bench.ops->write(bench.link, 0, "a", 1), 1);
    expect_from(fd, "127.0.0.1", 0, 0);
    assert_int_equal(bench_poll(&bench, 0, 0), 0);
    bench_close(&bench);
    spec.usual_port = 0;
    assert_int_equal(link_ops_get(LINK_UDP)->open(&spec, &link, &err), SH_EINPUT);
    assert_non_null(
        strstr(err.text, "Address already in use; a receiver on this machine with that port must share it"));
    spec.source_port = spec.port;
    snprintf(spec.source, sizeof spec.source, "127.0.0.1");
    assert_int_equal(link_ops_get(LINK_UDP)->open(&spec, &link, &err), SH_EINPUT);
    snprintf(spec.source, sizeof spec.source, "192.0.2.1"); /* of documents: nobody's */
    assert_int_equal(link_ops_get(LINK_UDP)->open(&spec, &link, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "from 192.0.2.1"));
    static const char *const nobodys[] = {"localhost", "300.1.1.1",       "224.0.0.1",
                                          "0.0.0.0",   "255.255.255.255", "127.255.255.255"};
    for (size_t i = 0; i < sizeof nobodys / sizeof nobodys[0]; i++) {
        snprintf(spec.source, sizeof spec.source, "%s", nobodys[i]);
        assert_int_equal(link_ops_get(LINK_UDP)->open(&spec, &link, &err), SH_EINPUT);
        assert_non_null(strstr(err.text, "allowed is a numeric address of this machine"));
    }
    close(owner);
    close(fd);
}

static void multicast_has_an_interface_and_a_ttl(void **state)
{
    (void)state;
    static const int ttl[3][2] = {{0, 1}, {1, 1}, {9, 9}}; /* asked for, and on the wire */
    struct link_spec spec;
    struct sockaddr_in at = {.sin_family = AF_INET};
    const int one = 1;
    close(open_receiver(&spec));
    at.sin_port = htons((uint16_t)spec.port);
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    const struct ip_mreqn group = {{inet_addr("239.1.2.3")}, {0}, (int)if_nametoindex("lo")};
    assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(setsockopt(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group), 0);
    assert_int_equal(setsockopt(fd, IPPROTO_IP, IP_RECVTTL, &one, sizeof one), 0);
    snprintf(spec.address, sizeof spec.address, "239.1.2.3");
    snprintf(spec.interface, sizeof spec.interface, "lo");
    for (int i = 0; i < 3; i++) {
        spec.ttl = ttl[i][0];
        struct bench bench = bench_open(&spec);
        bench_expect(&bench, LINK_OPENED, 0);
        assert_int_equal(bench.ops->write(bench.link, 0, "all", 3), 3);
        expect_from(fd, "127.0.0.1", 0, ttl[i][1]);
        bench_close(&bench);
    }
    close(fd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_write_is_a_datagram),
        cmocka_unit_test(a_receiver_that_is_not_there),
        cmocka_unit_test(a_refusal_costs_no_later_datagram),
        cmocka_unit_test(what_arrives_can_be_read),
        cmocka_unit_test(where_packets_may_go),
        cmocka_unit_test(sources_share_their_port),
        cmocka_unit_test(a_source_port_that_is_taken),
        cmocka_unit_test(multicast_has_an_interface_and_a_ttl),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
