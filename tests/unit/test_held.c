/* SPDX-License-Identifier: MIT */
/* Which connections a client still has after the head has ended them: those in the system's table, and those that are
 * in no table any more, which only the client's descriptors show. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <arpa/inet.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>
#include <cmocka.h>

#include "firmware_sim/app/studio/verdict/held.h"

static struct watch watch;
static struct watch_break broken[3];
static int head_fd, client_fd;
static unsigned client_port;

static void take_address(int fd, struct sockaddr_in *at)
{
    socklen_t len = sizeof *at;
    assert_int_equal(getsockname(fd, (struct sockaddr *)at, &len), 0);
}

/* A head, and a client that is connected to it. */
static int setup(void **state)
{
    (void)state;
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    const int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    client_fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (bind(listener, (struct sockaddr *)&at, sizeof at) != 0 || listen(listener, 1) != 0) return -1;
    take_address(listener, &at);
    if (connect(client_fd, (struct sockaddr *)&at, sizeof at) != 0) return -1;
    head_fd = accept(listener, NULL, NULL);
    take_address(client_fd, &at);
    client_port = ntohs(at.sin_port);
    memset(&watch, 0, sizeof watch);
    memset(broken, 0, sizeof broken);
    pthread_mutex_init(&watch.lock, NULL);
    watch.broken = broken;
    return close(listener);
}

static int teardown(void **state)
{
    (void)state;
    if (head_fd >= 0) close(head_fd);
    if (client_fd >= 0) close(client_fd);
    return pthread_mutex_destroy(&watch.lock); /* nobody holds it */
}

static void end_session_of(const char *host, unsigned port)
{
    snprintf(broken[watch.n_broken++].peer, sizeof broken[0].peer, "%s:%u", host, port);
}

static void a_client_keeps_its_end_open(void **state)
{
    (void)state;
    assert_int_equal(held_any(&watch), 0); /* no session has ended */
    end_session_of("127.0.0.1", client_port ^ 1);
    assert_int_equal(held_any(&watch), 0); /* another one's */
    end_session_of("127.0.0.2", client_port);
    assert_int_equal(held_any(&watch), 0);
    end_session_of("127.0.0.1", client_port);
    assert_int_equal(held_any(&watch), 1);
    close(head_fd);
    head_fd = -1;
    assert_int_equal(held_any(&watch), 1); /* the client has not closed its end */
    close(client_fd);
    client_fd = -1;
    assert_int_equal(held_any(&watch), 0);
}

static void who_came_back_does_not_count(void **state)
{
    (void)state;
    end_session_of("127.0.0.1", client_port);
    broken[0].back_ns = 1;
    assert_int_equal(held_any(&watch), 0);
    end_session_of("[::1]", client_port); /* only IPv4 is known */
    strcpy(broken[2].peer, "serial");
    watch.n_broken = 3;
    assert_int_equal(held_any(&watch), 0);
    broken[0].back_ns = 0;
    assert_int_equal(held_any(&watch), 1);
}

/* The head resets the connection, so it is in no table. The client, a child of this process, still has its socket. */
static void a_socket_in_no_table_is_held(void **state)
{
    (void)state;
    const struct linger at_once = {.l_onoff = 1};
    int alive[2];
    char byte;
    assert_int_equal(pipe(alive), 0);
    const pid_t client = fork();
    if (client == 0) {
        close(alive[1]);
        close(head_fd);
        while (read(alive[0], &byte, 1) > 0) /* until the test ends */
            continue;
        _exit(0);
    }
    assert_true(client > 0);
    close(alive[0]);
    close(client_fd);
    client_fd = -1;
    end_session_of("127.0.0.1", 1); /* nobody's: the table shows nothing */
    assert_int_equal(held_any(&watch), 0);
    setsockopt(head_fd, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    close(head_fd);
    head_fd = -1;
    assert_int_equal(held_any(&watch), 1);
    broken[0].back_ns = 1;
    assert_int_equal(held_any(&watch), 0); /* no session is missed, so nobody looks */
    broken[0].back_ns = 0;
    close(alive[1]);
    assert_int_equal(waitpid(client, NULL, 0), client);
    assert_int_equal(held_any(&watch), 0);
}

#define WITH_CLIENT(test) cmocka_unit_test_setup_teardown(test, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        WITH_CLIENT(a_client_keeps_its_end_open),
        WITH_CLIENT(who_came_back_does_not_count),
        WITH_CLIENT(a_socket_in_no_table_is_held),
    };
    return cmocka_run_group_tests_name("held connections", tests, NULL, NULL);
}
