/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "firmware_sim/base/json.h"

/* Collects one text in memory. */
struct sink {
    FILE *file;
    char *text;
    size_t size;
    struct json json;
};

static struct json *sink_begin(struct sink *sink)
{
    sink->file = open_memstream(&sink->text, &sink->size);
    assert_non_null(sink->file);
    json_begin(&sink->json, sink->file);
    return &sink->json;
}

static void sink_expect(struct sink *sink, int code, const char *text)
{
    assert_int_equal(json_end(&sink->json, NULL), code);
    fclose(sink->file);
    if (text != NULL) assert_string_equal(sink->text, text);
    free(sink->text);
}

static void objects_arrays_and_values(void **ctx)
{
    (void)ctx;
    struct sink sink;
    struct json *json = sink_begin(&sink);
    json_open_object(json, NULL);
    json_uint(json, "pulses", UINT64_MAX);
    json_int(json, "t_ns", INT64_MIN);
    json_open_array(json, "scenes");
    json_open_object(json, NULL);
    json_string(json, "scene", "room");
    json_bool(json, "ok", 1);
    json_close_object(json);
    json_double(json, NULL, 0.5);
    json_bool(json, NULL, 0);
    json_close_array(json);
    json_open_object(json, "none");
    json_close_object(json);
    json_open_array(json, "empty");
    json_close_array(json);
    json_string(json, "sha", NULL);
    json_close_object(json);
    sink_expect(&sink, SH_OK,
                "{\n"
                "  \"pulses\": 18446744073709551615,\n"
                "  \"t_ns\": -9223372036854775808,\n"
                "  \"scenes\": [\n"
                "    {\n"
                "      \"scene\": \"room\",\n"
                "      \"ok\": true\n"
                "    },\n"
                "    0.5,\n"
                "    false\n"
                "  ],\n"
                "  \"none\": {},\n"
                "  \"empty\": [],\n"
                "  \"sha\": null\n"
                "}\n");
}

static void one_line_has_no_blanks(void **ctx)
{
    (void)ctx;
    struct sink sink;
    struct json *json = sink_begin(&sink);
    json_begin_one_line(json, sink.file);
    json_open_object(json, NULL);
    json_open_array(json, "endpoints");
    for (int i = 0; i < 2; i++) {
        json_open_object(json, NULL);
        json_string(json, "type", "a b");
        json_int(json, "port", i);
        json_close_object(json);
    }
    json_close_array(json);
    json_open_array(json, "none");
    json_close_array(json);
    json_close_object(json);
    sink_expect(&sink, SH_OK,
                "{\"endpoints\":[{\"type\":\"a b\",\"port\":0},{\"type\":\"a b\",\"port\":1}],\"none\":[]}\n");
}

/* The rules are RFC 8259, section 7. The UTF-8 cases are those of Unicode 15, table 3-7, at both sides of each
 * limit. */
static void strings_are_escaped(void **ctx)
{
    (void)ctx;
    static const struct {
        const char *in, *out;
    } cases[] = {
        {"", "\"\"\n"},
        {"a\"b\\c/", "\"a\\\"b\\\\c/\"\n"},
        {"\x01\n\t\x1f\x7f", "\"\\u0001\\u000a\\u0009\\u001f\x7f\"\n"},
        {"\xc3\xa4 \xe2\x82\xac \xf0\x9f\x98\x80", "\"\xc3\xa4 \xe2\x82\xac \xf0\x9f\x98\x80\"\n"},
        {"\xe4", "\"\\ufffd\"\n"},                       /* Latin-1 */
        {"\xe2\x82", "\"\\ufffd\\ufffd\"\n"},            /* cut */
        {"\xc0\x80", "\"\\ufffd\\ufffd\"\n"},            /* overlong */
        {"\xe0\x9f\xbf", "\"\\ufffd\\ufffd\\ufffd\"\n"}, /* overlong */
        {"\xe0\xa0\x80", "\"\xe0\xa0\x80\"\n"},
        {"\xed\xa0\x80", "\"\\ufffd\\ufffd\\ufffd\"\n"}, /* surrogate */
        {"\xed\x9f\xbf", "\"\xed\x9f\xbf\"\n"},
        {"\xf0\x8f\xbf\xbf", "\"\\ufffd\\ufffd\\ufffd\\ufffd\"\n"},
        {"\xf4\x8f\xbf\xbf", "\"\xf4\x8f\xbf\xbf\"\n"},
        {"\xf4\x90\x80\x80", "\"\\ufffd\\ufffd\\ufffd\\ufffd\"\n"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct sink sink;
        json_string(sink_begin(&sink), NULL, cases[i].in);
        sink_expect(&sink, SH_OK, cases[i].out);
    }
}

static void doubles_as_a_person_would_write_them(void **ctx)
{
    (void)ctx;
    static const struct {
        double in;
        const char *out;
    } cases[] = {
        {0, "0\n"},
        {-0.0, "-0\n"},
        {0.1, "0.1\n"},
        {300000, "300000\n"},
        {1e300, "1e+300\n"},
        {5e-324, "4.94065645841247e-324\n"},
        {0.1 + 0.2, "0.30000000000000004\n"},
        {NAN, "null\n"},
        {INFINITY, "null\n"},
        {-INFINITY, "null\n"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct sink sink;
        json_double(sink_begin(&sink), NULL, cases[i].in);
        sink_expect(&sink, SH_OK, cases[i].out);
    }
}

static void doubles_read_back_exactly(void **ctx)
{
    (void)ctx;
    uint64_t bits = UINT64_C(0x9e3779b97f4a7c15);
    for (int i = 0; i < 20000; i++) {
        bits = bits * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
        double in;
        memcpy(&in, &bits, sizeof in);
        if (!isfinite(in)) continue;
        struct sink sink;
        json_double(sink_begin(&sink), NULL, in);
        assert_int_equal(json_end(&sink.json, NULL), SH_OK);
        const double out = strtod(sink.text, NULL);
        assert_memory_equal(&in, &out, sizeof in);
        fclose(sink.file);
        free(sink.text);
    }
}

static void misuse_is_told(void **ctx)
{
    (void)ctx;
    struct sink sink;
    struct json *json = sink_begin(&sink);
    sink_expect(&sink, SH_ESTATE, NULL); /* nothing */
    json = sink_begin(&sink);
    json_open_object(json, NULL);
    sink_expect(&sink, SH_ESTATE, NULL); /* left open */
    json = sink_begin(&sink);
    json_open_object(json, NULL);
    json_int(json, NULL, 1);
    json_close_object(json);
    sink_expect(&sink, SH_ESTATE, NULL); /* no key in an object */
    json = sink_begin(&sink);
    json_open_array(json, NULL);
    json_int(json, "key", 1);
    json_close_array(json);
    sink_expect(&sink, SH_ESTATE, NULL);
    json = sink_begin(&sink);
    json_open_array(json, NULL);
    json_close_object(json);
    json_close_array(json);
    sink_expect(&sink, SH_ESTATE, NULL);
    json = sink_begin(&sink);
    json_int(json, NULL, 1);
    json_int(json, NULL, 2);
    sink_expect(&sink, SH_ESTATE, NULL); /* two values */
    json = sink_begin(&sink);
    for (int i = 0; i < JSON_MAX_DEPTH + 1; i++)
        json_open_array(json, NULL);
    for (int i = 0; i < JSON_MAX_DEPTH + 1; i++)
        json_close_array(json);
    sink_expect(&sink, SH_ESTATE, NULL);
    json = sink_begin(&sink);
    for (int i = 0; i < JSON_MAX_DEPTH; i++)
        json_open_array(json, NULL);
    for (int i = 0; i < JSON_MAX_DEPTH; i++)
        json_close_array(json);
    sink_expect(&sink, SH_OK, NULL);
}

static void a_full_disk_is_reported(void **ctx)
{
    (void)ctx;
    struct sh_err err = {0};
    struct json json;
    FILE *full = fopen("/dev/full", "w");
    assert_non_null(full);
    json_begin(&json, full);
    json_int(&json, NULL, 1);
    assert_int_equal(json_end(&json, &err), SH_EIO);
    assert_non_null(strstr(err.text, "No space left"));
    fclose(full);
}

/* Fails once, as a disk that is full for a moment. */
static ssize_t write_but_once(void *cookie, const char *bytes, size_t len)
{
    int *n = cookie;
    (void)bytes;
    if ((*n)++ > 0) return (ssize_t)len;
    errno = ENOSPC;
    return 0;
}

static void an_earlier_failure_gets_no_wrong_reason(void **ctx)
{
    (void)ctx;
    int n = 0;
    struct sh_err err = {0};
    struct json json;
    FILE *file = fopencookie(&n, "w", (cookie_io_functions_t){.write = write_but_once});
    assert_non_null(file);
    json_begin(&json, file);
    json_int(&json, NULL, 1);
    assert_int_not_equal(fflush(file), 0);
    errno = ENOENT; /* of another call since then */
    assert_int_equal(json_end(&json, &err), SH_EIO);
    assert_string_equal(err.text, "writing failed");
    fclose(file);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(objects_arrays_and_values), cmocka_unit_test(one_line_has_no_blanks),
        cmocka_unit_test(strings_are_escaped),       cmocka_unit_test(doubles_as_a_person_would_write_them),
        cmocka_unit_test(doubles_read_back_exactly), cmocka_unit_test(misuse_is_told),
        cmocka_unit_test(a_full_disk_is_reported),   cmocka_unit_test(an_earlier_failure_gets_no_wrong_reason),
    };
    return cmocka_run_group_tests_name("json", tests, NULL, NULL);
}
