/* SPDX-License-Identifier: MIT */
/* Stream sockets by themselves: their texts, settings, states, and what they do once the peer is gone. */
#include "tests/common/cases.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/un.h>
#include <unistd.h>

#include "drivers/socket/socket.h"

static struct sh_err err;

static int listen_here(char name[64])
{
    const struct socket_place place = {.what = "test", .host = ""};
    int fd;
    if (socket_open(&place, &fd, name, 64, &err) != SH_OK) fail_msg("%s", err.text);
    return fd;
}

/* Connects two sockets: fd[0] is the client, fd[1] the other end. */
static void connect_pair(int fd[2])
{
    char name[64];
    struct socket_address at;
    const int listener = listen_here(name);
    socket_note_address(listener, &at);
    fd[0] = socket_open_at((const struct sockaddr *)&at.at, at.len, 1);
    assert_true(fd[0] >= 0);
    int reserve = -1;
    struct pollfd slot = {.fd = listener, .events = POLLIN};
    assert_int_equal(poll(&slot, 1, 60000), 1);
    assert_int_equal(socket_accept(listener, &reserve, &fd[1], NULL, NULL), 1);
    assert_true(fd[1] >= 0);
    close(reserve);
    close(listener);
}

static void close_pair(const int fd[2])
{
    close(fd[0]);
    close(fd[1]);
}

/* Waits for these events. */
static short wait_for(int fd, short events)
{
    struct pollfd slot = {.fd = fd, .events = events};
    assert_int_equal(poll(&slot, 1, 60000), 1);
    return slot.revents;
}

static void test_codes(void **state)
{
    (void)state;
    static const struct {
        int error, code;
    } rows[] = {{EACCES, SH_EPERM},     {EPERM, SH_EPERM},         {EADDRINUSE, SH_EINPUT}, {EADDRNOTAVAIL, SH_EINPUT},
                {ENOENT, SH_EINPUT},    {ECONNREFUSED, SH_EINPUT}, {EIO, SH_EIO},           {ETIMEDOUT, SH_EIO},
                {EHOSTUNREACH, SH_EIO}, {EMFILE, SH_EIO}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        assert_int_equal(socket_error_code(rows[i].error), rows[i].code);
}

/* Multicast: 224.0.0.0/4 (RFC 5771) and ff00::/8 (RFC 4291). */
static void test_groups_and_texts(void **state)
{
    (void)state;
    static const struct {
        const char *host, *text;
        int port, is_group;
    } rows[] = {{"223.255.255.255", "223.255.255.255:1", 1, 0},
                {"224.0.0.0", "224.0.0.0:2368", 2368, 1},
                {"239.255.255.255", "239.255.255.255:0", 0, 1},
                {"240.0.0.0", "240.0.0.0:65535", 65535, 0},
                {"127.0.0.1", "127.0.0.1:40123", 40123, 0},
                {"::1", "[::1]:40123", 40123, 0},
                {"ff02::1", "[ff02::1]:9", 9, 1},
                {"fe80::1", "[fe80::1]:9", 9, 0}};
    char text[80];
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct addrinfo *list;
        assert_int_equal(socket_resolve("x", rows[i].host, rows[i].port, SOCK_DGRAM, &list, &err), SH_OK);
        assert_int_equal(list->ai_socktype, SOCK_DGRAM);
        assert_int_equal(!!socket_is_group(list->ai_addr), rows[i].is_group);
        socket_address_text(list->ai_addr, list->ai_addrlen, text, sizeof text);
        assert_string_equal(text, rows[i].text);
        freeaddrinfo(list);
    }
    const struct sockaddr_un local = {.sun_family = AF_UNIX};
    socket_address_text((const struct sockaddr *)&local, sizeof local, text, sizeof text);
    assert_string_equal(text, "a local client");
    const struct sockaddr none = {.sa_family = AF_UNSPEC};
    socket_address_text(&none, sizeof none, text, sizeof text);
    assert_string_equal(text, "unknown address");
}

/* The reason is the resolver's. No label of a name has more than 63 characters (RFC 1035), so no server is asked. */
static void test_no_such_address(void **state)
{
    (void)state;
    char host[80] = {0}, text[200];
    memset(host, 'a', 70);
    struct addrinfo *list;
    const int why = getaddrinfo(host, "7", &(const struct addrinfo){.ai_socktype = SOCK_STREAM}, &list);
    assert_true(why != 0 && why != EAI_SYSTEM);
    errno = EIO; /* an older error that has nothing to do with it */
    assert_int_equal(socket_resolve("test", host, 7, SOCK_STREAM, &list, &err), SH_EINPUT);
    snprintf(text, sizeof text, "test:%s:7: no such address: %s", host, gai_strerror(why));
    assert_string_equal(err.text, text);
}

static void expect_no_opening(const struct socket_place *place, int code, const char *text)
{
    char name[64];
    int fd;
    assert_int_equal(socket_open(place, &fd, name, sizeof name, &err), code);
    assert_string_equal(err.text, text);
}

static void test_opening(void **state)
{
    (void)state;
    char name[64], peer[64], text[120];
    const int listener = listen_here(name);
    int fd, port;
    assert_int_equal(sscanf(name, "127.0.0.1:%d", &port), 1);
    assert_true((fcntl(listener, F_GETFL) & O_NONBLOCK) != 0);
    assert_true((fcntl(listener, F_GETFD) & FD_CLOEXEC) != 0);
    struct socket_place place = {.what = "test", .host = "127.0.0.1", .port = port};
    snprintf(text, sizeof text,
             "test:127.0.0.1:%d: cannot listen: Address already in use; port 0 lets the system choose", port);
    expect_no_opening(&place, SH_EINPUT, text);
    place.connecting = 1;
    assert_int_equal(socket_open(&place, &fd, peer, sizeof peer, &err), SH_OK);
    assert_string_equal(peer, name); /* that of the peer, and not its own */
    assert_true((fcntl(fd, F_GETFL) & O_NONBLOCK) != 0);
    close(fd);
    struct socket_address at;
    socket_note_address(listener, &at);
    assert_true(socket_listen_again(&at) < 0);
    assert_int_equal(errno, EADDRINUSE);
    close(listener);
    snprintf(text, sizeof text, "test:127.0.0.1:%d: cannot connect: Connection refused", port);
    expect_no_opening(&place, SH_EINPUT, text);
    const int again = socket_listen_again(&at);
    assert_true(again >= 0);
    assert_int_equal(socket_open(&place, &fd, peer, sizeof peer, &err), SH_OK);
    close(fd);
    close(again);
    place = (struct socket_place){.what = "test", .host = "no such host", .port = 1};
    assert_int_equal(socket_open(&place, &fd, name, sizeof name, &err), SH_EINPUT);
    assert_int_equal(strncmp(err.text, "test:no such host:1: no such address: ", 38), 0);
    place = (struct socket_place){.what = "test", .host = "192.0.2.1"}; /* of RFC 5737: nobody's */
    expect_no_opening(&place, SH_EINPUT, "test:192.0.2.1:0: cannot listen: Cannot assign requested address");
}

/* The settings that the header promises: about 25 s are 10 s of rest and three probes 5 s apart. */
static void test_settings(void **state)
{
    (void)state;
    static const struct {
        int level, option, before, after;
    } rows[] = {{IPPROTO_TCP, TCP_NODELAY, 0, 1},    {SOL_SOCKET, SO_KEEPALIVE, 0, 1},
                {IPPROTO_TCP, TCP_KEEPIDLE, -1, 10}, {IPPROTO_TCP, TCP_KEEPINTVL, -1, 5},
                {IPPROTO_TCP, TCP_KEEPCNT, -1, 3},   {IPPROTO_TCP, TCP_USER_TIMEOUT, 0, 0}};
    int fd[2], value;
    socklen_t len = sizeof value;
    connect_pair(fd);
    for (int tuned = 0; tuned <= 1; tuned++) {
        for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
            assert_int_equal(getsockopt(fd[0], rows[i].level, rows[i].option, &value, &len), 0);
            if (tuned || rows[i].before >= 0)
                assert_int_equal(value != 0 && rows[i].after == 1 ? 1 : value, tuned ? rows[i].after : rows[i].before);
        }
        socket_tune(fd[0]);
    }
    socket_tune_impatient(fd[0]);
    assert_int_equal(getsockopt(fd[0], IPPROTO_TCP, TCP_USER_TIMEOUT, &value, &len), 0);
    assert_int_equal(value, 25000);
    close_pair(fd);
}

static void test_own_end(void **state)
{
    (void)state;
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t len = sizeof at;
    int fd[2], own = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(own, (struct sockaddr *)&at, len), 0);
    assert_int_equal(getsockname(own, (struct sockaddr *)&at, &len), 0);
    assert_int_equal(socket_is_own_end(own), 0); /* not connected yet */
    assert_int_equal(connect(own, (struct sockaddr *)&at, len), 0);
    assert_int_equal(socket_is_own_end(own), 1);
    close(own);
    connect_pair(fd);
    assert_int_equal(socket_is_own_end(fd[0]), 0);
    assert_int_equal(socket_is_own_end(fd[1]), 0);
    close_pair(fd);
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, fd), 0); /* neither end has a name, so both are equal */
    assert_int_equal(socket_is_own_end(fd[0]), 0);
    close_pair(fd);
}

static void test_bytes(void **state)
{
    (void)state;
    static char much[1 << 20];
    char text[8];
    int fd[2];
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, fd), 0); /* which blocks by itself */
    assert_int_equal(socket_read(fd[0], text, sizeof text), 0);
    assert_int_equal(socket_write(fd[1], "abc", 3), 3);
    assert_int_equal(socket_read(fd[0], text, 0), 0);
    assert_int_equal(socket_read(fd[0], text, 2), 2);
    assert_memory_equal(text, "ab", 2);
    assert_int_equal(socket_read(fd[0], text, sizeof text), 1);
    assert_int_equal(text[0], 'c');
    while (socket_write(fd[1], much, sizeof much) > 0)
        continue;
    assert_int_equal(socket_write(fd[1], much, sizeof much), 0); /* full */
    assert_int_equal(socket_write_heard(fd[1], much, 1), 0);
    socket_drain(fd[0]);
    assert_int_equal(socket_read(fd[0], text, sizeof text), 0);
    assert_int_equal(socket_write(fd[1], "d", 1), 1);
    assert_int_equal(socket_write(fd[0], "last", 4), 4);
    close(fd[0]);
    /* The peer is gone. There is no SIGPIPE, and the bytes that it sent last are read first. */
    assert_int_equal(socket_write(fd[1], "x", 1), SH_ECLOSED);
    assert_int_equal(socket_write_heard(fd[1], "x", 1), 0);
    assert_int_equal(socket_read(fd[1], text, 3), 3);
    assert_int_equal(socket_write_heard(fd[1], "x", 1), 0);
    assert_int_equal(socket_read(fd[1], text, 3), 1);
    assert_int_equal(socket_write_heard(fd[1], "x", 1), SH_ECLOSED);
    assert_int_equal(socket_read(fd[1], text, sizeof text), SH_ECLOSED);
    close(fd[1]);
}

/* Reads one MiB at most, however much there is. */
static void test_drain(void **state)
{
    (void)state;
    enum { MIB = 1 << 20, READ = 4096 };
    const int room = 4 * MIB;
    static char much[MIB + READ];
    char rest[2 * READ];
    int fd[2];
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, fd), 0);
    /* The system's own limit may be lower for users other than root. */
    if (setsockopt(fd[1], SOL_SOCKET, SO_SNDBUFFORCE, &room, sizeof room) == 0 &&
        socket_write(fd[1], much, sizeof much) == sizeof much) {
        socket_drain(fd[0]);
        assert_int_equal(socket_read(fd[0], rest, sizeof rest), READ);
    }
    close_pair(fd);
}

static void test_states(void **state)
{
    (void)state;
    char byte;
    int fd[2];
    connect_pair(fd);
    assert_int_equal(socket_state(fd[0], 0), SOCKET_OPEN);
    assert_int_equal(socket_state(fd[0], POLLOUT), SOCKET_OPEN);
    assert_int_equal(socket_state(fd[0], POLLIN), SOCKET_OPEN); /* a false alarm */
    assert_int_equal(send(fd[1], "a", 1, 0), 1);
    assert_int_equal(socket_state(fd[0], wait_for(fd[0], POLLIN)), SOCKET_OPEN);
    assert_int_equal(shutdown(fd[1], SHUT_WR), 0);
    assert_int_equal(socket_state(fd[0], POLLIN), SOCKET_OPEN); /* a byte is there */
    assert_int_equal(recv(fd[0], &byte, 1, 0), 1);
    assert_int_equal(socket_state(fd[0], wait_for(fd[0], POLLIN)), SOCKET_SHUT);
    assert_int_equal(shutdown(fd[0], SHUT_WR), 0);
    assert_int_equal(socket_state(fd[0], wait_for(fd[0], POLLHUP)), SOCKET_ENDED);
    close_pair(fd);
    connect_pair(fd);
    socket_break(fd[1]); /* which the peer sees as a reset */
    const short revents = wait_for(fd[0], POLLIN);
    assert_true((revents & POLLERR) != 0);
    assert_int_equal(recv(fd[0], &byte, 1, 0), -1);
    assert_int_equal(errno, ECONNRESET);
    assert_int_equal(socket_state(fd[0], revents), SOCKET_ENDED);
    assert_true(fcntl(fd[1], F_GETFD) >= 0);
    close_pair(fd);
    connect_pair(fd);
    socket_break(fd[1]);
    assert_int_equal(socket_state(fd[0], wait_for(fd[0], POLLIN)), SOCKET_ENDED); /* it reads the error itself */
    close_pair(fd);
    assert_int_equal(socket_state(fd[0], POLLNVAL), SOCKET_ENDED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_codes),           cmocka_unit_test(test_groups_and_texts),
        cmocka_unit_test(test_no_such_address), cmocka_unit_test(test_opening),
        cmocka_unit_test(test_settings),        cmocka_unit_test(test_own_end),
        cmocka_unit_test(test_bytes),           cmocka_unit_test(test_drain),
        cmocka_unit_test(test_states),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
