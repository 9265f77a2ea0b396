/* SPDX-License-Identifier: MIT */
/* The pty link with clients that come and go as fast as they can, many at once, and killed. */
#include <poll.h>

#include "tests/unit/pty_rig.h"

static void test_many_at_once(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    int fd[20];
    for (int round = 0; round < 5; round++) {
        for (int i = 0; i < 20; i++)
            fd[i] = client_open(&bench); /* inotify tells one open for all of these */
        bench_expect(&bench, LINK_OPENED, 0);
        for (int i = 0; i < 19; i++) {
            close(fd[(i * 7) % 20]);
            if (i % 3 == 0) assert_true(is_calm(&bench, 0)); /* one is left: no end */
        }
        bench_write_all(&bench, 0, "x", 1);
        close(fd[(19 * 7) % 20]);
        bench_expect(&bench, LINK_CLOSED, 0);
        assert_true(is_calm(&bench, 1));
    }
    bench_close(&bench);
}

static pid_t spawn_cycles(const char *path, int cycles)
{
    pid_t child = fork_child();
    if (child != 0) return child;
    for (int i = 0; i < cycles; i++) {
        int fd = open(path, O_RDWR | O_NOCTTY);
        if (fd < 0) _exit(1);
        if (i % 3 == 0 && write(fd, "x", 1) != 1) _exit(1);
        close(fd);
    }
    _exit(0);
}

/* Follows the events while children open and close as fast as they can. Order and balance must hold throughout. */
static void follow(struct bench *bench, const pid_t *children, int n_children, size_t *bytes)
{
    char data[256];
    int open_now = 0, left = n_children;
    *bytes = 0;
    for (const int64_t end_ms = now_ms() + DEADLINE_MS;;) {
        assert_true(now_ms() < end_ms);
        int status;
        for (int i = 0; i < n_children && left > 0; i++)
            if (waitpid(children[i], &status, WNOHANG) == children[i]) {
                assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
                left--;
            }
        bench->n_queue = 0;
        bench_poll(bench, 0, left > 0 ? 5 : open_now ? 1000 : 0);
        for (int i = 0; i < bench->n_queue; i++) {
            const enum link_event_kind kind = bench->queue[i].kind;
            if (kind == LINK_OPENED) assert_int_equal(open_now++, 0);
            if (kind == LINK_CLOSED) assert_int_equal(open_now--, 1);
        }
        for (ssize_t n; open_now && (n = bench->ops->read(bench->link, 0, data, sizeof data)) > 0;)
            *bytes += (size_t)n;
        /* The children were gone before this look, and it found nothing, so there is no more. */
        if (left == 0 && !open_now && bench->n_queue == 0) break;
    }
    bench->n_queue = 0;
}

static void test_quick_cycles(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    const char *path = pty_path(&bench);
    for (int n_children = 1; n_children <= 3; n_children++) {
        pid_t children[3];
        size_t bytes;
        for (int i = 0; i < n_children; i++)
            children[i] = spawn_cycles(path, 200);
        follow(&bench, children, n_children, &bytes);
        assert_int_equal(bytes, 67 * n_children); /* of 200 cycles, 0, 3, .. 198 write: nothing is lost */
        bench.n_queue = 0;
        bench_poll(&bench, 0, 0); /* a last open and close that is still to be told */
        assert_true(bench.n_queue == 0 || bench.queue[0].kind == LINK_OPENED);
        if (bench.n_queue > 0) assert_int_equal(read_to_end(&bench), 0);
        bench.n_queue = 0;
        assert_true(is_calm(&bench, 1));
        int fd = client_open(&bench);
        bench_expect(&bench, LINK_OPENED, 0);
        close(fd);
        bench_expect(&bench, LINK_CLOSED, 0);
    }
    bench_close(&bench);
}

/* Opens, asks, waits for the answer, closes, and comes back at once, so that it meets all moments of a session's end. A
 * client may ask again after a second, as real ones do. */
static void ask_again_and_again(const char *path, int cycles)
{
    for (int i = 0; i < cycles; i++) {
        struct pollfd slot = {.fd = open(path, O_RDWR | O_NOCTTY), .events = POLLIN};
        int answered = 0;
        char byte = 'x';
        if (slot.fd < 0) _exit(1);
        for (int tries = 0; tries < 3 && !answered; tries++) {
            if (write(slot.fd, &byte, 1) != 1) _exit(2);
            answered = poll(&slot, 1, 1000) == 1 && read(slot.fd, &byte, 1) == 1;
        }
        if (!answered) _exit(3);
        close(slot.fd);
    }
    _exit(0);
}

static void test_nobody_missed(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    const char *path = pty_path(&bench);
    pid_t child = fork_child();
    if (child == 0) ask_again_and_again(path, 3000);
    int status = 0, open_now = 0, sessions = 0;
    for (int64_t end_ms = now_ms() + DEADLINE_MS; waitpid(child, &status, WNOHANG) == 0;) {
        assert_true(now_ms() < end_ms); /* since the last session began */
        bench.n_queue = 0;
        bench_poll(&bench, 0, 100);
        for (int i = 0; i < bench.n_queue; i++) {
            const enum link_event_kind kind = bench.queue[i].kind;
            if (kind == LINK_OPENED) assert_int_equal(open_now++, 0);
            if (kind == LINK_CLOSED) assert_int_equal(open_now--, 1);
            if (kind == LINK_OPENED) sessions++, end_ms = now_ms() + DEADLINE_MS;
        }
        char data[16];
        ssize_t n = open_now ? bench.ops->read(bench.link, 0, data, sizeof data) : 0;
        if (n > 0) assert_int_equal(bench.ops->write(bench.link, 0, data, (size_t)n), n);
    }
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
    /* There is one session each. A client that comes at the end of the one before may be counted with it. How often
     * depends on the machine's scheduling, so the lower limit only shows that most are told apart. */
    assert_in_range(sessions, 1500, 3000);
    if (open_now) read_to_end(&bench);
    bench_close(&bench);
}

/* A child is killed while it writes and does not read. Another one keeps the session up. */
static void test_kill(void **state)
{
    (void)state;
    struct bench bench = bench_open(&plain);
    for (int with_other = 0; with_other < 2; with_other++) {
        int other = with_other ? client_open(&bench) : -1;
        if (with_other) bench_expect(&bench, LINK_OPENED, 0);
        int fd = client_open(&bench);
        if (!with_other) bench_expect(&bench, LINK_OPENED, 0);
        bench_fill(&bench, 0); /* no client reads, and bytes left in the terminal must not keep the session up */
        pid_t child = fork_child();
        if (child == 0) {
            char data[512] = "";
            while (write(fd, data, sizeof data) > 0)
                ;
            _exit(1);
        }
        close(fd); /* the child has it open still */
        char data[4096];
        bench_read_all(&bench, 0, data, sizeof data); /* it is writing */
        kill(child, SIGKILL);
        waitpid(child, NULL, 0);
        if (with_other) {
            while (bench.ops->read(bench.link, 0, data, sizeof data) > 0)
                ;
            bench.n_queue = 0;
            while (bench_poll(&bench, 0, 30) > 0) {
                assert_int_equal(bench.queue[0].kind, LINK_READABLE);
                while (bench.ops->read(bench.link, 0, data, sizeof data) > 0)
                    ;
                bench.n_queue = 0;
            }
            close(other);
        }
        read_to_end(&bench);
        bench.n_queue = 0;
        assert_true(is_calm(&bench, 1));
    }
    bench_close(&bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_many_at_once),
        cmocka_unit_test(test_quick_cycles),
        cmocka_unit_test(test_nobody_missed),
        cmocka_unit_test(test_kill),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
