/* SPDX-License-Identifier: MIT */
/* Connections that a client still has after the head has ended them: real ones on the loopback, both ends of which are
 * in this process. The client's processes are this one, or none. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>
#include <cmocka.h>

#include "firmware_sim/app/studio/verdict/family.h"
#include "firmware_sim/app/studio/verdict/held.h"

enum { MOST = 256 }; /* so many sessions are looked at */

static struct watch watch;
static struct watch_break broken[MOST];
static int has_family, listener = -1, head = -1, client = -1;
static char peer[64]; /* of the client's end */

int family_any(int (*see)(void *ctx, pid_t pid), void *ctx)
{
    return has_family && see(ctx, getpid());
}

static void name_of(int fd, struct sockaddr_in *at)
{
    socklen_t len = sizeof *at;
    assert_int_equal(getsockname(fd, (struct sockaddr *)at, &len), 0);
}

static int begin(void **state)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    (void)state;
    listener = socket(AF_INET, SOCK_STREAM, 0);
    client = socket(AF_INET, SOCK_STREAM, 0);
    assert_int_equal(bind(listener, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(listen(listener, 1), 0);
    name_of(listener, &at);
    assert_int_equal(connect(client, (struct sockaddr *)&at, sizeof at), 0);
    head = accept(listener, NULL, NULL);
    assert_true(head >= 0);
    name_of(client, &at);
    snprintf(peer, sizeof peer, "127.0.0.1:%u", ntohs(at.sin_port));
    memset(broken, 0, sizeof broken);
    watch = (struct watch){.broken = broken, .n_broken = 1};
    pthread_mutex_init(&watch.lock, NULL);
    strcpy(broken[0].peer, peer);
    has_family = 0;
    return 0;
}

static int end(void **state)
{
    (void)state;
    close(listener);
    if (head >= 0) close(head);
    if (client >= 0) close(client);
    return 0;
}

static void expect_held(int held)
{
    assert_int_equal(held_any(&watch), held);
    assert_int_equal(pthread_mutex_trylock(&watch.lock), 0);
    pthread_mutex_unlock(&watch.lock);
}

static void close_end(int *fd)
{
    close(*fd);
    *fd = -1;
}

static void an_open_connection(void **state)
{
    (void)state;
    expect_held(1);
    close_end(&head); /* the client's end is open still */
    expect_held(1);
    close_end(&client);
    expect_held(0);
}

static void a_connection_that_the_client_closed(void **state)
{
    (void)state;
    assert_int_equal(shutdown(client, SHUT_WR), 0);
    expect_held(0);
}

/* Sessions after which the client came back do not count, nor do those of other addresses. */
static void other_sessions(void **state)
{
    static const char *const others[] = {"127.0.0.1:1", "[::1]:5", "/dev/pts/3", "", "usb", "127.0.0:5"};
    (void)state;
    broken[0].back_ns = 1;
    expect_held(0);
    broken[0].back_ns = 0;
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
        strcpy(broken[0].peer, others[i]);
        expect_held(0);
    }
    snprintf(broken[0].peer, sizeof broken[0].peer, "127.0.0.2%s", strrchr(peer, ':'));
    expect_held(0);
    watch.n_broken = MOST;
    strcpy(broken[MOST - 1].peer, peer);
    expect_held(1);
    watch.n_broken--;
    expect_held(0);
}

/* After an abrupt end the client's socket is in no table: only its descriptor shows it. */
static void a_dead_connection(void **state)
{
    const struct linger at_once = {.l_onoff = 1};
    (void)state;
    setsockopt(head, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    close_end(&head);
    expect_held(0);
    has_family = 1;
    expect_held(1);
    broken[0].back_ns = 1; /* nobody is away, so nothing is looked at */
    expect_held(0);
    broken[0].back_ns = 0;
    close_end(&client);
    expect_held(0);
}

/* Sockets of other kinds are in their tables, and other descriptors are none. */
static void living_descriptors(void **state)
{
    const struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    int pair[2], tube[2];
    const int udp = socket(AF_INET, SOCK_DGRAM, 0);
    (void)state;
    close_end(&client);
    close_end(&head);
    assert_int_equal(bind(udp, (const struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, pair), 0);
    assert_int_equal(pipe(tube), 0);
    has_family = 1;
    expect_held(0);
    for (int i = 0; i < 2; i++) {
        close(pair[i]);
        close(tube[i]);
    }
    close(udp);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(an_open_connection, begin, end),
        cmocka_unit_test_setup_teardown(a_connection_that_the_client_closed, begin, end),
        cmocka_unit_test_setup_teardown(other_sessions, begin, end),
        cmocka_unit_test_setup_teardown(a_dead_connection, begin, end),
        cmocka_unit_test_setup_teardown(living_descriptors, begin, end),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
