/* SPDX-License-Identifier: MIT */
/* `scanhead view` in this process, until a signal ends it. A browser asks it meanwhile, in a thread of its own: over
 * HTTP, and by a WebSocket (RFC 6455) whose messages have no effect. */
#include "tests/unit/commands_rig.h"

#include <arpa/inet.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

static int go_there(void **state)
{
    (void)state;
    if (commands_begin() != 0) return -1;
    write_text("a.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\n"
                        "property double z\nend_header\n1 2 3\nnan nan nan\n4 5 6\n");
    return 0;
}

/* ---- the browser; no assertion of cmocka may fail in its thread, so it keeps what it got */

struct browser {
    pthread_t command; /* the thread that runs it */
    int ready_fd;
    char ready[256], head[2][4096], hello[512];
};

static int dial(int port)
{
    const struct sockaddr_in to = {
        .sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    const struct timeval limit = {.tv_sec = 20}; /* it only ends a wait without an answer */
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    return connect(fd, (const struct sockaddr *)&to, sizeof to) == 0 ? fd : -1;
}

/* Sends a request, and reads up to `until`, or to the end. */
static int ask(int port, const char *request, const char *until, char *to, size_t cap)
{
    const int fd = dial(port);
    size_t len = 0;
    if (fd < 0 || write(fd, request, strlen(request)) < 0) return fd;
    while (len + 1 < cap && (until == NULL || strstr(to, until) == NULL)) {
        const ssize_t n = read(fd, to + len, cap - 1 - len);
        if (n <= 0) break;
        len += (size_t)n;
        to[len] = '\0';
    }
    return fd;
}

static void *browse(void *browser)
{
    static const uint8_t message[] = {0x81, 0x85, 0, 0, 0, 0, 'h', 'e', 'l', 'l', 'o'}; /* masked with zeros */
    struct browser *b = browser;
    char request[512];
    int port = 0;
    if (read(b->ready_fd, b->ready, sizeof b->ready - 1) > 0)
        sscanf(b->ready, "{\"endpoints\":[{\"type\":\"web\",\"endpoint\":\"http://127.0.0.1:%d/", &port);
    snprintf(request, sizeof request, "GET /head HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nConnection: close\r\n\r\n", port);
    close(ask(port, request, NULL, b->head[0], sizeof b->head[0]));
    char upgrade[512];
    snprintf(upgrade, sizeof upgrade,
             "GET /ws HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
             "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n",
             port);
    const int fd = ask(port, upgrade, "\r\n\r\n", b->hello, sizeof b->hello);
    for (int i = 0; i < 3 && fd >= 0; i++)
        if (write(fd, message, sizeof message) < 0) break;
    close(ask(port, request, NULL, b->head[1], sizeof b->head[1])); /* it goes on after the messages */
    close(fd);
    pthread_kill(b->command, SIGTERM);
    return NULL;
}

/* ---- the command */

static void a_page_is_served_until_a_signal(void **state)
{
    (void)state;
    struct browser b = {.command = pthread_self()};
    pthread_t thread;
    char words[64], want[128];
    int fd[2], port;
    assert_int_equal(pipe(fd), 0);
    b.ready_fd = fd[0];
    assert_int_equal(pthread_create(&thread, NULL, browse, &b), 0);
    snprintf(words, sizeof words, "a.ply --ready-fd %d", fd[1]);
    does(&app_view, words, 0);
    pthread_join(thread, NULL);
    close(fd[0]);
    assert_int_equal(close(fd[1]), -1); /* it was given away */
    assert_int_equal(sscanf(on_out, "http://127.0.0.1:%d/", &port), 1);
    snprintf(want, sizeof want, "http://127.0.0.1:%d/\n", port);
    assert_string_equal(on_out, want);
    snprintf(want, sizeof want, "{\"endpoints\":[{\"type\":\"web\",\"endpoint\":\"http://127.0.0.1:%d/\"}]}\n", port);
    assert_string_equal(b.ready, want);
    assert_string_equal(on_err, "scanhead: a.ply: 2 points, 1 shots without echo, 0 triangles in 0 meshes\n");
    for (int i = 0; i < 2; i++) {
        assert_int_equal(strncmp(b.head[i], "HTTP/1.1 200 ", 13), 0);
        has(b.head[i], "\"file\":\"a.ply\"");
        has(b.head[i], "\"points\":2,");
    }
    assert_int_equal(strncmp(b.hello, "HTTP/1.1 101 ", 13), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_page_is_served_until_a_signal)};
    return cmocka_run_group_tests_name("view command", tests, go_there, commands_end);
}
