/* SPDX-License-Identifier: MIT */
/* A cable that is pulled: what its clients see is silence, and what was begun goes on after it, or is reset.
 *
 * The client's own system says what came to it (TCP_INFO): so no privilege is needed to see the wire. */
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <linux/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/syscall.h>

#include "drivers/socket/silence.h"
#include "tests/unit/web_rig.h"

static int lacks_v6; /* the system can't set the option of IPv6 */

int setsockopt(int fd, int level, int name, const void *value, socklen_t len)
{
    errno = ENOPROTOOPT;
    return lacks_v6 && level == IPPROTO_IPV6 ? -1 : (int)syscall(SYS_setsockopt, fd, level, name, value, len);
}

static int fault(struct bench *bench, enum link_fault what, uint32_t n)
{
    return bench->ops->fault(bench->link, what, 0, n, 0.0);
}

static struct tcp_info info_of(int fd)
{
    struct tcp_info info = {0};
    socklen_t len = sizeof info;
    assert_int_equal(getsockopt(fd, IPPROTO_TCP, TCP_INFO, &info, &len), 0);
    return info;
}

/* Begins a connection, and does not wait for it. */
static int begin_dial(const struct bench *bench, int family)
{
    struct sockaddr_in v4 = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    struct sockaddr_in6 v6 = {.sin6_family = AF_INET6, .sin6_addr = IN6ADDR_LOOPBACK_INIT};
    v4.sin_port = v6.sin6_port = htons((uint16_t)bench_port(bench));
    const int fd = socket(family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const int rc = family == AF_INET ? connect(fd, (struct sockaddr *)&v4, sizeof v4)
                                     : connect(fd, (struct sockaddr *)&v6, sizeof v6);
    assert_true(rc == 0 || errno == EINPROGRESS);
    return fd;
}

/* The client's bytes and another one's request for a connection get no answer: not even a segment without data. The
 * client's system has repeated its bytes by then, and so has had the time for an answer. */
static int expect_silence(struct bench *bench, int fd, int family)
{
    const uint32_t before = info_of(fd).tcpi_segs_in, repeated = info_of(fd).tcpi_total_retrans;
    const int other = begin_dial(bench, family);
    struct pollfd slot = {.fd = other, .events = POLLOUT};
    assert_int_equal(write(fd, "hello", 5), 5);
    for (const int64_t end_ms = give_up_ms(); info_of(fd).tcpi_total_retrans < repeated + 2;) {
        assert_int_equal(bench_poll(bench, 1, 10), 0);
        assert_int_equal(bench->ops->write(bench->link, 0, "x", 1), 0);
        if (now_ms() > end_ms) give_up("a repetition");
    }
    assert_int_equal(info_of(fd).tcpi_segs_in, before);
    assert_int_equal(poll(&slot, 1, 0), 0);
    return other;
}

static void check_tcp(const char *address, int family)
{
    struct link_spec spec = {.type = LINK_TCP, .max_sessions = 2};
    char text[8];
    snprintf(spec.address, sizeof spec.address, "%s", address);
    struct bench bench = bench_open(&spec);
    const int fd = begin_dial(&bench, family);
    bench_expect(&bench, LINK_OPENED, 0);
    /* The client confirms late, as it does on a busy connection. The head must not repeat these bytes in the
     * silence. */
    assert_int_equal(setsockopt(fd, IPPROTO_TCP, TCP_QUICKACK, &(int){0}, sizeof(int)), 0);
    bench_write_all(&bench, 0, "abc", 3);
    assert_int_equal(fault(&bench, LINK_FAULT_CABLE, 0), SH_OK);
    assert_int_equal(fault(&bench, LINK_FAULT_CABLE, 0), SH_ESTATE);
    fd_read_all(fd, text, 3);
    int other = expect_silence(&bench, fd, family);
    assert_int_equal(fault(&bench, LINK_FAULT_PLUG, 0), SH_OK);
    bench_write_all(&bench, 0, "def", 3);
    fd_read_all(fd, text, 3);
    assert_memory_equal(text, "def", 3);
    bench_read_all(&bench, 0, text, 5); /* repeated by the client's system until it is heard */
    assert_memory_equal(text, "hello", 5);
    assert_int_equal(bench_expect(&bench, LINK_OPENED, 0).session, 1);
    /* Again, and then both are reset. */
    assert_int_equal(fault(&bench, LINK_FAULT_CABLE, 0), SH_OK);
    assert_int_equal(write(fd, "lost", 4), 4);
    assert_int_equal(fault(&bench, LINK_FAULT_PLUG, 1), SH_OK);
    for (int i = 0; i < 2; i++)
        assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, i);
    assert_int_equal(read(fd, text, 1), -1);
    assert_int_equal(errno, ECONNRESET);
    assert_int_equal(read(other, text, 1), -1);
    assert_int_equal(errno, ECONNRESET);
    close(fd);
    close(other);
    bench_close(&bench);
}

static void test_tcp(void **state)
{
    (void)state;
    check_tcp("127.0.0.1", AF_INET);
}

static void test_tcp_v6(void **state)
{
    (void)state;
    const int fd = socket(AF_INET6, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const struct sockaddr_in6 at = {.sin6_family = AF_INET6, .sin6_addr = IN6ADDR_LOOPBACK_INIT};
    const int has_v6 = fd >= 0 && bind(fd, (const struct sockaddr *)&at, sizeof at) == 0;
    if (fd >= 0) close(fd);
    if (!has_v6) {
        print_message("# this machine has no IPv6\n");
        skip();
    }
    check_tcp("::1", AF_INET6);
}

/* A socket of IPv6 needs two options. The second one can't be set, and then neither is. */
static void test_neither_option(void **state)
{
    (void)state;
    const int fd = socket(AF_INET6, SOCK_STREAM | SOCK_CLOEXEC, 0);
    int least_ttl = -1;
    socklen_t len = sizeof least_ttl;
    if (fd < 0) skip();
    lacks_v6 = 1;
    assert_int_equal(sockets_silence(fd, NULL, 0), SH_ESTATE);
    lacks_v6 = 0;
    assert_int_equal(getsockopt(fd, IPPROTO_IP, IP_MINTTL, &least_ttl, &len), 0);
    assert_int_equal(least_ttl, 0);
    close(fd);
}

/* A link that ends with its cable pulled ends its sessions as ever. So does one that loses power meanwhile. */
static void test_ends(void **state)
{
    (void)state;
    const struct link_spec spec = {.type = LINK_TCP, .max_sessions = 1};
    char byte;
    for (int unplugs = 0; unplugs < 2; unplugs++) {
        struct bench bench = bench_open(&spec);
        const int fd = begin_dial(&bench, AF_INET);
        bench_expect(&bench, LINK_OPENED, 0);
        assert_int_equal(fault(&bench, LINK_FAULT_CABLE, 0), SH_OK);
        if (unplugs) assert_int_equal(fault(&bench, LINK_FAULT_UNPLUG, 0), SH_OK);
        if (unplugs) bench_expect(&bench, LINK_CLOSED, 0);
        bench_close(&bench);
        assert_int_equal(fd_read(fd, &byte, 1), unplugs ? -1 : 0);
        close(fd);
    }
}

/* A WebSocket and a client that asks for a file meanwhile: libwebsockets is silent, too. */
static void test_web(void **state)
{
    (void)state;
    char place[64], request[200], answer[2000];
    struct bench bench = web_open(place);
    uint8_t frame[7];
    snprintf(request, sizeof request, "GET /scene HTTP/1.1\r\nHost: %s\r\n\r\n", place);
    for (int resets = 0; resets < 2; resets++) {
        const int fd = web_upgrade(&bench, place, "/ws", ""), other = web_dial(place);
        bench_expect(&bench, LINK_OPENED, 0);
        for (int i = 0; i < 3; i++)
            bench_poll(&bench, 0, 1);
        assert_int_equal(fault(&bench, LINK_FAULT_CABLE, 0), SH_OK);
        assert_int_equal(fault(&bench, LINK_FAULT_CABLE, 0), SH_ESTATE);
        const uint32_t before = info_of(fd).tcpi_segs_in, before_other = info_of(other).tcpi_segs_in;
        web_send_frame(fd, 0x81, "*IDN?", 5);
        assert_int_equal(send(other, request, strlen(request), MSG_NOSIGNAL), strlen(request));
        for (const int64_t end_ms = give_up_ms(); info_of(fd).tcpi_total_retrans < 2;) {
            assert_int_equal(bench_poll(&bench, 1, 10), 0);
            assert_int_equal(bench.ops->write(bench.link, 0, "x", 1), 0);
            if (now_ms() > end_ms) give_up("a repetition");
        }
        assert_int_equal(info_of(fd).tcpi_segs_in, before);
        assert_int_equal(info_of(other).tcpi_segs_in, before_other);
        assert_int_equal(fault(&bench, LINK_FAULT_PLUG, (uint32_t)resets), SH_OK);
        if (resets) {
            bench_expect(&bench, LINK_CLOSED, 0);
            assert_int_equal(fd_read(fd, frame, 1), -1);
            assert_int_equal(fd_read(other, frame, 1), -1);
        } else {
            char line[6];
            bench_read_all(&bench, 0, line, 6);
            assert_memory_equal(line, "*IDN?\n", 6);
            assert_int_equal(bench.ops->write(bench.link, 0, "hello", 5), 5);
            bench_expect(&bench, LINK_WRITABLE, 1);
            fd_read_all(fd, frame, 7);
            assert_memory_equal(frame, "\x81\x05hello", 7);
            assert_true(web_listen_to(&bench, other, answer, sizeof answer) > 13);
            assert_memory_equal(answer, "HTTP/1.1 200 ", 13);
        }
        close(fd);
        close(other);
        if (!resets) bench_expect(&bench, LINK_CLOSED, 0);
    }
    bench_close(&bench);
}

/* Datagrams that are sent meanwhile are lost, and counted; the session stays. Datagrams for the head are lost, too. */
static void test_udp(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_UDP};
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)}, from;
    socklen_t len = sizeof at;
    char text[8];
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(getsockname(fd, (struct sockaddr *)&at, &len), 0);
    spec.port = ntohs(at.sin_port);
    struct bench bench = bench_open(&spec);
    bench_expect(&bench, LINK_OPENED, 0);
    bench_write_all(&bench, 0, "a", 1);
    assert_int_equal(recvfrom(fd, text, sizeof text, 0, (struct sockaddr *)&from, &len), 1);
    assert_int_equal(fault(&bench, LINK_FAULT_CABLE, 0), SH_OK);
    assert_int_equal(fault(&bench, LINK_FAULT_CABLE, 0), SH_ESTATE);
    assert_int_equal(bench.ops->write(bench.link, 0, "b", 1), 1);
    assert_int_equal(bench.ops->write(bench.link, 0, "c", 1), 1);
    assert_int_equal(bench.ops->refused(bench.link), 2);
    assert_int_equal(sendto(fd, "old", 3, 0, (struct sockaddr *)&from, len), 3);
    assert_int_equal(bench_poll(&bench, 0, 0), 0);
    assert_int_equal(bench.ops->read(bench.link, 0, text, sizeof text), 0);
    assert_int_equal(fault(&bench, LINK_FAULT_PLUG, 0), SH_OK);
    bench_write_all(&bench, 0, "d", 1);
    assert_int_equal(recv(fd, text, sizeof text, 0), 1); /* the next one after a */
    assert_int_equal(text[0], 'd');
    assert_int_equal(sendto(fd, "new", 3, 0, (struct sockaddr *)&from, len), 3);
    bench_expect(&bench, LINK_READABLE, 0);
    assert_int_equal(bench.ops->read(bench.link, 0, text, sizeof text), 3);
    assert_memory_equal(text, "new", 3);
    assert_int_equal(bench.ops->refused(bench.link), 2);
    close(fd);
    bench_close(&bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_tcp),  cmocka_unit_test(test_tcp_v6),
                                       cmocka_unit_test(test_ends), cmocka_unit_test(test_web),
                                       cmocka_unit_test(test_udp),  cmocka_unit_test(test_neither_option)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
