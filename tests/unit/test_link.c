/* SPDX-License-Identifier: MIT */
/* The links null, file and fd, and the table of all links. The other links have programs of their own. */
#include "tests/unit/link_test.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <termios.h>

#include "drivers/link/link_poll.h"

static void test_table(void **state)
{
    (void)state;
    const char *const names[] = {"null", "file", "pty", "tcp", "fd", "udp", "web", "memory"};
    const enum link_type types[] = {LINK_NULL, LINK_FILE, LINK_PTY, LINK_TCP, LINK_FD, LINK_UDP, LINK_WEB, LINK_MEMORY};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        assert_string_equal(link_ops_get(types[i])->name, names[i]);
        assert_null(link_ops_get(types[i])->capacity); /* no fixed limit */
    }
    assert_null(link_ops_get((enum link_type)(LINK_MEMORY + 1)));
    assert_string_equal(link_ops_get(LINK_USB)->name, "usb");
    assert_null(link_ops_get((enum link_type) - 1));
}

static void test_null(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_NULL};
    struct bench bench = bench_open(&spec);
    char text[32];
    bench.ops->endpoint(bench.link, text, sizeof text);
    assert_string_equal(text, "null");
    bench_expect(&bench, LINK_OPENED, 0);
    bench_expect(&bench, LINK_WRITABLE, 1);
    assert_int_equal(bench_poll(&bench, 0, 0), 0);
    assert_int_equal(bench.ops->write(bench.link, 0, text, 32), 32);
    assert_int_equal(bench.ops->read(bench.link, 0, text, 32), 0);
    bench_close(&bench);
}

/* A thousand signals are one event, and a link without sessions gets it as well. */
static void test_wake(void **state)
{
    (void)state;
    const enum link_type types[] = {LINK_NULL, LINK_PTY, LINK_TCP};
    for (int i = 0; i < 3; i++) {
        struct link_spec spec = {.type = types[i], .max_sessions = 1};
        struct bench bench = bench_open(&spec);
        if (types[i] == LINK_NULL) bench_expect(&bench, LINK_OPENED, 0);
        bench.wake = eventfd(0, EFD_CLOEXEC);
        for (int k = 0; k < 1000; k++)
            assert_int_equal(eventfd_write(bench.wake, 1), 0);
        bench_expect(&bench, LINK_WOKEN, 0);
        assert_int_equal(bench_poll(&bench, 0, 0), 0);
        close(bench.wake);
        bench_close(&bench);
    }
}

static atomic_int is_waited;

static void on_signal(int number)
{
    (void)number;
}

/* Signals come until the wait has ended, so at least one of them comes in it. */
static void *interrupt(void *waiter)
{
    while (!is_waited) {
        pthread_kill(*(pthread_t *)waiter, SIGUSR1);
        sched_yield();
    }
    return NULL;
}

/* A signal is no event and no error. A refusal of poll(2) is an error: here more descriptors than a process may have.
 */
static void test_wait(void **state)
{
    (void)state;
    struct sigaction act = {.sa_handler = on_signal}, before;
    struct rlimit limit, low;
    pthread_t self = pthread_self(), other;
    struct pollfd fds[2] = {{.fd = eventfd(0, EFD_CLOEXEC), .events = POLLIN, .revents = POLLIN},
                            {.fd = -1, .revents = POLLIN}};
    is_waited = 0;
    assert_int_equal(sigaction(SIGUSR1, &act, &before), 0);
    assert_int_equal(pthread_create(&other, NULL, interrupt, &self), 0);
    const int rc = link_wait(fds, 2, -1);
    is_waited = 1;
    pthread_join(other, NULL);
    sigaction(SIGUSR1, &before, NULL);
    assert_int_equal(rc, SH_OK);
    assert_int_equal(fds[0].revents | fds[1].revents, 0);
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &limit), 0);
    low = limit;
    low.rlim_cur = 1;
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &low), 0);
    const int refused = link_wait(fds, 2, 0);
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &limit), 0);
    assert_int_equal(refused, SH_EIO);
    close(fds[0].fd);
}

/* Where there is no room, nothing is reported and a wake-up is not drained: it comes with the next call. */
static void test_no_room(void **state)
{
    (void)state;
    struct link_event event[2];
    struct link_events none = {event, 0, 0}, one = {event, 0, 1}, two = {event, 0, 2};
    const int wake = eventfd(1, EFD_CLOEXEC | EFD_NONBLOCK);
    assert_int_equal(link_poll_sink(wake, 1, 0, &none), 0);
    assert_int_equal(link_poll_sink(wake, 1, 0, &one), 1);
    assert_int_equal(event[0].kind, LINK_WRITABLE);
    assert_int_equal(link_poll_sink(wake, 1, -1, &two), 2); /* it does not wait where there is an event */
    assert_int_equal(event[0].kind, LINK_WRITABLE);
    assert_int_equal(event[0].session, 0);
    assert_string_equal(event[0].peer, "");
    assert_int_equal(event[1].kind, LINK_WOKEN);
    two.n = 0;
    assert_int_equal(link_poll_sink(wake, 0, 0, &two), 0);
    close(wake);
}

static void test_file(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_FILE};
    char *dir = test_dir(), text[300], want[300], back[16];
    snprintf(spec.path, sizeof spec.path, "%s/stream.shs", dir);
    for (int round = 0; round < 2; round++) { /* the second time the file is there, and is truncated */
        struct bench bench = bench_open(&spec);
        bench.ops->endpoint(bench.link, text, sizeof text);
        snprintf(want, sizeof want, "file:%s", spec.path);
        assert_string_equal(text, want);
        bench_expect(&bench, LINK_OPENED, 0);
        bench_write_all(&bench, 0, "abc", 3);
        bench_write_all(&bench, 0, "defg", 4);
        assert_int_equal(bench.ops->read(bench.link, 0, text, 3), 0);
        bench_close(&bench);
    }
    int fd = open(spec.path, O_RDONLY);
    assert_int_equal(read(fd, back, sizeof back), 7);
    assert_memory_equal(back, "abcdefg", 7);
    close(fd);
    unlink(spec.path);
    rmdir(dir);
}

static void test_file_refusals(void **state)
{
    (void)state;
    char *dir = test_dir();
    struct link_spec spec = {.type = LINK_FILE};
    expect_refused(&spec, SH_EINPUT, "path");
    snprintf(spec.path, sizeof spec.path, "%s", dir);
    expect_refused(&spec, SH_EINPUT, dir);
    snprintf(spec.path, sizeof spec.path, "%s/no/such", dir);
    expect_refused(&spec, SH_EINPUT, spec.path);
    snprintf(spec.path, sizeof spec.path, "%s/fifo", dir);
    assert_int_equal(mkfifo(spec.path, 0600), 0);
    expect_refused(&spec, SH_EINPUT, "regular file"); /* nobody reads: must not block */
    int reader = open(spec.path, O_RDONLY | O_NONBLOCK);
    expect_refused(&spec, SH_EINPUT, "regular file");
    close(reader);
    unlink(spec.path);
    rmdir(dir);
}

/* /dev/full is a full disk. */
static void test_file_full(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_FILE, .path = "/dev/full"};
    struct bench bench = bench_open(&spec);
    bench_expect(&bench, LINK_OPENED, 0);
    assert_int_equal(bench.ops->write(bench.link, 0, "x", 1), SH_EIO);
    assert_string_equal(bench_expect(&bench, LINK_CLOSED, 0).peer, "No space left on device");
    assert_int_equal(bench_poll(&bench, 1, 0), 0);
    assert_int_equal(bench.ops->write(bench.link, 0, "x", 1), SH_ECLOSED);
    bench_close(&bench);
}

/* A device that takes nothing more, such as a serial port whose other end says so, must not hold up the link. */
static void test_file_device(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_FILE};
    struct termios mode;
    const int other_end = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    assert_int_equal(unlockpt(other_end), 0);
    assert_int_equal(tcgetattr(other_end, &mode), 0);
    cfmakeraw(&mode);
    assert_int_equal(tcsetattr(other_end, TCSANOW, &mode), 0);
    assert_int_equal(ptsname_r(other_end, spec.path, sizeof spec.path), 0);
    struct bench bench = bench_open(&spec);
    bench_expect(&bench, LINK_OPENED, 0);
    fd_drain(other_end, bench_fill(&bench, 0));
    bench_expect(&bench, LINK_WRITABLE, 1);
    close(other_end);
    assert_int_equal(bench.ops->write(bench.link, 0, "x", 1), SH_EIO);
    assert_string_equal(bench_expect(&bench, LINK_CLOSED, 1).peer, strerror(EIO));
    assert_int_equal(bench_poll(&bench, 1, 0), 0);
    bench_close(&bench);
}

static void test_fd(void **state)
{
    (void)state;
    int pair[2];
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair), 0);
    struct link_spec spec = {.type = LINK_FD, .fd = pair[0]};
    struct bench bench = bench_open(&spec);
    bench_expect(&bench, LINK_OPENED, 0);
    exchange(&bench, 0, pair[1]);
    size_t held = bench_fill(&bench, 0);
    fd_drain(pair[1], held);
    bench_expect(&bench, LINK_WRITABLE, 1);
    close(pair[1]);
    bench_expect(&bench, LINK_CLOSED, 1);
    assert_int_equal(bench.ops->write(bench.link, 0, "x", 1), SH_ECLOSED); /* and no SIGPIPE */
    assert_int_equal(bench_poll(&bench, 1, 0), 0);
    const int64_t start_ms = now_ms();
    assert_int_equal(bench_poll(&bench, 1, 50), 0);
    assert_true(now_ms() - start_ms >= 49); /* the other end is gone, and keeps nobody awake */
    bench_close(&bench);
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair), 0);
    spec.fd = pair[0];
    snprintf(spec.path, sizeof spec.path, "the observer");
    bench = bench_open(&spec); /* ended from this side: written bytes are sent before */
    char name[64];
    bench.ops->endpoint(bench.link, name, sizeof name);
    assert_string_equal(name, "the observer");
    bench_expect(&bench, LINK_OPENED, 0);
    bench_write_all(&bench, 0, "last", 4);
    bench.ops->end(bench.link, 0);
    bench_expect(&bench, LINK_CLOSED, 0);
    char last[8], byte;
    assert_int_equal(read(pair[1], last, sizeof last), 4);
    assert_int_equal(read(pair[1], last, sizeof last), 0);
    close(pair[1]);
    bench_close(&bench);
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair), 0);
    spec.fd = pair[0];
    bench = bench_open(&spec); /* bytes that the other end wrote before it went are read first */
    bench_expect(&bench, LINK_OPENED, 0);
    assert_int_equal(write(pair[1], "q", 1), 1);
    close(pair[1]);
    bench_expect(&bench, LINK_READABLE, 0);
    assert_int_equal(bench.ops->read(bench.link, 0, &byte, 1), 1);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_close(&bench);

    int pipes[2];
    assert_int_equal(pipe(pipes), 0);
    spec.fd = pipes[0];
    expect_refused(&spec, SH_EINPUT, "socket");
    close(pipes[0]);
    close(pipes[1]);
    spec.fd = -1;
    expect_refused(&spec, SH_EINPUT, "fd:-1");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_table),         cmocka_unit_test(test_null),
        cmocka_unit_test(test_wake),          cmocka_unit_test(test_file),
        cmocka_unit_test(test_file_refusals), cmocka_unit_test(test_file_full),
        cmocka_unit_test(test_file_device),   cmocka_unit_test(test_fd),
        cmocka_unit_test(test_wait),          cmocka_unit_test(test_no_room),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
