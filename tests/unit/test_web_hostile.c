/* SPDX-License-Identifier: MIT */
/* Bytes at a web link's port that are no request of a browser. Each client gets an answer and an end at once, and none
 * keeps others out. Clients are bytes on a socket. */
#include <sys/socket.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "tests/unit/web_rig.h"

enum { PLACES = 48, OF_ONE = 40 };

/* Writes the text with the link's place for @. */
static size_t fill_in(char *to, size_t room, const char *text, size_t len, const char *place)
{
    size_t n = 0;
    for (size_t i = 0; i < len; i++) {
        const size_t more = text[i] == '@' ? strlen(place) : 1;
        assert_true(n + more < room);
        memcpy(to + n, text[i] == '@' ? place : text + i, more);
        n += more;
    }
    to[n] = '\0';
    return n;
}

/* Sends it, and reads to the connection's end. Returns the status; 0: it ended without a byte. */
static int send_raw(struct bench *bench, const char *place, const char *text, size_t len, char *answer, size_t room)
{
    static char bytes[30000];
    int fd = web_dial(place), status = 0;
    const size_t n = fill_in(bytes, sizeof bytes, text, len, place);
    size_t at = 0;
    assert_int_equal(send(fd, bytes, n, MSG_NOSIGNAL), n);
    for (size_t got = 1; got > 0 && at + 1 < room; at += got)
        got = web_listen_to(bench, fd, answer + at, room - 1 - at);
    answer[at] = '\0';
    close(fd);
    if (at > 0 && sscanf(answer, "HTTP/1.1 %d ", &status) != 1) fail_msg("%.*s: no answer: %s", (int)len, text, answer);
    return status;
}

#define HOST    "Host: @\r\n"
#define ASKS    "Upgrade: websocket\r\nConnection: upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: "
#define UPGRADE ASKS "AAAAAAAAAAAAAAAAAAAAAA==\r\n"
#define CASE(text, status, why)             \
    {                                       \
        text, sizeof(text) - 1, status, why \
    }
#define CONTENT    "a request must not have content here"
#define EXPECT     "only Expect: 100-continue is supported"
#define HOSTS      "a request must have one Host, the address that scanhead printed, and at most one Origin"
#define KEY        "Sec-WebSocket-Key must be 16 bytes as base64"
#define METHODS    "only GET and HEAD are answered; commands go over the WebSocket at /ws"
#define NOT_HTTP   "this is not a request of HTTP/1.1"
#define NOT_THIS   "the Host of this request is not this head; use the address that scanhead printed"
#define NO_PATH    "a path must begin with /, and %XX in it must be a byte in hexadecimal, but not 0"
#define PROTOCOL   "the subprotocol must be scanhead-native-1, or not given"
#define VERSIONS   "only HTTP/1.0 and HTTP/1.1 are supported"
#define WEBSOCKETS "/ws takes only a WebSocket of version 13, subprotocol scanhead-native-1"

static const struct {
    const char *text;
    size_t len;
    int status;
    const char *why; /* what the answer says; NULL: no words */
} requests[] = {
    CASE("CONNECT x:1 HTTP/1.1\r\n" HOST "\r\n", 405, METHODS),
    CASE("OPTIONS * HTTP/1.1\r\n" HOST "\r\n", 405, METHODS),
    CASE("FOO / HTTP/1.1\r\n" HOST "\r\n", 405, METHODS),
    CASE("POST / HTTP/1.1\r\n" HOST "Expect: 100-continue\r\nContent-Length: 5\r\n\r\n", 405, METHODS),
    CASE("GET / HTTP/1.1\r\nHost: localhost:18080abc\r\n\r\n", 400, HOSTS),
    CASE("GET / HTTP/1.1\r\nHost: localhost:99999\r\n\r\n", 400, HOSTS),
    CASE("GET / HTTP/1.1\r\nHost: local host\r\n\r\n", 400, HOSTS),
    CASE("GET / HTTP/1.1\r\n" HOST "nonsense\r\n", 400, NOT_HTTP), /* the link does not wait for more */
    CASE("GET / HTTP/1.1\r\n" HOST "X: a\0b", 400, NOT_HTTP),
    CASE("GET / HTTP/1.1\r\n" HOST "X: a\rb\r\n", 400, NOT_HTTP),
    CASE("GET / HTTP/1.1\r\n" HOST " folded\r\n\r\n", 400, NOT_HTTP),
    CASE("GET / HTTP/1.1\r\nHost : @\r\n\r\n", 400, NOT_HTTP),
    CASE("GET / HTTP/1.1\r\n" HOST HOST "\r\n", 400, HOSTS),
    CASE("GET / HTTP/1.1\r\n" HOST "Origin: http://elsewhere.example\r\nOrigin: http://@\r\n\r\n", 400, HOSTS),
    CASE("GET / HTTP/1.1\r\n\r\n", 400, HOSTS),
    CASE("GET /\r\n", 400, NOT_HTTP), /* HTTP/0.9 */
    CASE("GET foo HTTP/1.1\r\n" HOST "\r\n", 400, NO_PATH),
    CASE("GET /%00 HTTP/1.1\r\n" HOST "\r\n", 400, NO_PATH),
    CASE("GET /%4 HTTP/1.1\r\n" HOST "\r\n", 400, NO_PATH),
    CASE("PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", 505, VERSIONS),
    CASE("\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03UUUUUUUU", 400, NOT_HTTP), /* TLS */
    CASE("GET / HTTP/1.1\r\n" HOST "Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 413, CONTENT),
    CASE("GET / HTTP/1.1\r\n" HOST "Transfer-Encoding: chunked\r\nContent-Length: 5\r\n\r\n", 400, CONTENT),
    CASE("GET / HTTP/1.1\r\n" HOST "Content-Length: 5\r\nExpect: 100-continue\r\n\r\n", 413, CONTENT),
    CASE("GET / HTTP/1.1\r\n" HOST "Content-Length: 0\r\nContent-Length: 0\r\n\r\n", 400, NOT_HTTP),
    CASE("GET / HTTP/1.1\r\n" HOST "Content-Length: -1\r\n\r\n", 400, NOT_HTTP),
    CASE("GET /scene HTTP/1.1\r\n" HOST "Expect: tea\r\n\r\n", 417, EXPECT),
    CASE("GET /scene HTTP/1.1\r\n" HOST "Expect: 100-continue\r\n\r\n", 200, NULL),
    CASE("GET /scene HTTP/1.1\r\n" HOST "Content-Length: 0\r\n\r\n", 200, NULL),
    CASE("GET /scene HTTP/1.1\nHost: @\n\n", 200, NULL),
    CASE("\r\n\r\nGET /scene HTTP/1.1\r\n" HOST "\r\n", 200, NULL),
    CASE("GET /sc%65ne HTTP/1.0\r\n" HOST "\r\n", 200, NULL),
    CASE("GET http://@/scene HTTP/1.1\r\nHost: elsewhere.example\r\n\r\n", 200, NULL),
    CASE("GET http://elsewhere.example/scene HTTP/1.1\r\n" HOST "\r\n", 421, NOT_THIS),
    CASE("GET /scene HTTP/1.0\r\n\r\n", 421, NOT_THIS),
    CASE("GET /scene HTTP/1.0\r\nOrigin: http://\r\n\r\n", 0, NULL), /* no Host, so no Origin is right: no byte comes */
    CASE("GET /ws HTTP/1.1\r\n" HOST "Upgrade: websocket\r\nConnection: upgrade\r\nSec-WebSocket-Version: 8\r\n\r\n",
         426, WEBSOCKETS),
    CASE("GET /ws HTTP/1.1\r\n" HOST "Upgrade: websocket\r\nConnection: upgrade\r\nSec-WebSocket-Version: 13\r\n\r\n",
         400, KEY),
    CASE("GET /ws HTTP/1.1\r\n" HOST ASKS "AAAAAAAAAAAAAAAAAAAAA!==\r\n\r\n", 400, KEY),
    CASE("GET /ws HTTP/1.1\r\n" HOST ASKS "AAAAAAAAAAAAAAAAAAAAAA=A\r\n\r\n", 400, KEY),
    CASE("GET /ws HTTP/1.1\r\n" HOST ASKS "AAAAAAAAAAAAAAAAAAAAA==\r\n\r\n", 400, KEY),
    CASE("GET /ws HTTP/1.1\r\n" HOST ASKS "AAAAAAAAAAAAAAAAAAAAAA===\r\n\r\n", 400, KEY),
    CASE("GET /%4g HTTP/1.1\r\n" HOST "\r\n", 400, NO_PATH),
    CASE("GET /%g4 HTTP/1.1\r\n" HOST "\r\n", 400, NO_PATH),
    CASE("GET /% HTTP/1.1\r\n" HOST "\r\n", 400, NO_PATH),
    CASE("HEAD /ws HTTP/1.1\r\n" HOST UPGRADE "\r\n", 426, NULL),
    CASE("GET /ws HTTP/1.0\r\n" HOST UPGRADE "\r\n", 426, WEBSOCKETS),
    CASE("GET /ws HTTP/1.1\r\n" HOST UPGRADE "Sec-WebSocket-Protocol: bare\r\n\r\n", 400, PROTOCOL),
    CASE("GET /scene?%zz HTTP/1.1\r\n" HOST "\r\n", 400, NO_PATH),
};

/* Words of a status are those of RFC 9110, section 15. */
static void expect_words(int status, const char *answer)
{
    static const struct {
        int status;
        const char *words;
    } of[] = {{200, "OK"},
              {400, "Bad Request"},
              {404, "Not Found"},
              {405, "Method Not Allowed"},
              {408, "Request Timeout"},
              {413, "Content Too Large"},
              {417, "Expectation Failed"},
              {421, "Misdirected Request"},
              {426, "Upgrade Required"},
              {503, "Service Unavailable"},
              {505, "HTTP Version Not Supported"}};
    char line[80];
    for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
        if (of[i].status != status) continue;
        snprintf(line, sizeof line, "HTTP/1.1 %d %s\r\n", status, of[i].words);
        if (strncmp(answer, line, strlen(line)) != 0) fail_msg("%.60s", answer);
    }
}

/* The body of a refusal is its reason, in a line. */
static void expect_body(const char *answer, const char *why)
{
    const char *body = strstr(answer, "\r\n\r\n");
    assert_non_null(body);
    assert_int_equal(strncmp(body + 4, why, strlen(why)), 0);
    assert_string_equal(body + 4 + strlen(why), "\n");
}

static void test_requests(void **state)
{
    (void)state;
    static char answer[20000];
    char place[64];
    struct bench bench = web_open(place);
    for (size_t i = 0; i < sizeof requests / sizeof *requests; i++) {
        const int status = send_raw(&bench, place, requests[i].text, requests[i].len, answer, sizeof answer);
        if (status != requests[i].status) fail_msg("%s: %d, not %d", requests[i].text, status, requests[i].status);
        if (status != 0) assert_non_null(strstr(answer, "connection: close"));
        expect_words(status, answer);
        if (requests[i].why != NULL) expect_body(answer, requests[i].why);
        if (status == 405) assert_non_null(strstr(answer, "\r\nallow: GET, HEAD\r\n"));
        if (status == 426) assert_non_null(strstr(answer, "\r\nsec-websocket-version: 13\r\n"));
    }
    bench_close(&bench);
}

/* The owner gets a path of 255 bytes and a query of 1023 whole, counted without %XX. A longer path is cut, and a longer
 * query is refused. */
static void test_longest(void **state)
{
    (void)state;
    enum { PATH = 255, QUERY = 1023 };
    static char text[3000], answer[3000], want[2000];
    char place[64];
    struct bench bench = web_open(place);
    snprintf(want, sizeof want, "\r\n\r\n/echo%0*d?%0*d", PATH - 5, 7, QUERY, 8);
    size_t len = (size_t)snprintf(text, sizeof text, "GET /%%65cho%0*d?%0*d%%38 HTTP/1.1\r\n" HOST "\r\n", PATH - 5, 7,
                                  QUERY - 1, 0);
    assert_int_equal(send_raw(&bench, place, text, len, answer, sizeof answer), 200);
    assert_string_equal(strstr(answer, "\r\n\r\n"), want);
    for (int more = 1; more <= 2; more++) {
        snprintf(want, sizeof want, "\r\n\r\n/echo\n%0*d?q", PATH - 6, 0);
        len = (size_t)snprintf(text, sizeof text, "GET /echo%%0a%0*d?q HTTP/1.1\r\n" HOST "\r\n", PATH - 6 + more, 0);
        assert_int_equal(send_raw(&bench, place, text, len, answer, sizeof answer), 200);
        assert_string_equal(strstr(answer, "\r\n\r\n"), want);
    }
    len = (size_t)snprintf(text, sizeof text, "GET /echo?%0*d HTTP/1.1\r\n" HOST "\r\n", QUERY + 1, 0);
    assert_int_equal(send_raw(&bench, place, text, len, answer, sizeof answer), 400);
    expect_body(answer, "the query after ? has more than 1023 bytes");
    bench_close(&bench);
}

/* There are as many arguments and fields as fit into a request. */
static void test_many(void **state)
{
    (void)state;
    static char text[9000], answer[1 << 20];
    static const struct {
        const char *begin, *more;
        int n, status;
    } cases[] = {{"GET /?a=", "&a=", 400, 200},
                 {"GET /scene?a=", "&a=", 400, 400},
                 {"GET /scene HTTP/1.1\r\n" HOST, "Cookie: a=b\r\n", 400, 200},
                 {"GET /scene HTTP/1.1\r\n" HOST, "Accept: a\r\n", 400, 200}};
    char place[64];
    struct bench bench = web_open(place);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        size_t n = (size_t)snprintf(text, sizeof text, "%s", cases[i].begin);
        for (int j = 0; j < cases[i].n; j++)
            n += (size_t)snprintf(text + n, sizeof text - n, "%s", cases[i].more);
        n += (size_t)snprintf(text + n, sizeof text - n, "%s", i < 2 ? " HTTP/1.1\r\n" HOST "\r\n" : "\r\n");
        assert_true(n < 8000);
        assert_int_equal(send_raw(&bench, place, text, n, answer, sizeof answer), cases[i].status);
    }
    bench_close(&bench);
}

static int dial_and_say(struct bench *bench, const char *place, uint8_t last, const char *text)
{
    int fd = web_dial_from(place, last);
    assert_int_equal(send(fd, text, strlen(text), MSG_NOSIGNAL), strlen(text));
    bench_poll(bench, 0, 0);
    return fd;
}

static int is_open(int fd)
{
    char byte;
    return recv(fd, &byte, 1, MSG_PEEK | MSG_DONTWAIT) < 0 && errno == EAGAIN;
}

/* Clients fill the places, with any bytes, and come again. A browser is answered each time. */
static void test_nobody_is_shut_out(void **state)
{
    (void)state;
    static const char *const texts[] = {"CONNECT x:1 HTTP/1.1\r\nHost: x\r\n\r\n", "GET / HT", "", "\x16\x03",
                                        "GET /scene?n=big HTTP/1.1\r\nHost: x\r\n\r\n"};
    char place[64];
    struct bench bench = web_open(place);
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        int fd[3 * PLACES];
        for (int j = 0; j < 3 * PLACES; j++) {
            fd[j] = dial_and_say(&bench, place, 1, texts[i]);
            if (j % PLACES == PLACES - 1) assert_int_equal(web_status_of(&bench, place, "GET /scene", ""), 200);
        }
        for (int j = 0; j < 3 * PLACES; j++)
            close(fd[j]);
    }
    bench_close(&bench);
}

/* One address keeps some of the places, those of its newest clients. The client of another address stays. */
static void test_one_address(void **state)
{
    (void)state;
    char place[64];
    struct bench bench = web_open(place);
    int other = dial_and_say(&bench, place, 3, "GET / HT"), fd[2 * PLACES], open = 0;
    for (int i = 0; i < 2 * PLACES; i++)
        fd[i] = dial_and_say(&bench, place, 2, "GET / HT");
    for (int i = 0; i < 2 * PLACES - OF_ONE; i++) /* a busy machine ends them later */
        for (int tries = 0; tries < 10000 && is_open(fd[i]); tries++)
            bench_poll(&bench, 0, 1);
    for (int i = 0; i < 2 * PLACES; i++) {
        assert_int_equal(is_open(fd[i]), i >= 2 * PLACES - OF_ONE);
        open += is_open(fd[i]);
    }
    assert_int_equal(open, OF_ONE);
    assert_true(is_open(other));
    for (int i = 0; i < 2 * PLACES; i++)
        close(fd[i]);
    close(other);
    bench_close(&bench);
}

/* Half a request that has to go gets an answer. A client that reads is not cut off by others of its address. */
static void test_who_makes_room(void **state)
{
    (void)state;
    char place[64], answer[1000];
    struct bench bench = web_open(place);
    int first = dial_and_say(&bench, place, 1, "GET / HT"), fd[OF_ONE];
    int session = web_upgrade(&bench, place, "/ws", "");
    bench_expect(&bench, LINK_OPENED, 0);
    for (int i = 0; i < OF_ONE; i++)
        fd[i] = dial_and_say(&bench, place, 1, "");
    answer[web_listen_to(&bench, first, answer, sizeof answer - 1)] = '\0';
    assert_int_equal(strncmp(answer, "HTTP/1.1 408 ", 13), 0);
    expect_body(answer, "other clients wait; send the whole request at once");
    bench_expect(&bench, LINK_REFUSED, 0);
    assert_true(is_open(session));
    for (int i = 0; i < OF_ONE; i++)
        close(fd[i]);
    close(first);
    close(session);
    bench_close(&bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_requests),    cmocka_unit_test(test_longest),
        cmocka_unit_test(test_many),        cmocka_unit_test(test_nobody_is_shut_out),
        cmocka_unit_test(test_one_address), cmocka_unit_test(test_who_makes_room),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
