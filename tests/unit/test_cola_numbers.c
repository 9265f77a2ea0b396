/* SPDX-License-Identifier: MIT */
/* Numbers and texts of CoLa at their limits, in both forms (COLA.md): in CoLa-A hexadecimal, or decimal with a sign;
 * negative hexadecimal numbers are two's complement. In CoLa-B they are big-endian. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/protocol/cola_telegram.h"

static struct cola_args args_of(enum cola_form form, const void *bytes, size_t len)
{
    const uint8_t *at = bytes;
    return (struct cola_args){.form = form, .at = at, .end = at + len};
}

/* A number of `bytes` bytes. Where error is not COLA_OK, the value is 0. */
static void unsigned_numbers(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        unsigned bytes;
        uint32_t value;
        enum cola_error error;
    } rows[] = {
        {"0", 1, 0, COLA_OK},
        {"FF", 1, 255, COLA_OK},
        {"ff", 1, 255, COLA_OK},
        {"  9", 1, 9, COLA_OK},
        {"a", 1, 10, COLA_OK},
        {"100", 1, 0, COLA_OVERFLOW},
        {"+255", 1, 255, COLA_OK},
        {"+256", 1, 0, COLA_OVERFLOW},
        {"FFFF", 2, 65535, COLA_OK},
        {"10000", 2, 0, COLA_OVERFLOW},
        {"+65535", 2, 65535, COLA_OK},
        {"+65536", 2, 0, COLA_OVERFLOW},
        {"FFFFFFFF", 4, 4294967295, COLA_OK},
        {"100000000", 4, 0, COLA_OVERFLOW},
        {"+4294967295", 4, 4294967295, COLA_OK},
        {"+4294967296", 4, 0, COLA_OVERFLOW},
        {"-0", 1, 0, COLA_OK},
        {"-1", 1, 0, COLA_OVERFLOW},
        {"", 1, 0, COLA_TOO_SHORT},
        {" ", 1, 0, COLA_TOO_SHORT},
        {"+", 1, 0, COLA_TOO_SHORT},
        {"- 1", 1, 0, COLA_TOO_SHORT},
        {"G", 1, 0, COLA_CHARACTER},
        {"1/", 1, 0, COLA_CHARACTER},
        {"1:", 1, 0, COLA_CHARACTER},
        {"@", 1, 0, COLA_CHARACTER},
        {"`", 1, 0, COLA_CHARACTER},
        {"g", 1, 0, COLA_CHARACTER},
        {"+A", 1, 0, COLA_CHARACTER},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct cola_args args = args_of(COLA_A, rows[i].text, strlen(rows[i].text));
        const uint32_t value = cola_arg_u(&args, rows[i].bytes);
        assert_int_equal(args.error, rows[i].error);
        assert_int_equal(value, rows[i].value);
        assert_int_equal(cola_args_end(&args), rows[i].error);
    }
}

static void signed_numbers(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        unsigned bytes;
        int32_t value;
        enum cola_error error;
    } rows[] = {
        {"7F", 1, 127, COLA_OK},
        {"80", 1, -128, COLA_OK},
        {"FF", 1, -1, COLA_OK},
        {"100", 1, 0, COLA_OVERFLOW},
        {"+127", 1, 127, COLA_OK},
        {"+128", 1, 0, COLA_OVERFLOW},
        {"-128", 1, -128, COLA_OK},
        {"-129", 1, 0, COLA_OVERFLOW},
        {"7FFF", 2, 32767, COLA_OK},
        {"8000", 2, -32768, COLA_OK},
        {"10000", 2, 0, COLA_OVERFLOW},
        {"+32767", 2, 32767, COLA_OK},
        {"+32768", 2, 0, COLA_OVERFLOW},
        {"-32768", 2, -32768, COLA_OK},
        {"-32769", 2, 0, COLA_OVERFLOW},
        {"FFF92230", 4, -450000, COLA_OK},
        {"80000000", 4, INT32_MIN, COLA_OK},
        {"-2147483648", 4, INT32_MIN, COLA_OK},
        {"-2147483649", 4, 0, COLA_OVERFLOW},
        {"+2147483647", 4, INT32_MAX, COLA_OK},
        {"+2147483648", 4, 0, COLA_OVERFLOW},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct cola_args args = args_of(COLA_A, rows[i].text, strlen(rows[i].text));
        const int32_t value = cola_arg_i(&args, rows[i].bytes);
        assert_int_equal(args.error, rows[i].error);
        assert_int_equal(value, rows[i].value);
    }
}

static void numbers_in_b(void **state)
{
    (void)state;
    static const uint8_t bytes[] = {0x80, 0x7f, 0xff, 0x80, 0, 0x81};
    for (size_t len = 0; len <= 4; len++)
        for (unsigned n = 1; n <= 4; n *= 2) {
            struct cola_args u = args_of(COLA_B, bytes, len), i = u;
            const uint32_t want = n == 1 ? 0x80 : n == 2 ? 0x807f : 0x807fff80;
            const int32_t want_i = n == 1   ? -128
                                   : n == 2 ? 0x807f - 0x10000
                                            : (int32_t)(0x807fff80 - INT64_C(0x100000000));
            const enum cola_error error = len < n ? COLA_TOO_SHORT : COLA_OK;
            assert_int_equal(cola_arg_u(&u, n), error == COLA_OK ? want : 0);
            assert_int_equal(cola_arg_i(&i, n), error == COLA_OK ? want_i : 0);
            assert_true(u.error == error && i.error == error);
            assert_int_equal(cola_args_end(&u), error != COLA_OK ? error : len > n ? COLA_TOO_LONG : COLA_OK);
        }
    struct cola_args two = args_of(COLA_B, bytes + 3, 3);
    assert_int_equal(cola_arg_i(&two, 2), -32768);
    assert_int_equal(cola_arg_i(&two, 1), -127);
    assert_int_equal(cola_args_end(&two), COLA_OK);
}

/* After an error all values are 0, and a later error changes nothing. CoLa-A ignores blanks after the last value. */
static void the_first_error_stays(void **state)
{
    (void)state;
    char text[8] = "old";
    struct cola_args args = args_of(COLA_A, "1FF 2 3 abc", 11);
    assert_int_equal(cola_arg_u(&args, 1), 0);
    assert_int_equal(cola_arg_u(&args, 1), 0);
    assert_int_equal(cola_arg_i(&args, 1), 0);
    cola_arg_text(&args, text, sizeof text);
    assert_string_equal(text, "");
    assert_int_equal(cola_args_end(&args), COLA_OVERFLOW);
    args = args_of(COLA_A, "1  ", 3);
    assert_int_equal(cola_arg_u(&args, 1), 1);
    assert_int_equal(cola_args_end(&args), COLA_OK);
    args = args_of(COLA_A, "1 2", 3);
    assert_int_equal(cola_arg_u(&args, 1), 1);
    assert_int_equal(cola_args_end(&args), COLA_TOO_LONG);
    args = args_of(COLA_B, "\1 ", 2);
    assert_int_equal(cola_arg_u(&args, 1), 1);
    assert_int_equal(cola_args_end(&args), COLA_TOO_LONG);
}

static void texts(void **state)
{
    (void)state;
    static const struct {
        enum cola_form form;
        const char *bytes;
        size_t len;
        const char *text;
        enum cola_error error; /* of cola_args_end */
    } rows[] = {
        {COLA_A, "3 abc", 5, "abc", COLA_OK},
        {COLA_A, "2 abc", 5, "ab", COLA_TOO_LONG},
        {COLA_A, "4 abc", 5, "", COLA_TOO_SHORT},
        {COLA_A, "3", 1, "", COLA_TOO_SHORT},
        {COLA_A, "0", 1, "", COLA_OK},
        {COLA_A, "7 abcdefg", 9, "abcdefg", COLA_OK},
        {COLA_A, "8 abcdefgh", 10, "", COLA_OVERFLOW},
        {COLA_A, "3  ab", 5, " ab", COLA_OK},
        {COLA_B, "\0\3abc", 5, "abc", COLA_OK},
        {COLA_B, "\0\3ab", 4, "", COLA_TOO_SHORT},
        {COLA_B, "\0\7abcdefg", 9, "abcdefg", COLA_OK},
        {COLA_B,
         "\0\x8"
         "abcdefgh",
         10, "", COLA_OVERFLOW},
        {COLA_B, "\0\3a\0c", 5, "", COLA_INVALID_DATA},
        {COLA_B, "\0\0", 2, "", COLA_OK},
        {COLA_B, "\0", 1, "", COLA_TOO_SHORT},
        {COLA_B, "\0\2 a", 4, " a", COLA_OK},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char text[8] = "old";
        struct cola_args args = args_of(rows[i].form, rows[i].bytes, rows[i].len);
        cola_arg_text(&args, text, sizeof text);
        assert_string_equal(text, rows[i].text);
        assert_int_equal(cola_args_end(&args), rows[i].error);
    }
}

/* A telegram has room in exactly as many bytes as it is long. */
static size_t write_all(enum cola_form form, uint8_t *to, size_t cap)
{
    struct cola_out out = {.buf = to, .cap = cap};
    cola_begin(&out, form, "sRA x");
    cola_put_u(&out, 1, 0x1fe);
    cola_put_u(&out, 2, 0);
    cola_put_u(&out, 4, 0xfedcba98);
    cola_put_i(&out, 1, -1);
    cola_put_i(&out, 2, -2);
    cola_put_i(&out, 4, INT32_MIN);
    cola_put_float(&out, 0.5f); /* 3F000000 */
    cola_put_float(&out, 0);
    cola_put_text(&out, "ab");
    cola_put_text(&out, "");
    cola_put_word(&out, "w");
    return cola_end(&out);
}

static void writing(void **state)
{
    (void)state;
    static const char a[] = "\2sRA x FE 0 FEDCBA98 FF FFFE 80000000 3F000000 00000000 2 ab 0 w\3";
    static const char b[] = "\2\2\2\2\0\0\0\x25sRA x \xfe\0\0\xfe\xdc\xba\x98\xff\xff\xfe\x80\0\0\0\x3f\0\0\0\0\0\0\0"
                            "\0\2ab\0\0w";
    uint8_t to[128], check = 0;
    const size_t b_len = sizeof b - 1;
    for (size_t i = 8; i < b_len; i++)
        check ^= (uint8_t)b[i];
    assert_int_equal(write_all(COLA_A, to, sizeof to), sizeof a - 1);
    assert_memory_equal(to, a, sizeof a - 1);
    assert_int_equal(write_all(COLA_B, to, sizeof to), b_len + 1);
    assert_int_equal(to[7], b_len - 8);
    assert_memory_equal(to + 8, b + 8, b_len - 8);
    assert_memory_equal(to, b, 7);
    assert_int_equal(to[b_len], check);
    for (size_t cap = 0; cap < 80; cap++) {
        assert_int_equal(write_all(COLA_A, to, cap), cap >= sizeof a - 1 ? sizeof a - 1 : 0);
        if (cap >= 8) assert_int_equal(write_all(COLA_B, to, cap), cap > b_len ? b_len + 1 : 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(unsigned_numbers),      cmocka_unit_test(signed_numbers), cmocka_unit_test(numbers_in_b),
        cmocka_unit_test(the_first_error_stays), cmocka_unit_test(texts),          cmocka_unit_test(writing),
    };
    return cmocka_run_group_tests_name("cola numbers", tests, NULL, NULL);
}
