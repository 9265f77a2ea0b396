/* SPDX-License-Identifier: MIT */
/* HTTP of other programs: pieces, limits, broken requests, garbage. The tests go through the settings of a VLP-16. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "core/rng.h"
#include "drivers/protocol/http_head.h"
#include "tests/unit/velodyne_http_rig.h"

static const char done[] = DONE("keep-alive");

/* Requests come one after the other on one connection, in one piece, and byte by byte. */
static void test_pieces(void **state)
{
    (void)state;
    static const char two[] = "POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: 8\r\n\r\nlaser=on"
                              "\r\nGET /cgi/none HTTP/1.1\r\nhost:x\r\n\r\n"
                              "POST /cgi/setting HTTP/1.1\nHost: x\ncontent-length:7\n\nrpm=600";
    static char whole[1024];
    http_send(two);
    snprintf(whole, sizeof whole, "%s", http_answer());
    assert_int_equal(strncmp(whole, done, sizeof done - 1), 0);
    assert_non_null(strstr(whole, "HTTP/1.1 404 Not Found"));
    assert_string_equal(whole + strlen(whole) - (sizeof done - 1), done);
    protocol_rig_clear(&http_rig);
    for (size_t i = 0; i < sizeof two - 1; i++)
        http_rig.ops->input(http_rig.protocol, (const uint8_t *)two + i, 1);
    assert_string_equal(http_answer(), whole);
}

/* Each error of a request is reported. The connection ends where the request's end can't be known. */
static void test_broken_requests(void **state)
{
    (void)state;
    static char long_line[700], long_head[4200];
    static const struct {
        const char *text;
        int status, ends;
    } cases[] = {
        {"\x16\x03\x01\x02\x01\x01\r\n\r\n", 400, 1}, /* TLS */
        {"\x16\x03\x01\x02\x01\x01", 400, 1},         /* it is refused at once: its end is never an empty line */
        {"GET /\r\n", 400, 1},                        /* HTTP/0.9 */
        {"GET / HTTP/1.1\r\nHost: x\r\nnonsense\r\n", 400, 1},
        {"GET / HTTP/1.1\r\nHost: localhost:18080abc\r\n\r\n", 400, 1},
        {"GET\r\n\r\n", 400, 1},
        {"G@T / HTTP/1.1\r\nHost: x\r\n\r\n", 400, 1},
        {"@ / HTTP/1.1\r\nHost: x\r\n\r\n", 400, 1},
        {"GET@ / HTTP/1.1\r\nHost: x\r\n\r\n", 400, 1},
        {"GET  HTTP/1.1\r\n\r\n", 400, 1},
        {"GET / HTTP/1.1 \r\n\r\n", 400, 1},
        {"GET / FTP/1.1\r\n\r\n", 400, 1},
        {"GET / HTTP/2.0\r\n\r\n", 505, 1},
        {"PROPFIND / HTTP/1.1\r\nHost: x\r\n\r\n", 501, 1},
        {"GET /cgi/info.json HTTP/1.1\r\n\r\n", 400, 1}, /* no Host */
        {"GET /cgi/info.json HTTP/1.1\r\nHost: x\r\nHost: y\r\n\r\n", 400, 1},
        {"GET /cgi/info.json HTTP/1.1\r\nHost: x\r\nnonsense\r\n\r\n", 400, 1},
        {"GET /cgi/info.json HTTP/1.1\r\nHost : x\r\n\r\n", 400, 1},
        {"GET /cgi/info.json HTTP/1.1\r\nHost: x\r\n folded\r\n\r\n", 400, 1},
        {"GET /cgi/info.json HTTP/1.1\r\nHost: x\x01\r\n\r\n", 400, 1},
        {"GET /cgi/info.json HTTP/1.1\r\nHost: x\r\nExpect: tea\r\n\r\n", 417, 1},
        {"GET /cgi/info.json HTTP/1.1\r\nHost: x\r\nExpect: tea\r\nExpect: 100-continue\r\n\r\n", 417, 1},
        {"GET /cgi/info.json HTTP/1.1\r\nHost: x\r\nOrigin: http://y\r\nOrigin: http://x\r\n\r\n", 400, 1},
        {"POST /cgi/setting HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n7\r\nrpm=600\r\n0\r\n\r\n", 411,
         1},
        {"POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: 7\r\nTransfer-Encoding: x\r\n\r\nrpm=600", 411, 1},
        {"POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: -7\r\n\r\n", 400, 1},
        {"POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: 7\r\nContent-Length: 7\r\n\r\nrpm=600", 400, 1},
        {"POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: 1025\r\n\r\n", 413, 1},
        {"POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: 18446744073709551623\r\n\r\nrpm=600", 413, 1},
        {long_line, 414, 1},
        {long_head, 431, 1},
        {"GET /cgi/setting HTTP/1.1\r\nHost: x\r\n\r\n", 405, 0},
        {"POST /cgi/info.json HTTP/1.1\r\nHost: x\r\nContent-Length: 0\r\n\r\n", 405, 0},
        {"POST /cgi/setting HTTP/1.1\r\nHost: x\r\n\r\n", 400, 0}, /* no body, and so no form */
        {"POST /cgi/setting HTTP/1.0\r\nConnection: keep-alive\r\n\r\n", 400, 0},
        {"OPTIONS /cgi/setting HTTP/1.1\r\nHost: x\r\n\r\n", 405, 0},
        {"GET / HTTP/1.1\r\nHost: x\r\n\r\n", 404, 0},
        {"GET /cgi/info.json HTTP/1.0\r\n\r\n", 200, 1},
        {"GET http://x/cgi/info.json HTTP/1.1\r\nHost: x\r\n\r\n", 200, 0},
        {"GET /cgi/info.json HTTP/1.0\r\nConnection: keep-alive\r\n\r\n", 200, 0},
        {"GET /cgi/info.json HTTP/1.1\r\nHost: x\r\nConnection: TE, close\r\n\r\n", 200, 1},
    };
    memset(long_line, 'a', sizeof long_line - 1);
    memset(long_head, 'a', sizeof long_head - 1);
    memcpy(long_head, "GET / HTTP/1.1\r\nHost: ", 22);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        http_renew();
        http_send(cases[i].text);
        if (http_status() != cases[i].status) fail_msg("%s: %s", cases[i].text, http_answer());
        assert_int_equal(http_rig.hung_up, cases[i].ends);
        assert_non_null(strstr(http_answer(), cases[i].ends ? "Connection: close\r\n" : "Connection: keep-alive\r\n"));
        http_assert_command(NULL);
        assert_int_equal(http_rig.count[PROTOCOL_WRONG], cases[i].status >= 400);
        if (cases[i].status >= 400 && cases[i].ends)
            assert_int_equal(http_rig.count[PROTOCOL_INPUT_LOST], strlen(cases[i].text));
        if (!cases[i].ends) continue;
        const size_t len = http_rig.len;
        http_get("/cgi/info.json"); /* after the last answer nothing more is answered */
        assert_int_equal(http_rig.len, 0);
        assert_true(len > 0);
        const uint64_t lost = http_rig.count[PROTOCOL_INPUT_LOST];
        http_send("abc");
        assert_int_equal(http_rig.count[PROTOCOL_INPUT_LOST] - lost, 3);
    }
}

/* RFC 9112, 6.3: without Transfer-Encoding and Content-Length a request's body has the length 0. `curl -X POST` sends
 * that. What comes after the head is the next request. */
static void test_no_length(void **state)
{
    (void)state;
    static const char get[] = "GET /cgi/none HTTP/1.1\r\nHost: x\r\n\r\n";
    char text[256];
    snprintf(text, sizeof text, "POST /cgi/save HTTP/1.1\r\nHost: 127.0.0.1\r\nAccept: */*\r\n\r\n%s", get);
    http_send(text);
    assert_memory_equal(http_answer(), done, sizeof done - 1);
    assert_int_equal(strncmp(http_answer() + sizeof done - 1, "HTTP/1.1 404 ", 13), 0);
    http_send("POST /cgi/setting HTTP/1.1\r\nHost: x\r\n\r\nrpm=600");
    assert_int_equal(http_status(), 400);
    assert_non_null(strstr(http_answer(), "this is not a request of HTTP/1.1")); /* the second answer */
    http_assert_command(NULL);
    assert_int_equal(http_rig.hung_up, 1);
}

/* A line of 512 bytes without its end, a head of 4096 bytes with its end, and a body of 1024 bytes are the longest. */
static void test_longest(void **state)
{
    (void)state;
    static char text[8192];
    for (int more = 0; more < 2; more++) {
        http_renew();
        snprintf(text, sizeof text, "GET /cgi/info.json?%0*d HTTP/1.1\r\nHost: x\r\n\r\n", 512 - 19 - 9 + more, 0);
        http_send(text);
        assert_int_equal(http_status(), more ? 414 : 200);
        http_renew();
        snprintf(text, sizeof text, "GET /cgi/info.json HTTP/1.1\r\nHost: x\r\nX: %0*d\r\n\r\n",
                 4096 - 29 - 9 - 3 - 4 + more, 0);
        assert_int_equal(strlen(text), 4096 + more);
        http_send(text);
        assert_int_equal(http_status(), more ? 431 : 200);
        http_renew();
        snprintf(text, sizeof text, "POST /cgi/none HTTP/1.1\r\nHost: x\r\nContent-Length: %d\r\n\r\n%0*d", 1024 + more,
                 1024 + more, 0);
        http_send(text);
        assert_int_equal(http_status(), more ? 413 : 404);
        http_renew();
        snprintf(text, sizeof text, "POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: %d\r\n\r\nrpm=%0*d",
                 1024 + more, 1020 + more, 900);
        http_send(text); /* no speed has 1,020 digits; sanitizers look at the copy of the body */
        assert_int_equal(http_status(), more ? 413 : 400);
    }
}

/* RFC 9110, section 5.6.1: elements may be empty, and have blanks around them. */
static void test_lists(void **state)
{
    (void)state;
    static const struct {
        const char *list;
        int has;
    } cases[] = {{"close", 1},   {"Close", 1},  {",close", 1}, {"close,", 1}, {"a,,close", 1}, {"a, close\t,b", 1},
                 {"a,b", 0},     {"closed", 0}, {"clos", 0},   {"", 0},       {",", 0},        {"a close", 0},
                 {"close b", 0}, {"xclose", 0}, {"a,close", 1}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const struct http_text list = {cases[i].list, strlen(cases[i].list)};
        if (http_list_has(list, "close") != cases[i].has) fail_msg("%s", cases[i].list);
    }
}

/* HEAD answers as GET, without the body. */
static void test_head_method(void **state)
{
    (void)state;
    http_send("HEAD /cgi/info.json HTTP/1.1\r\nHost: x\r\n\r\nHEAD /cgi/none HTTP/1.1\r\nHost: x\r\n\r\n");
    assert_int_equal(http_status(), 200);
    assert_non_null(strstr(http_answer(), "Content-Length: 88\r\n\r\nHTTP/1.1 404 Not Found"));
    assert_int_equal(strcmp(http_answer() + strlen(http_answer()) - 4, "\r\n\r\n"), 0);
    http_send("HEAD /cgi/info.json HTTP/1.1\r\nHost: x\r\n\r\nwhat is this\r\n\r\n"); /* that is no HEAD */
    assert_non_null(strstr(http_answer(), "\r\n\r\nthis is not a request of HTTP/1.1\n"));
}

/* The client waits for leave to send its body. */
static void test_expect_continue(void **state)
{
    (void)state;
    http_send("POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: 7\r\nExpect: 100-continue\r\n\r\n");
    assert_string_equal(http_answer(), "HTTP/1.1 100 Continue\r\n\r\n");
    protocol_rig_input(&http_rig, "rpm=");
    assert_string_equal(http_answer(), "HTTP/1.1 100 Continue\r\n\r\n");
    http_send("600");
    assert_string_equal(http_answer(), done);
    http_assert_command("HEAD:LINES 10.000000");
}

/* A browser sends a form of any page to any address, and names the page's origin. */
static void test_pages_from_elsewhere(void **state)
{
    (void)state;
    static const struct {
        const char *origin;
        int status;
    } cases[] = {
        {"http://evil.example", 403}, {"null", 403}, {"https://127.0.0.1:8080", 403}, {"http://127.0.0.1:8080", 200}};
    static const struct {
        const char *host; /* also that of the Origin */
        int status;
    } same[] = {{"localhost:80", 200}, {"[::1]:8080", 200},   {"lidar", 200},
                {"10.0.0.7", 200},     {"evil.example", 403}, /* its name may point to this machine: DNS rebinding */
                {"10.0.0.7.evil", 403}};
    char text[256];
    for (size_t i = 0; i < sizeof same / sizeof same[0]; i++) {
        snprintf(text, sizeof text,
                 "POST /cgi/setting HTTP/1.1\r\nHost: %s\r\nOrigin: http://%s\r\nContent-Length: 7\r\n\r\nrpm=600",
                 same[i].host, same[i].host);
        http_send(text);
        assert_int_equal(http_status(), same[i].status);
        http_assert_command(same[i].status == 200 ? "HEAD:LINES 10.000000" : NULL);
    }
    for (int i = 0; i < 4; i++) {
        snprintf(text, sizeof text,
                 "POST /cgi/setting HTTP/1.1\r\nHost: 127.0.0.1:8080\r\nOrigin: %s\r\nContent-Length: 7\r\n\r\nrpm=600",
                 cases[i].origin);
        http_send(text);
        assert_int_equal(http_status(), cases[i].status);
        http_assert_command(cases[i].status == 200 ? "HEAD:LINES 10.000000" : NULL);
    }
    /* An HTTP/1.0 request may lack a Host. Then no origin equals it. */
    http_renew();
    http_send("POST /cgi/setting HTTP/1.0\r\nOrigin: http://\r\nContent-Length: 7\r\n\r\nrpm=600");
    assert_int_equal(http_status(), 403);
    http_assert_command(NULL);
}

/* No bytes of a client come back. */
static void test_nothing_is_reflected(void **state)
{
    (void)state;
    static const char *const texts[] = {
        "GET /<script> HTTP/1.1\r\nHost: <script>\r\n\r\n",
        "POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: 12\r\n\r\nrpm=<script>",
        "POST /cgi/setting HTTP/1.1\r\nHost: x\r\nContent-Length: 10\r\n\r\n<script>=1",
        "<script> / HTTP/1.1\r\nHost: x\r\n\r\n"};
    for (int i = 0; i < 4; i++) {
        http_renew();
        http_send(texts[i]);
        assert_true(http_status() >= 400);
        assert_null(strstr(http_answer(), "script"));
    }
}

/* Garbage, and whole requests with some bytes wrong, come in pieces of all sizes. Every answer is one, nothing is
 * written past the buffers (sanitizers), and a new session works. */
static void test_garbage(void **state)
{
    (void)state;
    static const char good[] =
        "POST /cgi/setting HTTP/1.1\r\nHost: x\r\nExpect: 100-continue\r\nContent-Length: 7\r\n\r\nrpm=600"
        "GET /cgi/status.json HTTP/1.1\r\nHost: x\r\n\r\n";
    uint64_t draw = 0;
    for (int round = 0; round < 3000; round++) {
        static uint8_t bytes[8192];
        const size_t len = round % 3 == 0 ? rng_mix(++draw) % sizeof bytes : sizeof good - 1;
        http_renew();
        for (size_t i = 0; i < len; i++)
            bytes[i] = round % 3 == 0 ? (uint8_t)(rng_mix(++draw) >> 8) : (uint8_t)good[i];
        for (uint64_t n = rng_mix(++draw) % 4; round % 3 != 0 && n > 0; n--) {
            const size_t at = rng_mix(++draw) % len;
            bytes[at] = (uint8_t)rng_mix(++draw);
        }
        for (size_t at = 0, n; at < len; at += n) {
            n = 1 + rng_mix(++draw) % 700;
            if (n > len - at) n = len - at;
            http_rig.ops->input(http_rig.protocol, bytes + at, n);
        }
        for (uint32_t i = 0, at = 0; i < http_rig.n_units; at = (uint32_t)http_rig.end[i++])
            assert_memory_equal(http_rig.bytes + at, "HTTP/1.1 ", 9);
    }
    http_get("/cgi/info.json");
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, http_setup, http_teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(test_pieces),
        TEST(test_broken_requests),
        TEST(test_no_length),
        cmocka_unit_test(test_lists),
        TEST(test_head_method),
        TEST(test_longest),
        TEST(test_expect_continue),
        TEST(test_pages_from_elsewhere),
        TEST(test_nothing_is_reflected),
        TEST(test_garbage),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
