/* SPDX-License-Identifier: MIT */
/* The pty link: clients come and go at moments when the terminal is not watched. The link's own calls of the kernel go
 * through here, so that a client can act within them. */
#include <dlfcn.h>
#include <poll.h>
#include <sys/inotify.h>
#include <sys/syscall.h>
#include <termios.h>

#include "tests/unit/pty_rig.h"

static struct bench bench;
static int visitor = -1;             /* a client's descriptor */
static void (*when_unwatched)(void); /* called once, after the watch is taken away */
static void (*between_looks)(void);  /* called once, after poll has looked at all descriptors but the last */
static int looks_for_bytes_first;    /* then poll has looked at the last one for bytes, too, but not for a hang-up */

static int comes_early; /* a client opens the terminal just before it is watched for the first time */
static int is_full;     /* the system has no more watches */
static int has_no_pair; /* nor terminals */
static int is_no_tty;   /* the terminal that the link opens has no settings */

static void call_once(void (**what)(void))
{
    void (*now)(void) = *what;
    *what = NULL;
    if (now != NULL) now();
}

int inotify_add_watch(int fd, const char *path, uint32_t mask)
{
    if (comes_early) visitor = open(path, O_RDWR | O_NOCTTY | O_CLOEXEC);
    comes_early = 0;
    errno = ENOSPC;
    return is_full ? -1 : (int)syscall(SYS_inotify_add_watch, fd, path, mask);
}

int posix_openpt(int flags)
{
    errno = ENOSPC;
    return has_no_pair ? -1 : open("/dev/ptmx", flags);
}

int tcgetattr(int fd, struct termios *settings)
{
    int (*real)(int, struct termios *);
    void *found = dlsym(RTLD_NEXT, "tcgetattr");
    memcpy(&real, &found, sizeof real);
    errno = ENOTTY;
    return is_no_tty ? -1 : real(fd, settings);
}

int inotify_rm_watch(int fd, int watch)
{
    int rc = (int)syscall(SYS_inotify_rm_watch, fd, watch);
    call_once(&when_unwatched);
    return rc;
}

/* The kernel looks at one descriptor after the other. */
int poll(struct pollfd *fds, nfds_t n, int timeout_ms)
{
    const struct timespec wait = {timeout_ms / 1000, timeout_ms % 1000 * 1000000L}, none = {0, 0};
    if (n < 3 || between_looks == NULL) return ppoll(fds, n, timeout_ms < 0 ? NULL : &wait, NULL);
    int before = ppoll(fds, n - 1, &none, NULL);
    call_once(&between_looks);
    int last = ppoll(fds + n - 1, 1, &none, NULL);
    if (looks_for_bytes_first) fds[n - 1].revents &= (short)~POLLIN;
    looks_for_bytes_first = 0;
    return before < 0 || last < 0 ? -1 : before + last;
}

static void come(void)
{
    visitor = client_open(&bench);
}

static void leave(void)
{
    close(visitor);
}

static void write_and_leave(void)
{
    come();
    assert_int_equal(write(visitor, "*RST\n", 5), 5);
    leave();
}

static void begin(void)
{
    bench = bench_open(&plain);
    come();
    bench_expect(&bench, LINK_OPENED, 0);
}

/* A client has its session, and gets its answers. */
static void expect_served(int fd)
{
    char text[8];
    bench_expect(&bench, LINK_OPENED, 0);
    assert_int_equal(write(fd, "ask", 3), 3);
    bench_read_all(&bench, 0, text, 3);
    assert_memory_equal(text, "ask", 3);
    bench_write_all(&bench, 0, "answer", 6);
    fd_read_all(fd, text, 6);
    assert_memory_equal(text, "answer", 6);
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    assert_true(is_calm(&bench, 1));
}

/* A client leaves. While the terminal is not watched, another one does what `next` says. */
static void begin_with(void (*next)(void))
{
    begin();
    leave();
    when_unwatched = next;
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_expect(&bench, LINK_OPENED, 0);
}

/* A client that wrote and left meanwhile is accepted, and the next one is not confused with it. */
static void test_written_and_gone_unwatched(void **state)
{
    (void)state;
    begin_with(write_and_leave);
    assert_int_equal(read_to_end(&bench), 5);
    bench.n_queue = 0;
    expect_served(client_open(&bench));
    bench_close(&bench);
}

/* The next client comes before the link has read the bytes of the one before. It has a session of its own. */
static void test_next_after_written_and_gone(void **state)
{
    (void)state;
    begin_with(write_and_leave);
    int fd = client_open(&bench);
    char text[8];
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_expect(&bench, LINK_OPENED, 0);
    bench_read_all(&bench, 0, text, 5);
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    expect_served(client_open(&bench));
    bench_close(&bench);
}

/* A client comes unwatched. Its hang-up is seen, and its close event not yet. */
static void test_came_unwatched_left_between_looks(void **state)
{
    (void)state;
    begin_with(come);
    between_looks = leave;
    bench_expect(&bench, LINK_CLOSED, 0);
    assert_null(between_looks);
    expect_served(client_open(&bench));
    bench_close(&bench);
}

static void say_and_leave(void)
{
    assert_int_equal(write(visitor, "*RST\n", 5), 5);
    leave();
}

/* A client writes and leaves after the look for bytes, but before the look for a hang-up. Its bytes are in its session.
 */
static void test_wrote_between_looks(void **state)
{
    (void)state;
    begin();
    between_looks = say_and_leave;
    looks_for_bytes_first = 1;
    assert_int_equal(read_to_end(&bench), 5);
    assert_null(between_looks);
    bench.n_queue = 0;
    assert_true(is_calm(&bench, 1));
    expect_served(client_open(&bench));
    bench_close(&bench);
}

/* The caller has room for one event at a time, and gets all in their order. */
static void test_one_event_at_a_time(void **state)
{
    (void)state;
    static const enum link_event_kind want[] = {LINK_CLOSED, LINK_OPENED, LINK_CLOSED};
    struct link_event event;
    begin();
    leave();
    come();
    leave();
    for (size_t i = 0; i < sizeof want / sizeof want[0]; i++) {
        assert_int_equal(bench.ops->poll(bench.link, bench.wake, 0, WAIT_MS, &event, 1), 1);
        assert_int_equal(event.kind, want[i]);
        assert_int_equal(event.session, 0);
        assert_string_equal(event.peer, pty_path(&bench));
    }
    assert_int_equal(bench.ops->poll(bench.link, bench.wake, 0, 0, &event, 1), 0);
    expect_served(client_open(&bench));
    bench_close(&bench);
}

/* The system has no terminal at all, or none that works. The error names the link by its symlink, if it has one, and no
 * descriptor is left open. */
static void test_no_terminal(void **state)
{
    (void)state;
    const struct link_spec named = {.type = LINK_PTY, .path = "t"};
    const int n_open = count_open();
    has_no_pair = 1;
    expect_refused(&plain, SH_EIO, "link pty:(no symlink): no pseudo terminal: No space left on device");
    expect_refused(&named, SH_EIO, "link pty:t: no pseudo terminal: No space left on device");
    has_no_pair = 0;
    is_full = 1;
    expect_refused(&plain, SH_EIO, "inotify on /dev/pts/");
    is_full = 0;
    is_no_tty = 1;
    expect_refused(&named, SH_EIO, "link pty:t: /dev/pts/");
    expect_refused(&plain, SH_EIO, " cannot be set up: Inappropriate ioctl for device");
    is_no_tty = 0;
    assert_int_equal(count_open(), n_open);
}

/* The symlink is there before the watch, so a client that waits for it may have come already. */
static void test_came_with_the_symlink(void **state)
{
    (void)state;
    comes_early = 1;
    bench = bench_open(&plain);
    assert_int_equal(comes_early, 0);
    bench_expect(&bench, LINK_OPENED, 0);
    exchange(&bench, 0, visitor);
    leave();
    bench_expect(&bench, LINK_CLOSED, 0);
    bench_close(&bench);
}

static int fault(enum link_fault what)
{
    return bench.ops->fault(bench.link, what, 0, 0, 0.0);
}

/* A port that can't be watched when it is to come back stays unplugged, until it can. */
static void test_plugged_in_unwatched(void **state)
{
    (void)state;
    bench = bench_open(&plain);
    assert_int_equal(fault(LINK_FAULT_UNPLUG), SH_OK);
    is_full = 1;
    assert_int_equal(fault(LINK_FAULT_PLUG), SH_ESTATE);
    is_full = 0;
    assert_int_equal(fault(LINK_FAULT_PLUG), SH_OK);
    expect_served(client_open(&bench));
    bench_close(&bench);
}

/* A client is cut off, and its next terminal can't be watched. The link says that it fails. */
static void test_cut_off_unwatched(void **state)
{
    (void)state;
    struct link_event events[LINK_MAX_EVENTS];
    begin();
    is_full = 1;
    assert_int_equal(fault(LINK_FAULT_DISCONNECT), SH_ESTATE);
    is_full = 0;
    assert_int_equal(bench.ops->poll(bench.link, bench.wake, 0, 0, events, LINK_MAX_EVENTS), SH_EIO);
    leave();
    bench_close(&bench);
}

/* The system has no other terminal for a client that is to be cut off. The client keeps its own terminal, and its
 * session. */
static void test_cut_off_without_another_terminal(void **state)
{
    (void)state;
    begin();
    has_no_pair = 1;
    assert_int_equal(fault(LINK_FAULT_DISCONNECT), SH_ESTATE);
    has_no_pair = 0;
    exchange(&bench, 0, visitor);
    leave();
    bench_expect(&bench, LINK_CLOSED, 0);
    expect_served(client_open(&bench));
    bench_close(&bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_written_and_gone_unwatched),
        cmocka_unit_test(test_next_after_written_and_gone),
        cmocka_unit_test(test_came_unwatched_left_between_looks),
        cmocka_unit_test(test_wrote_between_looks),
        cmocka_unit_test(test_one_event_at_a_time),
        cmocka_unit_test(test_no_terminal),
        cmocka_unit_test(test_came_with_the_symlink),
        cmocka_unit_test(test_plugged_in_unwatched),
        cmocka_unit_test(test_cut_off_unwatched),
        cmocka_unit_test(test_cut_off_without_another_terminal),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
