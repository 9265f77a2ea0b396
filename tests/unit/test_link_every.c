/* SPDX-License-Identifier: MIT */
/* Links of all types: they give back every descriptor when they are closed, with a client or without, and when they
 * can't be opened. Their owner can wake each. */
#include "tests/unit/link_test.h"

#include <dirent.h>
#include <fcntl.h>
#include <libwebsockets.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include "drivers/link/memory.h"
#include "drivers/usb/backend.h"

static char *dir;
static struct link_memory memory;

static int make_dir(void **state)
{
    (void)state;
    dir = test_dir();
    return 0;
}

static int remove_dir(void **state)
{
    static const char *const names[] = {"file", "port", "redir"};
    char path[120];
    (void)state;
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        snprintf(path, sizeof path, "%s/%s", dir, names[i]);
        unlink(path);
    }
    return rmdir(dir);
}

static struct link_spec at(struct link_spec spec, const char *name)
{
    snprintf(spec.path, sizeof spec.path, "%s/%s", dir, name);
    return spec;
}

enum { N_SPECS = 10 };

static void list_specs(struct link_spec specs[N_SPECS])
{
    const struct link_spec usb = {.type = LINK_USB, .vid = 1, .own_serial = 1, .whose = "test_link_every"};
    struct link_spec redir = usb, usbip = usb;
    redir.backend = USB_BACKEND_USBREDIR;
    usbip.backend = USB_BACKEND_USBIP;
    const struct link_spec all[N_SPECS] = {{.type = LINK_NULL},
                                           at((struct link_spec){.type = LINK_FILE}, "file"),
                                           at((struct link_spec){.type = LINK_PTY}, "port"),
                                           {.type = LINK_TCP, .max_sessions = 2},
                                           {.type = LINK_WEB, .max_sessions = 2},
                                           {.type = LINK_UDP, .port = 9},
                                           {.type = LINK_MEMORY, .memory = &memory},
                                           usbip,
                                           redir,
                                           at(redir, "redir")};
    memcpy(specs, all, sizeof all);
}

static int count_open(void)
{
    int n = 0;
    DIR *fds = opendir("/proc/self/fd");
    assert_non_null(fds);
    while (readdir(fds) != NULL)
        n++;
    closedir(fds);
    return n;
}

/* Fails where the link has kept a descriptor. `before` is how many were open. libwebsockets 4.3 may add one: it keeps
 * the eventfd of each context that it ends (4.1 does not). */
static void expect_open(const struct link_spec *spec, const char *what, int *before)
{
    const int now = count_open();
    if (spec->type == LINK_WEB && LWS_LIBRARY_VERSION_NUMBER >= 4003000 && now == *before + 1) *before = now;
    if (now != *before)
        fail_msg("%s, %s: %d descriptors were open, now %d", link_ops_get(spec->type)->name, what, *before, now);
}

/* The owner is woken once, however often it was signalled since the last time. */
static void wake_up(struct bench *bench)
{
    uint64_t count = 1;
    for (int round = 0; round < 2; round++) {
        int n_woken = 0;
        assert_int_equal(write(bench->wake, &count, sizeof count), sizeof count);
        for (int i = 0; i < 5; i++) {
            bench_poll(bench, 0, n_woken ? 0 : 1000);
            for (int k = 0; k < bench->n_queue; k++)
                n_woken += bench->queue[k].kind == LINK_WOKEN;
            bench->n_queue = 0;
        }
        assert_int_equal(n_woken, 1);
        assert_int_equal(read(bench->wake, &count, sizeof count), -1);
        count = 3;
    }
}

/* Opens a link, lets a client come where there is a port, and closes it. */
static void use(const struct link_spec *spec, int with_client)
{
    struct bench bench = bench_open(spec);
    char endpoint[300];
    bench.wake = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    bench.ops->endpoint(bench.link, endpoint, sizeof endpoint);
    const int fd =
        with_client && strstr(endpoint, "127.0.0.1:") != NULL && spec->type != LINK_UDP ? dial(bench_port(&bench)) : -1;
    for (int i = 0; i < 3; i++)
        bench_poll(&bench, 0, 1);
    wake_up(&bench);
    if (fd >= 0) close(fd); /* else some links would wait for the client */
    for (int i = 0; i < 3; i++)
        bench_poll(&bench, 0, 1);
    bench_close(&bench);
    close(bench.wake);
}

static void test_closing(void **state)
{
    struct link_spec specs[N_SPECS];
    (void)state;
    list_specs(specs);
    for (size_t i = 0; i < N_SPECS; i++) {
        use(&specs[i], 0); /* libraries that are loaded once may keep something */
        int before = count_open();
        for (int with_client = 0; with_client <= 1; with_client++) {
            memory = (struct link_memory){0};
            use(&specs[i], with_client);
            expect_open(&specs[i], with_client ? "with a client" : "alone", &before);
        }
    }
}

static void test_failing(void **state)
{
    struct link_spec specs[N_SPECS];
    struct sh_err err;
    void *none;
    (void)state;
    list_specs(specs);
    for (size_t i = 0; i < N_SPECS; i++) {
        struct link_spec *spec = &specs[i];
        if (spec->type == LINK_NULL || spec->type == LINK_MEMORY) continue;
        if (spec->type == LINK_UDP) snprintf(spec->source, sizeof spec->source, "192.0.2.1"); /* nobody's: RFC 5737 */
        struct bench bench = {.link = NULL};
        if (spec->type != LINK_UDP) bench = bench_open(spec); /* takes the place */
        if (spec->type != LINK_UDP && spec->path[0] == '\0') spec->port = bench_port(&bench);
        if (spec->type == LINK_PTY) snprintf(spec->path, sizeof spec->path, "%s", dir); /* a folder is there */
        const int before = count_open();
        const struct link_ops *ops = link_ops_get(spec->type);
        if (ops->open(spec, &none, &err) == SH_OK) fail_msg("%s opens twice", ops->name);
        if (count_open() != before)
            fail_msg("%s: %s: %d descriptors were open, now %d", ops->name, err.text, before, count_open());
        if (bench.link != NULL) bench_close(&bench);
    }
}

static void expect_text(const struct link_spec *spec, const char *text)
{
    struct sh_err err = {0, ""};
    void *link;
    assert_int_equal(link_ops_get(spec->type)->open(spec, &link, &err), SH_EINPUT);
    assert_string_equal(err.text, text);
}

/* The error of a wrong spec says what is wrong, where, and what is allowed. */
static void test_texts(void **state)
{
    (void)state;
    int fd[2];
    char text[300];
    expect_text(&(struct link_spec){.type = LINK_FD, .fd = 999},
                "link fd:999: not an open socket: Bad file descriptor");
    assert_int_equal(pipe(fd), 0);
    snprintf(text, sizeof text, "link fd:%d: not an open socket: Socket operation on non-socket", fd[0]);
    expect_text(&(struct link_spec){.type = LINK_FD, .fd = fd[0]}, text);
    close(fd[0]);
    close(fd[1]);
    assert_int_equal(socketpair(AF_UNIX, SOCK_DGRAM, 0, fd), 0);
    snprintf(text, sizeof text, "link fd:%d: not a stream socket", fd[0]);
    expect_text(&(struct link_spec){.type = LINK_FD, .fd = fd[0]}, text);
    close(fd[0]);
    close(fd[1]);
    expect_text(&(struct link_spec){.type = LINK_FILE}, "link file: a path is needed");
    static const struct {
        struct link_spec spec;
        const char *text;
    } rows[] = {
        {{.type = LINK_TCP, .port = 65536, .max_sessions = 1},
         "link tcp:127.0.0.1:65536: allowed ports are 0 to 65535"},
        {{.type = LINK_TCP, .port = -1, .max_sessions = 1}, "link tcp:127.0.0.1:-1: allowed ports are 0 to 65535"},
        {{.type = LINK_TCP, .max_sessions = 0}, "link tcp:127.0.0.1:0: 0 sessions; allowed are 1 to 8"},
        {{.type = LINK_WEB, .address = "localhost", .max_sessions = 9},
         "link web:localhost:0: 9 sessions; allowed are 1 to 8"},
        {{.type = LINK_USB, .personality = 99}, "link usb: no such USB identity"},
        {{.type = LINK_USB, .backend = 99}, "link usb: this build does not have that back end"},
        {{.type = LINK_UDP, .address = "255.255.255.255", .port = 9},
         "link udp:255.255.255.255:9: a broadcast needs the key interface: the interface that sends it"},
        {{.type = LINK_UDP, .address = "127.0.0.1", .port = 9, .interface = "no-such-if"},
         "link udp:127.0.0.1:9: interface no-such-if doesn't exist, or has no address of the receiver's family"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        expect_text(&rows[i].spec, rows[i].text);
    struct link_spec fifo = at((struct link_spec){.type = LINK_FILE}, "fifo");
    assert_int_equal(mkfifo(fifo.path, 0600), 0);
    const int reader = open(fifo.path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    snprintf(text, sizeof text,
             "link file:%.200s: neither a regular file nor a character device; use a pty or tcp link", fifo.path);
    expect_text(&fifo, text);
    close(reader);
    unlink(fifo.path);
    struct link_spec missing = at((struct link_spec){.type = LINK_PTY}, "no/port");
    snprintf(text, sizeof text, "link pty:%.200s: the symlink cannot be made: No such file or directory", missing.path);
    expect_text(&missing, text);
}

/* Whether one of the first polls reports the wake-up. */
static int hears(const struct link_ops *ops, void *link, int wake)
{
    struct link_event events[LINK_MAX_EVENTS];
    for (int turn = 0; turn < 3; turn++) {
        const int n = ops->poll(link, wake, 0, 0, events, LINK_MAX_EVENTS);
        for (int i = 0; i < n; i++)
            if (events[i].kind == LINK_WOKEN) return 1;
        if (n < 0) return 0;
    }
    return 0;
}

enum { FEW = 16 };

/* Sets the limit so that `left` descriptors are free below it. A library may keep some of those that it opened before. */
static void leave_descriptors(int left, rlim_t max)
{
    int fd[FEW + 1], n = 0;
    do
        fd[n] = open("/dev/null", O_RDONLY | O_CLOEXEC);
    while (n++ < left);
    const struct rlimit few = {.rlim_cur = (rlim_t)fd[n - 1], .rlim_max = max};
    while (n > 0)
        close(fd[--n]);
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &few), 0);
}

/* The process has only a few descriptors left, from none to as many as it takes. The link opens and then waits with its
 * owner's wake-up, for which it needs no further one. Or it says why not, and keeps nothing. */
static void test_few_descriptors(void **state)
{
    struct link_spec specs[N_SPECS];
    struct rlimit before;
    (void)state;
    list_specs(specs);
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &before), 0);
    int n_open = count_open();
    for (size_t i = 0; i < N_SPECS; i++) {
        const struct link_ops *ops = link_ops_get(specs[i].type);
        for (int left = 0; left <= FEW; left++) {
            const int wake = eventfd(1, EFD_CLOEXEC | EFD_NONBLOCK);
            struct sh_err err = {0, ""};
            void *link;
            leave_descriptors(left, before.rlim_max);
            const int rc = ops->open(&specs[i], &link, &err);
            const int is_woken = rc == SH_OK && hears(ops, link, wake);
            if (rc == SH_OK) ops->close(link);
            assert_int_equal(setrlimit(RLIMIT_NOFILE, &before), 0);
            close(wake);
            if (rc != SH_OK && (err.text[0] == '\0' || strchr(err.text, '\n') != NULL))
                fail_msg("%s: \"%s\" is no reason", ops->name, err.text);
            if (rc == SH_OK && !is_woken) fail_msg("%s: no wake-up with %d descriptors left", ops->name, left);
            if (rc != SH_OK && left == FEW) fail_msg("%s: %s", ops->name, err.text);
            expect_open(&specs[i], err.text, &n_open);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_closing), cmocka_unit_test(test_failing),
                                       cmocka_unit_test(test_texts), cmocka_unit_test(test_few_descriptors)};
    return cmocka_run_group_tests(tests, make_dir, remove_dir);
}
