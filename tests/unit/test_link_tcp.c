/* SPDX-License-Identifier: MIT */
/* The link tcp: sessions come, end in each way, fill up, and are refused. */
#include "tests/unit/link_test.h"

#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>

static void test_tcp_sessions(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_TCP, .max_sessions = 2};
    struct bench bench = bench_open(&spec);
    const int port = bench_port(&bench);
    char text[96], want[96];
    bench.ops->endpoint(bench.link, text, sizeof text);
    snprintf(want, sizeof want, "tcp:127.0.0.1:%d", port);
    assert_string_equal(text, want);
    int a = dial(port);
    assert_int_equal(bench_expect(&bench, LINK_OPENED, 0).session, 0);
    int b = dial(port);
    struct link_event event = bench_expect(&bench, LINK_OPENED, 0);
    assert_int_equal(event.session, 1);
    assert_int_equal(strncmp(event.peer, "127.0.0.1:", 10), 0);
    exchange(&bench, 0, a);
    exchange(&bench, 1, b);
    int c = dial(port);
    bench_expect(&bench, LINK_REFUSED, 0);
    char byte;
    assert_int_equal(fd_read(c, &byte, 1), 0); /* told, not left waiting */
    close(c);
    exchange(&bench, 1, b);
    close(a);
    assert_int_equal(bench_expect(&bench, LINK_SHUT, 3).session, 0);
    assert_int_equal(bench.ops->write(bench.link, 0, "x", 1), 1);
    assert_int_equal(bench_expect(&bench, LINK_CLOSED, 3).session, 0);
    assert_int_equal(bench.ops->write(bench.link, 0, "x", 1), SH_ECLOSED);
    a = dial(port);
    assert_int_equal(bench_expect(&bench, LINK_OPENED, 0).session, 0);
    exchange(&bench, 0, a);
    assert_int_equal(bench.ops->write(bench.link, 7, "x", 1), SH_ECLOSED);
    assert_int_equal(bench.ops->read(bench.link, -1, &byte, 1), SH_ECLOSED);
    close(a);
    close(b);
    bench_close(&bench);
}

static void test_tcp_endings(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_TCP, .max_sessions = 1};
    struct bench bench = bench_open(&spec);
    char byte;
    /* The connection is half closed, with a byte still to read. */
    int fd = dial(bench_port(&bench));
    bench_expect(&bench, LINK_OPENED, 0);
    assert_int_equal(write(fd, "q", 1), 1);
    assert_int_equal(shutdown(fd, SHUT_WR), 0);
    bench_read_all(&bench, 0, &byte, 1);
    assert_int_equal(byte, 'q');
    bench_expect(&bench, LINK_SHUT, 0);
    assert_int_equal(bench_poll(&bench, 0, 0), 0); /* said once */
    assert_int_equal(bench.ops->read(bench.link, 0, &byte, 1), 0);
    assert_int_equal(bench.ops->write(bench.link, 0, "r", 1), 1);
    assert_int_equal(fd_read(fd, &byte, 1), 1); /* it gets what is due to it */
    assert_int_equal(byte, 'r');
    bench.ops->end(bench.link, 0);
    bench_expect(&bench, LINK_CLOSED, 0);
    assert_int_equal(fd_read(fd, &byte, 1), 0);
    close(fd);
    /* Another client comes before that has been read: the session is not free yet, but will be. */
    fd = dial(bench_port(&bench));
    bench_expect(&bench, LINK_OPENED, 0);
    assert_int_equal(write(fd, "q", 1), 1);
    close(fd);
    fd = dial(bench_port(&bench));
    bench_poll(&bench, 0, DEADLINE_MS);
    bench_read_all(&bench, 0, &byte, 1);
    bench_expect(&bench, LINK_SHUT, 0);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_expect(&bench, LINK_OPENED, 0);
    exchange(&bench, 0, fd);
    /* The connection is closed, which shows by the first byte that is written to it. */
    close(fd);
    bench_expect(&bench, LINK_SHUT, 0);
    assert_int_equal(bench.ops->write(bench.link, 0, "x", 1), 1);
    bench_expect(&bench, LINK_CLOSED, 0);
    /* The connection is reset, while frames are on their way. */
    fd = dial(bench_port(&bench));
    bench_expect(&bench, LINK_OPENED, 0);
    bench_fill(&bench, 0);
    const struct linger reset = {.l_onoff = 1, .l_linger = 0};
    setsockopt(fd, SOL_SOCKET, SO_LINGER, &reset, sizeof reset);
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 1);
    /* write notices a reset before poll does. */
    fd = dial(bench_port(&bench));
    bench_expect(&bench, LINK_OPENED, 0);
    setsockopt(fd, SOL_SOCKET, SO_LINGER, &reset, sizeof reset);
    close(fd);
    ssize_t n = 0;
    for (const int64_t end_ms = give_up_ms(); n >= 0 && now_ms() < end_ms;)
        n = bench.ops->write(bench.link, 0, "x", 1);
    assert_int_equal(n, SH_ECLOSED);
    bench_expect(&bench, LINK_CLOSED, 0);
    assert_int_equal(bench_poll(&bench, 1, 0), 0);
    /* The link's owner ends it. The client's own end is not waited for. */
    fd = dial(bench_port(&bench));
    bench_expect(&bench, LINK_OPENED, 0);
    bench.ops->end(bench.link, 0);
    bench_expect(&bench, LINK_CLOSED, 0);
    assert_int_equal(fd_read(fd, &byte, 1), 0);
    close(fd);
    bench_close(&bench);
}

/* A client that leaves with bytes unread resets the connection. The head notices it while it writes, before it has read
 * the client's last command. */
static void test_tcp_last_words(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_TCP, .max_sessions = 1};
    struct bench bench = bench_open(&spec);
    const struct linger reset = {.l_onoff = 1, .l_linger = 0};
    char words[4];
    int fd = dial(bench_port(&bench));
    bench_expect(&bench, LINK_OPENED, 0);
    assert_int_equal(write(fd, "STOP", 4), 4);
    setsockopt(fd, SOL_SOCKET, SO_LINGER, &reset, sizeof reset);
    close(fd);
    for (int i = 0; i < 3; i++) /* the reset has come: on the loopback interface close() delivers it */
        assert_int_equal(bench.ops->write(bench.link, 0, "x", 1), 0);
    bench_read_all(&bench, 0, words, 4);
    assert_memory_equal(words, "STOP", 4);
    assert_int_equal(bench.ops->write(bench.link, 0, "x", 1), SH_ECLOSED);
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_close(&bench);
}

/* The link is closed before it has read a client's last bytes. The client gets all that was written to it, and its
 * end. */
static void test_tcp_close(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_TCP, .max_sessions = 2};
    struct bench bench = bench_open(&spec);
    char byte;
    int fd = dial(bench_port(&bench));
    bench_expect(&bench, LINK_OPENED, 0);
    const size_t held = bench_fill(&bench, 0);
    assert_int_equal(write(fd, "STOP", 4), 4);
    bench_close(&bench);
    fd_drain(fd, held);
    assert_int_equal(fd_read(fd, &byte, 1), 0);
    close(fd);
}

static void test_tcp_full(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_TCP, .max_sessions = 2};
    struct bench bench = bench_open(&spec);
    int lazy = dial(bench_port(&bench));
    bench_expect(&bench, LINK_OPENED, 0);
    int other = dial(bench_port(&bench));
    bench_expect(&bench, LINK_OPENED, 0);
    size_t held = bench_fill(&bench, 0);
    exchange(&bench, 1, other); /* one lazy reader does not hold up another */
    fd_drain(lazy, held);
    assert_int_equal(bench_expect(&bench, LINK_WRITABLE, 1).session, 0);
    close(lazy);
    close(other);
    bench_close(&bench);
}

/* The child is killed in the middle of its reading and writing. */
static void test_tcp_kill(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_TCP, .max_sessions = 1};
    struct bench bench = bench_open(&spec);
    int fd = dial(bench_port(&bench));
    bench_expect(&bench, LINK_OPENED, 0);
    pid_t child = fork();
    if (child == 0) {
        char data[4096];
        while (read(fd, data, sizeof data) > 0 && write(fd, data, 16) > 0)
            ;
        _exit(0);
    }
    close(fd);
    char data[10000] = "";
    bench_write_all(&bench, 0, data, sizeof data);
    bench_read_all(&bench, 0, data, 16);
    kill(child, SIGKILL);
    waitpid(child, NULL, 0);
    const int64_t end_ms = give_up_ms();
    for (int closed = 0; !closed;) { /* the child's bytes come first */
        if (now_ms() > end_ms) give_up("the end of a client that was killed");
        while (bench.ops->read(bench.link, 0, data, sizeof data) > 0)
            ;
        bench.n_queue = 0;
        bench_poll(&bench, 0, 1000);
        closed = bench.n_queue > 0 && bench.queue[0].kind == LINK_CLOSED;
        if (bench.n_queue > 0 && bench.queue[0].kind == LINK_SHUT) bench.ops->write(bench.link, 0, data, 1);
    }
    bench_close(&bench);
}

/* Events that do not fit into the caller's array come with the next call. */
static void test_tcp_small_array(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_TCP, .max_sessions = 2};
    struct bench bench = bench_open(&spec);
    struct link_event event;
    int fd[3], seen[6] = {0};
    for (int i = 0; i < 3; i++)
        fd[i] = dial(bench_port(&bench));
    for (int i = 0; i < 3; i++) {
        assert_int_equal(bench.ops->poll(bench.link, -1, 0, DEADLINE_MS, &event, 1), 1);
        seen[event.kind]++;
    }
    const struct linger reset = {.l_onoff = 1, .l_linger = 0};
    for (int i = 0; i < 3; i++) {
        setsockopt(fd[i], SOL_SOCKET, SO_LINGER, &reset, sizeof reset);
        close(fd[i]);
    }
    for (int i = 0; i < 2; i++) {
        assert_int_equal(bench.ops->poll(bench.link, -1, 0, DEADLINE_MS, &event, 1), 1);
        seen[event.kind]++;
    }
    assert_int_equal(seen[LINK_OPENED], 2);
    assert_int_equal(seen[LINK_REFUSED], 1);
    assert_int_equal(seen[LINK_CLOSED], 2);
    bench_close(&bench);
}

static void test_tcp_refusals(void **state)
{
    (void)state;
    struct link_spec spec = {.type = LINK_TCP, .max_sessions = 1};
    struct bench bench = bench_open(&spec);
    char want[64];
    spec.port = bench_port(&bench);
    snprintf(want, sizeof want, "tcp:127.0.0.1:%d: cannot listen: Address already in use", spec.port);
    expect_refused(&spec, SH_EINPUT, want);
    bench_close(&bench);
    spec.port = 65536;
    expect_refused(&spec, SH_EINPUT, "0 to 65535");
    spec.port = 0;
    spec.max_sessions = LINK_MAX_SESSIONS + 1;
    expect_refused(&spec, SH_EINPUT, "1 to 8");
    spec.max_sessions = 1;
    snprintf(spec.address, sizeof spec.address, "300.1.1.1");
    expect_refused(&spec, SH_EINPUT, "tcp:300.1.1.1:0");
    snprintf(spec.address, sizeof spec.address, "192.0.2.1"); /* TEST-NET: never an address of ours */
    expect_refused(&spec, SH_EINPUT, "tcp:192.0.2.1:0: cannot listen");
}

/* The user has no rights. The error names the one that is needed. */
static void test_tcp_privileged_port(void **state)
{
    (void)state;
    int least = 0;
    FILE *f = fopen("/proc/sys/net/ipv4/ip_unprivileged_port_start", "r");
    if (f == NULL || fscanf(f, "%d", &least) != 1 || least <= 80) skip();
    fclose(f);
    pid_t pid = fork();
    if (pid == 0) {
        struct link_spec spec = {.type = LINK_TCP, .max_sessions = 1, .port = 80};
        struct sh_err err = {0};
        void *link;
        if (getuid() == 0 && (setgid(65534) != 0 || setuid(65534) != 0)) _exit(2);
        int rc = link_ops_get(LINK_TCP)->open(&spec, &link, &err);
        _exit(rc != SH_EPERM || strstr(err.text, "tcp:127.0.0.1:80") == NULL ||
              strstr(err.text, "CAP_NET_BIND_SERVICE") == NULL);
    }
    int status = 0;
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_int_equal(status, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_tcp_sessions),
        cmocka_unit_test(test_tcp_endings),
        cmocka_unit_test(test_tcp_last_words),
        cmocka_unit_test(test_tcp_close),
        cmocka_unit_test(test_tcp_full),
        cmocka_unit_test(test_tcp_kill),
        cmocka_unit_test(test_tcp_small_array),
        cmocka_unit_test(test_tcp_refusals),
        cmocka_unit_test(test_tcp_privileged_port),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
