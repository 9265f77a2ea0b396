/* SPDX-License-Identifier: MIT */
/* Parts of an HTTP head, one by one: request lines and fields as RFC 9112 has them (tokens: RFC 9110, 5.6.2), and
 * places (host and port) as RFC 3986, 3.2. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/protocol/http_head.h"

static struct http_text text_of(const char *s)
{
    return (struct http_text){s, strlen(s)};
}

static void expect_text(struct http_text got, const char *want)
{
    assert_int_equal(got.len, strlen(want));
    assert_memory_equal(got.s, want, got.len);
}

static void test_request_lines(void **state)
{
    (void)state;
    static const struct {
        const char *line;
        int status;
    } rows[] = {
        {"GET / HTTP/1.1", 0},
        {"GET / HTTP/1.0", 0},
        {"GET / HTTP/1.9", 0},
        {"A!#$%&'*+-.^_`|~z / HTTP/1.1", 0},
        {"GET / HTTP/0.9", 505},
        {"GET / HTTP/2.0", 505},
        {"GET / HTTP/1./", 505},
        {"GET / HTTP/1.:", 505},
        {"GET / HTTP/1,1", 400},
        {"GET / HTTP/1.1 ", 400},
        {"GET / HTTP/1.", 400},
        {"GET / http/1.1", 400},
        {"GET  HTTP/1.1", 400},
        {"GET /", 400},
        {"GET", 400},
        {"", 400},
        {" / HTTP/1.1", 400},
        {"G@T / HTTP/1.1", 400},
        {"G(T / HTTP/1.1", 400},
        {"G\"T / HTTP/1.1", 400},
        {"GET /\x1f HTTP/1.1", 400},
        {"GET /\x7f HTTP/1.1", 400},
        {"GET /\x80 HTTP/1.1", 0},
    };
    struct http_line line;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        if (http_read_line(text_of(rows[i].line), &line) != rows[i].status) fail_msg("%s", rows[i].line);
    assert_int_equal(http_read_line(text_of("POST /a?b HTTP/1.7"), &line), 0);
    expect_text(line.method, "POST");
    expect_text(line.target, "/a?b");
    assert_int_equal(line.minor, 7);
}

static void test_fields(void **state)
{
    (void)state;
    static const struct {
        const char *line, *name, *value; /* name NULL: it is wrong */
    } rows[] = {
        {"Host: x", "Host", "x"}, {"Host:x", "Host", "x"},  {"Host: \t x y\t ", "Host", "x y"}, {"Host:", "Host", ""},
        {"Host: ", "Host", ""},   {"a:b:c", "a", "b:c"},    {"a: \xff", "a", "\xff"},           {"Host", NULL, NULL},
        {": x", NULL, NULL},      {"Host : x", NULL, NULL}, {" Host: x", NULL, NULL},           {"a: \x1f", NULL, NULL},
        {"a: \x7f", NULL, NULL},  {"a/: x", NULL, NULL},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct http_field f;
        assert_int_equal(http_read_field(text_of(rows[i].line), &f), rows[i].name != NULL ? 0 : 400);
        if (rows[i].name == NULL) continue;
        expect_text(f.name, rows[i].name);
        expect_text(f.value, rows[i].value);
    }
}

/* Up to a million the number is exact. */
static void test_lengths(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        int status;
        size_t value;
    } rows[] = {{"0", 0, 0},   {"7", 0, 7},    {"0042", 0, 42}, {"999999", 0, 999999}, {"1000000", 0, 1000000},
                {"", 400, 0},  {"-1", 400, 0}, {"+1", 400, 0},  {"1 ", 400, 0},        {"/", 400, 0},
                {":", 400, 0}, {"1a", 400, 0}};
    size_t value;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        assert_int_equal(http_read_length(text_of(rows[i].text), &value), rows[i].status);
        if (rows[i].status == 0) assert_int_equal(value, rows[i].value);
    }
    assert_int_equal(http_read_length(text_of("99999999999999999999999999999999999999"), &value), 0);
    assert_true(value > 1000000);
}

static void test_places(void **state)
{
    (void)state;
    static const struct {
        const char *text, *host; /* NULL: it is wrong */
        int port;
    } rows[] = {
        {"localhost", "localhost", 80},
        {"localhost:", "localhost", 80},
        {"localhost:8080", "localhost", 8080},
        {"10.0.0.7:1", "10.0.0.7", 1},
        {"a:65535", "a", 65535},
        {"a:65536", NULL, 0},
        {"a:b", NULL, 0},
        {"a:1:2", NULL, 0},
        {"[::1]", "[::1]", 80},
        {"[::1]:8080", "[::1]", 8080},
        {"[fe80::1%eth0]:2", "[fe80::1%eth0]", 2},
        {"[::1]x", NULL, 0},
        {"[::1]x:80", NULL, 0},
        {"[::1/]", NULL, 0},
        {"[::1", NULL, 0},
        {"", "", 80},
        {"a/b", NULL, 0},
        {"a@b", NULL, 0},
        {"a b", NULL, 0},
        {"a-b._~%41!$&'()*+,;=", "a-b._~%41!$&'()*+,;=", 80},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct http_place place;
        if (http_read_place(text_of(rows[i].text), &place) != (rows[i].host != NULL ? 0 : 400))
            fail_msg("%s", rows[i].text);
        if (rows[i].host == NULL) continue;
        expect_text(place.host, rows[i].host);
        assert_int_equal(place.port, rows[i].port);
    }
}

static void test_targets(void **state)
{
    (void)state;
    static const struct {
        const char *target, *place, *path, *query; /* NULL: there is none */
    } rows[] = {
        {"/a", NULL, "/a", NULL},
        {"/a?b?c", NULL, "/a", "b?c"},
        {"/?", NULL, "/", ""},
        {"http://h/a?b", "h", "/a", "b"},
        {"HTTP://h:1", "h:1", "/", NULL},
        {"http://h?b", "h", "/", "b"},
        {"http://", "", "/", NULL},
        {"https://h/a", NULL, "https://h/a", NULL},
        {"*", NULL, "*", NULL},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct http_target t;
        http_split_target(text_of(rows[i].target), &t);
        assert_int_equal(t.place.s != NULL, rows[i].place != NULL);
        if (rows[i].place != NULL) expect_text(t.place, rows[i].place);
        expect_text(t.path, rows[i].path);
        if (rows[i].query != NULL) expect_text(t.query, rows[i].query);
        if (rows[i].query == NULL) assert_int_equal(t.query.len, 0);
    }
}

/* A head comes byte by byte. A wrong byte is found at once, and an end with or without carriage returns. */
static void test_scan(void **state)
{
    (void)state;
    static const struct {
        const char *bytes;
        int result;   /* of all of them */
        size_t first; /* how many it takes */
    } rows[] = {
        {"GET / HTTP/1.1\r\nHost: x\r\n\r\n", HTTP_SCAN_WHOLE, 27},
        {"GET / HTTP/1.1\nHost: x\n\n", HTTP_SCAN_WHOLE, 24},
        {"GET / HTTP/1.1\r\n\r\n", HTTP_SCAN_WHOLE, 18},
        {"GET / HTTP/1.1\r\nHost: x\r\n", HTTP_SCAN_MORE, 25},
        {"G@", 400, 2},
        {"GET /\x01", 400, 6},
        {"GET / HTTP/2.0\n", 505, 15},
        {"GET / HTTP/1.1\nHo st", 400, 18},
        {"GET / HTTP/1.1\nHost: \x01", 400, 22},
        {"GET / HTTP/1.1\nHost\n", 400, 20},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct http_scan scan = {0};
        size_t n = 0;
        int result = HTTP_SCAN_MORE;
        while (result == HTTP_SCAN_MORE && n < strlen(rows[i].bytes))
            result = http_scan_head(&scan, rows[i].bytes, ++n);
        assert_int_equal(result, rows[i].result);
        assert_int_equal(n, rows[i].first);
        if (result == HTTP_SCAN_WHOLE) assert_int_equal(scan.at, n);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_request_lines), cmocka_unit_test(test_fields),  cmocka_unit_test(test_lengths),
        cmocka_unit_test(test_places),        cmocka_unit_test(test_targets), cmocka_unit_test(test_scan),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
