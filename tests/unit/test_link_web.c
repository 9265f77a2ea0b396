/* SPDX-License-Identifier: MIT */
/* The web link: answers to requests, sessions by WebSocket, and refusals. Clients are bytes on a socket, in the form of
 * RFC 9112 and RFC 6455. */
#include <sys/socket.h>
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <sys/resource.h>

#include "tests/unit/web_rig.h"

/* The rules that a browser enforces for the page: nothing from elsewhere, no frame around it, no type guessed, no other
 * site's script. */
static void test_headers(void **state)
{
    (void)state;
    static const char *const fields[] = {"content-security-policy: default-src 'self'; frame-ancestors 'none'\r\n",
                                         "cross-origin-resource-policy: same-origin\r\n",
                                         "x-content-type-options: nosniff\r\n", "referrer-policy: no-referrer\r\n",
                                         "cache-control: no-store\r\n"};
    static const char *const lines[] = {"GET / HTTP/1.1", "GET /scene HTTP/1.1", "GET /nothing HTTP/1.1"};
    char place[64], request[200], head[8192];
    struct bench bench = web_open(place);
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        int fd = web_dial(place);
        size_t n = 0, got = 1;
        snprintf(request, sizeof request, "%s\r\nHost: %s\r\n\r\n", lines[i], place);
        assert_int_equal(send(fd, request, strlen(request), MSG_NOSIGNAL), strlen(request));
        for (head[0] = '\0'; got > 0 && n + 1 < sizeof head && strstr(head, "\r\n\r\n") == NULL; head[n] = '\0')
            n += got = web_listen_to(&bench, fd, head + n, sizeof head - 1 - n);
        for (size_t j = 0; j < sizeof fields / sizeof fields[0]; j++)
            if (strstr(head, fields[j]) == NULL) fail_msg("%s: no %s in: %s", lines[i], fields[j], head);
        assert_null(strcasestr(head, "access-control-allow-origin"));
        close(fd);
    }
    bench_close(&bench);
}

static void test_requests(void **state)
{
    (void)state;
    char place[64], long_field[9000] = "Cookie: ", *body, host[100];
    struct bench bench = web_open(place);
    size_t len;
    snprintf(host, sizeof host, "Host: %s\r\n", place);
    assert_int_equal(web_ask(&bench, place, "GET /", host, &body, &len), 200);
    assert_non_null(strstr(body, "<title>"));
    web_n_released = 0;
    assert_int_equal(web_ask(&bench, place, "GET /scene", host, &body, &len), 200);
    assert_int_equal(len, 5);
    assert_memory_equal(body, "bbbbb", 5);
    assert_int_equal(web_ask(&bench, place, "GET /scene?n=big", host, &body, &len), 200);
    assert_int_equal(len, 3000000);
    assert_int_equal(body[len - 1], 'b');
    assert_int_equal(web_ask(&bench, place, "GET /scene?n=x", host, &body, &len), 400);
    assert_non_null(strstr(body, "not a number"));
    assert_int_equal(web_ask(&bench, place, "GET /scene?a=1&b=2&c=3", host, &body, &len), 400);
    assert_non_null(strstr(body, "three words"));
    assert_int_equal(web_status_of(&bench, place, "GET /scene?n=no", ""), 503);
    assert_int_equal(web_status_of(&bench, place, "HEAD /", ""), 200);
    assert_int_equal(web_ask(&bench, place, "GET /nothing", host, &body, &len), 404);
    assert_string_equal(body, "there is nothing at this path\n");
    assert_int_equal(web_status_of(&bench, place, "GET /../web.c", ""), 404);
    assert_int_equal(web_status_of(&bench, place, "POST /", "Content-Length: 0\r\n"), 405);
    assert_int_equal(web_status_of(&bench, place, "GET /ws", ""), 426);
    memset(long_field + 8, 'a', 8100);
    strcpy(long_field + 8108, "\r\n"); /* with the line and Host 8,147 to 8,151 bytes */
    assert_int_equal(web_status_of(&bench, place, "GET /", long_field), 200);
    memset(long_field + 8, 'a', 8200);
    strcpy(long_field + 8208, "\r\n");
    assert_int_equal(web_ask(&bench, place, "GET /", long_field, &body, &len), 413);
    assert_string_equal(body, "a request must have at most 8192 bytes\n");
    assert_int_equal(web_status_of(&bench, place, "GET /", "Upgrade: h2c\r\nConnection: Upgrade\r\n"), 200);
    bench_close(&bench);
    assert_int_equal(web_n_released, 2); /* one each; errors and the page's own files are not the owner's */
}

/* Returns whether a request is answered long before the time is over that a client may take. */
static int is_answered_soon(struct bench *bench, const char *place)
{
    char request[200], answer[4096];
    int fd = web_dial(place);
    snprintf(request, sizeof request, "GET /scene HTTP/1.1\r\nHost: %s\r\n\r\n", place);
    assert_int_equal(send(fd, request, strlen(request), MSG_NOSIGNAL), strlen(request));
    ssize_t n = -1;
    for (int i = 0; i < 3000 && n < 0; i++) {
        bench_poll(bench, 0, 1);
        n = recv(fd, answer, sizeof answer, MSG_DONTWAIT);
    }
    close(fd);
    return n > 12 && memcmp(answer, "HTTP/1.1 200", 12) == 0;
}

/* A connection ends with its first answer. */
static void test_one_request_each(void **state)
{
    (void)state;
    static const char second[] = "GET /\r\nContent-Length: 1\r\n\r\nn: hts";
    char place[64], request[300], answer[4096];
    struct bench bench = web_open(place);
    int fd = web_dial(place), n_answers = 0;
    size_t n = 0, got = 1;
    snprintf(request, sizeof request, "GET /scene HTTP/1.1\r\nHost: %s\r\n\r\n%s", place, second);
    assert_int_equal(send(fd, request, strlen(request), MSG_NOSIGNAL), strlen(request));
    for (; got > 0 && n + 1 < sizeof answer; n += got)
        got = web_listen_to(&bench, fd, answer + n, sizeof answer - 1 - n);
    answer[n] = '\0';
    assert_int_equal(got, 0);
    for (const char *at = answer; (at = strstr(at, "HTTP/1.1 ")) != NULL; at += 9)
        n_answers++;
    assert_int_equal(n_answers, 1);
    assert_non_null(strstr(answer, "connection: close\r\n"));
    assert_string_equal(answer + n - 5, "bbbbb");
    close(fd);
    assert_int_equal(web_status_of(&bench, place, "GET /scene", ""), 200);
    for (int i = 0; i < 80; i++) /* more than libwebsockets has room for: each answer gives its own back */
        assert_true(is_answered_soon(&bench, place));
    bench_close(&bench);
}

/* A client sends half a request and leaves. Its connection ends at once. */
static void test_half_request(void **state)
{
    (void)state;
    char place[64], byte;
    struct bench bench = web_open(place);
    int fd = web_dial(place);
    assert_int_equal(send(fd, "GET /", 5, MSG_NOSIGNAL), 5);
    for (int i = 0; i < 3; i++)
        bench_poll(&bench, 0, 1);
    assert_int_equal(shutdown(fd, SHUT_WR), 0);
    ssize_t n = -1;
    for (int i = 0; i < 100 && n != 0; i++) { /* far fewer than in the seconds that a request may take */
        bench_poll(&bench, 0, 1);
        n = recv(fd, &byte, 1, MSG_DONTWAIT);
    }
    assert_int_equal(n, 0);
    close(fd);
    bench_close(&bench);
}

/* Leaves this process without a free descriptor. *before: the limit as it was. */
static void take_descriptors(struct rlimit *before)
{
    const int next = open("/dev/null", O_RDONLY | O_CLOEXEC);
    assert_true(next >= 0);
    close(next);
    assert_int_equal(getrlimit(RLIMIT_NOFILE, before), 0);
    const struct rlimit none = {.rlim_cur = (rlim_t)next, .rlim_max = before->rlim_max};
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &none), 0);
}

/* Two clients find no descriptor before the owner hears of either. Each is reported by its own name. */
static void test_refused_names(void **state)
{
    (void)state;
    char place[64];
    struct bench bench = web_open(place);
    struct rlimit before;
    bench_poll(&bench, 0, 0); /* which takes what it needs for itself */
    const int fd[] = {web_dial_from(place, 1), web_dial_from(place, 2)};
    take_descriptors(&before);
    const struct link_event first = bench_expect(&bench, LINK_REFUSED, 0);
    const struct link_event second = bench_expect(&bench, LINK_REFUSED, 0);
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &before), 0);
    assert_memory_equal(first.peer, "127.0.0.1:", 10);
    assert_memory_equal(second.peer, "127.0.0.2:", 10);
    close(fd[0]);
    close(fd[1]);
    bench_close(&bench);
}

/* The descriptors run out before a request is whole. The request's client gets the reason, and is reported. */
static void test_descriptors_run_out(void **state)
{
    (void)state;
    char place[64], rest[200], answer[2000] = "";
    struct bench bench = web_open(place);
    struct rlimit before;
    const int fd = web_dial(place);
    assert_int_equal(send(fd, "GET /scene", 10, MSG_NOSIGNAL), 10);
    for (int i = 0; i < 3; i++)
        bench_poll(&bench, 0, 1);
    snprintf(rest, sizeof rest, " HTTP/1.1\r\nHost: %s\r\n\r\n", place);
    assert_int_equal(send(fd, rest, strlen(rest), MSG_NOSIGNAL), strlen(rest));
    take_descriptors(&before);
    const size_t n = web_listen_to(&bench, fd, answer, sizeof answer - 1);
    assert_int_equal(setrlimit(RLIMIT_NOFILE, &before), 0);
    assert_true(n > 13);
    assert_memory_equal(answer, "HTTP/1.1 503 ", 13);
    assert_non_null(strstr(answer, "\r\n\r\nthe head has no file descriptor left for this connection\n"));
    bench_expect(&bench, LINK_REFUSED, 0);
    close(fd);
    bench_close(&bench);
}

static void test_who_asks(void **state)
{
    (void)state;
    char place[64], fields[200], *body;
    struct bench bench = web_open(place);
    size_t len;
    const char *port = strchr(place, ':');
    const struct {
        const char *host, *origin;
        int status;
    } cases[] = {
        {"127.0.0.1", NULL, 200},
        {"localhost", NULL, 200},
        {"[::1]", NULL, 200},
        {"elsewhere.example", NULL, 421},
        {"127.0.0.1.example", NULL, 421},
        {"localhost", "http://localhost", 200},
        {"localhost", "http://127.0.0.1", 0}, /* no byte */
        {"localhost", "http://elsewhere.example", 0},
        {"elsewhere.example", "http://elsewhere.example", 421},
        {"localhost", "https://localhost", 0},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        int n = snprintf(fields, sizeof fields, "Host: %s%s\r\n", cases[i].host, port);
        if (cases[i].origin != NULL)
            snprintf(fields + n, sizeof fields - (size_t)n, "Origin: %s%s\r\n", cases[i].origin, port);
        assert_int_equal(web_ask(&bench, place, "GET /scene", fields, &body, &len), cases[i].status);
    }
    snprintf(fields, sizeof fields, "Host: 127.0.0.1:1\r\n");
    assert_int_equal(web_ask(&bench, place, "GET /scene", fields, &body, &len), 421);
    snprintf(fields, sizeof fields, "Host: %s\r\nOrigin: null\r\n", place);
    assert_int_equal(web_ask(&bench, place, "GET /scene", fields, &body, &len), 0);
    assert_true(web_ask(&bench, place, "GET /scene", "", &body, &len) != 200);
    /* Fetch metadata (W3C): a picture of another site's page has no Origin. */
    static const struct {
        const char *from, *request;
        int status;
    } parts[] = {
        {"cross-site", "GET /scene", 0},     {"same-site", "GET /scene", 0},     {"same-origin", "GET /scene", 200},
        {"none", "GET /scene", 200},         {"cross-site", "HEAD /scene?x", 0}, {"cross-site", "GET /", 200},
        {"cross-site", "GET /main.js", 200}, {"cross-site", "GET /%73cene", 0},
    };
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) {
        snprintf(fields, sizeof fields, "Host: %s\r\nSec-Fetch-Site: %s\r\n", place, parts[i].from);
        assert_int_equal(web_ask(&bench, place, parts[i].request, fields, &body, &len), parts[i].status);
    }
    bench_close(&bench);
}

static void test_session(void **state)
{
    (void)state;
    static uint8_t payload[200000];
    char place[64], text[100];
    struct bench bench = web_open(place);
    size_t len;
    int fd = web_upgrade(&bench, place, "/ws", "Sec-WebSocket-Protocol: scanhead-native-1\r\n");
    assert_true(fd > 0);
    struct link_event event = bench_expect(&bench, LINK_OPENED, 0);
    assert_int_equal(event.session, 0);
    web_send_frame(fd, 0x81, "*IDN?", 5); /* the end of the last line need not be said */
    web_send_frame(fd, 0x01, "HEAD:", 5); /* in two pieces */
    web_send_frame(fd, 0x80, "PRR?\nTIME?\n", 11);
    bench_read_all(&bench, 0, text, 22);
    assert_memory_equal(text, "*IDN?\nHEAD:PRR?\nTIME?\n", 22);
    bench_write_all(&bench, 0, "OK\r\n", 4);
    assert_int_equal(web_take_frame(&bench, fd, payload, &len), 0x81);
    assert_int_equal(len, 4);
    assert_memory_equal(payload, "OK\r\n", 4);
    memset(payload, 0xd5, sizeof payload);
    assert_int_equal(bench.ops->write(bench.link, 0, payload, 150000), 150000);
    assert_int_equal(bench.ops->write(bench.link, 0, payload, 1), 0); /* one message at a time */
    memset(payload, 0, sizeof payload);
    assert_int_equal(web_take_frame(&bench, fd, payload, &len), 0x82);
    assert_int_equal(len, 150000);
    assert_int_equal(payload[149999], 0xd5);
    bench_expect(&bench, LINK_WRITABLE, 1);
    close(fd);
    bench_expect(&bench, LINK_CLOSED, 0);
    assert_int_equal(bench.ops->write(bench.link, 0, payload, 1), SH_ECLOSED);
    bench_close(&bench);
}

/* The client runs in a thread of its own. The client takes all until the link says goodbye, and answers the goodbye. */
struct taker {
    int fd;
    uint8_t bytes[300000];
    size_t n;
};

static void *take_all(void *ctx)
{
    struct taker *taker = ctx;
    for (ssize_t n; (n = recv(taker->fd, taker->bytes + taker->n, sizeof taker->bytes - taker->n, 0)) > 0;) {
        taker->n += (size_t)n;
        if (taker->n >= 22 && taker->bytes[taker->n - 22] == 0x88) web_send_frame(taker->fd, 0x88, "\x03\xe9", 2);
    }
    return NULL;
}

/* Bytes that were written before the end arrive whole. After them the reason for the end comes. */
static void test_goodbye(void **state)
{
    (void)state;
    static struct taker taker;
    static uint8_t payload[250000];
    static const char why[] = "\x88\x14\x03\xe9the head has ended"; /* 1001 */
    char place[64];
    pthread_t thread;
    struct bench bench = web_open(place);
    taker.fd = web_upgrade(&bench, place, "/ws", "");
    assert_true(taker.fd > 0);
    bench_expect(&bench, LINK_OPENED, 0);
    memset(payload, 0xd5, sizeof payload);
    assert_int_equal(bench.ops->write(bench.link, 0, payload, sizeof payload), sizeof payload);
    assert_int_equal(pthread_create(&thread, NULL, take_all, &taker), 0);
    bench_close(&bench);
    assert_int_equal(pthread_join(thread, NULL), 0);
    assert_int_equal(taker.n, 10 + sizeof payload + sizeof why - 1); /* a long message's header has 10 bytes */
    assert_memory_equal(taker.bytes + 10, payload, sizeof payload);
    assert_memory_equal(taker.bytes + 10 + sizeof payload, why, sizeof why - 1);
    close(taker.fd);
}

static void test_turned_down(void **state)
{
    (void)state;
    char place[64], origin[100];
    uint8_t payload[200];
    struct bench bench = web_open(place);
    size_t len;
    int fd[WEB_SESSIONS + 1];
    assert_int_equal(web_upgrade(&bench, place, "/ws", "Origin: http://elsewhere.example\r\n"), 0);
    assert_int_equal(web_upgrade(&bench, place, "/", ""), 0);
    assert_int_equal(web_upgrade(&bench, place, "/ws", "Sec-WebSocket-Protocol: bare\r\n"), 0);
    assert_int_equal(web_upgrade(&bench, place, "/ws", "Origin: null\r\nSec-WebSocket-Protocol: bare\r\n"), 0);
    snprintf(origin, sizeof origin, "Origin: http://%s\r\n", place);
    for (int i = 0; i <= WEB_SESSIONS; i++)
        fd[i] = web_upgrade(&bench, place, "/ws", origin);
    for (int i = 0; i < WEB_SESSIONS; i++)
        assert_int_equal(bench_expect(&bench, LINK_OPENED, 0).session, i);
    web_send_frame(fd[WEB_SESSIONS], 0x81, "*IDN?", 5); /* it does not wait to hear that it is welcome */
    web_send_frame(fd[WEB_SESSIONS], 0x81, "*IDN?", 5);
    assert_int_equal(web_take_frame(&bench, fd[WEB_SESSIONS], payload, &len), 0x88);
    assert_int_equal(payload[0] << 8 | payload[1], 1013);
    assert_int_equal(len, 2 + strlen("all 2 sessions of this link are taken"));
    assert_memory_equal(payload + 2, "all 2 sessions of this link are taken", len - 2);
    bench_expect(&bench, LINK_REFUSED, 0);
    for (int i = 0; i <= WEB_SESSIONS; i++)
        close(fd[i]);
    for (int i = 0; i < WEB_SESSIONS; i++)
        bench_expect(&bench, LINK_CLOSED, 0);
    bench_close(&bench);
}

/* A link of one session has other words for those who come too late. */
static void test_only_session(void **state)
{
    (void)state;
    static const struct link_spec one = {.type = LINK_WEB, .max_sessions = 1};
    static const char why[] = "the only session of this link is taken";
    char url[128];
    uint8_t payload[200];
    size_t len;
    struct bench bench = bench_open(&one);
    bench.ops->endpoint(bench.link, url, sizeof url);
    char *place = url + strlen("http://");
    place[strlen(place) - 1] = '\0';
    const int first = web_upgrade(&bench, place, "/ws", ""), second = web_upgrade(&bench, place, "/ws", "");
    assert_int_equal(web_take_frame(&bench, second, payload, &len), 0x88);
    assert_int_equal(payload[0] << 8 | payload[1], 1013);
    assert_int_equal(len, 2 + strlen(why));
    assert_memory_equal(payload + 2, why, len - 2);
    assert_int_equal(web_status_of(&bench, place, "GET /scene", ""), 404); /* it serves the page alone */
    close(first);
    close(second);
    bench_close(&bench);
}

/* A message that is no command ends its session, with the reason, and does nothing else. */
static void test_bad_messages(void **state)
{
    (void)state;
    static char long_text[5000];
    uint8_t payload[200];
    char place[64];
    memset(long_text, 'a', sizeof long_text);
    const struct {
        uint8_t first;
        const char *data;
        size_t len;
        int code;
        const char *why;
    } cases[] = {{0x82, "*IDN?", 5, 1003, "a command must be a text message"},
                 {0x81, long_text, sizeof long_text, 1009, "a message must have at most 4096 bytes"}};
    struct bench bench = web_open(place);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        size_t len;
        int fd = web_upgrade(&bench, place, "/ws", "");
        bench_expect(&bench, LINK_OPENED, 0);
        web_send_frame(fd, cases[i].first, cases[i].data, cases[i].len);
        assert_int_equal(web_take_frame(&bench, fd, payload, &len), 0x88);
        assert_int_equal(payload[0] << 8 | payload[1], cases[i].code);
        assert_int_equal(len, 2 + strlen(cases[i].why));
        assert_memory_equal(payload + 2, cases[i].why, len - 2);
        close(fd); /* or, without its answer, some seconds later */
        bench_expect(&bench, LINK_CLOSED, 0);
    }
    int fd = web_upgrade(&bench, place, "/ws", "");
    bench_expect(&bench, LINK_OPENED, 0);
    close(fd);
    bench_close(&bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_headers),
        cmocka_unit_test(test_requests),
        cmocka_unit_test(test_who_asks),
        cmocka_unit_test(test_session),
        cmocka_unit_test(test_one_request_each),
        cmocka_unit_test(test_half_request),
        cmocka_unit_test(test_goodbye),
        cmocka_unit_test(test_refused_names),
        cmocka_unit_test(test_descriptors_run_out),
        cmocka_unit_test(test_turned_down),
        cmocka_unit_test(test_only_session),
        cmocka_unit_test(test_bad_messages),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
