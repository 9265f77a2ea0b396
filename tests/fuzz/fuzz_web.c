/* SPDX-License-Identifier: MIT */
/* This fuzzes the web link with the bytes of one client, over a socket of this machine. The input is a byte, then a
 * request, and after an upgrade WebSocket frames. `@HOST@` becomes the link's own address. The link must go on, and the
 * client's session must end with it. libwebsockets itself is not instrumented, but our code around it is. */
#include <arpa/inet.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/link/link.h"
#include "drivers/link/web.h"
#include "tests/fuzz/rig.h"

enum { MAX_INPUT = 12000, MAX_TURNS = 24 };

static struct {
    const struct link_ops *ops;
    void *link;
    char host[64];
    int port;
} web;

static int get(void *ctx, const char *path, const char *query, struct web_body *out, struct sh_err *err)
{
    (void)ctx;
    if (strcmp(path, "/scene") != 0) return SH_EINPUT;
    if (query[0] == 'x') return sh_fail(err, SH_EINPUT, "%.40s: not a number", query);
    out->len = query[0] == 'b' ? 300000 : 5;
    out->type = "application/octet-stream";
    out->bytes = malloc(out->len);
    memset(out->bytes, 'b', out->len);
    return SH_OK;
}

static void open_web(void)
{
    static const struct web_source source = {.get = get};
    static const struct link_spec spec = {.type = LINK_WEB, .max_sessions = 2, .web = &source};
    struct sh_err err = {0};
    char url[128];
    web.ops = link_ops_get(LINK_WEB);
    if (web.ops->open(&spec, &web.link, &err) != SH_OK) {
        fprintf(stderr, "%s\n", err.text);
        exit(1);
    }
    web.ops->endpoint(web.link, url, sizeof url);
    if (sscanf(url, "http://%63[0-9.:]/", web.host) != 1) exit(1);
    web.port = atoi(strchr(web.host, ':') + 1);
}

static int dial(void)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)web.port)};
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const struct linger abort_it = {1, 0}; /* keeps no address in use for a minute */
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    while (fd >= 0 && connect(fd, (struct sockaddr *)&at, sizeof at) != 0) {
        const int is_alarm = errno == EINTR; /* libFuzzer's own clock */
        close(fd);
        fd = is_alarm ? socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0) : -1;
    }
    if (fd < 0) {
        perror("connect");
        exit(1);
    }
    setsockopt(fd, SOL_SOCKET, SO_LINGER, &abort_it, sizeof abort_it);
    return fd;
}

/* Runs one turn of the link: reads what it has for the owner, and answers. */
static int turn(void)
{
    struct link_event event[LINK_MAX_EVENTS];
    char bytes[2048];
    const int n = web.ops->poll(web.link, -1, 3, 0, event, LINK_MAX_EVENTS);
    fuzz_must(n >= 0 && n <= LINK_MAX_EVENTS, "the link goes on");
    for (int i = 0; i < n; i++) {
        const int session = event[i].session;
        if (event[i].kind == LINK_READABLE) {
            const ssize_t got = web.ops->read(web.link, session, bytes, sizeof bytes);
            fuzz_must(got <= (ssize_t)sizeof bytes, "no more is read than asked for");
            if (got > 0) web.ops->write(web.link, session, "OK\r\n", 4);
        } else if (event[i].kind == LINK_OPENED) {
            web.ops->write(web.link, session, "\xd5 frame", 7);
        }
    }
    return n;
}

static size_t fill_in_host(const uint8_t *data, size_t size, uint8_t *out, size_t room)
{
    size_t n = 0;
    for (size_t i = 0; i < size && n < room; i++) {
        const size_t len = strlen(web.host);
        if (size - i >= 6 && memcmp(data + i, "@HOST@", 6) == 0 && room - n > len) {
            memcpy(out + n, web.host, len);
            n += len;
            i += 5;
        } else {
            out[n++] = data[i];
        }
    }
    return n;
}

static void drain(int fd)
{
    static char bytes[1 << 16];
    while (recv(fd, bytes, sizeof bytes, MSG_DONTWAIT) > 0)
        continue;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t bytes[MAX_INPUT];
    struct fuzz_bytes in = {data, size};
    const unsigned how = fuzz_u8(&in);
    if (web.ops == NULL) open_web();
    const size_t n = fill_in_host(in.p, in.n, bytes, sizeof bytes), first = n * (how & 15) / 15;
    const int fd = dial();
    if (first > 0 && send(fd, bytes, first, MSG_DONTWAIT | MSG_NOSIGNAL) < 0) abort();
    for (int i = 0; i < 4; i++)
        turn();
    if (n > first) send(fd, bytes + first, n - first, MSG_DONTWAIT | MSG_NOSIGNAL);
    for (int i = 0; i < MAX_TURNS / 3; i++) {
        turn();
        drain(fd);
    }
    if ((how & 16) != 0) shutdown(fd, SHUT_WR);
    for (int i = 0; i < 2; i++)
        turn();
    close(fd);
    for (int i = 0; i < MAX_TURNS && turn() > 0; i++)
        continue;
    return 0;
}
