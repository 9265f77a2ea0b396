/* SPDX-License-Identifier: MIT */
/* libscanhead: commands over a socket pair, a pty and TCP. */
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>

#include "drivers/host/source.h"
#include "tests/unit/host_rig.h"

/* ---- commands: a thread plays the head, by script */

struct script {
    int fd;
    const char *expect; /* line the client must send */
    int frames_before, frames_after, big;
    const char *reply; /* NULL: hang up */
    int ok;
    const char *identity; /* not NULL: the client asks for it first, after an empty line */
};

/* The head gives up a client that takes or sends nothing. */
static int can(int fd, short what)
{
    struct pollfd slot = {.fd = fd, .events = what};
    return poll(&slot, 1, WAIT_MS) == 1;
}

static int came(int fd, const char *expect)
{
    char line[600];
    size_t n = 0;
    while (n < sizeof line - 1 && can(fd, POLLIN) && read(fd, line + n, 1) == 1 && line[n] != '\n')
        n++;
    line[n] = 0;
    return strcmp(line, expect) == 0;
}

/* came() and give() don't wait for ever: a client that has given up takes no more. */
static int give(int fd, const void *data, size_t len)
{
    size_t done = 0;
    for (ssize_t n; done < len; done += (size_t)n)
        if (!can(fd, POLLOUT) || (n = write(fd, (const char *)data + done, len - done)) <= 0) return 0;
    return 1;
}

static void act(struct script *s)
{
    s->ok = 1;
    if (s->identity != NULL)
        s->ok = came(s->fd, "") && came(s->fd, "*IDN?") && give(s->fd, s->identity, strlen(s->identity));
    s->ok = came(s->fd, s->expect) && s->ok;
    static uint8_t frame[NATIVE_MAX_FRAME];
    for (int i = 0; i < s->frames_before + s->frames_after; i++) {
        if (i == s->frames_before) s->ok &= give(s->fd, s->reply, strlen(s->reply));
        struct line_block block = make_block(s->big ? MAX_POINTS : 1, (uint64_t)i);
        size_t len = native_encode_points(frame, sizeof frame, &block, 0);
        native_finish_frame(frame, rig_next_seq());
        if (!give(s->fd, frame, len)) return;
    }
    if (s->frames_after == 0 && s->reply != NULL) s->ok &= give(s->fd, s->reply, strlen(s->reply));
    if (s->reply == NULL) shutdown(s->fd, SHUT_RDWR);
}

static void *play(void *arg)
{
    struct script *s = arg;
    int flags = fcntl(s->fd, F_GETFL);
    fcntl(s->fd, F_SETFL, flags | O_NONBLOCK);
    act(s);
    fcntl(s->fd, F_SETFL, flags);
    return NULL;
}

static int run_command(struct scanhead *sh, struct script *s, char *reply, size_t reply_len)
{
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, play, s), 0);
    int rc = scanhead_command(sh, s->expect, reply, reply_len, WAIT_MS);
    pthread_join(thread, NULL);
    assert_true(s->ok);
    return rc;
}

/* The head takes no more bytes. That is an error, and no signal, which would end the client's program. */
static void test_command_to_nobody(void **state)
{
    (void)state;
    char reply[16];
    int head;
    struct scanhead *sh = open_pair(&head);
    assert_int_equal(shutdown(head, SHUT_RD), 0);
    assert_int_equal(scanhead_command(sh, "*IDN?", reply, sizeof reply, WAIT_MS), SCANHEAD_ECLOSED);
    close(head);
    scanhead_close(sh);
}

static void test_command(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    char reply[512];
    memset(echo, 0x11, sizeof echo);
    memset(dt, 0, sizeof dt);
    put_points(head, 1, 1000);
    put_all(head, "LATE\r\n", 6); /* the reply to a command given up: never taken for a new one's */
    struct script s = {.fd = head,
                       .expect = "*IDN?",
                       .frames_before = 5,
                       .frames_after = 3,
                       .reply = "Maker,Model,SN1,scanhead native 1\r\n"};
    assert_int_equal(run_command(sh, &s, reply, sizeof reply), 0);
    assert_string_equal(reply, "Maker,Model,SN1,scanhead native 1");
    struct script e = {
        .fd = head, .expect = "HEAD:PRR 5000000", .frames_before = 1, .reply = "ERR -222,\"Data out of range\"\r\n"};
    assert_int_equal(run_command(sh, &e, reply, sizeof reply), 0);
    assert_string_equal(reply, "ERR -222,\"Data out of range\"");
    static const uint64_t pulses[] = {1000, 0, 1, 2, 3, 4, 5, 6, 7, 0};
    for (size_t i = 0; i < sizeof pulses / sizeof pulses[0]; i++) {
        expect_frame(sh, SCANHEAD_POINTS, &f);
        assert_int_equal(f.pulse0, pulses[i]);
    }
    assert_int_equal(scanhead_next(sh, &f, 0), SCANHEAD_ETIMEOUT);
    struct script h = {.fd = head, .expect = "SCAN:STOP", .frames_before = 1, .reply = NULL};
    assert_int_equal(run_command(sh, &h, reply, sizeof reply), SCANHEAD_ECLOSED);
    expect_frame(sh, SCANHEAD_POINTS, &f); /* frames before the end are not lost */
    assert_int_equal(scanhead_next(sh, &f, 0), SCANHEAD_ECLOSED);
    assert_int_equal(scanhead_command(sh, "*IDN?", reply, sizeof reply, 10), SCANHEAD_ECLOSED);
    close(head);
    scanhead_close(sh);
}

static void test_command_refused(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    char reply[512], back[32];
    assert_int_equal(scanhead_command(sh, "", reply, sizeof reply, 10), SCANHEAD_EINPUT);
    assert_int_equal(scanhead_command(sh, "  ", reply, sizeof reply, 10), SCANHEAD_EINPUT);
    assert_int_equal(scanhead_command(sh, "A\nB", reply, sizeof reply, 10), SCANHEAD_EINPUT);
    assert_int_equal(scanhead_command(sh, "\xc3\xa4", reply, sizeof reply, 10), SCANHEAD_EINPUT);
    assert_int_equal(recv(head, back, sizeof back, MSG_DONTWAIT), -1);
    assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, 1), SCANHEAD_ETIMEOUT);
    assert_non_null(strstr(scanhead_error(sh), "TIME?"));
    assert_int_equal(recv(head, back, sizeof back, 0), 6);
    /* The earlier command's reply comes after the next one was given, and does not count for the next. */
    struct script s = {.fd = head,
                       .expect = "HEAD:PRR?",
                       .identity = "999\r\nMaker,Model,SN1,scanhead native 1\r\n",
                       .reply = "12345678\r\n"};
    assert_int_equal(run_command(sh, &s, reply, sizeof reply), 0);
    assert_string_equal(reply, "12345678");
    assert_int_equal(scanhead_command(sh, ":*idn?", reply, sizeof reply, 1), SCANHEAD_ETIMEOUT);
    assert_int_equal(recv(head, back, sizeof back, 0), 7);
    s.identity = "Maker,Model,SN1,scanhead native 1\r\nMaker,Model,SN1,scanhead native 1\r\n";
    assert_int_equal(run_command(sh, &s, reply, sizeof reply), 0);
    assert_string_equal(reply, "12345678");
    s.identity = NULL;
    assert_int_equal(run_command(sh, &s, reply, 8), SCANHEAD_EINPUT); /* not cut */
    close(head);
    scanhead_close(sh);
}

/* A correct frame with a wrong descriptor. */
static void put_wrong_descriptor(int fd)
{
    memset(out, 0, NATIVE_HEADER_LEN);
    memcpy(out, (uint8_t[]){NATIVE_SYNC, NATIVE_DESCRIPTOR, NATIVE_VERSION}, 3);
    put_all(fd, out, native_finish_frame(out, rig_next_seq()));
}

/* There are more than 64 MiB before the reply. The oldest frames are dropped and counted, but their contents are not
 * forgotten. The first one is wrong: it is refused. */
static void test_command_queue_bound(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_info info;
    struct scanhead_stats stats;
    char reply[32];
    memset(echo, 0x11, sizeof echo);
    put_wrong_descriptor(head);
    put_descriptor(head, 1, 1, 0);
    put_anchor(head, 0);
    /* a full frame is 65548 bytes and its entry a few more, so 64 MiB hold 1023 of them, and some small ones */
    struct script s = {.fd = head, .expect = "HEAD:PRR?", .frames_before = 1100, .big = 1, .reply = "1\r\n"};
    assert_int_equal(run_command(sh, &s, reply, sizeof reply), 0);
    assert_string_equal(reply, "1");
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.frames, 1103);
    assert_int_equal(stats.dropped, 1102 - 1023);
    assert_int_equal(stats.refused, 1);
    assert_int_equal(scanhead_get_info(sh, &info), 0);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    assert_int_equal(f.pulse0, 1100 - 1023);
    close(head);
    scanhead_close(sh);
}

static void test_pty(void **state)
{
    (void)state;
    int master = posix_openpt(O_RDWR | O_NOCTTY);
    char source[64], err[256], reply[32];
    if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0) skip();
    snprintf(source, sizeof source, "tty:%s", ptsname(master));
    struct scanhead *sh;
    struct scanhead_frame f;
    assert_int_equal(scanhead_open(source, &sh, err, sizeof err), 0);
    /* The text has bytes that a terminal in its usual mode would change: ^C ^D CR ^S ^V DEL. */
    struct native_event e = {.code = 1, .text = "\x03\x04\r\n\x11\x13\x16\x7f"};
    put_all(master, out, native_encode_event(out, sizeof out, &e, 1, 0));
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_string_equal(f.event_text, e.text);
    struct script s = {
        .fd = master, .expect = "TIME?", .reply = "12\r\n", .identity = "Maker,Model,SN1,scanhead native 1\r\n"};
    assert_int_equal(run_command(sh, &s, reply, sizeof reply), 0);
    assert_string_equal(reply, "12");
    close(master);
    assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_ECLOSED);
    scanhead_close(sh);
}

static void check_tcp(int family, const char *host)
{
    struct sockaddr_storage address = {.ss_family = (sa_family_t)family};
    struct sockaddr_in6 *v6 = (struct sockaddr_in6 *)&address;
    struct sockaddr_in *v4 = (struct sockaddr_in *)&address;
    if (family == AF_INET)
        v4->sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    else
        v6->sin6_addr = in6addr_loopback;
    socklen_t len = family == AF_INET ? sizeof *v4 : sizeof *v6;
    int fd = socket(family, SOCK_STREAM, 0);
    if (fd < 0 || bind(fd, (struct sockaddr *)&address, len) != 0) skip();
    assert_int_equal(listen(fd, 1), 0);
    getsockname(fd, (struct sockaddr *)&address, &len);
    char source[64], err[256], reply[32];
    snprintf(source, sizeof source, "tcp:%s:%d", host, ntohs(family == AF_INET ? v4->sin_port : v6->sin6_port));
    struct scanhead *sh;
    struct scanhead_frame f;
    assert_int_equal(scanhead_open(source, &sh, err, sizeof err), 0);
    int head = accept(fd, NULL, NULL);
    put_points(head, 2, 3);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    struct script s = {.fd = head, .expect = "TIME?", .frames_before = 2, .reply = "12\r\n"};
    assert_int_equal(run_command(sh, &s, reply, sizeof reply), 0);
    close(head);
    close(fd);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_ECLOSED);
    scanhead_close(sh);
    /* nobody listens there any more */
    assert_int_equal(scanhead_open(source, &sh, err, sizeof err), SCANHEAD_EIO);
    assert_non_null(strstr(err, source));
}

static void test_tcp(void **state)
{
    (void)state;
    check_tcp(AF_INET, "127.0.0.1");
}

static void test_tcp6(void **state)
{
    (void)state;
    check_tcp(AF_INET6, "[::1]");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_command),
        cmocka_unit_test(test_command_to_nobody),
        cmocka_unit_test(test_command_refused),
        cmocka_unit_test(test_command_queue_bound),
        cmocka_unit_test(test_pty),
        cmocka_unit_test(test_tcp),
        cmocka_unit_test(test_tcp6),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
