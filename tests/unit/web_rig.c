/* SPDX-License-Identifier: MIT */
#include "tests/unit/web_rig.h"

#include <arpa/inet.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

static int echo(const char *path, const char *query, struct web_body *out)
{
    *out = (struct web_body){.type = "text/plain"};
    const int len = asprintf(&out->bytes, "%s?%s", path, query);
    out->len = len > 0 ? (size_t)len : 0;
    return len > 0 ? SH_OK : SH_ENOMEM;
}

static int get(void *ctx, const char *path, const char *query, struct web_body *out, struct sh_err *err)
{
    (void)ctx;
    if (strncmp(path, "/echo", 5) == 0) return echo(path, query, out);
    if (strcmp(path, "/scene") != 0) return SH_EINPUT;
    if (strcmp(query, "a=1&b=2&c=3") == 0) return sh_fail(err, SH_EINPUT, "three words");
    if (strcmp(query, "n=x") == 0) return sh_fail(err, SH_EINPUT, "n=x: not a number");
    if (strcmp(query, "n=no") == 0) return sh_fail(err, SH_ENOMEM, "no memory");
    out->len = strcmp(query, "n=big") == 0 ? 3000000 : 5;
    out->type = "application/octet-stream";
    out->bytes = malloc(out->len);
    memset(out->bytes, 'b', out->len);
    return SH_OK;
}

int web_n_released;

static void release(void *ctx, char *bytes)
{
    (void)ctx;
    free(bytes);
    web_n_released++;
}

static const struct web_source source = {.get = get, .release = release};
static const struct link_spec spec = {.type = LINK_WEB, .max_sessions = WEB_SESSIONS, .web = &source};

struct bench web_open(char place[64])
{
    struct bench bench = bench_open(&spec);
    char url[128];
    bench.ops->endpoint(bench.link, url, sizeof url);
    assert_int_equal(sscanf(url, "http://%63[0-9.:]/", place), 1);
    return bench;
}

int web_dial_from(const char *place, uint8_t last)
{
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    struct sockaddr_in from = {.sin_family = AF_INET};
    from.sin_addr.s_addr = htonl(INADDR_LOOPBACK - 1 + last);
    assert_int_equal(bind(fd, (struct sockaddr *)&from, sizeof from), 0);
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)atoi(strchr(place, ':') + 1))};
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    assert_int_equal(connect(fd, (struct sockaddr *)&at, sizeof at), 0);
    return fd;
}

int web_dial(const char *place)
{
    return web_dial_from(place, 1);
}

/* Lets the link work until the client has bytes, or its end. Returns the bytes read, or 0 at the end. */
size_t web_listen_to(struct bench *bench, int fd, void *buf, size_t len)
{
    int64_t end = now_ms() + DEADLINE_MS;
    for (;;) {
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        if (poll(&slot, 1, 0) > 0) {
            ssize_t n = recv(fd, buf, len, 0);
            return n > 0 ? (size_t)n : 0;
        }
        if (now_ms() > end) fail_msg("the link says nothing");
        bench_poll(bench, 0, 1);
    }
}

/* Reads the whole answer to a request with these fields. Returns its status, or 0 where the connection ended without a
 * byte. */
int web_ask(struct bench *bench, const char *place, const char *line, const char *fields, char **body, size_t *len)
{
    enum { ROOM = 4 << 20 };
    static char *answer; /* made once: a static array of this size would be searched for leaks in every program */
    char request[20000];
    int fd = web_dial(place), status = 0;
    size_t n = 0, got = 1, length = 0;
    snprintf(request, sizeof request, "%s HTTP/1.1\r\n%s\r\n", line, fields);
    assert_int_equal(send(fd, request, strlen(request), MSG_NOSIGNAL), strlen(request));
    if (answer == NULL) answer = malloc(ROOM);
    assert_non_null(answer);
    *body = NULL;
    for (*len = 0; got > 0 && (*body == NULL || *len < length);) {
        got = web_listen_to(bench, fd, answer + n, ROOM - 1 - n);
        n += got;
        answer[n] = '\0';
        char *end = strstr(answer, "\r\n\r\n"), *field = strstr(answer, "content-length: ");
        if (end == NULL) continue;
        assert_int_equal(sscanf(answer, "HTTP/1.1 %d", &status), 1);
        length = strncmp(line, "HEAD", 4) != 0 && field != NULL ? (size_t)atol(field + 16) : 0;
        *body = end + 4;
        *len = n - (size_t)(*body - answer);
    }
    close(fd);
    return status;
}

int web_status_of(struct bench *bench, const char *place, const char *line, const char *fields)
{
    char *body, host[20000];
    size_t len;
    snprintf(host, sizeof host, "Host: %s\r\n%s", place, fields);
    return web_ask(bench, place, line, host, &body, &len);
}

/* Opens a WebSocket. Returns 0 where it was turned down. */
int web_upgrade(struct bench *bench, const char *place, const char *path, const char *fields)
{
    char text[1000], answer[1000];
    int fd = web_dial(place);
    snprintf(text, sizeof text,
             "GET %s HTTP/1.1\r\nHost: %s\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
             "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n%s\r\n",
             path, place, fields);
    assert_int_equal(send(fd, text, strlen(text), MSG_NOSIGNAL), strlen(text));
    size_t n = 0, got;
    do { /* not beyond the head, as messages may follow at once */
        got = web_listen_to(bench, fd, answer + n, 1);
        n += got;
        answer[n] = '\0';
    } while (got > 0 && strstr(answer, "\r\n\r\n") == NULL);
    if (got > 0 && strncmp(answer, "HTTP/1.1 101", 12) == 0) return fd;
    close(fd);
    return 0;
}

/* Sends a frame from the client, masked with zeros. */
void web_send_frame(int fd, uint8_t first, const void *data, size_t len)
{
    uint8_t frame[20000] = {first};
    size_t n = 2;
    frame[1] = (uint8_t)(0x80 | (len < 126 ? len : 126));
    if (len >= 126) {
        frame[n++] = (uint8_t)(len >> 8);
        frame[n++] = (uint8_t)len;
    }
    n += 4;
    memcpy(frame + n, data, len);
    assert_int_equal(send(fd, frame, n + len, MSG_NOSIGNAL), n + len);
}

void web_take(struct bench *bench, int fd, uint8_t *to, size_t len)
{
    for (size_t n = 0; n < len;) {
        size_t got = web_listen_to(bench, fd, to + n, len - n);
        if (got == 0) fail_msg("ended after %zu of %zu bytes", n, len);
        n += got;
    }
}

/* Takes a frame from the link. Returns its first byte; writes the payload and its length. */
uint8_t web_take_frame(struct bench *bench, int fd, uint8_t *payload, size_t *len)
{
    uint8_t head[10];
    web_take(bench, fd, head, 2);
    *len = head[1];
    if (head[1] == 126) {
        web_take(bench, fd, head + 2, 2);
        *len = (size_t)head[2] << 8 | head[3];
    } else if (head[1] == 127) {
        web_take(bench, fd, head + 2, 8);
        *len = 0;
        for (int i = 2; i < 10; i++)
            *len = *len << 8 | head[i];
    }
    web_take(bench, fd, payload, *len);
    return head[0];
}
