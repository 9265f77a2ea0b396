/* SPDX-License-Identifier: MIT */
#include "tests/unit/link_test.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

static int gave_up; /* a wait of this program was in vain */

int64_t now_ms(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

int64_t give_up_ms(void)
{
    return now_ms() + (gave_up ? 1000 : WAIT_MS);
}

void give_up(const char *what)
{
    gave_up = 1;
    fail_msg("%s: not in time", what);
}

struct bench bench_open(const struct link_spec *spec)
{
    struct bench bench = {.ops = link_ops_get(spec->type), .wake = -1};
    struct sh_err err = {0, ""};
    if (bench.ops->open(spec, &bench.link, &err) != SH_OK) fail_msg("%s", err.text);
    return bench;
}

void bench_close(struct bench *bench)
{
    bench->ops->close(bench->link);
}

int bench_poll(struct bench *bench, uint32_t want_write, int timeout_ms)
{
    int room = (int)(sizeof bench->queue / sizeof bench->queue[0]) - bench->n_queue;
    alarm((unsigned)(timeout_ms + WAIT_MS) / 1000 + 1);
    int n = bench->ops->poll(bench->link, bench->wake, want_write, timeout_ms, bench->queue + bench->n_queue, room);
    alarm(0);
    assert_true(n >= 0 && n <= room);
    int kept = bench->n_queue;
    for (int i = bench->n_queue; i < bench->n_queue + n; i++) {
        if (bench->queue[i].kind == LINK_PLUGGED)
            bench->n_plugged++;
        else
            bench->queue[kept++] = bench->queue[i];
    }
    n = kept - bench->n_queue;
    bench->n_queue = kept;
    return n;
}

struct link_event bench_expect(struct bench *bench, enum link_event_kind kind, uint32_t want_write)
{
    const int64_t end_ms = give_up_ms();
    for (;;) {
        while (bench->n_queue > 0) {
            struct link_event event = bench->queue[0];
            memmove(bench->queue, bench->queue + 1, (size_t)--bench->n_queue * sizeof event);
            if (event.kind == kind) return event;
            if (event.kind != LINK_READABLE && event.kind != LINK_WRITABLE)
                fail_msg("event %d of session %d (%s) instead of %d", event.kind, event.session, event.peer, kind);
        }
        if (now_ms() > end_ms) {
            print_message("# event %d\n", kind);
            give_up("an event");
        }
        bench_poll(bench, want_write, 1000);
    }
}

void bench_write_all(struct bench *bench, int session, const void *data, size_t len)
{
    const char *at = data;
    while (len > 0) {
        ssize_t n = bench->ops->write(bench->link, session, at, len);
        assert_true(n >= 0);
        at += n;
        len -= (size_t)n;
        if (len > 0) bench_expect(bench, LINK_WRITABLE, 1u << session);
    }
}

void bench_read_all(struct bench *bench, int session, void *data, size_t len)
{
    char *at = data;
    while (len > 0) {
        ssize_t n = bench->ops->read(bench->link, session, at, len);
        assert_true(n >= 0);
        at += n;
        len -= (size_t)n;
        if (len > 0 && n == 0) bench_expect(bench, LINK_READABLE, 0);
    }
}

ssize_t fd_read(int fd, void *data, size_t len)
{
    struct pollfd slot = {.fd = fd, .events = POLLIN};
    if (poll(&slot, 1, (int)(give_up_ms() - now_ms())) != 1) give_up("bytes of the link, or its end");
    return read(fd, data, len);
}

void fd_read_all(int fd, void *data, size_t len)
{
    char *at = data;
    while (len > 0) {
        ssize_t n = fd_read(fd, at, len);
        assert_true(n > 0);
        at += n;
        len -= (size_t)n;
    }
}

size_t bench_fill(struct bench *bench, int session)
{
    enum { MOST_HELD = 1 << 28 }; /* buffers of the kernel's are a few MiB */
    static char data[44000];
    size_t total = 0;
    for (int calm = 0, rounds = 0; calm < 3; rounds++) {
        ssize_t n;
        assert_true(rounds < 1000);
        while ((n = bench->ops->write(bench->link, session, data, sizeof data)) > 0) {
            total += (size_t)n;
            if (total > MOST_HELD) fail_msg("it takes more than %d bytes that nobody reads", (int)MOST_HELD);
        }
        assert_int_equal(n, 0);
        const int64_t start_ms = now_ms();
        bench->n_queue = 0;
        if (bench_poll(bench, 1u << session, 50) > 0) {
            assert_int_equal(bench->queue[0].kind, LINK_WRITABLE);
            calm = 0;
        } else if (now_ms() - start_ms >= 49) {
            calm++;
        }
        bench->n_queue = 0;
    }
    return total;
}

void fd_drain(int fd, size_t len)
{
    static char data[65536];
    while (len > 0) {
        ssize_t n = fd_read(fd, data, len < sizeof data ? len : sizeof data);
        assert_true(n > 0);
        len -= (size_t)n;
    }
}

char *test_dir(void)
{
    static char dir[64];
    snprintf(dir, sizeof dir, "/tmp/test_link.XXXXXX");
    assert_non_null(mkdtemp(dir));
    return dir;
}

int bench_port(const struct bench *bench)
{
    char name[300];
    bench->ops->endpoint(bench->link, name, sizeof name);
    return atoi(strrchr(name, ':') + 1);
}

int dial(int port)
{
    const struct sockaddr_in at = {
        .sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK), .sin_port = htons((uint16_t)port)};
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (connect(fd, (const struct sockaddr *)&at, sizeof at) == 0) return fd;
    assert_int_equal(errno, ECONNREFUSED);
    close(fd);
    return -1;
}

void bench_expect_notice(struct bench *bench, const char *part)
{
    const struct link_event event = bench_expect(bench, LINK_NOTICE, 0);
    if (strstr(event.peer, part) == NULL) fail_msg("\"%s\" has no \"%s\"", event.peer, part);
}

void expect_refused(const struct link_spec *spec, int code, const char *part)
{
    struct sh_err err = {0, ""};
    void *link = NULL;
    assert_int_equal(link_ops_get(spec->type)->open(spec, &link, &err), code);
    assert_null(link);
    if (strstr(err.text, part) == NULL || strchr(err.text, '\n') != NULL) fail_msg("'%s' without '%s'", err.text, part);
}

static void fill_bytes(uint8_t *data, size_t len)
{
    for (size_t i = 0; i < len; i++)
        data[i] = (uint8_t)(i ^ i >> 8);
}

void exchange(struct bench *bench, int session, int fd)
{
    uint8_t out[2048], back[2048];
    fill_bytes(out, sizeof out);
    bench_write_all(bench, session, out, sizeof out);
    fd_read_all(fd, back, sizeof back);
    assert_memory_equal(out, back, sizeof out);
    memset(back, 0, sizeof back);
    assert_int_equal(write(fd, out, sizeof out), sizeof out);
    bench_read_all(bench, session, back, sizeof back);
    assert_memory_equal(out, back, sizeof out);
}
