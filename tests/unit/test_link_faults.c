/* SPDX-License-Identifier: MIT */
/* Faults of links on request: the ended sessions, their clients' view, and the link after the fault, which is as
 * before. */
#include <arpa/inet.h>
#include <limits.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include "tests/unit/pty_rig.h"
#include "tests/unit/web_rig.h"

static int cut(struct bench *bench, enum link_fault what, int session)
{
    return bench->ops->fault(bench->link, what, session, 0, 0.0);
}

/* The connection must end with a reset. */
static void expect_reset(int fd)
{
    char byte;
    assert_int_equal(read(fd, &byte, 1), -1);
    assert_int_equal(errno, ECONNRESET);
    close(fd);
}

/* These kinds of links have these faults. */
static void test_table(void **state)
{
    (void)state;
    const uint32_t ends = LINK_FAULT_BIT(LINK_FAULT_DISCONNECT) | LINK_FAULT_BIT(LINK_FAULT_REFUSE),
                   unplug = LINK_FAULT_BIT(LINK_FAULT_UNPLUG), cable = LINK_FAULT_BIT(LINK_FAULT_CABLE);
    const struct {
        enum link_type type;
        uint32_t faults;
    } rows[] = {{LINK_NULL, 0},
                {LINK_FILE, 0},
                {LINK_FD, 0},
                {LINK_PTY, ends | unplug},
                {LINK_TCP, ends | unplug | cable},
                {LINK_WEB, ends | unplug | cable},
                {LINK_UDP, unplug | cable}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct link_spec spec = {.type = rows[i].type};
        assert_int_equal(link_faults(&spec), rows[i].faults);
        assert_int_equal(link_ops_get(rows[i].type)->fault != NULL, rows[i].faults != 0);
    }
}

/* One client is cut off, but not its neighbour. The kernel's bytes for the first are gone. */
static void test_tcp_disconnect(void **state)
{
    (void)state;
    const struct link_spec spec = {.type = LINK_TCP, .max_sessions = 2};
    struct bench bench = bench_open(&spec);
    char text[8];
    int a = dial(bench_port(&bench));
    assert_int_equal(bench_expect(&bench, LINK_OPENED, 0).session, 0);
    int b = dial(bench_port(&bench));
    assert_int_equal(bench_expect(&bench, LINK_OPENED, 0).session, 1);
    bench_write_all(&bench, 0, "abc", 3);
    fd_read_all(a, text, 3);
    assert_int_equal(write(a, "unread", 6), 6);
    assert_int_equal(cut(&bench, LINK_FAULT_DISCONNECT, 0), SH_OK);
    expect_reset(a);
    assert_int_equal(bench.ops->write(bench.link, 0, "abc", 3), SH_ECLOSED);
    assert_int_equal(cut(&bench, LINK_FAULT_DISCONNECT, 0), SH_ESTATE); /* there is no client */
    bench.n_queue = 0;
    assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, 0);
    bench_write_all(&bench, 1, "def", 3);
    fd_read_all(b, text, 3);
    assert_memory_equal(text, "def", 3);
    a = dial(bench_port(&bench));
    assert_int_equal(bench_expect(&bench, LINK_OPENED, 0).session, 0);
    assert_int_equal(cut(&bench, LINK_FAULT_REFUSE, 0), SH_OK);
    expect_reset(a);
    assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, 0);
    close(b);
    bench_expect(&bench, LINK_SHUT, 0); /* a client that has closed looks as one that has said all */
    bench_close(&bench);
}

/* While it is unplugged the system refuses clients. Afterwards the port is the same. */
static void check_unplugged_port(struct bench *bench, int n_sessions, int port)
{
    assert_int_equal(cut(bench, LINK_FAULT_UNPLUG, 0), SH_OK);
    assert_int_equal(cut(bench, LINK_FAULT_UNPLUG, 0), SH_ESTATE);
    for (int i = 0; i < n_sessions; i++)
        assert_int_equal(bench_expect(bench, LINK_CLOSED, 0).session, i);
    assert_int_equal(dial(port), -1);
    bench_poll(bench, 0, 0);
    assert_true(is_calm(bench, 3));
    /* Another program takes the port, and gives it back. */
    struct sockaddr_in at = {
        .sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK), .sin_port = htons((uint16_t)port)};
    const int other = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), one = 1;
    setsockopt(other, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    assert_int_equal(bind(other, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(listen(other, 1), 0);
    assert_int_equal(cut(bench, LINK_FAULT_PLUG, 0), SH_ESTATE);
    close(other);
    assert_int_equal(cut(bench, LINK_FAULT_PLUG, 0), SH_OK);
    assert_int_equal(cut(bench, LINK_FAULT_PLUG, 0), SH_OK);
    assert_int_equal(bench_port(bench), port);
}

static void test_tcp_unplug(void **state)
{
    (void)state;
    const struct link_spec spec = {.type = LINK_TCP, .max_sessions = 2};
    struct bench bench = bench_open(&spec);
    const int port = bench_port(&bench);
    for (int round = 0; round < 2; round++) {
        int a = dial(port), b;
        bench_expect(&bench, LINK_OPENED, 0);
        b = dial(port);
        bench_expect(&bench, LINK_OPENED, 0);
        int waiting = dial(port); /* not accepted yet */
        check_unplugged_port(&bench, 2, port);
        expect_reset(a);
        expect_reset(b);
        expect_reset(waiting);
    }
    cut(&bench, LINK_FAULT_UNPLUG, 0);
    bench_close(&bench); /* unplugged as it is */
}

/* There is no close frame, and nothing of a message that is on its way. */
static void test_web(void **state)
{
    (void)state;
    char place[64];
    struct bench bench = web_open(place);
    const int port = bench_port(&bench);
    for (int round = 0; round < 2; round++) {
        int a = web_upgrade(&bench, place, "/ws", "");
        assert_int_equal(bench_expect(&bench, LINK_OPENED, 0).session, 0);
        int b = web_upgrade(&bench, place, "/ws", "");
        assert_int_equal(bench_expect(&bench, LINK_OPENED, 0).session, 1);
        assert_int_equal(bench.ops->write(bench.link, 0, "hello", 5), 5);
        assert_int_equal(cut(&bench, round == 0 ? LINK_FAULT_DISCONNECT : LINK_FAULT_REFUSE, 0), SH_OK);
        expect_reset(a);
        assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, 0);
        assert_int_equal(bench.ops->write(bench.link, 0, "hello", 5), SH_ECLOSED);
        assert_int_equal(bench.ops->write(bench.link, 1, "hello", 5), 5); /* the neighbour's goes out */
        bench_expect(&bench, LINK_WRITABLE, 2);
        uint8_t frame[7];
        fd_read_all(b, frame, 7);
        assert_memory_equal(frame, "\x81\x05hello", 7);
        int page = dial(port); /* a connection that has asked for nothing yet */
        for (int i = 0; i < 3; i++)
            bench_poll(&bench, 0, 10);
        assert_int_equal(cut(&bench, LINK_FAULT_UNPLUG, 0), SH_OK);
        assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, 1);
        expect_reset(b);
        expect_reset(page);
        assert_int_equal(dial(port), -1);
        bench_poll(&bench, 0, 10);
        assert_true(is_calm(&bench, 3));
        assert_int_equal(cut(&bench, LINK_FAULT_PLUG, 0), SH_OK);
    }
    close(web_upgrade(&bench, place, "/ws", ""));
    bench_expect(&bench, LINK_OPENED, 0);
    bench_close(&bench);
}

/* The client's terminal is hung up. Under the same name there is another one, empty and raw. */
static void test_pty_disconnect(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_PTY};
    char *dir = test_dir(), byte, before[PATH_MAX], after[PATH_MAX];
    snprintf(spec.path, sizeof spec.path, "%s/scan0", dir);
    struct bench bench = bench_open(&spec);
    assert_int_equal(cut(&bench, LINK_FAULT_DISCONNECT, 0), SH_ESTATE); /* there is no client */
    for (int round = 0; round < 3; round++) {
        assert_non_null(realpath(spec.path, before));
        int fd = client_open(&bench);
        assert_int_equal(bench_expect(&bench, LINK_OPENED, 0).session, 0);
        assert_int_equal(bench.ops->write(bench.link, 0, "lost", 4), 4);
        assert_int_equal(cut(&bench, round == 2 ? LINK_FAULT_REFUSE : LINK_FAULT_DISCONNECT, 0), SH_OK);
        assert_int_equal(bench.ops->write(bench.link, 0, "x", 1), SH_ECLOSED);
        if (round == 1) { /* the next client is faster than the owner */
            close(fd);
            fd = client_open(&bench);
            bench_expect(&bench, LINK_CLOSED, 0);
            bench_expect(&bench, LINK_OPENED, 0);
            bench_write_all(&bench, 0, "y", 1);
            fd_read_all(fd, &byte, 1);
            assert_int_equal(byte, 'y');
            close(fd);
        } else {
            struct pollfd slot = {.fd = fd, .events = POLLIN};
            assert_int_equal(poll(&slot, 1, 0), 1);
            assert_true((slot.revents & POLLHUP) != 0);
            assert_true(read(fd, &byte, 1) <= 0);
            close(fd);
        }
        bench_expect(&bench, LINK_CLOSED, 0);
        assert_true(is_calm(&bench, 1));
        assert_non_null(realpath(spec.path, after));
        assert_string_not_equal(before, after);
    }
    bench_close(&bench);
    rmdir(dir);
}

static void test_pty_unplug(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_PTY};
    char *dir = test_dir(), byte;
    struct stat st;
    snprintf(spec.path, sizeof spec.path, "%s/scan0", dir);
    struct bench bench = bench_open(&spec);
    for (int round = 0; round < 2; round++) {
        int fd = client_open(&bench);
        bench_expect(&bench, LINK_OPENED, 0);
        assert_int_equal(cut(&bench, LINK_FAULT_UNPLUG, 0), SH_OK);
        assert_int_equal(cut(&bench, LINK_FAULT_UNPLUG, 0), SH_ESTATE);
        bench_expect(&bench, LINK_CLOSED, 0);
        assert_true(read(fd, &byte, 1) <= 0);
        close(fd);
        assert_int_equal(lstat(spec.path, &st), -1);
        assert_true(is_calm(&bench, 1));
        close(open(spec.path, O_CREAT | O_WRONLY | O_CLOEXEC, 0600)); /* somebody else has taken the name */
        assert_int_equal(cut(&bench, LINK_FAULT_PLUG, 0), SH_ESTATE);
        unlink(spec.path);
        assert_int_equal(cut(&bench, LINK_FAULT_PLUG, 0), SH_OK);
        fd = client_open(&bench);
        bench_expect(&bench, LINK_OPENED, 0);
        bench_write_all(&bench, 0, "z", 1);
        fd_read_all(fd, &byte, 1);
        close(fd);
        bench_expect(&bench, LINK_CLOSED, 0);
    }
    cut(&bench, LINK_FAULT_UNPLUG, 0);
    bench_close(&bench);
    assert_int_equal(rmdir(dir), 0); /* nothing left */
}

/* Opens a socket that datagrams come to. */
static int open_receiver(int *port)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t len = sizeof at;
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(getsockname(fd, (struct sockaddr *)&at, &len), 0);
    *port = ntohs(at.sin_port);
    return fd;
}

static void test_udp(void **state)
{
    (void)state;
    struct sockaddr_in from, again;
    socklen_t len = sizeof from;
    char text[8];
    struct link_spec spec = {.type = LINK_UDP};
    const int fd = open_receiver(&spec.port);
    struct bench bench = bench_open(&spec);
    bench_expect(&bench, LINK_OPENED, 0);
    bench_write_all(&bench, 0, "one", 3);
    assert_int_equal(recvfrom(fd, text, sizeof text, 0, (struct sockaddr *)&from, &len), 3);
    assert_int_equal(cut(&bench, LINK_FAULT_UNPLUG, 0), SH_OK);
    assert_int_equal(bench.ops->write(bench.link, 0, "no", 2), SH_ECLOSED);
    bench_expect(&bench, LINK_CLOSED, 0);
    assert_int_equal(sendto(fd, "in vain", 7, 0, (struct sockaddr *)&from, len), 7);
    assert_true(is_calm(&bench, 1));
    assert_int_equal(cut(&bench, LINK_FAULT_PLUG, 0), SH_OK);
    bench_expect(&bench, LINK_OPENED, 0);
    assert_int_equal(bench.ops->read(bench.link, 0, text, sizeof text), 0);
    bench_write_all(&bench, 0, "two", 3);
    assert_int_equal(recvfrom(fd, text, sizeof text, 0, (struct sockaddr *)&again, &len), 3);
    assert_memory_equal(text, "two", 3);
    assert_int_equal(again.sin_port, from.sin_port);
    /* Unplugged and plugged in between two polls, a session ends all the same. */
    assert_int_equal(cut(&bench, LINK_FAULT_UNPLUG, 0), SH_OK);
    assert_int_equal(cut(&bench, LINK_FAULT_PLUG, 0), SH_OK);
    assert_int_equal(bench.ops->write(bench.link, 0, "no", 2), SH_ECLOSED);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_expect(&bench, LINK_OPENED, 0);
    bench_close(&bench);
    close(fd);
}

/* A session that was never reported ends without a word. A link that is away can't go away once more. A link that is
 * plugged in twice keeps what has come. */
static void test_udp_order(void **state)
{
    (void)state;
    struct sockaddr_in from;
    socklen_t len = sizeof from;
    char text[8];
    struct link_spec spec = {.type = LINK_UDP};
    const int fd = open_receiver(&spec.port);
    struct bench bench = bench_open(&spec);
    assert_int_equal(cut(&bench, LINK_FAULT_UNPLUG, 0), SH_OK);
    assert_true(is_calm(&bench, 1));
    assert_int_equal(cut(&bench, LINK_FAULT_UNPLUG, 0), SH_ESTATE);
    assert_int_equal(cut(&bench, LINK_FAULT_CABLE, 0), SH_ESTATE);
    assert_int_equal(cut(&bench, LINK_FAULT_PLUG, 0), SH_OK);
    bench_expect(&bench, LINK_OPENED, 0);
    assert_int_equal(cut(&bench, LINK_FAULT_CABLE, 0), SH_OK);
    assert_int_equal(cut(&bench, LINK_FAULT_UNPLUG, 0), SH_OK);
    bench_expect(&bench, LINK_CLOSED, 0);
    assert_int_equal(cut(&bench, LINK_FAULT_PLUG, 0), SH_OK);
    bench_expect(&bench, LINK_OPENED, 0);
    bench_write_all(&bench, 0, "one", 3);
    assert_int_equal(recvfrom(fd, text, sizeof text, 0, (struct sockaddr *)&from, &len), 3);
    assert_int_equal(sendto(fd, "kept", 4, 0, (struct sockaddr *)&from, len), 4);
    assert_int_equal(cut(&bench, LINK_FAULT_PLUG, 0), SH_OK);
    assert_int_equal(bench.ops->read(bench.link, 0, text, sizeof text), 4);
    assert_int_equal(bench.ops->refused(bench.link), 0);
    bench_close(&bench);
    close(fd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_table), cmocka_unit_test(test_tcp_disconnect), cmocka_unit_test(test_tcp_unplug),
        cmocka_unit_test(test_web),   cmocka_unit_test(test_pty_disconnect), cmocka_unit_test(test_pty_unplug),
        cmocka_unit_test(test_udp),   cmocka_unit_test(test_udp_order),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
