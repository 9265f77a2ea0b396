/* SPDX-License-Identifier: MIT */
/* Properties of every TCP socket of a head, for any link: a peer that vanishes without a word is noticed, and one that
 * comes when there are no descriptors is turned away. The test finds the link's end of a connection among this
 * process's own descriptors. */
#include "tests/unit/link_test.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <pthread.h>
#include <stdatomic.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>

#include "drivers/socket/socket.h"
#include "drivers/usb/backend.h"

enum { MAX_FD = 1024, NOTICED_S = 60 };

static int connect_to(const struct bench *bench, const char *path)
{
    if (path[0] == '\0') return dial(bench_port(bench));
    struct sockaddr_un local = {.sun_family = AF_UNIX};
    snprintf(local.sun_path, sizeof local.sun_path, "%s", path);
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(connect(fd, (struct sockaddr *)&local, sizeof local), 0);
    return fd;
}

/* Returns the link's end of the connection; -1: it is not accepted yet. */
static int other_end(int fd)
{
    struct sockaddr_in mine, peer;
    socklen_t len = sizeof mine;
    assert_int_equal(getsockname(fd, (struct sockaddr *)&mine, &len), 0);
    for (int i = 3; i < MAX_FD; i++) {
        len = sizeof peer;
        if (i != fd && getpeername(i, (struct sockaddr *)&peer, &len) == 0 && peer.sin_family == AF_INET &&
            peer.sin_port == mine.sin_port)
            return i;
    }
    return -1;
}

static int option(int fd, int level, int name)
{
    int value = 0;
    socklen_t len = sizeof value;
    assert_int_equal(getsockopt(fd, level, name, &value, &len), 0);
    return value;
}

/* impatient: a peer that vanishes is noticed with bytes under way, too. Otherwise a peer that only rests is not cut
 * off. */
static void check(const struct link_spec *spec, int impatient)
{
    struct bench bench = bench_open(spec);
    int fd = connect_to(&bench, spec->path), end = -1;
    for (const int64_t end_ms = now_ms() + DEADLINE_MS; end < 0; end = other_end(fd)) {
        assert_true(now_ms() < end_ms);
        bench.n_queue = 0;
        bench_poll(&bench, 0, 1);
    }
    assert_int_equal(option(end, SOL_SOCKET, SO_KEEPALIVE), 1);
    assert_int_equal(option(end, IPPROTO_TCP, TCP_NODELAY), 1);
    const int idle_s = option(end, IPPROTO_TCP, TCP_KEEPIDLE), interval_s = option(end, IPPROTO_TCP, TCP_KEEPINTVL),
              probes = option(end, IPPROTO_TCP, TCP_KEEPCNT);
    assert_in_range(idle_s + interval_s * probes, 1, NOTICED_S);
    const int timeout_ms = option(end, IPPROTO_TCP, TCP_USER_TIMEOUT);
    assert_in_range(timeout_ms, impatient ? 1 : 0, impatient ? NOTICED_S * 1000 : 0);
    close(fd);
    bench.n_queue = 0;
    bench_poll(&bench, 0, 0);
    bench_close(&bench);
}

/* One client after the other finds no descriptor. Each client is turned away and reported, and none is left to wake the
 * link again. */
static void starve(const struct link_spec *spec)
{
    enum { CLIENTS = 5, HOGS = 64 };
    struct bench bench = bench_open(spec);
    struct rlimit before, few;
    int fd[CLIENTS], hog[HOGS], n_hogs = 0;
    bench_poll(&bench, 0, 0); /* which takes what it needs for itself */
    for (int i = 0; i < CLIENTS; i++)
        fd[i] = connect_to(&bench, spec->path);
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &before), 0);
    few = (struct rlimit){.rlim_cur = (rlim_t)fd[CLIENTS - 1] + 8, .rlim_max = before.rlim_max};
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &few), 0);
    while (n_hogs < HOGS && (hog[n_hogs] = dup(fd[0])) >= 0)
        n_hogs++;
    int n_refused = 0;
    for (int polls = 0; polls < 10 * CLIENTS; polls++) { /* all of them have come; a poll takes several */
        bench.n_queue = 0;
        bench_poll(&bench, 0, 0);
        for (int i = 0; i < bench.n_queue; i++) {
            assert_int_equal(bench.queue[i].kind, LINK_REFUSED);
            const char *who = spec->path[0] != '\0' ? "a local client" : "127.0.0.1:";
            assert_memory_equal(bench.queue[i].peer, who, strlen(who));
            n_refused++;
        }
    }
    while (n_hogs > 0)
        close(hog[--n_hogs]);
    setrlimit(RLIMIT_NOFILE, &before);
    assert_int_equal(n_refused, CLIENTS);
    for (int i = 0; i < CLIENTS; i++) {
        char byte;
        assert_int_equal(recv(fd[i], &byte, 1, MSG_DONTWAIT), 0);
        close(fd[i]);
    }
    fd[0] = connect_to(&bench, spec->path); /* the next one is accepted */
    bench.n_queue = 0;
    bench_poll(&bench, 0, 0);
    for (int i = 0; i < bench.n_queue; i++)
        assert_int_not_equal(bench.queue[i].kind, LINK_REFUSED);
    close(fd[0]);
    bench_close(&bench);
}

static void test_tcp(void **state)
{
    (void)state;
    const struct link_spec spec = {.type = LINK_TCP, .max_sessions = 1};
    check(&spec, 0);
    starve(&spec);
}

static void test_usbip(void **state)
{
    (void)state;
    const struct link_spec spec = {.type = LINK_USB, .backend = USB_BACKEND_USBIP, .vid = 1};
    check(&spec, 1);
    starve(&spec);
}

static void test_usbredir(void **state)
{
    (void)state;
#ifdef HAVE_USBREDIR
    struct link_spec spec = {.type = LINK_USB, .backend = USB_BACKEND_USBREDIR, .vid = 1};
    check(&spec, 0);
    starve(&spec);
    snprintf(spec.path, sizeof spec.path, "/tmp/scanhead-test-%d.usbredir", (int)getpid());
    starve(&spec);
#else
    print_message("# needs libusbredirparser-dev\n");
    skip();
#endif
}

enum { IN_VAIN = 100 };
struct door {
    int listener, reserve, n_turned_away;
    atomic_int *go;
};

static void *turn_away(void *arg)
{
    struct door *door = arg;
    int fd;
    for (atomic_fetch_sub(door->go, 1); atomic_load(door->go) > 0;)
        ;
    while (socket_accept(door->listener, &door->reserve, &fd, NULL, NULL) && fd < 0)
        door->n_turned_away++;
    return NULL;
}

/* Two threads are without descriptors. Neither takes the one that the other gives up for a moment. */
static void starve_two_doors(void)
{
    int client[2 * IN_VAIN], n = 0;
    atomic_int go = 2;
    struct door door[2];
    struct rlimit before, few;
    pthread_t thread[2];
    for (int i = 0; i < 2; i++) {
        const struct socket_place place = {.what = "test", .host = ""};
        struct sh_err err;
        struct sockaddr_storage at;
        socklen_t len = sizeof at;
        door[i] = (struct door){.reserve = socket_reserve(), .go = &go};
        assert_int_equal(socket_open(&place, &door[i].listener, (char[64]){0}, 64, &err), SH_OK);
        assert_int_equal(getsockname(door[i].listener, (struct sockaddr *)&at, &len), 0);
        for (int k = 0; k < IN_VAIN; k++, n++) {
            client[n] = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
            assert_int_equal(connect(client[n], (struct sockaddr *)&at, len), 0);
        }
    }
    assert_int_equal(getrlimit(RLIMIT_NOFILE, &before), 0);
    few = (struct rlimit){.rlim_cur = (rlim_t)client[n - 1] + 1, .rlim_max = before.rlim_max};
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &few), 0);
    for (int i = 0; i < 2; i++)
        assert_int_equal(pthread_create(&thread[i], NULL, turn_away, &door[i]), 0);
    for (int i = 0; i < 2; i++)
        pthread_join(thread[i], NULL);
    setrlimit(RLIMIT_NOFILE, &before);
    while (n > 0)
        close(client[--n]);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(door[i].n_turned_away, IN_VAIN);
        assert_true(door[i].reserve >= 0);
        close(door[i].reserve);
        close(door[i].listener);
    }
}

/* If the threads took no turns, one round in three would fail on an idle machine of two processors. */
static void test_two_doors(void **state)
{
    (void)state;
    for (int round = 0; round < 10; round++)
        starve_two_doors();
}

static void test_web(void **state)
{
    (void)state;
    starve(&(struct link_spec){.type = LINK_WEB, .max_sessions = 1});
}

/* If clients come for a request, the one that has been silent for longest makes room. Otherwise none does. */
static void test_brief(void **state)
{
    (void)state;
    for (int brief = 0; brief < 2; brief++) {
        struct bench bench = bench_open(&(struct link_spec){.type = LINK_TCP, .max_sessions = 2, .brief = brief});
        char bytes[2];
        int first = dial(bench_port(&bench)), fd[2] = {-1, -1};
        bench_expect(&bench, LINK_OPENED, 0);
        fd[0] = dial(bench_port(&bench));
        bench_expect(&bench, LINK_OPENED, 0);
        assert_int_equal(send(first, "GE", 2, MSG_NOSIGNAL), 2); /* so that the other one is silent */
        bench_read_all(&bench, 0, bytes, 2);
        fd[1] = dial(bench_port(&bench));
        if (brief) {
            assert_int_equal(bench_expect(&bench, LINK_CLOSED, 0).session, 1);
            assert_int_equal(bench_expect(&bench, LINK_OPENED, 0).session, 1);
        } else {
            bench_expect(&bench, LINK_REFUSED, 0);
        }
        assert_int_equal(fd_read(brief ? fd[0] : fd[1], bytes, 1), 0);
        close(first);
        close(fd[0]);
        close(fd[1]);
        bench_close(&bench);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_tcp), cmocka_unit_test(test_usbip),     cmocka_unit_test(test_usbredir),
        cmocka_unit_test(test_web), cmocka_unit_test(test_two_doors), cmocka_unit_test(test_brief),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
